# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Sections of the reliability results."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from benchmarks.node import latency


def _latency(found: dict[str, Any]) -> str:
    return ('\n'.join(latency.rows(found)) + '\n\nThe echo node is what rclpy\'s tutorials show: '
            'message objects, rclpy\'s executor, six zeros. Both ran at the same time, measured in '
            'turns by one client of one thread. The node answers every message here (a queue of '
            '1 000, `max_age` 0); by itself it takes the ten latest.\n')


def _fuzz(found: dict[str, Any]) -> str:
    rejected = ', '.join(f'{code} {count:,}' for code, count in found['rejected'].items())
    return (f'{found["messages"]:,} messages, of which {found["accepted"]:,} were valid and '
            f'answered. Rejected: {rejected}. Counted under a wrong code: '
            f'{len(found["miscounted"])} codes. Numbers that left the node: '
            f'{found["numbers_seen"]:,}, not finite or over a limit: {found["bad_numbers"]}. '
            f'Answers to a known pose that were wrong after damage: '
            f'{found["wrong_answers_after_damage"]}. Node alive at the end: {found["alive"]}. '
            f'Resident memory grew by {found["memory_growth_mb"]:.0f} MB, in steps with the '
            'messages of 10 000 points (1.8 MB, one in 5000) among bursts of others. The owner '
            'of this memory is not known. Without these messages it grows by 1.6 MB in 100 000. A '
            'stream of these alone, valid or damaged, adds 18 to 32 MB, all with the first '
            'forty.\n')


def _storm(found: dict[str, Any]) -> str:
    return (f'{found["sets"]:,} sets of random parameters while streaming, '
            f'{found["accepted"]:,} of them accepted. Accepted, but not allowed in a model file: '
            f'{found["wrongly_accepted"]}; allowed, but refused: {found["wrongly_refused"]}; '
            f'refused without a reason: {found["refused_without_reason"]}. Of '
            f'{found["answers"]:,} answers, {found["wrong_answers"]} were not those of the '
            'accepted model.\n')


def _stall(found: dict[str, Any]) -> str:
    rows = [f'| {what} | {of["sent"]:,} | {of["commands"]:,} | {of["old_commands"]} | '
            f'{1e3 * of["oldest_s"]:.0f} ms | {of["farthest_mm"]:.1f} mm | {of["TIME"]} | '
            f'{of["superseded"]:,} |'
            for what, of in (('stamped', found['stamped']), ('stamp 0', found['unstamped']))]
    return ('\n'.join((
        f'Stopped (SIGSTOP) for {found["stopped_s"]:g} s in a stream of {found["rate"]:g} Hz of a '
        'platform that rises at 15 mm/s, and continued. Commands of the 2 s after that:', '',
        '| messages | sent | commands | sent over 0.1 s before it went on | oldest before it | '
        'farthest from the path | rejected, `TIME` | passed over for later ones |',
        '|---|---|---|---|---|---|---|---|', *rows, '')) + '\nUntil the first command the drives '
        'remain at the pose of the stop, with its gravity.\n')


def _soak(found: dict[str, Any]) -> str:
    return (f'{found["minutes"]:g} minutes at {found["rate"]:g} Hz: {found["sent"]:,} messages '
            f'sent, {found["answered"]:,} answered. Resident memory after the first minute '
            f'{found["memory_mb"]} MB, growth from then on {found["growth_mb"]} MB (goal: below '
            f'2). Longest wait of a message for the node {found["lag"]["max"]:.2f} s; commands '
            f'went stale {found["stale"]} times, once as the stream ended.\n')


def _restart(found: dict[str, Any]) -> str:
    slowest = max(found['start_to_first_command_s'])
    return (f'Killed with SIGKILL in mid-stream and started again {found["kills"]} times: messages '
            f'that reached a new node and were not answered: {found["unanswered"]}. From the start '
            f'of the process to its first command at most {slowest:.2f} s.\n')


SECTIONS: dict[str, tuple[str, Callable[[dict[str, Any]], str]]] = {
    'latency': ('Speed', _latency), 'fuzz': ('Damaged messages', _fuzz),
    'storm': ('Parameters', _storm), 'soak': ('Endurance', _soak),
    'stall': ('Standstill', _stall), 'restart': ('Restart', _restart)}
