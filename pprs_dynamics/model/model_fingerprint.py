"""What tells one model from every other: the SHA-256 of its values."""

from __future__ import annotations

import hashlib
import json
from typing import Any

from pprs_dynamics.model.force_model import ForceModel


def fingerprint(model: ForceModel) -> str:
    """Return the SHA-256 of the values in force, which changes with every parameter."""
    values: dict[str, Any] = dict(model.values)
    return hashlib.sha256(json.dumps(values, sort_keys=True, default=str).encode()).hexdigest()
