# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Binary answers: a JSON header with arrays for typed arrays; files to download."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from starlette.responses import Response

from pprs_dynamics.arrays import Array


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
