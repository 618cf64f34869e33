# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Short forms of the reliability runs in benchmarks/, each with a node as a process."""

from __future__ import annotations

import pytest

from benchmarks.node import fuzz, parameter_storm, restart, soak, stall

pytestmark = pytest.mark.nodes


def test_no_damage_to_a_message_harms_the_node(ros_domain: int) -> None:
    found = fuzz.run(1200, seed=3, domain=ros_domain)
    assert fuzz.passed(found), found


def test_no_storm_of_parameters_brings_a_model_into_force_that_is_none(ros_domain: int) -> None:
    found = parameter_storm.run(150, seed=3, domain=ros_domain)
    assert parameter_storm.passed(found), found


def test_a_node_that_was_killed_in_mid_stream_and_started_again_answers(ros_domain: int) -> None:
    found = restart.run(2, domain=ros_domain)
    assert found['kills'] == len(found['start_to_first_command_s']) == 2
    assert restart.passed(found), found


@pytest.mark.slow
def test_a_steady_stream_is_answered_message_by_message(ros_domain: int) -> None:
    found = soak.run(0.1, rate=200.0, domain=ros_domain)
    # A busy machine may hold up node and client, and the stream with them.
    assert found['answered'] == found['sent'] > 100


def test_a_node_that_stood_still_executes_nothing_of_what_waited(ros_domain: int) -> None:
    found = stall.run(1.0, domain=ros_domain)
    for stream in (found['stamped'], found['unstamped']):
        assert stream['back_after_s'] < stall.AFTER, found
        assert stream['old_commands'] == 0, found
        # It stood: later messages took the place of some five hundred, fewer from a busy sender.
        assert stream['superseded'] > 100, found
