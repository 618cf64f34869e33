# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Evaluation of the equations over samples, by functions that Numba compiles.

A *kernel* is a function `kernel(p, s, *tables)` that reads sample s of tables, evaluates
equations and writes sample s of other tables; it returns whether the sample is sound. Tables are
(N, k) float64, `p` is a named tuple of parameters. It is compiled together with a loop over s. A
*loop* is a function that contains its loop over the samples.

Loading compiled code takes 0.3 s, compiling it the first time 15 s. Where nothing may wait for
that, the same functions run as Python: 0.2 ms a sample, 8 ms of a hexapod.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Generic, TypeVar

import numpy as np

from pprs_dynamics.arrays import Array

Function = Callable[..., Any]
P = TypeVar('P', bound=tuple[Any, ...])

# What Python raises where compiled code returns infinities.
NOT_DEFINED = ZeroDivisionError, OverflowError, ValueError

_compiled: dict[Function, Function] = {}
_compiling: set[int] = set()  # threads that compile while others must not wait
_waiting: set[int] = set()  # threads that do not compile yet


class KernelParameters(Generic[P]):
    """The parameters of a kernel in both forms.

    Parameters
    ----------
    named : named tuple
        Of floats and of tuples, named or not, of the like.

    Attributes
    ----------
    row : (K,) array
        All numbers in `named`, in order. Handing it to compiled code takes a third of a
        microsecond, the named tuple itself four: half as long as the forces of a sample.
    """

    __slots__ = ('named', 'row')

    def __init__(self, named: P) -> None:
        self.named = named
        self.row = np.array(_numbers(named))


def _numbers(named: tuple[Any, ...]) -> list[float]:
    numbers: list[float] = []
    for value in named:
        if isinstance(value, tuple):
            numbers += _numbers(value)
        else:
            numbers.append(float(value))
    return numbers


def evaluate(kernel: Function, parameters: KernelParameters[Any], *tables: Array) -> int:
    """Run a kernel over all samples; return the first that is not sound, or -1.

    Parameters
    ----------
    kernel : function
    parameters : KernelParameters
        Of the same form in every call with this kernel.
    tables : arrays
        C-contiguous; the first is (N, k), N samples.
    """
    ready = _compiled.get(kernel)
    if ready is not None:
        first: int = ready(parameters.row, *tables)
        return first
    if _must_not_wait():
        try:
            return _on_floats(kernel, parameters.named, tables)
        except NOT_DEFINED:
            pass
    from pprs_dynamics.physics.mechanism.compilation import compiled_kernel

    first = _first_call(kernel, compiled_kernel(kernel, parameters.named), parameters.row, *tables)
    return first


def run(loop: Any, *arguments: Any) -> Any:
    """Return the result of a loop, for arguments of the same types in every call."""
    ready = _compiled.get(loop)
    if ready is not None:
        return ready(*arguments)
    if _must_not_wait():
        try:
            return loop(*arguments)
        except NOT_DEFINED:
            pass
    from pprs_dynamics.physics.mechanism.compilation import compiled_function

    return _first_call(loop, compiled_function(loop), *arguments)


def _first_call(function: Function, compiled: Function, *arguments: Any) -> Any:
    result = compiled(*arguments)
    _compiled[function] = compiled  # only now: another thread would wait for the compiler
    return result


def _on_floats(kernel: Function, p: tuple[Any, ...], tables: tuple[Array, ...]) -> int:
    # Elements of memoryviews are Python's floats, which are faster than NumPy's.
    views = [table.data for table in tables]
    for s in range(len(tables[0])):
        if not kernel(p, s, *views):
            return s
    return -1


def is_ready(kernel: Function) -> bool:
    """Return whether a kernel is compiled already, or others are: then it takes no time either."""
    return kernel in _compiled or (bool(_compiled) and not _must_not_wait())


def _must_not_wait() -> bool:
    thread = threading.get_ident()
    return thread in _waiting or bool(_compiling - {thread})


@contextmanager
def compiling_here() -> Iterator[None]:
    """While the block lasts other threads do not wait for what is not compiled yet."""
    _compiling.add(threading.get_ident())
    try:
        yield
    finally:
        _compiling.discard(threading.get_ident())


@contextmanager
def not_compiling_yet() -> Iterator[None]:
    """While the block lasts this thread does not wait for what is not compiled yet.

    For the few samples that building a model takes: a node must be there before it compiles.
    """
    _waiting.add(threading.get_ident())
    try:
        yield
    finally:
        _waiting.discard(threading.get_ident())
