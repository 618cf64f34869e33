# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The question of a new robot: the model's own numbers, and the effects that are common."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pprs_dynamics.drives import DRIVES
from pprs_dynamics.inference.experiments.columns import ColumnPlan, FittedTerm, reversal_shapes
from pprs_dynamics.inference.experiments.criteria import Precision, free_of
from pprs_dynamics.inference.experiments.information import Information
from pprs_dynamics.inference.experiments.question import Question, subjects_of
from pprs_dynamics.inference.regression.base_columns import (
    BaseColumn,
    ModelNumber,
    PresentCoefficient,
    PresentShape,
    ReversalShape,
)
from pprs_dynamics.inference.regression.design import FREE, Design
from pprs_dynamics.inference.regression.joint_fit import Regression
from pprs_dynamics.inference.regression.sensitivities import PASSIVE_WIDTHS, model_numbers
from pprs_dynamics.inference.residuals.noise import NoiseSpectrum
from pprs_dynamics.inference.search.candidates import Prices
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.motion.treatment import BLOCK_DURATION
from pprs_dynamics.physics.effects.catalogue import catalogue
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveRange
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.model.drive_model import DriveModel

# Effects that most machines have, or that are most often entered wrongly.
ON_DRIVES = ('viscous_friction', 'coulomb_friction', 'stribeck_friction', 'effort_offset',
             'drive_spring', 'drive_inertia')
IN_STRUCTURE = ('payload_mass', 'payload_offset', 'platform_inertia', 'external_wrench',
                'base_tilt', 'platform_drag', 'rod_mass', 'revolute_friction',
                'spherical_friction')
# How well the numbers of a new robot are known where its file does not say.
TOLERANCE = 0.1
NUMBERS = ('masses.platform', 'masses.payload', 'masses.slides', 'masses.lifts', 'masses.rods',
           'friction.drives.viscous', 'friction.drives.coulomb', 'friction.revolute.viscous',
           'friction.revolute.coulomb', 'friction.spherical.viscous',
           'friction.spherical.coulomb')
TYPICAL = DriveRange(20.0, BLOCK_DURATION, 0.2, 0.2)  # for shapes of effects


def commissioning(model: DriveModel, recordings: Sequence[Recording], noise: float) -> Question:
    """Return the question of a robot that nothing, or little, is known of.

    Parameters
    ----------
    model : DriveModel
    recordings : sequence of Recording
        What is there already; may be none.
    noise : float
        Standard deviation of means of the effort over 0.01 s [N], where nothing is recorded.
    """
    if not model_numbers(model):
        tolerances = {f'tolerances.{key}': TOLERANCE for key in NUMBERS
                      if np.any(model.values[key])}
        model = DriveModel.from_parameters({**model.values, **tolerances})
    present = {effect.name for effect in model.effects}
    terms = []
    for name, effect in catalogue().items():
        if name in present or name not in ON_DRIVES + IN_STRUCTURE:
            continue
        if issubclass(effect, DriveEffect):
            trials = effect.trials(TYPICAL)
            terms += [FittedTerm.at_scale(effect, drive, trials[len(trials) // 3])
                      for drive in range(len(DRIVES))]
        else:
            terms.append(FittedTerm.at_scale(effect, None, {}))
    samples = round(TYPICAL.duration / BLOCK_DURATION)
    if recordings:
        design = Design.of(model, recordings)
        regression = Regression(design.residuals, design.base)
        # What the model does not explain counts as noise as long as nothing else is known.
        fit = regression.fit(())
        plan, spectra = ColumnPlan.of_design(design, terms), regression.noise(fit)
        known = Information(plan, spectra).of_recordings(design, regression, fit)
        noise = max(regression.noise_floor(fit, d) for d in regression.drives)
    else:
        white = NoiseSpectrum(np.zeros(0), np.array([noise ** 2]), BLOCK_DURATION)
        plan = ColumnPlan(model, model, base_without_recordings(model), tuple(terms))
        spectra = dict.fromkeys(range(len(DRIVES)), white)
        known = Information(plan, spectra).prior()
    subjects = subjects_of(plan, Prices(len(catalogue()), len(DRIVES), samples, DECISIONS))
    scales = np.concatenate([np.ones(len(plan.numbers)), *(term.scales for term in terms)])
    criterion = Precision((*plan.numbers, *free_of(subjects)), plan.others, scales)
    return Question('commission', plan, spectra, known, criterion, (), tuple(subjects), noise)


def base_without_recordings(model: DriveModel) -> tuple[BaseColumn, ...]:
    """Return what is fitted on any recording of a model, as columns without rows."""
    base: list[BaseColumn] = [ModelNumber({}, 1.0, number) for number in model_numbers(model)]
    base += reversal_shapes(range(len(DRIVES)))
    base += [ReversalShape({}, 1.0, None, number) for number in range(len(PASSIVE_WIDTHS))]
    for effect in model.effects:
        if isinstance(effect, CatalogueEffect):
            for drive in effect.drives if isinstance(effect, DriveEffect) else (None,):
                base += [PresentCoefficient({}, FREE, type(effect), drive, c)
                         for c in effect.coefficients]
                base += [PresentShape({}, FREE, type(effect), drive, p) for p in effect.shape]
    return tuple(base)
