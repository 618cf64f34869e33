# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The answer of a diagnosis: which physical effect a model lacks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.inference.diagnosis.detectable import DetectableSize, detectable_sizes
from pprs_dynamics.inference.diagnosis.found_effects import (
    FoundEffect,
    RankedEffect,
    RankedSet,
)
from pprs_dynamics.inference.diagnosis.statements import Statement
from pprs_dynamics.inference.fit.reference import Reference
from pprs_dynamics.inference.readings.efforts import kinds_of
from pprs_dynamics.inference.readings.findings import NoMeasurement
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.residuals.noise import NoiseSpectrum
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.inference.search.decisions import DECISIONS, Decisions
from pprs_dynamics.inference.search.estimates import Calibration
from pprs_dynamics.inference.search.explained_effort import explained_shares
from pprs_dynamics.inference.search.table import ModelTable
from pprs_dynamics.measurement.motion.stick_slip import StickSlip
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.system.numbers import finite


@dataclass(frozen=True)
class SinceReference:
    """What a reference run says of the recordings of a diagnosis.

    Parameters
    ----------
    recordings : tuple of str
        The reference runs.
    covered : float
        Share of the samples whose states they know.
    explained : mapping of str to float
        Share of each drive's squared error, under the model as given, that they show as well.
    pace : float
        Speed of the drives, over that in them: the median of all drives.
    note : str
        What must be known of them; '' for nothing.
    """

    recordings: tuple[str, ...]
    covered: float
    explained: Mapping[str, float]
    pace: float
    note: str

    @classmethod
    def of(cls, reference: Reference, design: Design) -> SinceReference:
        """Return it for a design with a reference."""
        assert design.carried is not None
        left = design.residuals.error
        whole = left + design.carried.shown(design.residuals)
        before, after = (np.nansum(one ** 2, axis=0) for one in (whole, left))
        explained = {drive: max(0.0, 1 - float(after[d] / before[d]))
                     for d, drive in enumerate(design.drives) if before[d] > 0}
        here, there = (np.sqrt(np.nanmean(one.variables['velocity'] ** 2, axis=0))
                       for one in (design.residuals, reference.regression.residuals))
        moved = there > 0
        pace = float(np.median(here[moved] / there[moved])) if moved.any() else 1.0
        return cls(reference.names, design.carried.covered, explained, pace, reference.note)

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        return {'recordings': list(self.recordings), 'covered': self.covered,
                'explained': dict(self.explained), 'pace': self.pace}


