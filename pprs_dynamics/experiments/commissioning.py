"""The question of a new robot: the model's own numbers, and the effects that are common."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pprs_dynamics.diagnosis.joint_fit import Regression
from pprs_dynamics.effects.catalogue import catalogue
from pprs_dynamics.effects.drive_effect import DriveEffect, DriveRange
from pprs_dynamics.experiments.columns import Block, ColumnPlan
from pprs_dynamics.experiments.criteria import Explanation, Precision, index_of
from pprs_dynamics.experiments.information import Information, NoiseSpectra, block_index
from pprs_dynamics.experiments.question import Question, block_scales
from pprs_dynamics.measurement.recording import Recording
from pprs_dynamics.measurement.treatment import BLOCK_DURATION
from pprs_dynamics.mechanism.robot import DRIVES
from pprs_dynamics.model.drive_model import DriveModel
from pprs_dynamics.model.model_file import build_robot
from pprs_dynamics.regression.design import Design
from pprs_dynamics.regression.platform_sensitivities import PASSIVE_WIDTHS
from pprs_dynamics.regression.sensitivities import DRIVE_WIDTHS, known_numbers

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
    if not known_numbers(model):
        model = build_robot({**model.values, **{f'tolerances.{key}': TOLERANCE for key in NUMBERS
                                                if np.any(model.values[key])}})
    present = {effect.name for effect in model.effects}
    effects = [effect for name, effect in catalogue().items()
               if name in ON_DRIVES + IN_STRUCTURE and name not in present]
    blocks: list[Block] = []
    groups: list[tuple[str, list[Block]]] = []
    for effect in effects:
        chosen = tuple(range(len(effect.coefficients)))
        values = np.array([c.scale for c in effect.coefficients])
        own = []
        for drive in range(len(DRIVES)) if issubclass(effect, DriveEffect) else (None,):
            shape = {}
            if issubclass(effect, DriveEffect):
                trials = effect.trials(TYPICAL)
                shape = dict(trials[len(trials) // 3])
            own.append(Block(effect, drive, shape, chosen, values))
        blocks += own
        groups.append((effect.name, own))
    plan, spectra, gram, floor = _known(model, recordings, noise, blocks)
    numbers = tuple(k for k, (kind, _) in enumerate(plan.labels) if kind == 'number')
    others = tuple(k for k, (kind, _) in enumerate(plan.labels) if kind != 'number')
    subjects = tuple(
        Explanation(name, (block,), tuple(block_index(plan, [block])), block.truth,
                    block.size * float(np.log(TYPICAL.duration / BLOCK_DURATION)))
        for name, own in groups for block in own)
    scales = np.concatenate([np.ones(len(numbers)),
                             *(block_scales(one.blocks[0]) for one in subjects)])
    criterion = Precision((*numbers, *index_of(subjects)), others, scales)
    return Question('commission', model, plan, spectra, gram, criterion, (), subjects, floor)


def _known(model: DriveModel, recordings: Sequence[Recording], noise: float,
           blocks: Sequence[Block]) -> tuple[ColumnPlan, NoiseSpectra, np.ndarray, float]:
    """Return the plan, the noise, and what is known: from recordings, or from tolerances alone."""
    if recordings:
        from pprs_dynamics.experiments.columns import plan_for

        regression = Regression(Design.of(model, recordings))
        # What the model does not explain counts as noise as long as nothing else is known.
        noises = {d: series.fit_noise(series.error) for d, series in regression.series.items()}
        plan = plan_for(regression.design, blocks)
        spectra = NoiseSpectra(noises, regression.design.residuals.period)
        gram = Information(plan, spectra).of_recordings(regression)
        gram[np.diag_indices(len(plan.labels))] += regression.precision
        floor = max(float(np.sqrt(np.mean(one.error[one.known] ** 2)))
                    for one in regression.series.values())
        return plan, spectra, gram, floor
    numbers = known_numbers(model)
    labels = [('number', number.label) for number in numbers]
    labels += [('width', f'{drive} {k}') for k in range(len(DRIVE_WIDTHS)) for drive in DRIVES]
    labels += [('width', f'passive {k}') for k in range(len(PASSIVE_WIDTHS))]
    plan = ColumnPlan(model, tuple(labels), numbers, tuple(blocks))
    gram = np.zeros((plan.size, plan.size))
    gram[np.diag_indices(len(labels))] = 1.0
    return plan, NoiseSpectra.white(noise, BLOCK_DURATION), gram, noise
