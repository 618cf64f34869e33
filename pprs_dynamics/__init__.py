# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Forces of parallel robots with friction in every joint, and which effect a model lacks.

The names in `__init__.pyi` are stable; what is behind them may move.
"""

from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path
from typing import Any

__version__ = '0.1.0'

# Loaded at first use: `pprs --help` and a node's refusal need neither numpy nor a model.
_MODULES = {name.name: line.module for line in ast.parse(
    Path(__file__).with_suffix('.pyi').read_text(encoding='utf-8')).body
    if isinstance(line, ast.ImportFrom) for name in line.names}
__all__ = sorted(_MODULES)


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    value = getattr(import_module(_MODULES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
