# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Names of rclpy that are not public: all in one module, and a node that does without them."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from feedforward_bench import EQUAL, message_of, random_motion
from node_bench import bench
from rclpy import node as rclpy_node
from rclpy.node import Node
from rclpy.parameter import Parameter
from ros_processes import environment, node_process
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import MultiDOFJointTrajectory

import pprs_dynamics
from pprs_dynamics.ros.node import rclpy_internals
from pprs_dynamics.ros.node.provenance import names_given

PROJECT = Path(__file__).parents[2]
PAPER = PROJECT / 'config' / 'paper.yaml'
PAYLOAD = 1.5  # [kg], unlike the paper's
ONE = random_motion(np.random.default_rng(11), 1)

# What an rclpy of another release may lack, and a node that must do without it.
WITHOUT = {
    'nothing': '',
    'the implementation': 'internals.rclpy_implementation = None',
    'overrides': "internals.OVERRIDES = '_renamed'",
}
NODE = '''
import sys
from pprs_dynamics.ros.node import rclpy_internals as internals
{without}
from pprs_dynamics.ros.executables import {node}
sys.exit({node}())
'''


def command(node: str, without: str, *arguments: str) -> list[str]:
    code = NODE.format(node=node, without=WITHOUT[without])
    return [sys.executable, '-c', code, '--ros-args', *arguments]


@pytest.mark.nodes
@pytest.mark.parametrize('without', WITHOUT)
def test_the_node_answers_takes_parameters_and_has_its_last_word(
    ros_domain: int, tmp_path: Path, without: str,
) -> None:
    file = tmp_path / 'model.yaml'
    file.write_text(PAPER.read_text() + '    effects:\n'
                    '      effort_offset: {lift_2: {force: 1.5}}\n'
                    '      active: [effort_offset]\n'
                    '    command_timeout: 0.0\n    max_age: 0.0\n')
    log = tmp_path / 'log'
    node = command('feedforward', without, '--params-file', str(file), '-p',
                   f'masses.payload:={PAYLOAD}', '-p', 'timeout_action:=zero')
    values = {'masses.payload': PAYLOAD, 'effects.active': ['effort_offset'],
              'effects.effort_offset.lift_2.force': 1.5}
    from pprs_dynamics.physics.model.drive_model import DriveModel
    from pprs_dynamics.physics.model.parameter_file import default_parameters

    expected = DriveModel.from_parameters(
        {**default_parameters(), **values}).drive_forces(ONE).total[0]
    with bench() as running:
        commands = running.listen(Float64MultiArray, '/feedforward/commands')
        running.follow_status('/feedforward/status')
        publisher = running.probe.create_publisher(
            MultiDOFJointTrajectory, '/feedforward/trajectory', 100)
        with node_process(node, ros_domain, log) as process:
            assert running.spin_until(publisher.get_subscription_count, 20), log.read_text()
            assert running.connected()
            for count in range(1, 21):
                publisher.publish(message_of(ONE))
                assert running.spin_until(
                    lambda count=count: len(commands) == count), log.read_text()
                np.testing.assert_allclose(commands[-1].data, expected, rtol=0, atol=EQUAL)
            # Its timer runs, too.
            assert running.spin_until(
                lambda: running.status[-1]['counters']['accepted'] == 20), running.status[-1]
            assert running.status[-1]['state'] == 'active'
            process.terminate()
            assert running.spin_until(lambda: len(commands) == 21), log.read_text()
            assert list(commands[-1].data) == [0.0] * 6
            assert process.wait(5) == 0
    warned = 'this release of rclpy is not known' in log.read_text()
    assert warned == (without not in ('nothing', 'overrides'))
    assert 'Traceback' not in log.read_text()


