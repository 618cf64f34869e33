# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Parts of a diagnosis: reported effects, their rivals, and ranked sets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.search.candidates import SINCE, CostTerms, Course
from pprs_dynamics.inference.search.estimates import Estimate
from pprs_dynamics.inference.search.held_out import PredictiveGain
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.system.numbers import finite

Drives = tuple[str, ...] | None


@dataclass(frozen=True)
class RankedSet:
    """A set of effects with its cost.

    Parameters
    ----------
    names : tuple of (name, drives)
        Effects, and `unknown, VARIABLE` for patterns of no catalogue.
    terms : CostTerms
        Of its cost, less those of the best set.
    barred : str
        Why it may not be, whatever it costs; '' where it may.
    """

    names: tuple[tuple[str, Drives], ...]
    terms: CostTerms
    barred: str = ''

    @property
    def cost(self) -> float:
        """Above that of the best set; lower is better."""
        return self.terms.total

    def to_dict(self) -> dict[str, Any]:
        """Return an entry of `sets` in the JSON."""
        return {'cost': self.cost, 'terms': self.terms.to_dict(), 'effects': [
            {'name': name, 'drives': listed(drives)} for name, drives in self.names],
            **({'barred': self.barred} if self.barred else {})}


@dataclass(frozen=True)
class FoundEffect:
    """An effect of a row of the table.

    Parameters
    ----------
    effect : type of CatalogueEffect
    drives : tuple of str or None
        On which it sits; None for the structure.
    parameters : dict of str to Estimate
    force : (M, D) array
        What it contributes [N].
    evidence : float
        Cost of the best set without it, less that of the best set.
    error_before, error_after : float
        Without its force, all else as it was fitted, and with it [N].
    held_out_before, held_out_after : float
        On held-out data: fitted without it, and with it [N].
    at_bound : tuple of str
        Parameters whose value is none: at the edge of what was tried.
    share : float
        By which its force alone lowers the error, over the error of the input model: of the root
        mean square over drives, each in units of its noise.
    gain : PredictiveGain, optional
        By how much the reported effects predict held-out data better than without it; None where
        that is unknown.
    objection : str
        Why data refute it, as a clause; '' where they do not.
    without : RankedSet, optional
        The best set without it, against the best one with it.
    in_model : mapping of str to float
        What the given model says of the parameters, where it has the effect: then the recordings
        say something else. Empty for an effect that it lacks.
    course : Course or None
        When it is there, from the start of the first recording [s]; None: all the time.
    moments : mapping of str to Estimate
        First moments of added bodies: see `Estimates`.
    """

    effect: type[CatalogueEffect]
    drives: Drives
    parameters: dict[str, Estimate]
    force: Array
    evidence: float
    error_before: float
    error_after: float
    held_out_before: float
    held_out_after: float
    at_bound: tuple[str, ...] = ()
    share: float = 0.0
    gain: PredictiveGain | None = None
    objection: str = ''
    without: RankedSet | None = None
    in_model: Mapping[str, float] = field(default_factory=dict)
    course: Course | None = None
    moments: Mapping[str, Estimate] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name in the catalogue."""
        return self.effect.name

    @property
    def places(self) -> tuple[tuple[str, ...], ...]:
        """Links or joints that it is on, each with those that no motion separates from it."""
        return self.effect.places_of(self.parameters)

    @property
    def certainty(self) -> float:
        """Standard errors of the held-out gain; NaN where that is unknown."""
        return float('nan') if self.gain is None else self.gain.certainty

    @property
    def when(self) -> str:
        """When it is there, as the end of a clause; '' where that is all the time."""
        if self.course is None:
            return ''
        if self.course.kind == SINCE:
            return f' since {self.course.begin:.4g} s'
        return f', growing from nothing at the start to this at {self.course.end:.4g} s'

    def to_dict(self) -> dict[str, Any]:
        """Return the keys of the interface."""
        return {'name': self.name, 'drives': listed(self.drives),
                'alike': [list(names) for names in self.places if len(names) > 1],
                'since': self.course.begin if self.course and self.course.kind == SINCE else None,
                'course': self.course.kind if self.course else None,
                'parameters': {key: estimate.to_dict()
                               for key, estimate in self.parameters.items()},
                **({'moments': {key: estimate.to_dict() for key, estimate in self.moments.items()}}
                   if self.moments else {}),
                **({'in_model': dict(self.in_model)} if self.in_model else {}),
                'evidence': self.evidence,
                'without': None if self.without is None else self.without.to_dict(),
                'error_before': self.error_before, 'error_after': self.error_after,
                'held_out_before': self.held_out_before, 'held_out_after': self.held_out_after,
                'held_out_certainty': finite(self.certainty)}


@dataclass(frozen=True)
class RivalEffect:
    """An effect that would explain the recordings about as well as a reported one.

    Parameters
    ----------
    found : FoundEffect
        In the row of the rival.
    of : str
        The reported effect.
    cost : float
        Of its row, above that of the reported row.
    remaining : (M, D) array
        Residual of its row [N].
    """

    found: FoundEffect
    of: str
    cost: float
    remaining: Array


@dataclass(frozen=True)
class RankedEffect:
    """A candidate for the first place, or a suspect."""

    name: str
    drives: Drives
    evidence: float
    error_after: float

    def to_dict(self) -> dict[str, Any]:
        """Return the keys of the interface."""
        return {'name': self.name, 'drives': listed(self.drives), 'evidence': self.evidence,
                'error_after': self.error_after}


def listed(drives: Drives) -> list[str] | None:
    """Return names of drives for JSON."""
    return None if drives is None else list(drives)
