# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Evaluation of the equations over samples: compiled, on floats, or on arrays.

A *kernel* is a function `kernel(p, s, *tables)` that reads sample s of tables, evaluates
equations and writes sample s of other tables; it returns whether the sample is sound. Tables are
(N, k) float64, `p` is a named tuple of parameters. With Numba a kernel is compiled, and called
for every s in turn. Without, s is one sample of memoryviews, whose elements are Python's floats
and faster than NumPy's; or, of many samples, a slice, so that the same lines work on arrays.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Generic, TypeVar

import numpy as np

from pprs_dynamics.arrays import Array

Kernel = Callable[..., Any]
P = TypeVar('P', bound=tuple[Any, ...])

PLAIN = 'PPRS_DYNAMICS_PLAIN'  # set to anything but 0, nothing is compiled
BLOCK = 2048  # samples: about 100 intermediate arrays then stay in a core's cache
FEW = 8  # samples, up to which floats are faster than arrays
# Loading what is compiled takes 0.9 s of processor time; on arrays a sample takes 1 us more, a call
# 0.1 ms.
PAYS, CALL = 500_000, 100  # samples
# A function over the tables of a mechanism takes longer without a compiler: on arrays motion and
# forces each 0.05 ms a sample and 10 ms a call (hexapod); of few samples on floats each 5 ms.
TREE_SAMPLE, TREE_CALL, TREE_ON_FLOATS = 50, 10_000, 5_000  # of such samples
TREE_FEW = 4

_loops: dict[Kernel, Callable[..., int]] = {}
_functions: dict[Kernel, Callable[..., Any]] = {}
_compile: Callable[[Kernel, tuple[Any, ...]], Callable[..., int]] | None = None
_decided = False
_plain_samples = 0  # that may still be evaluated before compiling pays
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


def evaluate(kernel: Kernel, parameters: KernelParameters[Any], *tables: Array) -> int:
    """Run a kernel over all samples; return the first that is not sound, or -1.

    Parameters
    ----------
    kernel : function
    parameters : KernelParameters
        Of the same form in every call with this kernel.
    tables : arrays
        C-contiguous; the first is (N, k), N samples.
    """
    loop = _loops.get(kernel)
    if loop is not None:
        return loop(parameters.row, *tables)
    if _is_plain(len(tables[0]) + CALL):
        return evaluate_plainly(kernel, parameters, *tables)
    assert _compile is not None
    loop = _compile(kernel, parameters.named)
    first = loop(parameters.row, *tables)
    _loops[kernel] = loop  # only now: another thread would wait for the compiler
    return first


def compiled_or_none(function: Kernel, samples: int) -> Callable[..., Any] | None:
    """Return a function over a mechanism's tables compiled, or None where NumPy is to do.

    Parameters
    ----------
    function : function
        Over all samples, with loops; see `compilation.compiled_function`.
    samples : int
        That it is about to be called for.
    """
    ready = _functions.get(function)
    if ready is not None:
        return ready
    if _is_plain(TREE_ON_FLOATS * samples if samples <= TREE_FEW
                 else TREE_SAMPLE * samples + TREE_CALL):
        return None
    from pprs_dynamics.physics.mechanism.compilation import compiled_function

    compiled = compiled_function(function)

    def first(*arguments: Any) -> Any:
        result = compiled(*arguments)
        _functions[function] = compiled  # only now: another thread would wait for the compiler
        return result

    return first


def _is_plain(samples: int) -> bool:
    """Return whether as many samples are to be evaluated without compiled code now."""
    global _plain_samples
    if _waiting and threading.get_ident() in _waiting:
        return True
    if _plain_samples > 0 and not _decided:
        _plain_samples -= samples
        return True
    # Who compiles in the background wants answers meanwhile.
    return bool(_compiling and threading.get_ident() not in _compiling) or not is_compiled()


def postpone_compiling() -> None:
    """Evaluate plainly until compiled code would have paid: for programs that soon end."""
    global _plain_samples
    _plain_samples = PAYS


@contextmanager
def compiling_here() -> Iterator[None]:
    """While the block lasts other threads evaluate plainly what is not compiled yet."""
    _compiling.add(threading.get_ident())
    try:
        yield
    finally:
        _compiling.discard(threading.get_ident())


@contextmanager
def not_compiling_yet() -> Iterator[None]:
    """While the block lasts this thread evaluates plainly what is not compiled yet.

    For the few samples that building a model takes: a node must be there before it compiles.
    """
    _waiting.add(threading.get_ident())
    try:
        yield
    finally:
        _waiting.discard(threading.get_ident())


def evaluate_if_ready(kernel: Kernel, parameters: KernelParameters[Any], *tables: Array) -> int:
    """Run a kernel as `evaluate` does, compiled only where something has been compiled before."""
    loop = _loops.get(kernel)
    if loop is not None:
        return loop(parameters.row, *tables)
    return (evaluate if _decided else evaluate_plainly)(kernel, parameters, *tables)


def evaluate_plainly(kernel: Kernel, parameters: KernelParameters[Any], *tables: Array) -> int:
    """Run a kernel as `evaluate` does, never compiled."""
    samples, p = len(tables[0]), parameters.named
    if samples <= FEW:
        try:
            return _on_floats(kernel, samples, p, tables)
        except (ZeroDivisionError, OverflowError, ValueError):
            pass  # arrays answer with infinities instead
    with np.errstate(all='ignore'):
        for start in range(0, samples, BLOCK):
            sound = kernel(p, slice(start, start + BLOCK), *tables)
            if not np.all(sound):
                return start + int(np.argmin(sound)) if np.ndim(sound) else start
    return -1


def is_compiled() -> bool:
    """Return whether kernels are compiled here."""
    global _compile, _decided
    if not _decided:
        _decided = True
        if os.environ.get(PLAIN, '0') in ('', '0'):
            # Half a second, so only where something is evaluated.
            from pprs_dynamics.physics.mechanism.compilation import compiler

            _compile = compiler()
    return _compile is not None


def _on_floats(
    kernel: Kernel, samples: int, p: tuple[Any, ...], tables: tuple[Array, ...],
) -> int:
    views = [table.data for table in tables]
    for s in range(samples):
        if not kernel(p, s, *views):
            return s
    return -1
