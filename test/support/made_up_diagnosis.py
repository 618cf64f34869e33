# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Small diagnoses made up by hand, for what is said and drawn of them."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from pprs_dynamics import DriveModel
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.inference.diagnosis.diagnosis import (
    Diagnosis,
    EffectAlone,
    FoundEffect,
    NamedEffect,
    RankedSet,
)
from pprs_dynamics.inference.diagnosis.statements import Statement
from pprs_dynamics.inference.residuals.noise import NoiseSpectrum
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.inference.search.candidates import CostTerms
from pprs_dynamics.inference.search.estimates import Estimate, FittedNumber
from pprs_dynamics.physics.effects.catalogue import CATALOGUE

SAMPLES, PERIOD = 1500, 0.01
NOISE = 0.05  # [N]


@cache
def made_up_residuals() -> Residuals:
    """Return a motion of all drives, with nothing but noise between model and effort."""
    rng = np.random.default_rng(3)
    time = np.arange(SAMPLES) * PERIOD
    phase = 2 * np.pi * np.outer(time, 0.2 + 0.05 * np.arange(6))
    position, velocity = 0.05 * np.sin(phase), 0.05 * np.cos(phase)
    model = 5.0 + 20 * position
    platform = {f'platform_{name}': 0.03 * np.sin((2 + k) * time)
                for k, name in enumerate(('x', 'y', 'z', 'tilt', 'turn'))}
    return Residuals(
        DRIVES, time, np.zeros(SAMPLES, dtype=int), model + NOISE * rng.normal(size=model.shape),
        model, {}, {'position': position, 'velocity': velocity, 'acceleration': -position,
                    'load': 8 + position, 'rod_angle': 1 + position, **platform}, PERIOD)


def found_effect(name: str, drives: tuple[str, ...] | None = ('lift_2',), value: float = 0.6,
                 held_out_after: float = 0.056, only: tuple[str, ...] = (),
                 **changes: Any) -> FoundEffect:
    """Return an effect with a value for every parameter, or for those of `only`."""
    effect = CATALOGUE[name]
    parameters = {
        f'{place}{p.name}': Estimate(value, 0.01, p.unit) if not only or p.name in only
        else Estimate(0.0, 0.0, p.unit)
        for place in ([''] if drives is None else [f'{d}.' for d in drives])
        for p in effect.parameters}
    force = np.zeros((SAMPLES, 6))
    velocity = made_up_residuals().variables['velocity']
    for d in range(6):
        if drives is None or DRIVES[d] in drives:
            force[:, d] = value * np.sign(velocity[:, d])
    values = {'parameters': parameters, 'evidence': 120.4, 'error_before': 0.25,
              'error_after': 0.0510, 'held_out_before': 0.26, **changes}
    return FoundEffect(effect, drives, force=force, held_out_after=held_out_after, **values)


def statement(drive: str = 'slide_1', variable: str = 'position', kind: str = 'range',
              limits: tuple[float, float] | None = (0.01, 0.02)) -> Statement:
    """Return what remains somewhere."""
    return Statement(drive, variable, limits, 0.41, 0.07, f'{drive}: 41% of its squared error lies '
                     'somewhere, in 7% of the time; it is shifted there by +0.3 N', 77.0, kind,
                     0.3 ** 2 * 0.07)


def made_up_diagnosis(verdict: str = 'effect', **changes: Any) -> Diagnosis:
    """Return a diagnosis; `changes` are its fields."""
    residuals, model = made_up_residuals(), DriveModel.load()
    effects = changes.get('effects', ())
    missing = sum((effect.force for effect in effects), np.zeros((SAMPLES, 6)))
    given = Residuals(DRIVES, residuals.time, residuals.segment, residuals.measured + missing,
                      residuals.model, {}, residuals.variables, PERIOD)
    fields: dict[str, Any] = {
        'verdict': verdict, 'effects': (), 'indistinguishable': (), 'unconfirmed': (),
        'candidates': tuple(
            EffectAlone(e.name, e.drives, e.evidence, e.error_after) for e in effects),
        'suspects': (), 'depends_on': (), 'sets': (),
        'calibrated': (), 'warnings': (), 'noise': dict.fromkeys(DRIVES, white_noise()),
        'noise_floors': dict.fromkeys(DRIVES, NOISE),
        'notes': (), 'model': model, 'adopted': model, 'residuals': given,
        'remaining': residuals.error}
    return Diagnosis(**{**fields, **changes})


def white_noise() -> NoiseSpectrum:
    """Return the noise between model and effort."""
    return NoiseSpectrum(np.array([1.0]), np.array([NOISE ** 2, 0.0]), PERIOD)


def ranked_set(names: tuple[tuple[str, tuple[str, ...] | None], ...], cost: float) -> RankedSet:
    """Return a set that costs so much more than the best, all of it for its names."""
    return RankedSet(tuple(NamedEffect(*name) for name in names), CostTerms(names=cost))


def ranked_sets(*names: str) -> tuple[RankedSet, ...]:
    """Return sets of one effect each, every one 7 worse than the one before."""
    return tuple(ranked_set(((name, ('lift_2',)),), 7.0 * k) for k, name in enumerate(names))


def calibration(after: float = 1.02) -> FittedNumber:
    """Return a payload that was weighed with a tolerance of 5 %."""
    return FittedNumber('masses.payload', '', 1.0, after, 0.002, 'kg')


SUSPECT = EffectAlone('effort_offset', ('slide_3',), -4.2, 0.06)
