"""One statement of the equations, three ways to run it over samples.

A *kernel* is a function `kernel(numbers, s, *tables)` that reads sample s of tables, evaluates
equations and writes sample s of other tables; it returns whether the sample is sound. Tables are
(N, k) float64, `numbers` is one row. With Numba a kernel is compiled, and called for every s in
turn. Without, s is one sample of memoryviews, whose elements are Python's floats and faster than
NumPy's; or, of many samples, a slice, so that the same lines work on arrays.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array

Kernel = Callable[..., Any]

PLAIN = 'PPRS_DYNAMICS_PLAIN'  # set to anything but 0, nothing is compiled
BLOCK = 2048  # samples: about 100 intermediate arrays then stay in a core's cache
FEW = 8  # samples, up to which floats are faster than arrays

_loops: dict[Kernel, Callable[..., int]] = {}
_compile: Callable[[Kernel], Callable[..., int]] | None = None
_decided = False


def evaluate(kernel: Kernel, numbers: Array, *tables: Array) -> int:
    """Run a kernel over all samples; return the first that is not sound, or -1.

    Parameters
    ----------
    kernel : function
    numbers : (K,) array
    tables : arrays
        C-contiguous; the first is (N, k), N samples.
    """
    try:
        loop = _loops[kernel]
    except KeyError:
        loop = _loops[kernel] = _loop(kernel)
    return loop(numbers, *tables)


def evaluate_if_ready(kernel: Kernel, numbers: Array, *tables: Array) -> int:
    """Do the same, but compiled only where something else has been compiled before."""
    loop = _loops.get(kernel)
    if loop is not None:
        return loop(numbers, *tables)
    if _decided:
        return evaluate(kernel, numbers, *tables)
    return evaluate_plainly(kernel, numbers, *tables)


def evaluate_plainly(kernel: Kernel, numbers: Array, *tables: Array) -> int:
    """Do the same without compiling, whether or not Numba is there."""
    samples = len(tables[0])
    if samples <= FEW:
        try:
            return _on_floats(kernel, samples, numbers, tables)
        except (ZeroDivisionError, OverflowError, ValueError):
            pass  # arrays answer with infinities instead
    with np.errstate(all='ignore'):
        for start in range(0, samples, BLOCK):
            sound = kernel(numbers, slice(start, start + BLOCK), *tables)
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
            from pprs_dynamics.mechanism.compilation import compiler

            _compile = compiler()
    return _compile is not None


def _on_floats(kernel: Kernel, samples: int, numbers: Array, tables: tuple[Array, ...]) -> int:
    views, row = [table.data for table in tables], numbers.tolist()
    for s in range(samples):
        if not kernel(row, s, *views):
            return s
    return -1


def _loop(kernel: Kernel) -> Callable[..., int]:
    if is_compiled():
        assert _compile is not None
        return _compile(kernel)

    return partial(evaluate_plainly, kernel)
