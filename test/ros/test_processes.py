# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The installed executables as processes over DDS, as `ros2 run` starts them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from feedforward_bench import message_of, random_motion
from node_bench import Bench, bench
from rcl_interfaces.srv import ListParameters
from rclpy.parameter import Parameter
from ros_processes import environment, executable, node_process
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import MultiDOFJointTrajectory

from pprs_dynamics import DriveModel
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.errors import PprsError
from pprs_dynamics.physics.mechanism.paths import Excitation
from pprs_dynamics.ros.feedforward import FeedforwardNode
from pprs_dynamics.ros.messages.trajectory_request import TRAJECTORY, readers_for
from pprs_dynamics.ros.monitor import MonitorNode
from pprs_dynamics.simulation.motion_files import write_motion

pytestmark = pytest.mark.nodes

PAPER = Path(__file__).parents[2] / 'config' / 'paper.yaml'


EQUAL = 1e-12


def play(domain: int, *parameters: str) -> subprocess.CompletedProcess[str]:
    arguments = [word for parameter in parameters for word in ('-p', parameter)]
    return subprocess.run([executable('play_trajectory'), '--ros-args', *arguments],
                          env=environment(domain), capture_output=True, text=True, timeout=120)


def test_a_csv_of_poses_is_played_as_the_motion_that_it_is(
    running: Bench, ros_domain: int, tmp_path: Path,
) -> None:
    motion = Excitation(duration=2.0, seed=3).motion(np.arange(0, 2.0, 0.02))
    write_motion(tmp_path / 'poses.csv', DRIVES, motion)
    received = running.listen(MultiDOFJointTrajectory, '/feedforward/trajectory', 1000)
    done = play(ros_domain, 'source:=csv', f'file:={tmp_path / "poses.csv"}', 'rate:=50.0',
                'points:=2')
    assert done.returncode == 0, done.stderr
    assert running.spin_until(lambda: len(received) == len(motion))
    assert [len(message.points) for message in received] == [2] * (len(motion) - 1) + [1]
    reader = readers_for(DriveModel.load())[TRAJECTORY]
    played = [reader.of_message(message, 1).motion for message in received]
    for name in ('position', 'orientation', 'linear_velocity', 'angular_acceleration'):
        np.testing.assert_allclose([getattr(p, name)[0] for p in played], getattr(motion, name),
                                   rtol=0, atol=EQUAL)


MISTAKES = {
    'feedforward masses.paylod:=1.0': 'did you mean masses.payload',
    'play_trajectory source:=spiral': "source is 'spiral'",
    'play_trajectory ratee:=5.0': 'unknown parameter ratee (did you mean rate?)',
    'feedforward geometry.base_radius:=0.2': 'equations is missing, must',
    'feedforward effort_limits:=[1.0,2.0]': 'effort_limits is [1.0, 2.0]',
}


def refused(domain: int, name: str, *arguments: str) -> str:
    """Return what an executable prints that does not start."""
    done = subprocess.run([executable(name), *arguments], env=environment(domain),
                          capture_output=True, text=True, timeout=120)
    assert done.returncode == 2
    assert 'Traceback' not in done.stderr
    return done.stderr.strip()


@pytest.mark.parametrize('mistake', MISTAKES)
def test_a_wrong_parameter_is_one_sentence_and_status_2(ros_domain: int, mistake: str) -> None:
    name, parameter = mistake.split(' ')
    assert MISTAKES[mistake] in refused(ros_domain, name, '--ros-args', '-p', parameter)


def test_a_parameter_file_that_ros_cannot_read_is_one_sentence(
    ros_domain: int, tmp_path: Path,
) -> None:
    file = tmp_path / 'model.yaml'
    file.write_text('/**:\n  ros__parameters:\n    gravity: [0, 0.0, -9.81]\n')
    said = refused(ros_domain, 'feedforward', '--ros-args', '--params-file', str(file))
    assert str(file) in said
    assert 'write 0.0, not 0' in said


