# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Functions compiled by Numba and kept on disk; imported only where something is evaluated.

They are kept in the package's own __pycache__ or the user's cache directory; NUMBA_CACHE_DIR names
another place. NUMBA_DISABLE_JIT=1 switches compiling off.
"""

from __future__ import annotations

import dis
import hashlib
from collections.abc import Callable
from functools import cache
from types import CellType, CodeType, FunctionType
from typing import Any

import numba
import numpy as np
from numba.core import cgutils, types
from numba.extending import intrinsic
from numba.np import arrayobj

from pprs_dynamics.physics.mechanism.vectors import block, elements

PACKAGE = 'pprs_dynamics'


@cache
def compiled_function(function: FunctionType) -> Callable[..., Any]:
    """Return a function compiled for the arguments that it gets, kept on disk."""
    return _stored(_keyed(_bound(function), _fingerprint(function)))


def _stored(function: FunctionType) -> Callable[..., Any]:
    """Return a function compiled, and kept on disk where that can be written."""
    # It makes no arrays, so that nothing needs to count references to those that it gets.
    options: dict[str, Any] = {'nogil': True, 'error_model': 'numpy', 'no_cfunc_wrapper': True,
                               '_nrt': False}
    try:
        compiled: Callable[..., Any] = numba.njit(cache=True, **options)(function)
    except RuntimeError:  # no locator available
        compiled = numba.njit(**options)(function)
    return compiled


def _keyed(function: FunctionType, fingerprint: str) -> FunctionType:
    """Return a function that Numba stores under the code of itself and all that it calls.

    Numba looks only at the file of a function to decide whether stored code is up to date. All
    functions get this file, and a name with a fingerprint of their code.
    """
    function = FunctionType(function.__code__.replace(co_filename=__file__),
                            function.__globals__, function.__name__, function.__defaults__,
                            function.__closure__)
    function.__qualname__ = f'{function.__name__}_{fingerprint}'
    function.__module__ = __name__
    return function


def _fingerprint(function: FunctionType) -> str:
    """Return a hash of the code of a function and of all that it calls and reads."""
    content = hashlib.sha256()
    waiting: list[Any] = [function]
    seen: set[Any] = set()
    while waiting:
        source = waiting.pop()
        if isinstance(source, FunctionType) and source not in seen:
            seen.add(source)
            # A docstring is a constant, too, but nothing that is compiled depends on it.
            # Stored code imports the modules that its functions came from.
            content.update(source.__module__.encode())
            content.update(_code_text(source.__code__, source.__doc__).encode())
            waiting += [cell.cell_contents for cell in source.__closure__ or ()]
            for name in sorted(_names(source.__code__) & source.__globals__.keys()):
                used = source.__globals__[name]
                if isinstance(used, (int, float)):
                    content.update(f'{name}={used!r}'.encode())
                elif getattr(used, '__module__', '').startswith(PACKAGE):
                    waiting.append(used)
        elif isinstance(source, type) and source not in seen:
            seen.add(source)
            content.update(f'{source.__name__}{getattr(source, "_fields", ())}'.encode())
    return content.hexdigest()[:12]


def _code_text(code: CodeType, doc: str | None) -> str:
    """Return instructions, names and constants of a function, without its place in a file."""
    constants = [_code_text(constant, None) if isinstance(constant, CodeType) else repr(constant)
                 for constant in code.co_consts if constant != doc or doc is None]
    # Instructions have numbers of names: those that read m.w and m.u are the same.
    return repr((code.co_code, code.co_names, code.co_freevars, constants))


@cache
def _compiled(function: FunctionType) -> Any:
    """Return a function of this package, and all that it calls, for Numba."""
    return _inlined(_bound(function))


def _bound(function: FunctionType) -> FunctionType:
    """Return a copy of a function whose callees of this package are compiled."""
    def callee(used: Any) -> Any:
        if used is elements:
            return _compiled(_unchanged)
        if used is block:
            return _block
        if isinstance(used, FunctionType) and used.__module__.startswith(PACKAGE):
            return _compiled(used)
        # Numba compiles a callee again for each Python integer that is a constant.
        return np.int64(used) if type(used) is int else used

    namespace = dict(function.__globals__)
    for name in _names(function.__code__) & namespace.keys():
        namespace[name] = callee(namespace[name])
    cells = tuple(CellType(callee(cell.cell_contents)) for cell in function.__closure__ or ())
    bound = FunctionType(function.__code__, namespace, function.__name__, function.__defaults__,
                         cells)
    bound.__module__ = function.__module__
    return bound


def _unchanged(named: Any) -> Any:
    """Return arrays as they are, of which compiled code reads elements fast enough."""
    return named


@intrinsic  # type: ignore[untyped-decorator]
def _block(context: Any, row: Any, start: Any, shape: Any) -> Any:
    """Return what `block` does: NumPy's `reshape` takes seven times as long to compile."""
    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        source = arrayobj.make_array(row)(context, builder, arguments[0])
        found = arrayobj.make_array(signature.return_type)(context, builder)
        sizes = cgutils.unpack_tuple(builder, arguments[2])
        strides = [source.itemsize]
        for size in reversed(sizes[1:]):
            strides.insert(0, builder.mul(strides[0], size))
        arrayobj.populate_array(found, builder.gep(source.data, [arguments[1]]), sizes, strides,
                                source.itemsize, None)
        return found._getvalue()

    return types.Array(row.dtype, len(shape), 'C')(row, start, shape), code


def _inlined(function: FunctionType) -> Any:
    """Return a function that Numba inlines where it is called."""
    # Else their many results are copied through memory: four times slower. Nobody calls them from
    # Python, and wrappers for that would take half of the compiling.
    return numba.njit(nogil=True, error_model='numpy', forceinline=True, no_cpython_wrapper=True,
                      no_cfunc_wrapper=True, _nrt=False)(function)


@cache
def _names(code: CodeType) -> set[str]:
    """Return the global names that a function and those within it look up."""
    own = {step.argval for step in dis.get_instructions(code) if step.opname == 'LOAD_GLOBAL'}
    return own.union(*(_names(constant) for constant in code.co_consts
                       if isinstance(constant, CodeType)))
