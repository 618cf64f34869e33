# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A number of a machine that is another one afterwards."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class ChangedNumber:
    """A number of the machine that is another one afterwards.

    Parameters
    ----------
    name : str
        Of an effect; `model` for a number of the model's own.
    drives : tuple of str or None
        On which it sits; None in the structure.
    parameter : str
    before : float or None
        0 for the strength of an effect that was not there; None for what it had no value of.
    after, std : float
        The latter of the difference.
    unit : str
    """

    name: str
    drives: tuple[str, ...] | None
    parameter: str
    before: float | None
    after: float
    std: float
    unit: str

    def to_dict(self) -> dict[str, Any]:
        """Return an entry of `changes` in the JSON."""
        return {**vars(self), 'drives': None if self.drives is None else list(self.drives)}
