# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What may make an answer worth less: bodies that cannot be, motion, length, filtering, bounds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pprs_dynamics.arrays import root_mean_square
from pprs_dynamics.inference.diagnosis.found_effects import FoundEffect
from pprs_dynamics.inference.search.candidates import SINCE, CandidateSet, Component
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.physics.effects.catalogue import catalogue
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.laws.elastic_joint import ElasticJoint
from pprs_dynamics.physics.effects.laws.lost_motion import LostMotion


def find_cautions(
    fits: FittedSets, best: CandidateSet, effects: Sequence[FoundEffect],
) -> tuple[str, ...]:
    """Return sentences, the graver first."""
    return (*fits.design.given.faults, *_courses(effects), *_length(fits, best), *_motion(fits),
            *_filtered(fits), *_second_encoders(fits, effects),
            *_unexcited(fits, best), *_bounds(effects), *_one_load(fits, effects))


def _length(fits: FittedSets, best: CandidateSet) -> Iterator[str]:
    design, regression = fits.design, fits.regression
    residuals = design.residuals
    duration = len(residuals) * residuals.period
    if duration < fits.decisions.short:
        yield (f'the recordings last {duration:.3g} s together: too short to tell effects from '
               'slow noise; record at least 20 s')
        return
    worth = {d: noise.effective_samples(len(regression.series[d]))
             for d, noise in regression.noise(best.fit).items()}
    poor = [design.drives[d] for d, count in worth.items() if count < fits.decisions.few_samples]
    if poor:
        least = min(worth.values())
        yield (f'noise on {", ".join(poor)} is so slow that the recording is worth only '
               f'{least:.0f} independent samples: constants and slow drifts cannot be told from '
               'it; repeat the recording')


def _motion(fits: FittedSets) -> Iterator[str]:
    design = fits.design
    velocity = design.residuals.variables['velocity']
    still, one_way = [], []
    for d, name in enumerate(design.drives):
        v = velocity[:, d]
        moving = design.moving(d)
        if not design.moves(d):
            still.append(name)
        elif max((v[moving] > 0).mean(), (v[moving] < 0).mean()) > fits.decisions.one_way:
            one_way.append(name)
    if still:
        yield (f'{", ".join(still)} hardly move: friction there cannot be seen, and what holds a '
               'drive at rest looks like a constant force')
    if one_way:
        yield (f'{", ".join(one_way)} move in one direction only: friction there looks like a '
               'constant force; record motion both ways')


def _second_encoders(fits: FittedSets, effects: Sequence[FoundEffect]) -> Iterator[str]:
    """Look for second encoders that tell of a wind-up or a clearance which efforts do not."""
    design, windups = fits.design, fits.components.windups
    told = {(effect.name, name) for effect in effects for name in effect.drives or ()}
    for d, clearance in design.second_encoders.clearances.items():
        name, units = design.drives[d], design.given.units[d]
        where = f'the link of {name} is not where its motor is: by its second encoder '
        unseen = 'which changes the efforts by less than can be told'
        windup = windups.get(d)
        if clearance.explained > max(fits.decisions.explained,
                                     0.0 if windup is None else windup.explained):
            if clearance.size > 0 and (LostMotion.name, name) not in told:
                yield (f'{where}there is a clearance of {clearance.size:.3g} {units.of("m")} '
                       f'between them ({LostMotion.name}), whose side the {clearance.of} chooses, '
                       f'{unseen}')
        elif windup is not None and (ElasticJoint.name, name) not in told:
            yield (f'{where}it winds up by {windup.compliance:.3g} {units.of("m/N")}, '
                   f'{1e3 * windup.loss:.2g} ms behind its load, {unseen}')


def _filtered(fits: FittedSets) -> Iterator[str]:
    """Look for efforts that hold no fast noise at all, at full rate."""
    design = fits.design
    found = []
    for d, name in enumerate(design.drives):
        error = [recording.effort_measured[part, d] - recording.effort[part, d]
                 for recording in design.recordings for part in recording.segments]
        longest = max(error, key=len)
        longest = longest[np.isfinite(longest)]
        if len(longest) < 200 or not np.any(longest):
            continue
        first, third = np.diff(longest), np.diff(longest, 3)
        # Third differences of white noise have ten times the variance of first ones.
        if np.mean(third ** 2) < fits.decisions.filtered * np.mean(first ** 2):
            found.append(name)
    if found:
        yield (f'effort of {", ".join(found)} looks filtered: it holds no fast noise. A filter '
               'delays and rounds what happens at reversals; switch it off, or look out for '
               'time_delay and hysteresis that are the filter\'s')


def _unexcited(fits: FittedSets, best: CandidateSet) -> Iterator[str]:
    """Name effects that this motion would not show even at a size that matters."""
    regression = fits.regression
    adopted = {candidate.name for candidate in best.effects}
    weak = []
    for term in fits.design.structure:
        if (term.effect.name in adopted or term.effect.is_of_one_place
                or fits.design.present(term.effect, None) is not None):
            continue
        information = regression.own_information(best.fit, regression.block(term.rows))
        scales = np.array([c.scale for c in term.effect.coefficients])
        sizes = np.diag(information) * scales ** 2
        present = {c.name: size for c, size in zip(term.effect.coefficients, sizes, strict=True)}
        names = [name for name, size in present.items() if size < fits.decisions.unexcited]
        if names:
            weak.append(term.effect.name if len(names) == len(present)
                        else f'{term.effect.name} ({", ".join(names)})')
    if weak:
        yield (f'this motion hardly excites {", ".join(weak)}: it cannot tell whether '
               f'{"it is" if len(weak) == 1 else "they are"} there')


def _courses(effects: Sequence[FoundEffect]) -> Iterator[str]:
    """Say what to do with effects that are not there all the time."""
    for effect in effects:
        if effect.course is None:
            continue
        if effect.course.kind == SINCE:
            yield (f'{effect.name} is there{effect.when}: adopt would fit it throughout, and must '
                   'be given a recording that begins after that')
        else:
            yield (f'{effect.name} is not constant{effect.when}: warm the machine up, and look for '
                   'what slips')


def _bounds(effects: Sequence[FoundEffect]) -> Iterator[str]:
    for effect in effects:
        if effect.at_bound:
            yield (f'{effect.name}: {", ".join(effect.at_bound)} stands at the edge of what was '
                   'tried; its value is not to be trusted')


def _one_load(fits: FittedSets, effects: Sequence[FoundEffect]) -> Iterator[str]:
    """Name friction by load that friction which does not follow the load replaces nearly."""
    for effect in effects:
        other = catalogue().get(effect.effect.at_one_load)
        if other is None or not issubclass(other, DriveEffect):
            continue
        for name in effect.drives or ():
            d = fits.design.drives.index(name)
            force = effect.force[:, d]
            rows = np.concatenate([fits.components.term(Component.of(
                other, d, {}, names)).rows[d] for names in other.variants[-1:]])
            moving = fits.design.moving(d) & np.isfinite(force)
            wanted, columns = force[moving], rows[:, moving]
            rest = wanted - np.linalg.lstsq(columns.T, wanted, rcond=None)[0] @ columns
            if root_mean_square(rest) < fits.decisions.one_load * root_mean_square(wanted):
                yield (f'{effect.name} on {name} and {other.name} differ by less than '
                       f'{fits.decisions.one_load:.0%} here: the load hardly varies. Record '
                       'another load to separate them')
