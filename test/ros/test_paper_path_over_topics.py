# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The paper's path through both nodes as processes over DDS; `colcon test` runs this one, too."""

from __future__ import annotations

import signal
from pathlib import Path

import numpy as np
import pytest
from node_bench import Bench
from ros_processes import executable, node_process
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from pprs_dynamics import DriveModel
from pprs_dynamics.physics.mechanism.paths import HelicalPath

pytestmark = pytest.mark.nodes

PAPER = Path(__file__).parents[2] / 'config' / 'paper.yaml'
EQUAL = 1e-12


def test_the_papers_path_goes_in_and_its_forces_come_out(
    running: Bench, ros_domain: int, tmp_path: Path,
) -> None:
    commands = running.listen(Float64MultiArray, '/feedforward/commands', 1000)
    stamped = running.listen(JointState, '/feedforward/joint_command', 1000)
    # No timeout: a player that stalls on a busy machine must not add a command.
    server = [executable('feedforward'), '--ros-args', '--params-file', str(PAPER),
              '-p', 'command_timeout:=0.0', '-p', 'timeout_action:=silent',
              # Every message is compared, however busy this machine is.
              '-p', 'max_age:=0.0', '-p',
              'qos_overrides./feedforward/trajectory.subscription.depth:=1000']
    player = [executable('play_trajectory'), '--ros-args', '-p', 'rate:=100.0']
    times = np.arange(0.0, HelicalPath.duration + 0.01, 0.01)
    with node_process(server, ros_domain, tmp_path / 'server.log') as feedforward:
        assert running.connected()
        with node_process(player, ros_domain, tmp_path / 'player.log') as playing:
            assert running.spin_until(lambda: len(stamped) == len(commands) == len(times))
            assert playing.wait(60) == 0
        feedforward.send_signal(signal.SIGTERM)
        assert feedforward.wait(60) == 0
    expected = DriveModel.load(PAPER).drive_forces(HelicalPath().motion(times))
    np.testing.assert_allclose([c.data for c in commands], expected.total, rtol=0, atol=EQUAL)
    np.testing.assert_allclose([c.position for c in stamped], expected.mechanism.position,
                               rtol=0, atol=EQUAL)