@pytest.mark.nodes
@pytest.mark.parametrize('node', ['feedforward', 'play_trajectory'])
def test_without_overrides_a_name_that_is_none_is_still_refused(
    ros_domain: int, tmp_path: Path, node: str,
) -> None:
    file = tmp_path / 'parameters.yaml'
    file.write_text('/**:\n  ros__parameters:\n    masses: {paylod: 1.0}\n')
    done = subprocess.run(
        command(node, 'overrides', '--params-file', str(file)), env=environment(ros_domain),
        capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert ('unknown key masses.paylod' in done.stderr
            or 'unknown parameter masses.paylod' in done.stderr)
    assert 'Traceback' not in done.stderr


@pytest.mark.nodes
def test_overrides_are_the_same_in_both_ways(monkeypatch: pytest.MonkeyPatch) -> None:
    given = {'a.number': 1.5, 'a.list': [1.0, 2.0], 'a.word': 'up', 'a.switch': True}
    with bench() as running:
        node = Node('asked', context=running.context, parameter_overrides=[
            Parameter(name, value=value) for name, value in given.items()])
        candidates = (*given, 'not.given', 'use_sim_time')
        known = rclpy_internals.parameter_overrides(node, tuple)
        monkeypatch.setattr(rclpy_internals, 'OVERRIDES', '_renamed')
        asked = rclpy_internals.parameter_overrides(node, lambda: candidates)
        assert {name: list(value) if name == 'a.list' else value
                for name, value in asked.items()} == known == given
        # Nothing stays declared of what was asked for.
        assert not any(node.has_parameter(name) for name in candidates[:-1])
        node.destroy_node()


def test_names_given_are_those_of_files_and_command_line(tmp_path: Path) -> None:
    file = tmp_path / 'parameters.yaml'
    file.write_text('/**:\n  ros__parameters:\n    masses: {payload: 1.0}\n    rate: 3.0\n'
                    'robot:\n  feedforward:\n    ros__parameters: {gravity: [0.0, 0.0, -1.6]}\n')
    assert names_given(['feedforward', '--ros-args', '--params-file', str(file), '-p', 'seed:=3',
                        '--param', 'monitor:window:=0.1', '-r', '__node:=one']) == [
        'masses.payload', 'rate', 'gravity', 'seed', 'window']


def private_names(file: Path) -> list[str]:
    """Return what a file takes from modules or objects that is not public."""
    found = []
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f'{node.module}.{alias.name}' for alias in node.names)]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            names = []
        found += [name for name in names if re.match(r'rclpy\.(impl|_)', name)]
        if (isinstance(node, ast.Attribute) and re.match('_[^_]', node.attr)
                and not (isinstance(node.value, ast.Name) and node.value.id in ('self', 'cls'))):
            found.append(node.attr)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and (
                node.value.startswith('_parameter_overrides')):
            found.append(node.value)
    return found


def test_no_other_file_of_the_nodes_uses_names_that_are_not_public() -> None:
    files = [*(PROJECT / 'pprs_dynamics' / 'ros').rglob('*.py'),
             *(PROJECT / 'benchmarks' / 'node').glob('*.py'), *(PROJECT / 'demo').glob('*.py')]
    found = {file.name: private_names(file) for file in files}
    assert found.pop('rclpy_internals.py')
    # The system's own way to end a process.
    assert {name for names in found.values() for name in names} <= {'_exit'}


def test_no_attribute_of_a_node_takes_the_place_of_rclpys() -> None:
    """A node of ours that had its own `_subscriptions` heard no /clock any more."""
    def nodes(path: Path) -> dict[str, set[str]]:
        """Return the private attributes that each class of nodes in a file sets."""
        found = {}
        for each in ast.walk(ast.parse(path.read_text())):
            if isinstance(each, ast.ClassDef) and (each.name == 'Node' or any(
                    'Node' in ast.unparse(base) for base in each.bases)):
                found[each.name] = {
                    one.attr for one in ast.walk(each)
                    if isinstance(one, ast.Attribute) and isinstance(one.ctx, ast.Store)
                    and ast.unparse(one.value) == 'self' and one.attr.startswith('_')}
        return found
    taken = nodes(Path(rclpy_node.__file__))['Node']
    assert {'_subscriptions', '_publishers', '_timers'} <= taken
    ours = {name: found for path in (Path(pprs_dynamics.__file__).parent / 'ros').rglob('*.py')
            for name, found in nodes(path).items()}
    assert len(ours) >= 5
    assert {name: found & taken for name, found in ours.items() if found & taken} == {}
