# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What somebody did in a session, so that it can be taken back and done again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from pprs_dynamics.app.workbench.tick_fits import Tick
from pprs_dynamics.physics.model.drive_model import DriveModel

MOST_MOMENTS = 200  # that are kept; a moment is a few kilobytes


@dataclass(frozen=True)
class Moment:
    """What there was: a model with its ledger, and ticks with their values.

    Parameters
    ----------
    model : DriveModel
    ticks : mapping of str to Tick
    fitted_since : int
        Revision at which the fits began that the ticks belong to.
    """

    model: DriveModel = field(repr=False)
    ticks: Mapping[str, Tick]
    fitted_since: int

    def is_as(self, other: Moment) -> bool:
        """Return whether both are the same for somebody who looks at them."""
        return self.model is other.model and self.ticks == other.ticks


class History:
    """Moments before the one that is shown, and those that were taken back, each with its deed."""

    def __init__(self) -> None:
        self._done: list[tuple[str, Moment]] = []
        self._undone: list[tuple[str, Moment]] = []

    @property
    def undoes(self) -> str:
        """The deed that is taken back next, '' for none."""
        return self._done[-1][0] if self._done else ''

    @property
    def redoes(self) -> str:
        """The deed that is done again next, '' for none."""
        return self._undone[-1][0] if self._undone else ''

    def note(self, deed: str, before: Moment) -> None:
        """Note what was done and what there was before.

        The same deed over and over, as a slider does it, is one.
        """
        if deed != self.undoes:
            self._done = [*self._done, (deed, before)][-MOST_MOMENTS:]
        self._undone = []

    def back(self, now: Moment) -> Moment | None:
        """Take the last deed back: return the moment before it, None where there is none."""
        return self._moved(self._done, self._undone, now)

    def forward(self, now: Moment) -> Moment | None:
        """Do again what was taken back last: return the moment after it."""
        return self._moved(self._undone, self._done, now)

    @staticmethod
    def _moved(source: list[tuple[str, Moment]], target: list[tuple[str, Moment]], now: Moment,
               ) -> Moment | None:
        if not source:
            return None
        deed, moment = source.pop()
        target.append((deed, now))
        return moment
