# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Checked fields of requests, and binary answers.

An answer is a JSON header with arrays for typed arrays, or a file to download.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from sys import float_info
from typing import Any

import numpy as np
from starlette.responses import Response

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import PprsError

LARGEST = float_info.max  # whole numbers of JSON may be larger


class BadRequestError(PprsError, ValueError):
    """A request that is not what the page sends."""


class Fields(dict[str, Any]):
    """Fields of a request. What reads one raises `BadRequestError` for any other."""

    @classmethod
    def of(cls, content: bytes) -> Fields:
        """Return the fields of a JSON object, all numbers finite and all text Unicode."""
        try:
            body = json.loads(content)
            json.dumps(body, ensure_ascii=False, allow_nan=False).encode()
        except (ValueError, RecursionError):
            raise BadRequestError('the body is no JSON of finite numbers and of text') from None
        if not isinstance(body, dict):
            raise BadRequestError('the body must be an object')
        return cls(body)

    def text(self, key: str) -> str:
        """Return a text."""
        value = self.get(key)
        if not isinstance(value, str):
            raise BadRequestError(f'{key} must be a text')
        return value

    def number(self, key: str) -> float:
        """Return a number."""
        return float(_is_number(self.get(key), f'{key} must be a number'))

    def range(self, key: str) -> tuple[float, float]:
        """Return two numbers."""
        value, rule = self.get(key), f'{key} must be two numbers'
        if not isinstance(value, list) or len(value) != 2:
            raise BadRequestError(rule)
        return float(_is_number(value[0], rule)), float(_is_number(value[1], rule))

    def revision(self) -> int:
        """Return the revision that a change counts on."""
        value = _is_number(self.get('revision'), 'revision must be a whole number')
        if value != int(value):
            raise BadRequestError('revision must be a whole number')
        return int(value)

    def drives(self) -> list[str] | None:
        """Return names of drives, None where none are given."""
        value = self.get('drives')
        if value is not None and not (isinstance(value, list) and value and all(
                isinstance(name, str) for name in value)):
            raise BadRequestError('drives must be a list of names')
        return value


def _is_number(value: Any, rule: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or abs(value) > LARGEST:
        raise BadRequestError(rule)
    return value


def packed(header: Mapping[str, Any], arrays: Mapping[str, Array]) -> bytes:
    """Return the length of the header (uint32), the header, and float32 arrays; little-endian.

    The header gets `arrays`: name and shape of each, in order. What is not known is NaN.
    """
    parts = [np.ascontiguousarray(array, dtype='<f4') for array in arrays.values()]
    shapes = [{'name': name, 'shape': part.shape}
              for name, part in zip(arrays, parts, strict=True)]
    text = json.dumps({**header, 'arrays': shapes}, allow_nan=False).encode()
    text += b' ' * (-len(text) % 4)  # so that numbers begin at a multiple of their size
    return b''.join((len(text).to_bytes(4, 'little'), text, *(part.tobytes() for part in parts)))


def binary(header: Mapping[str, Any], arrays: Mapping[str, Array]) -> Response:
    """Return an answer of a header and numbers."""
    return Response(packed(header, arrays), media_type='application/octet-stream')


def attached(name: str, kind: str, content: bytes) -> Response:
    """Return a file that the browser saves."""
    return Response(content, media_type=kind, headers={
        'Content-Disposition': f'attachment; filename="{name}"'})
