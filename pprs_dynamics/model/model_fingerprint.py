# Copyright 2026 The pprs_dynamics founders
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What tells one model from every other: the SHA-256 of its values."""

from __future__ import annotations

import hashlib
import json
from typing import Any

from pprs_dynamics.model.force_model import ForceModel
from pprs_dynamics.model.keys import ARM_URDF


def fingerprint(model: ForceModel) -> str:
    """Return the SHA-256 of the values in force, which changes with every parameter."""
    values: dict[str, Any] = dict(model.values)
    if model.content:
        values[ARM_URDF] = model.content  # wherever the file lies
    return hashlib.sha256(json.dumps(values, sort_keys=True, default=str).encode()).hexdigest()
