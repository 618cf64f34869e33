# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A node whose equations are not compiled yet answers, and goes on while they are compiled."""

from __future__ import annotations

import os
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from feedforward_bench import EQUAL, message_of, random_motion
from node_bench import bench
from rcl_interfaces.srv import ListParameters
from ros_processes import environment, executable, node_process
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import (
    JointTrajectory,
    JointTrajectoryPoint,
    MultiDOFJointTrajectory,
)

from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.physics.mechanism import evaluation
from pprs_dynamics.physics.mechanism.evaluation import compiling_here

MOTION = random_motion(np.random.default_rng(8), 1)


def test_other_threads_do_not_wait_for_a_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(evaluation, '_loops', {})
    monkeypatch.setattr(evaluation, '_decided', True)
    begun, go_on = threading.Event(), threading.Event()

    def slow_compiler(kernel: object, named: object) -> object:
        begun.set()
        assert go_on.wait(30)
        return lambda row, *tables: -1

    monkeypatch.setattr(evaluation, '_compile', slow_compiler)

    def compile_one() -> None:
        with compiling_here():
            DriveModel.load().drive_forces(MOTION)

    thread = threading.Thread(target=compile_one, daemon=True)
    thread.start()
    assert begun.wait(30)
    meanwhile = DriveModel.load().drive_forces(MOTION).total
    assert not evaluation._loops
    go_on.set()
    thread.join(30)
    monkeypatch.undo()
    np.testing.assert_allclose(
        meanwhile, DriveModel.load().drive_forces(MOTION).total, rtol=0, atol=EQUAL)


@pytest.mark.nodes
def test_a_node_without_compiled_kernels_answers_messages_and_services(
    ros_domain: int, tmp_path: Path,
) -> None:
    pytest.importorskip('numba')
    log = tmp_path / 'log'
    cold = {**environment(ros_domain), 'NUMBA_CACHE_DIR': str(tmp_path / 'cache'),
            'PPRS_DYNAMICS_PLAIN': '0'}
    command = [executable('feedforward'), '--ros-args', '-p', 'demo:=true', '-p', 'max_age:=0.0',
               '-p', 'command_timeout:=0.0']
    with bench() as running, node_process(command, ros_domain, log, cold) as process:
        commands = running.listen(Float64MultiArray, '/feedforward/commands')
        running.follow_status('/feedforward/status')
        publisher = running.probe.create_publisher(
            MultiDOFJointTrajectory, '/feedforward/trajectory', 100)
        client = running.probe.create_client(ListParameters, '/feedforward/list_parameters')
        assert running.spin_until(publisher.get_subscription_count, 20), log.read_text()
        assert running.connected()
        publisher.publish(message_of(MOTION))
        asked = client.call_async(ListParameters.Request())
        assert running.spin_until(lambda: commands and asked.done(), 20)
        assert running.status[-1]['preparing'] is True
        np.testing.assert_allclose(
            commands[0].data, DriveModel.load().drive_forces(MOTION).total[0], rtol=0, atol=EQUAL)
        # Stopped in the middle of it, it ends as ever.
        cache = tmp_path / 'cache'
        assert running.spin_until(lambda: cache.is_dir() and os.listdir(cache), 30)
        process.terminate()
        assert process.wait(10) == 0
    assert 'Traceback' not in log.read_text()


@pytest.mark.nodes
def test_a_robot_with_loops_is_answered_at_once_and_compiled_beside(
    ros_domain: int, tmp_path: Path,
) -> None:
    pytest.importorskip('numba')
    log, model = tmp_path / 'log', DriveModel.load('config/hexapod.yaml')
    cold = {**environment(ros_domain), 'NUMBA_CACHE_DIR': str(tmp_path / 'cache'),
            'PPRS_DYNAMICS_PLAIN': '0'}
    command = [executable('feedforward'), '--ros-args', '--params-file', model.source, '-p',
               'max_age:=0.0', '-p', 'command_timeout:=0.0']
    home = model.robot.structure.home[model.robot.structure.tables.drives]
    asked = JointTrajectory(joint_names=list(model.drives), points=[JointTrajectoryPoint(
        positions=(home + 0.01).tolist(), velocities=[0.0] * 6, accelerations=[0.0] * 6)])
    rest = np.zeros((1, 6))
    expected = model.drive_forces(JointMotion(home[None] + 0.01, rest, rest)).total[0]
    with bench() as running, node_process(command, ros_domain, log, cold) as process:
        commands = running.listen(Float64MultiArray, '/feedforward/commands')
        running.follow_status('/feedforward/status')
        publisher = running.probe.create_publisher(
            JointTrajectory, '/feedforward/trajectory', 100)
        assert running.spin_until(publisher.get_subscription_count, 20), log.read_text()
        assert running.connected()
        publisher.publish(asked)
        assert running.spin_until(lambda: commands and running.status, 20), log.read_text()
        assert running.status[-1]['preparing'] is True
        np.testing.assert_allclose(commands[0].data, expected, rtol=0, atol=1e-9)
        process.terminate()
        assert process.wait(10) == 0
    assert 'Traceback' not in log.read_text()


# What Numba does to this registry, without pause.
COMPILING = """
import weakref
from pprs_dynamics.ros import executables
from pprs_dynamics.ros.node import preparation

class Compiled:
    pass

def compile_for_ever(model):
    kept = [Compiled() for _ in range(100_000)]
    finalizers = [weakref.finalize(one, len, ()) for one in kept]
    while True:
        weakref.finalize(kept[0], len, ()).detach()

preparation.prepare = compile_for_ever
raise SystemExit(executables.{node}())
"""


@pytest.mark.nodes
@pytest.mark.parametrize('node', ['feedforward', 'monitor'])
def test_a_node_that_ends_while_it_compiles_ends_without_a_word(
    ros_domain: int, tmp_path: Path, node: str,
) -> None:
    log = tmp_path / 'log'
    command = [sys.executable, '-c', COMPILING.format(node=node), '--ros-args', '-p', 'demo:=true']
    with bench() as running, node_process(command, ros_domain, log) as process:
        running.follow_status(f'/{node}/status')
        assert running.spin_until(lambda: running.status, 20), log.read_text()
        process.terminate()
        assert process.wait(10) == 0
    assert 'Traceback' not in log.read_text()
