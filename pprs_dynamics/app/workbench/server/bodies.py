# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Bodies of requests, judged: what is not as the page sends it is refused in a sentence.

Every function raises `BadRequestError`.
"""

from __future__ import annotations

from typing import Any

from pprs_dynamics.errors import PprsError


class BadRequestError(PprsError, ValueError):
    """A body that is not what the page sends."""


def text_of(body: Any, key: str) -> str:
    """Return a text."""
    value = body.get(key)
    if not isinstance(value, str):
        raise BadRequestError(f'{key} must be a text')
    return value


def number_of(body: Any, key: str) -> float:
    """Return a number."""
    value = body.get(key)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise BadRequestError(f'{key} must be a number')
    return float(value)


def range_of(body: Any, key: str) -> tuple[float, float]:
    """Return two numbers."""
    value = body.get(key)
    if not (isinstance(value, list) and len(value) == 2 and all(
            isinstance(end, (int, float)) and not isinstance(end, bool) for end in value)):
        raise BadRequestError(f'{key} must be two numbers')
    return float(value[0]), float(value[1])


def revision_of(body: Any) -> int:
    """Return the revision that a change counts on."""
    value = body.get('revision')
    if isinstance(value, bool) or not isinstance(value, int):
        raise BadRequestError('revision must be a whole number')
    return value
