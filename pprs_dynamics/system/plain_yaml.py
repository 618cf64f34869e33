# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Single values as YAML: names as they are, and quoted where they would be something else."""

from __future__ import annotations

import json
import re

PLAIN = re.compile(r'[A-Za-z_/.][\w./\-]*', re.ASCII)
# Words that YAML takes for a truth value, for nothing or for a number.
WORDS = frozenset(('y', 'n', 'yes', 'no', 'true', 'false', 'on', 'off', 'null', '.nan', '.inf'))


def scalar(value: str | int) -> str:
    """Return a name or a number as YAML."""
    if isinstance(value, int):
        return str(value)
    if PLAIN.fullmatch(value) and value.lower() not in WORDS:
        return value
    return json.dumps(value, ensure_ascii=False)
