# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Who sends, and what of it was passed over, by what the middleware tells of each message."""

from __future__ import annotations

from typing import Any

from pprs_dynamics.ros.node.senders import TURNS, Senders


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def info(publisher: bytes, number: int | None) -> dict[str, Any]:
    return {'publisher_gid': {'data': publisher}, 'publication_sequence_number': number}


def test_what_later_messages_replaced_is_counted_for_each_publisher() -> None:
    senders = Senders(Clock())
    sent = [(b'a', 7), (b'a', 8), (b'a', 12), (b'b', 1), (b'a', 13), (b'b', 4), (b'b', 4)]
    assert [senders.passed_over(info(*each)) for each in sent] == [0, 0, 3, 0, 0, 2, 0]


def test_a_publisher_that_is_started_again_does_not_take_turns_with_the_old_one() -> None:
    clock = Clock()
    senders = Senders(clock)
    for publisher in (b'a', b'a', b'b', b'b'):
        clock.now += 0.01
        senders.passed_over(info(publisher, 1))
        assert not senders.take_turns
    clock.now += 0.01
    senders.passed_over(info(b'a', 2))
    assert senders.take_turns
    clock.now += TURNS
    assert not senders.take_turns
