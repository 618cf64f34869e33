# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Thread pool over drives; NumPy releases the interpreter lock while it computes."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Generic, TypeVar

WORKERS = min(os.cpu_count() or 1, 6)

Item = TypeVar('Item')
Result = TypeVar('Result')


def each(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Return the function of every item, in order; the first error is raised."""
    with ThreadPoolExecutor(WORKERS) as pool:
        return list(pool.map(function, items))


class lazy(Generic[Result]):
    """A property that is computed once for an object, when it is first asked for.

    `functools.cached_property` of Python 3.11 has one lock for all objects of a class: threads
    over drives would wait for one another.

    Parameters
    ----------
    make : callable
        From the object to the value.
    """

    def __init__(self, make: Callable[[Any], Result]) -> None:
        self._make, self.__doc__ = make, make.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, instance: object, owner: type | None = None) -> Result:
        if instance is None:
            return self  # type: ignore[return-value]  # of the class, for documentation
        value = vars(instance)[self._name] = self._make(instance)
        return value