@dataclass(frozen=True)
class Diagnosis:
    """The answer.

    Parameters
    ----------
    verdict : {'unknown', 'ambiguous', 'effect', 'adequate'}
    effects : tuple of FoundEffect
        Those of the row of least cost; whose force removes most of the error first.
    indistinguishable : tuple of tuple of str
        Each an adopted effect and its rivals.
    unconfirmed : tuple of FoundEffect
        Fitted as well, but no machine can have them, or the error does not fall with them, or not
        on held-out data.
    candidates, suspects : tuple of RankedEffect
    depends_on : tuple of Statement
        What no effect explains.
    sets : tuple of RankedSet
        The best sets of the search, the best first.
    barred : tuple of RankedSet
        Those that would cost less than a rival and may not be.
    calibrated : tuple of Calibration
        Numbers that moved within their tolerances.
    warnings, notes : tuple of str
    model : DriveModel
        As given.
    adopted : DriveModel
        With the effects.
    residuals : Residuals
        Of the model as given.
    remaining : (M, D) array
        Measured minus `adopted` [N].
    noise : mapping of str to NoiseSpectrum
        By drive.
    noise_floors : mapping of str to float
        Root of the mean square of the noise of each drive [N].
    noise_floor : float
        The same over drives [N].
    refit : float
        Error with the fitted numbers of the model but without the effects [N].
    above_noise : mapping of str to float
        Residual of a drive over its noise, where the reported effects do not explain it.
    little : mapping of str to float
        Drives of whose effort the reported effects explain little, with the shares.
    unseen_noise : tuple of str
        Drives whose noise the recordings do not determine: their floor is an upper bound, the
        residual of the best set.
    held_out_on : {'blocks', 'validation'}
    effort_looks_like : mapping of str to NoMeasurement
        Drives whose efforts are no measurement: then nothing is claimed.
    stick_slip : mapping of str to StickSlip
        Drives that stick and slip for much of the time: then nothing else is claimed.
    since : SinceReference, optional
        The reference run since which changes are reported; None: what the model lacks.
    selection : ModelTable, optional
        All rows that were fitted.
    decisions : Decisions
        With which it was made.
    """

    verdict: str
    effects: tuple[FoundEffect, ...]
    indistinguishable: tuple[tuple[str, ...], ...]
    unconfirmed: tuple[FoundEffect, ...]
    candidates: tuple[RankedEffect, ...]
    suspects: tuple[RankedEffect, ...]
    depends_on: tuple[Statement, ...]
    sets: tuple[RankedSet, ...]
    barred: tuple[RankedSet, ...]
    calibrated: tuple[Calibration, ...]
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    model: DriveModel
    adopted: DriveModel
    residuals: Residuals
    remaining: Array
    noise: dict[str, NoiseSpectrum]
    noise_floors: dict[str, float]
    noise_floor: float
    refit: float = np.nan
    above_noise: Mapping[str, float] = field(default_factory=dict)
    little: Mapping[str, float] = field(default_factory=dict)
    unseen_noise: tuple[str, ...] = ()
    held_out_on: str = 'blocks'
    effort_looks_like: Mapping[str, NoMeasurement] = field(default_factory=dict)
    stick_slip: Mapping[str, StickSlip] = field(default_factory=dict)
    since: SinceReference | None = None
    selection: ModelTable | None = field(default=None, repr=False, compare=False)
    decisions: Decisions = DECISIONS

    @cached_property
    def detectable(self) -> tuple[DetectableSize, ...]:
        """Smallest sizes of other effects; none where the answer is open."""
        if (self.selection is None or self.verdict not in ('adequate', 'effect')
                or any(effect.course for effect in self.effects)):
            return ()
        return detectable_sizes(self.selection.last, self.selection.reported)

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON: the keys that docs/commands.md lists."""
        return {
            'verdict': self.verdict,
            'effects': [effect.to_dict() for effect in self.effects],
            'refit': {'error_before': root_mean_square(self.residuals.error),
                      'error_after': finite(self.refit)},
            'indistinguishable': [list(names) for names in self.indistinguishable],
            'unconfirmed': [effect.to_dict() for effect in self.unconfirmed],
            'candidates': [candidate.to_dict() for candidate in self.candidates],
            'depends_on': [
                {'drive': s.drive, 'variable': s.variable, 'share_of_error': s.share_of_error,
                 'range': None if s.range is None else list(s.range), 'text': s.text}
                for s in self.depends_on],
            'suspects': [{key: value for key, value in s.to_dict().items() if key != 'error_after'}
                         for s in self.suspects],
            'sets': [fitted.to_dict() for fitted in self.sets],
            'barred': [ranked.to_dict() for ranked in self.barred],
            'calibrated': [number.to_dict() for number in self.calibrated],
            'detectable': [detectable.to_dict() for detectable in self.detectable],
            'held_out_on': self.held_out_on, 'above_noise': dict(self.above_noise),
            'effort_looks_like': kinds_of(self.effort_looks_like),
            'stick_slip': {drive: {'frequency': slip.frequency, 'speed': slip.speed,
                                   'step': slip.step, 'share_of_time': slip.share}
                           for drive, slip in self.stick_slip.items()},
            'explained': _for_json(explained_shares(self.residuals)),
            'little_explained': dict(self.little),
            'explained_after': _for_json(explained_shares(self.residuals, self.remaining)),
            'reference': None if self.since is None else self.since.to_dict(),
            'changed_since': None if self.since is None else [
                effect.name for effect in self.effects],
            'noise_floor': self.noise_floor,
            'noise_floors': dict(self.noise_floors), 'warnings': list(self.warnings)}


def _for_json(shares: Mapping[str, float]) -> dict[str, float | None]:
    return {name: finite(share) for name, share in shares.items()}
