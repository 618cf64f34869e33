# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""SHA-256 fingerprint of a model's values."""

from __future__ import annotations

import hashlib
import json
from typing import Any

from pprs_dynamics.physics.model.force_model import ForceModel
from pprs_dynamics.physics.model.keys import FILES


def fingerprint(model: ForceModel) -> str:
    """Return the SHA-256 of the values in force, which changes with every parameter."""
    values: dict[str, Any] = dict(model.values)
    if model.content:
        values.update({key: model.content for key in FILES if values.get(key)})  # wherever it lies
    return hashlib.sha256(json.dumps(values, sort_keys=True, default=str).encode()).hexdigest()