@pytest.mark.parametrize(('name', 'arguments'), [
    ('feedforward', ('--params-file', str(PAPER))), ('monitor', ('robot.yaml',)),
    ('play_trajectory', ('--ros-args', '-p', 'rate:=50.0', '--', '--params-file', str(PAPER)))])
def test_what_ros_would_pass_over_is_refused_with_usage(
    ros_domain: int, name: str, arguments: tuple[str, ...],
) -> None:
    said = refused(ros_domain, name, *arguments)
    assert said.startswith(f'usage: {name} [--ros-args')
    assert f'{arguments[-2:][0]} is outside of --ros-args' in said


def test_without_ros_the_executables_say_what_to_install(tmp_path: Path) -> None:
    # A folder in front of the path whose rclpy cannot be imported stands for a machine without.
    (tmp_path / 'rclpy.py').write_text('raise ImportError("not here")')
    code = ('from pprs_dynamics.ros.executables import feedforward; '
            'raise SystemExit(feedforward())')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, timeout=120,
                          env={**environment(0), 'PYTHONPATH': str(tmp_path)})
    assert done.returncode == 2
    assert done.stderr.strip().startswith('feedforward needs ROS 2: source an installation')
    assert len(done.stderr.strip().splitlines()) == 1


# A node that speaks to a machine takes no other robot's model for it by itself.

@pytest.mark.parametrize('node', ['feedforward', 'monitor'])
def test_without_a_model_it_does_not_start_and_says_what_to_write(
    node: str, ros_domain: int,
) -> None:
    said = refused(ros_domain, node).splitlines()[-1]
    assert said.startswith(f'{node} was given no model')
    assert '--params-file FILE' in said
    assert 'demo:=true' in said


@pytest.mark.parametrize(('kind', 'given'), [
    (FeedforwardNode, {}), (FeedforwardNode, {'masses.payload': 2.0}),
    (MonitorNode, {'demo': False})])
def test_changes_of_the_papers_robot_are_no_model(kind: type, given: dict[str, object]) -> None:
    with bench() as running, pytest.raises(PprsError, match='given no model'):
        running.add(kind, parameter_overrides=[
            Parameter(name, value=value) for name, value in given.items()])


def test_a_demonstration_stays_one() -> None:
    with bench() as running:
        node = running.add(FeedforwardNode, parameter_overrides=[Parameter('demo', value=True)])
        answer, = node.set_parameters([Parameter('demo', value=False)])
        assert not answer.successful


# A node whose equations are not compiled yet answers, and goes on while they are compiled.

ONE_POSE = random_motion(np.random.default_rng(8), 1)


@pytest.mark.nodes
def test_a_node_without_compiled_kernels_answers_messages_and_services(
    ros_domain: int, tmp_path: Path,
) -> None:
    log = tmp_path / 'log'
    cold = {**environment(ros_domain), 'NUMBA_CACHE_DIR': str(tmp_path / 'cache')}
    command = [executable('feedforward'), '--ros-args', '-p', 'demo:=true', '-p', 'max_age:=0.0',
               '-p', 'command_timeout:=0.0']
    with bench() as running, node_process(command, ros_domain, log, cold) as process:
        commands = running.listen(Float64MultiArray, '/feedforward/commands')
        running.follow_status('/feedforward/status')
        publisher = running.probe.create_publisher(
            MultiDOFJointTrajectory, '/feedforward/trajectory', 100)
        client = running.probe.create_client(ListParameters, '/feedforward/list_parameters')
        assert running.spin_until(publisher.get_subscription_count), log.read_text()
        assert running.connected()
        publisher.publish(message_of(ONE_POSE))
        asked = client.call_async(ListParameters.Request())
        assert running.spin_until(lambda: commands and asked.done())
        assert running.status[-1]['preparing'] is True
        np.testing.assert_allclose(
            commands[0].data, DriveModel.load().drive_forces(ONE_POSE).total[0], rtol=0, atol=EQUAL)
        # Stopped in the middle of it, it ends as ever.
        cache = tmp_path / 'cache'
        assert running.spin_until(lambda: cache.is_dir() and os.listdir(cache))
        process.terminate()
        assert process.wait(60) == 0
    assert 'Traceback' not in log.read_text()
