# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Effects of other packages that fail: one sentence that names them, and the nodes live on."""

from __future__ import annotations

import time
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from failing_effects import FAULTS, fail, parameters
from feedforward_bench import EQUAL, feedforward_bench, held, message_of, random_motion
from monitor_bench import MonitorBench
from node_bench import bench
from rclpy.parameter import Parameter

from pprs_dynamics.physics.mechanism.paths import HelicalPath

MOTION = random_motion(np.random.default_rng(11), 3)
ONE = MOTION[:1]


@pytest.mark.nodes
@pytest.mark.parametrize('fault', ['exits', 'longer'])  # test_user_effects.py has all
def test_feedforward_rejects_counts_tells_and_goes_on(package: ModuleType, fault: str) -> None:
    with feedforward_bench(**parameters('worn_brake')) as node:
        answer = node.answer(message_of(ONE))
        for count in (1, 2):
            fail(package, 'columns', fault)
            silent = len(node.commands)
            for _ in range(3):
                node.send(message_of(ONE))
            assert node.counters['EFFECT'] == 3 * count
            status = node.wait_for_status(level='ERROR', code='EFFECT')
            assert FAULTS[fault].split(' (')[0] in status['message']
            # Once, though commands never go stale here: not the messages are wrong.
            assert node.bench.spin_until(lambda silent=silent: len(node.commands) > silent)
            node.bench.spin_for(0.1)
            assert len(node.commands) == silent + 1
            np.testing.assert_allclose(node.commands[-1].data, held(ONE), rtol=0, atol=EQUAL)
            fail(package, 'nowhere')
            assert node.answer(message_of(ONE)) == answer
            node.wait_for_status(level='OK', code='OK')
            assert node.bench.status[-1]['counters']['EFFECT'] == 3 * count


@pytest.mark.nodes
def test_an_effect_that_fails_in_mid_path_leaves_the_path_to_the_controller(
    package: ModuleType,
) -> None:
    path = HelicalPath()
    motion = path.motion(np.arange(1.0, path.duration + 0.1, 0.05))
    with feedforward_bench(**parameters('worn_brake')) as node:
        node.answer(message_of(motion))
        assert node.bench.spin_until(lambda: node.joint_trajectory and node.joint_command)
        given, = node.joint_command
        fail(package, 'columns')
        node.send(message_of(motion[5:]))
        said = node.wait_for_status(level='ERROR', code='EFFECT')['message']
        assert 'a trajectory controller completes its trajectory' in said
        assert node.bench.spin_until(lambda: len(node.joint_command) == 2)
        np.testing.assert_allclose(node.joint_command[-1].position, given.position, atol=EQUAL)
        assert len(node.joint_trajectory) == 1


@pytest.mark.nodes
def test_stale_commands_are_held_without_an_effect_that_fails_at_rest(package: Any) -> None:
    def columns(cls: type, drive: Any, **_: float) -> tuple[Any]:
        return (np.array([1.0 / v for v in drive.velocity.tolist()]),)

    package.WornBrake.columns = classmethod(columns)
    from pprs_dynamics.physics.effects.catalogue import guard

    guard(package.WornBrake)
    with feedforward_bench(**parameters('worn_brake'), command_timeout=0.15) as node:
        node.answer(message_of(ONE))
        status = node.wait_for_status(level='STALE', code='STALE')
        assert 'the last pose is held at rest, without worn_brake' in status['message']
        assert node.bench.spin_until(lambda: len(node.commands) == 2)
        np.testing.assert_allclose(node.commands[-1].data, held(ONE), rtol=0, atol=EQUAL)


@pytest.mark.nodes
def test_a_pause_in_the_middle_of_a_computation_leaves_no_old_command(package: Any) -> None:
    pause = 0.0

    def columns(cls: type, drive: Any, **_: float) -> tuple[Any]:
        time.sleep(pause)
        return (drive.velocity,)

    package.WornBrake.columns = classmethod(columns)
    with feedforward_bench(**parameters('worn_brake'), max_age=0.5) as node:
        node.answer(message_of(ONE))
        pause, silent = 1.0, len(node.commands)
        node.send(message_of(ONE))
        assert 'the node stood still for' in node.wait_for_status(code='TIME')['message']
        pause = 0.0
        node.answer(message_of(ONE))
        assert len(node.commands) == silent + 1


@pytest.mark.nodes
@pytest.mark.parametrize('place', ['__init__', 'drive_memory'])
def test_a_parameter_that_an_effect_fails_at_is_refused_with_the_reason(
    package: ModuleType, place: str,
) -> None:
    with feedforward_bench(**parameters('worn_brake')) as node:
        answer = node.answer(message_of(ONE))
        fail(package, place)
        result, = node.node.set_parameters(
            [Parameter('effects.worn_brake.slide_2.coefficient', value=4.0)])
        assert not result.successful
        assert result.reason.startswith(f'effect worn_brake: {place} raised ZeroDivisionError')
        fail(package, 'nowhere')
        assert node.answer(message_of(ONE)) == answer


# --- the other nodes, and pprs --------------------------------------------------------------------


@pytest.mark.nodes
def test_the_monitor_counts_tells_and_goes_on(package: ModuleType) -> None:
    with bench() as running:
        monitor = MonitorBench(running, **parameters('worn_brake'))
        monitor.send(300)
        assert len(monitor.residual) > 100
        fail(package, 'columns')
        monitor.send(200)
        silent = len(monitor.residual)
        assert monitor.says('EFFECT')
        assert monitor.bench.status[-1]['counters']['EFFECT'] > 0
        assert 'effect worn_brake: columns raised' in monitor.bench.status[-1]['message']
        result, = monitor.node.set_parameters(
            [Parameter('effects.worn_brake.slide_2.coefficient', value=4.0)])
        assert result.successful, result.reason
        fail(package, 'drive_memory')
        monitor.send(200)
        assert len(monitor.residual) == silent
        fail(package, 'nowhere')
        monitor.send(400)
        assert len(monitor.residual) > silent + 200

        def goes_on() -> bool:
            """Return whether the last second was compared, of which the break was a part."""
            monitor.send(100)
            return bool(monitor.bench.status[-1]['code'] == 'OK')

        assert monitor.bench.spin_until(goes_on)
