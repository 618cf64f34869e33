# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What is computed for several drives at once."""

from __future__ import annotations

from threading import Barrier

from pprs_dynamics.system import parallel
from pprs_dynamics.system.parallel import each, lazy


class Square:
    """Its value is made only once another thread makes another's."""

    def __init__(self, number: int, beside: Barrier) -> None:
        self.number, self.beside, self.made = number, beside, 0

    @lazy
    def value(self) -> int:
        """Square of the number."""
        self.beside.wait()
        self.made += 1
        return self.number ** 2


def test_lazy_properties_of_two_objects_are_made_side_by_side_and_once(monkeypatch) -> None:
    monkeypatch.setattr(parallel, 'WORKERS', 2)
    beside = Barrier(2, timeout=5)
    squares = [Square(number, beside) for number in (3, 4)]
    assert each(lambda square: square.value, squares) == [9, 16]
    assert [square.value for square in squares] == [9, 16]
    assert [square.made for square in squares] == [1, 1]
    vars(squares[0]).pop('value')
    assert each(lambda s: s.value if s is squares[0] else beside.wait(), squares)[0] == 9
    assert squares[0].made == 2
