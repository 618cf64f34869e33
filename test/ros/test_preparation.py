# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A node whose equations are not compiled yet answers, and goes on while they are compiled."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from feedforward_bench import EQUAL, message_of, random_motion
from node_bench import bench
from rcl_interfaces.srv import ListParameters
from ros_processes import environment, executable, node_process
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import MultiDOFJointTrajectory

from pprs_dynamics import DriveModel

MOTION = random_motion(np.random.default_rng(8), 1)


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
