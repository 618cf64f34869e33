# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Kernels compiled by Numba, kept on disk; imported only where something is evaluated."""

from __future__ import annotations

import dis
import hashlib
import math
from collections.abc import Callable
from functools import cache
from itertools import count
from pathlib import Path
from types import CellType, CodeType, FunctionType
from typing import Any

from pprs_dynamics.physics.mechanism import arithmetic

PACKAGE = 'pprs_dynamics'
REPLACED: dict[Any, Any] = {
    arithmetic.sqrt: math.sqrt,
    arithmetic.tanh: math.tanh,
    arithmetic.larger: arithmetic.compiled_larger,
    arithmetic.everywhere: arithmetic.compiled_everywhere,
    arithmetic.sin: math.sin,
    arithmetic.cos: math.cos,
    arithmetic.largest: arithmetic.compiled_largest,
    arithmetic.solve: arithmetic.compiled_solve,
    arithmetic.elements: arithmetic.compiled_elements,
}
PHYSICS = Path(__file__).parents[1]


def compiler() -> Callable[[Any, tuple[Any, ...]], Callable[..., int]] | None:
    """Return the compiler of a kernel's loop, or None without Numba or a place for its cache.

    It takes a kernel and parameters of the form that the kernel takes; the loop takes a row.

    Compiling takes seconds, which pays only where it happens once: in the package's own
    __pycache__ or the user's cache directory; NUMBA_CACHE_DIR names another one.
    """
    try:
        import numba  # noqa: F401
    except ImportError:
        return None
    try:
        _compiled_loop(_nothing, ())
    except RuntimeError:  # no locator available: nowhere to write
        return None
    return _compiled_loop


@cache
def compiled_function(function: FunctionType) -> Callable[..., Any]:
    """Return a function compiled for the arguments that it gets, kept on disk."""
    import numba

    own = _bound(function, _plain)
    # See `_compiled_loop` on the name.
    own.__qualname__ = f'{function.__name__}_{_code_digest(function)}'
    compiled: Callable[..., Any] = numba.njit(
        cache=True, nogil=True, error_model='numpy', no_cfunc_wrapper=True, _nrt=False)(own)
    return compiled


@cache
def _plain(function: FunctionType) -> Any:
    """Return a function of this package, and all that it calls, for Numba.

    It makes no arrays, so that nothing counts references to those of its tables: what is called
    need not be inlined for that, and compiles in half of the time.
    """
    import numba

    return numba.njit(nogil=True, error_model='numpy', _nrt=False, no_cpython_wrapper=True,
                      no_cfunc_wrapper=True)(_bound(function, _plain))


def _code_digest(function: FunctionType) -> str:
    """Return a fingerprint of the code of a function and of all that it calls."""
    content, seen = hashlib.sha256(Path(__file__).read_bytes()), set()
    waiting = [function]
    while waiting:
        one = waiting.pop()
        one = REPLACED.get(one, one)
        if one in seen or not isinstance(one, FunctionType):
            continue
        seen.add(one)
        code = one.__code__
        # Instructions have numbers of names: those that read m.w and m.u are the same.
        content.update(code.co_code + repr((code.co_consts, code.co_names)).encode())
        for name in sorted(_names(one.__code__) & one.__globals__.keys()):
            used = one.__globals__[name]
            if isinstance(used, FunctionType) and used.__module__.startswith(PACKAGE):
                waiting.append(used)
            elif isinstance(used, (int, float)):
                content.update(f'{name}={used}'.encode())
    return content.hexdigest()[:12]


def _nothing(p: Any, s: Any) -> bool:
    return True


def _template(row: Any, *tables: Any) -> int:
    p = read(row)  # type: ignore[name-defined]  # noqa: F821
    first = -1
    for s in range(len(tables[0])):
        if not kernel(p, s, *tables) and first < 0:  # type: ignore[name-defined]  # noqa: F821
            first = s
    return first


def _compiled_loop(kernel: Any, named: tuple[Any, ...]) -> Callable[..., int]:
    import numba

    own = {'kernel': _compiled(kernel), 'read': _inlined(_reader(named))}
    loop = FunctionType(_template.__code__, {**_template.__globals__, **own},
                        f'{kernel.__name__}_loop')
    # Numba looks only at the file of the loop when it decides whether what it kept is up to
    # date; the name tells it of all other files.
    loop.__qualname__ = f'{kernel.__module__}.{kernel.__name__}_{_digest()}'.replace('.', '_')
    loop.__module__ = __name__
    compiled: Callable[..., int] = numba.njit(
        cache=True, nogil=True, error_model='numpy', no_cfunc_wrapper=True)(loop)
    return compiled


def _reader(named: tuple[Any, ...]) -> Any:
    """Return a function that makes named tuples of this form from a row of their numbers."""
    namespace: dict[str, Any] = {}
    index = count()

    def expression(value: Any) -> str:
        if not isinstance(value, tuple):
            return f'row[{next(index)}]'
        elements = ''.join(f'{expression(element)}, ' for element in value)
        if type(value) is tuple:
            return f'({elements})'
        namespace[type(value).__name__] = type(value)
        return f'{type(value).__name__}({elements})'

    # Written out: Numba makes named tuples only where all their elements are.
    exec(f'def read(row):\n    return {expression(named)}', namespace)
    return namespace['read']


@cache
def _compiled(function: FunctionType) -> Any:
    """Return a function of this package, and all that it calls, for Numba."""
    return _inlined(_bound(function, _compiled))


def _bound(function: FunctionType, compile_one: Callable[[Any], Any]) -> FunctionType:
    """Return a copy of a function whose callees of this package are compiled."""
    def callee(used: Any) -> Any:
        if isinstance(used, FunctionType) and used.__module__.startswith(PACKAGE):
            used = REPLACED.get(used, used)
            return compile_one(used) if isinstance(used, FunctionType) else used
        return used

    namespace = dict(function.__globals__)
    for name in _names(function.__code__) & namespace.keys():
        namespace[name] = callee(namespace[name])
    cells = tuple(CellType(callee(cell.cell_contents)) for cell in function.__closure__ or ())
    bound = FunctionType(function.__code__, namespace, function.__name__, function.__defaults__,
                         cells)
    bound.__module__ = function.__module__
    return bound


def _inlined(function: FunctionType) -> Any:
    """Return a function that Numba inlines where it is called."""
    import numba

    # Else their many results are copied through memory: four times slower. Nobody calls them from
    # Python, and wrappers for that would take half of the compiling.
    return numba.njit(nogil=True, error_model='numpy', forceinline=True, no_cpython_wrapper=True,
                      no_cfunc_wrapper=True)(function)


def _names(code: CodeType) -> set[str]:
    """Return the global names that a function and those within it look up."""
    own = {step.argval for step in dis.get_instructions(code) if step.opname == 'LOAD_GLOBAL'}
    return own.union(*(_names(constant) for constant in code.co_consts
                       if isinstance(constant, CodeType)))


@cache
def _digest() -> str:
    """Return a fingerprint of every file that equations may stand in."""
    content = hashlib.sha256()
    for file in sorted(PHYSICS.rglob('*.py')):
        content.update(file.read_bytes())
    return content.hexdigest()[:12]
