# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Warnings that qualify an answer: length, motion, filtering, excitation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from pprs_dynamics.arrays import root_mean_square
from pprs_dynamics.inference.diagnosis.diagnosis import FoundEffect
from pprs_dynamics.inference.diagnosis.quantities import listed
from pprs_dynamics.inference.regression.base_columns import ReversalShape
from pprs_dynamics.inference.search.candidates import CandidateSet
from pprs_dynamics.inference.search.fitted_model import friction_forms
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.laws.elastic_joint import ElasticJoint
from pprs_dynamics.physics.effects.laws.lost_motion import LostMotion


def find_cautions(
    fits: FittedSets, best: CandidateSet, effects: Sequence[FoundEffect],
    noise_levels: Mapping[str, float],
) -> tuple[str, ...]:
    """Return sentences, the graver first."""
    return (*fits.design.given.faults, *_length(fits, best), *_motion(fits), *_filtered(fits),
            *_reversals(fits, best, noise_levels), *_second_encoders(fits, effects),
            *_unexcited(fits, best), *_one_load(fits, effects))


def _length(fits: FittedSets, best: CandidateSet) -> Iterator[str]:
    design, regression = fits.design, fits.regression
    duration = len(design.residuals) * design.residuals.period
    if duration < fits.decisions.short:
        yield (f'the recordings last {duration:.2g} s together, too short to separate effects from '
               'slow noise; record at least 20 s')
        return
    worth = {d: noise.effective_samples(len(regression.series[d]))
             for d, noise in regression.noise(best.fit).items()}
    poor = [design.drives[d] for d, count in worth.items() if count < fits.decisions.few_samples]
    if poor:
        count = round(min(worth.values()))
        yield (f'the noise of {listed(poor)} is slow: for a constant force the recording is worth '
               f'{count} independent sample{"s" * (count != 1)}. Record for longer')


def _motion(fits: FittedSets) -> Iterator[str]:
    design, still, one_way = fits.design, [], []
    for d, name in enumerate(design.drives):
        v = design.residuals.variables['velocity'][design.moving(d), d]
        if not design.moves(d):
            still.append(name)
        elif max((v > 0).mean(), (v < 0).mean()) > fits.decisions.one_way:
            one_way.append(name)
    if still:
        yield f'{listed(still)} hardly moved: friction there looks like a constant force'
    if one_way:
        yield (f'{listed(one_way)} moved in one direction only: friction there looks like a '
               'constant force; record motion both ways')


def _reversals(fits: FittedSets, best: CandidateSet, noise_levels: Mapping[str, float],
               ) -> Iterator[str]:
    """Yield the drives whose friction reverses in another width than the model's."""
    forces = friction_forms(fits, best, ReversalShape)
    wrong = [fits.design.drives[d] for d in fits.regression.drives
             if root_mean_square(forces[:, d]) > noise_levels[fits.design.drives[d]]]
    if wrong:
        yield (f'friction of {listed(wrong)} seems to reverse over another range of velocities '
               'than in the model, and that part of the error remains. `pprs fit` estimates '
               'friction.reversal_velocities')


def _second_encoders(fits: FittedSets, effects: Sequence[FoundEffect]) -> Iterator[str]:
    """Yield wind-up and clearance that second encoders show and efforts do not."""
    design, windups = fits.design, fits.components.windups
    reported = {(effect.name, name) for effect in effects for name in effect.drives or ()}
    for d, clearance in design.second_encoders.clearances.items():
        name, units, windup = design.drives[d], design.given.units[d], windups.get(d)
        what = ''
        if clearance.explained > max(fits.decisions.explained,
                                     0.0 if windup is None else windup.explained):
            if clearance.size > 0 and (LostMotion.name, name) not in reported:
                what = (f'a clearance of {clearance.size:.3g} {units.of("m")} ({LostMotion.name}), '
                        f'whose side the {clearance.of} chooses')
        elif windup is not None and (ElasticJoint.name, name) not in reported:
            what = (f'a wind-up of {windup.compliance:.3g} {units.of("m/N")}, '
                    f'{1e3 * windup.loss:.2g} ms after its load')
        if what:
            yield (f'the second encoder of {name} shows {what}; it does not change the efforts '
                   'visibly')


def _filtered(fits: FittedSets) -> Iterator[str]:
    """Yield the drives whose efforts have no fast noise at full rate."""
    design, found = fits.design, []
    for d, name in enumerate(design.drives):
        error = max((recording.effort_measured[part, d] - recording.effort[part, d]
                     for recording in design.recordings for part in recording.segments), key=len)
        error = error[np.isfinite(error)]
        # Third differences of white noise have ten times the variance of first ones.
        if len(error) >= 200 and np.any(error) and np.mean(np.diff(error, 3) ** 2) < (
                fits.decisions.filtered * np.mean(np.diff(error) ** 2)):
            found.append(name)
    if found:
        yield (f'effort of {listed(found)} looks filtered, it has no fast noise. A filter looks '
               'like time_delay and hysteresis: switch it off')


def _unexcited(fits: FittedSets, best: CandidateSet) -> Iterator[str]:
    """Yield the effects that this motion would not show even at a size that matters."""
    regression, weak = fits.regression, []
    for term in fits.design.structure:
        if (term.effect.name in {candidate.name for candidate in best.effects}
                or term.effect.is_of_one_place
                or fits.design.present(term.effect, None) is not None):
            continue
        information = regression.own_information(best.fit, regression.block(term.rows))
        scales = np.array([c.scale for c in term.effect.coefficients])
        names = [c.name for c, size in zip(
            term.effect.coefficients, np.diag(information) * scales ** 2, strict=True)
            if size < fits.decisions.unexcited]
        if names:
            weak.append(term.effect.name if len(names) == len(scales)
                        else f'{term.effect.name} ({", ".join(names)})')
    if weak:
        yield f'this motion hardly excites {listed(weak)}: no statement about them is possible'


def _one_load(fits: FittedSets, effects: Sequence[FoundEffect]) -> Iterator[str]:
    """Yield friction that a form error separates from one that follows the load, or does not."""
    design = fits.design
    for effect in effects:
        other = CATALOGUE.get(effect.effect.at_one_load)
        if other is None or not issubclass(other, DriveEffect):
            continue
        alike = []
        for d in map(design.drives.index, effect.drives or ()):
            force = np.nan_to_num(effect.force[:, d])
            columns = np.nan_to_num(design.drive_rows(other, d, {}))
            rest = force - np.linalg.lstsq(columns.T, force, rcond=None)[0] @ columns
            if root_mean_square(rest) < fits.decisions.form_share * root_mean_square(force):
                alike.append(design.drives[d])
        if alike:
            yield (f'{effect.name} and {other.name} cannot be separated on {listed(alike)}, '
                   'because the load hardly varies. Record with another load')
