"""Functions of one chain, evaluated for the three of them."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TypeVar, TypeVarTuple

CHAINS = 3
Ts = TypeVarTuple('Ts')
R = TypeVar('R')


def each_chain(function: Callable[[int, *Ts], R]) -> Callable[[*Ts], tuple[R, R, R]]:
    """Decorate a function of chain i, its first argument: the result gives those of all three.

    In Python as compiled; a tuple keeps them in registers. With arrays of three that a loop
    fills, the forces of a sample take LOOP_RATIO times as long in batches.
    """
    @wraps(function)
    def three(*arguments: *Ts) -> tuple[R, R, R]:
        return function(0, *arguments), function(1, *arguments), function(2, *arguments)

    return three
