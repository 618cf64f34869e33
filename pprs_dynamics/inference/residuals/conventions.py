# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Whether a recording has the units, signs and order of drives that the model means.

A recording in kilonewtons, or with the efforts of a reaction, is free of defects and yet wrong.
What tells is the model itself: the recording is read in other ways, and where one of them fits
several times better than what its names and units say, that is said. Nothing is ever changed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.errors import MisreadError
from pprs_dynamics.inference.residuals.changed_readings import (
    find_changed_efforts,
    find_changed_positions,
)
from pprs_dynamics.inference.residuals.excerpt import (
    Excerpt,
    excerpt_of,
    forces_in_pieces,
    forces_on,
)
from pprs_dynamics.inference.residuals.measured_effort import (
    EffortContent,
    effort_contents,
    find_no_measurements,
)
from pprs_dynamics.inference.residuals.mistakes import (
    POSITION_UNIT,
    Mistake,
    OtherReading,
    Scales,
    columns_line,
)
from pprs_dynamics.inference.residuals.readings import (
    ALL_NEGATED,
    ANGLES,
    LENGTHS,
    POSITION_SIGN,
    Reading,
    as_named,
    named,
    readings,
    rescaled,
)
from pprs_dynamics.measurement.files.defects import SLOW_STEP
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.files.samples import Defect
from pprs_dynamics.physics.model.force_model import ForceModel

# What efforts may be, as multiples of what they are taken for.
EFFORT_FACTORS = (1.0, -1.0, 1e-3, -1e-3, 1e3, -1e3)
EFFORT_PREFIXES = {1e-3: 'k', 1e3: 'm'}
TIMES = {1e-3: 'milliseconds', 1e-6: 'microseconds', 1e-9: 'nanoseconds'}
SHORTEST_STEP = 1e-5  # [s]; no robot is sampled at more than 100 kHz
# A reading is believed where it fits this many times better, for every mistake that it takes.
# Over 525 recordings with hidden effects of up to ten times their usual size, which all had the
# right units and signs, no reading fitted more than 1.8 times better.
CLEARLY_BETTER = 3.0
# And where it leaves no more than this: 0 is a perfect fit, 1 one without any likeness.
GOOD_FIT = 0.25
# Where the mechanism cannot follow what was recorded at all, there is nothing to be better than.
GOOD_FIT_ALONE = 0.1
# A fit as close as this leaves nothing to look for in signs and orders.
CLOSE_FIT = 0.015
# Of readings whose fits differ by less, the first and simplest counts.
SAME_FIT = 0.9
# Drives, and swings about their means, that are this much weaker than others tell nothing.
WEAK = 0.01
STROKE_SLACK = 0.05  # share of a stroke by which positions may lie outside it
# Multiples of the farthest end of a stroke, or of the largest speed, beyond which positions are in
# another unit where that fits better at all.
BEYOND = 2.0
# Efforts in percent and per mille of the largest of each drive, as multiples of that. Nameplates
# have the rated one, of which the largest in a URDF may be a multiple.
SHARES = {0.01: 'percent', 1e-3: 'per mille'}
LARGEST_OVERLOAD = 4.0
# By how much factors of drives may differ, relatively, and be one; and what is more than that.
ONE_FACTOR, SEVERAL_FACTORS = 0.25, 0.5
FAR_OUT = 10.0  # multiples of the farthest end of a stroke that no mistake of zero explains
ALIKE = 0.9  # least correlation of a recorded velocity with the derivative of positions
NEARLY = 0.2  # by how much a factor may be off, relatively


@dataclass(frozen=True)
class _Fit:
    """How well a reading fits: mean misfit, factors of the efforts, and mistakes it takes."""

    reading: Reading
    time_unit: float
    misfit: float
    factors: Array
    cost: float

    @property
    def score(self) -> float:
        """Misfit, dearer for every mistake."""
        return float(self.misfit * CLEARLY_BETTER ** self.cost)


def find_mistakes(model: ForceModel, recording: Recording) -> tuple[Defect, ...]:
    """Return what the numbers of a recording rather mean than its names and units say.

    Parameters
    ----------
    model : ForceModel
    recording : Recording
        Of the model's drives.

    Returns
    -------
    tuple of Defect
        Empty where nothing fits clearly better, and where the recording cannot tell.
    """
    changed = tuple(find_changed_positions(recording))
    if changed:
        return changed  # no reading of the whole is right
    excerpts = {unit: excerpt for unit in (1.0, *_time_units(recording))
                if (excerpt := excerpt_of(recording, unit)) is not None}
    best = _Search(model, excerpts).best()
    contents = effort_contents(model, recording)
    found: list[Defect] = []
    signs = _of_signs(model, recording, contents)
    # With all positions negated many arms weigh as with all efforts negated, and friction too.
    is_either = (best is not None and best.reading.kind == POSITION_SIGN
                 and best.reading.cost == ALL_NEGATED
                 and any({*sign.drives} >= {*contents} for sign in signs))
    if best is not None and not is_either:
        found += _of_fit(model, best)
    else:
        found += signs or _of_shares(model, contents)
    told = {finding.kind for finding in found}
    if not told & {POSITION_UNIT, 'drive_order'}:
        found += _of_strokes(model, recording)
    if not told & {POSITION_UNIT, POSITION_SIGN, 'reversed_time'}:
        unit = 1.0 if best is None else best.time_unit
        found += _of_velocities(recording, excerpts.get(unit))
    if not any(isinstance(finding, OtherReading) for finding in found):
        found += find_changed_efforts(model, recording)
    # In other units or signs it would seem to lack what is there.
    if not any(isinstance(finding, OtherReading) for finding in found):
        found += find_no_measurements(model, recording, contents)
    return tuple(found)


class _Search:
    """The search for a reading that fits better than the plain one.

    Parameters
    ----------
    model : ForceModel
    excerpts : dict of float to Excerpt
        Of the recording, by what its times are counted in [s].
    """

    def __init__(self, model: ForceModel, excerpts: dict[float, Excerpt]) -> None:
        self.model, self.excerpts = model, excerpts
        self._forces: dict[tuple[float, bytes, bool], Array | None] = {}

    def best(self) -> _Fit | None:
        """Return the best fit of another reading, where it is clearly better."""
        reference = self._reference()
        bound, least = (1.0, GOOD_FIT_ALONE) if reference is None else (reference, GOOD_FIT)
        best: _Fit | None = None
        drives, units = self.model.drives, self.model.units
        for reading in (as_named(drives), *readings(drives, units)):
            for unit, excerpt in self.excerpts.items():
                if not self._possible(reading, excerpt):
                    continue
                fit = self._fit(reading, unit, excerpt)
                if fit is None or not fit.cost:
                    continue
                is_better = (fit.misfit <= bound if self._is_beyond(reading, excerpt) else
                             fit.misfit <= least and (reference is None or fit.score <= bound))
                if is_better and (best is None or fit.score < SAME_FIT * best.score):
                    best = fit
            left = bound if best is None else best.misfit
            if reading.kind == POSITION_UNIT and left <= CLOSE_FIT:
                break
        return best

    def _reference(self) -> float | None:
        """Return the misfit of the plain reading; None where the mechanism cannot follow it."""
        excerpt = self.excerpts.get(1.0)
        if excerpt is None:
            return None
        forces = self._on(as_named(self.model.drives), 1.0, excerpt)
        if forces is None:
            forces = forces_in_pieces(self.model, excerpt.motion, excerpt.time)
        misfit, weight = _misfit(excerpt.effort, forces), self._weights(excerpt)
        told = np.isfinite(misfit)
        return float(np.average(misfit[told], weights=weight[told])) if np.any(
            weight[told]) else None

    def _weights(self, excerpt: Excerpt) -> Array:
        """Return what each drive counts, (D,): the more, the larger its effort; 0 at rest.

        The root of the effort: what is a hundred times as strong tells most, and not all.
        """
        effort = np.sqrt(np.nanmean(np.nan_to_num(excerpt.effort) ** 2, axis=0))
        speed = np.sqrt(np.mean(excerpt.motion.velocity ** 2, axis=0))
        moves = speed > self.model.reversal.velocity
        found: Array = np.sqrt(effort) * (moves if np.any(moves & (effort > 0)) else 1.0)
        return found

    def _on(self, reading: Reading, unit: float, excerpt: Excerpt) -> Array | None:
        key = unit, reading.position.tobytes(), reading.backwards
        if key not in self._forces:
            self._forces[key] = forces_on(
                self.model, reading.motion_of(excerpt.motion), excerpt.time)
        return self._forces[key]

    def _fit(self, reading: Reading, unit: float, excerpt: Excerpt) -> _Fit | None:
        forces = self._on(reading, unit, excerpt)
        if forces is None:
            return None
        effort, weight = reading.effort_of(excerpt.effort), self._weights(excerpt)
        weight = np.abs(reading.effort) @ weight
        misfits = np.array([_misfit(effort / factor, forces) for factor in EFFORT_FACTORS])
        told = np.flatnonzero(np.isfinite(misfits[0]) & (weight > 0))
        if not len(told):
            return None
        misfits, weight = misfits[:, told], weight[told]
        chosen, drives = np.argmin(misfits, axis=0), np.arange(len(told))
        left = misfits[chosen, drives]
        chosen[(left > GOOD_FIT) | (left * CLEARLY_BETTER > misfits[0])] = 0
        cost = reading.cost + (unit != 1.0)
        found = []
        # Each drive as it fits best, and all alike: those that tell little go with the others.
        for choice in (chosen, *(np.full(len(told), k) for k in range(len(EFFORT_FACTORS)))):
            factors = np.ones(effort.shape[1])
            factors[told] = np.asarray(EFFORT_FACTORS)[choice]
            if len(set(choice.tolist())) == 1:
                factors[np.isfinite(effort).any(axis=0)] = factors[told[0]]
            found.append(_Fit(
                reading, unit, float(np.average(misfits[choice, drives], weights=weight)),
                factors, cost + _cost(factors, told, self.model.drives)))
        return min(found, key=lambda one: one.score)

    def _possible(self, reading: Reading, excerpt: Excerpt) -> bool:
        """Return whether a reading brings positions into the strokes, and units where needed."""
        if not reading.kind:
            return True
        lower, upper = self.model.strokes
        with np.errstate(invalid='ignore'):
            slack = STROKE_SLACK * (upper - lower)

        def outside(position: Array) -> Array:
            out: Array = np.any((position < lower - slack) | (position > upper + slack), axis=0)
            return out

        position, group = excerpt.motion.position, [*reading.drives]
        needed = (reading.kind != POSITION_UNIT or self._is_beyond(reading, excerpt)
                  or bool(np.any(outside(position)[group]))
                  or not np.all(np.isfinite(upper - lower)[group]))
        return bool(needed and not np.any(outside(position @ reading.position.T)))

    def _is_beyond(self, reading: Reading, excerpt: Excerpt) -> bool:
        """Return whether what a reading scales is far beyond its stroke or its largest speed."""
        if reading.kind != POSITION_UNIT:
            return False
        motion, group = excerpt.motion, [*reading.drives]
        lower, upper = self.model.strokes
        reach = np.abs(motion.position).max(axis=0) / np.maximum(np.abs(lower), np.abs(upper))
        speed = np.abs(motion.velocity).max(axis=0) / self.model.speed_limits
        return bool(np.any(np.maximum(reach, speed)[group] > BEYOND))


def _cost(factors: Array, told: np.ndarray, drives: tuple[str, ...]) -> int:
    """Return how many mistakes factors of the efforts take: one where kinds of drives share it."""
    if np.all(factors[told] == factors[told[0]]):
        return int(factors[told[0]] != 1.0)
    kinds = [factors[:3], factors[3:]] if drives == DRIVES else [factors]
    return sum(int(kind[0] != 1.0) if np.all(kind == kind[0]) else int(np.sum(kind != 1.0))
               for kind in kinds)


def _misfit(effort: Array, forces: Array) -> Array:
    """Return how unlike measured efforts and forces of each drive are, (D,): 0 to 2.

    |a - b|^2 / (|a|^2 + |b|^2), the mean of what it is with and without the means of both: where
    the measured effort swings, what keeps its force is not like it. NaN for drives that tell
    nothing.
    """
    known = np.isfinite(effort) & np.isfinite(forces)
    count = np.maximum(known.sum(axis=0), 1)
    whole = [np.where(known, values, 0.0) for values in (effort, forces)]
    swings = [np.where(known, values - values.sum(axis=0) / count, 0.0) for values in whole]
    sizes = [np.sqrt(np.sum(values ** 2, axis=0)) for values in whole]
    swing = [np.sqrt(np.sum(values ** 2, axis=0)) for values in swings]
    unlike = _unlike(*whole)
    is_told = (swing[0] > WEAK * sizes[0]) | (swing[1] > WEAK * sizes[1])
    found = np.where(is_told, (unlike + _unlike(*swings)) / 2, unlike)
    weak = np.all([size <= WEAK * size.max() for size in sizes], axis=0)
    found[weak | ~known.any(axis=0)] = np.nan
    return found


def _unlike(a: Array, b: Array) -> Array:
    with np.errstate(invalid='ignore', divide='ignore'):
        ratio: Array = np.sum((a - b) ** 2, axis=0) / np.sum(a ** 2 + b ** 2, axis=0)
    return ratio


def _time_units(recording: Recording) -> list[float]:
    """Return units of time in which the steps would be those of a robot's recording [s]."""
    steps = np.concatenate([np.diff(recording.time[part]) for part in recording.segments]
                           or [np.zeros(0)])
    step = float(np.median(steps)) if len(steps) else 0.0
    return [unit for unit in TIMES
            if step > SLOW_STEP and SHORTEST_STEP <= step * unit <= SLOW_STEP]


def _of_fit(model: ForceModel, fit: _Fit) -> Iterator[Mistake]:
    """Yield the mistakes of times, of what is read otherwise, and of efforts."""
    drives, units = model.drives, model.units
    if fit.time_unit != 1.0:
        yield OtherReading('time_unit', 1, f'the times look like {TIMES[fit.time_unit]}: as '
                           f'seconds they make the motion {1 / fit.time_unit:.0f} times too slow '
                           'for its efforts', scales=(('', 'time_scale', fit.time_unit),))
    if fit.reading.kind:
        yield OtherReading.of(fit.reading.kind, drives, fit.reading.drives, fit.reading.what,
                              scales=_position_scales(model, fit.reading))
    for factor in EFFORT_FACTORS[1:]:
        group = tuple(np.flatnonzero(fit.factors == factor).tolist())
        if not group:
            continue
        prefix = EFFORT_PREFIXES.get(abs(factor))
        unit = None if prefix is None else ' or '.join(dict.fromkeys(
            prefix + units[k].effort for k in group))
        times = 'minus' if factor == -1.0 else f'{factor:g} times'
        guess = '' if unit is None else f', as if it were in {unit}'
        other = ' (or its position is negated)' if len(drives) == 1 and factor < 0 else ''
        yield OtherReading.of('effort_sign' if unit is None else 'effort_unit', drives, group,
                              f'the effort of {named(drives, group)} looks like {times} what '
                              f'the model says{guess}{other}',
                              scales=_effort_scales(model, group, np.full(len(drives), 1 / factor)))


def _position_scales(model: ForceModel, reading: Reading) -> Scales:
    """Return what positions are multiplied by, in columns of a model file, to be read so."""
    if reading.kind not in (POSITION_UNIT, POSITION_SIGN):
        return ()
    before = model.recorded.columns
    return tuple((drive, 'position_scale', float(reading.position[k, k]) * (
        1.0 if before is None else before.drives[drive].position_scale))
        for k, drive in enumerate(model.drives) if k in reading.drives)


def _effort_scales(model: ForceModel, group: tuple[int, ...], factors: Array) -> Scales:
    """Return what efforts are multiplied by, in columns of a model file, to be read so."""
    before = model.recorded.columns
    return tuple((drive, 'effort_scale', float(factors[k]) * (
        1.0 if before is None else before.drives[drive].effort_scale))
        for k, drive in enumerate(model.drives) if k in group)


def _of_signs(model: ForceModel, recorded: Recording, contents: Mapping[str, EffortContent],
              ) -> list[OtherReading]:
    """Return what weight, inertia and friction say of the efforts' sign, for whatever friction."""
    measured = [k for k, drive in enumerate(recorded.drives)
                if np.isfinite(recorded.effort[:, k]).any()]
    are_all = not any(content.is_upright for content in contents.values())
    # Of a drive among others that are right its weight or inertia must say so, too.
    negated = tuple(model.drives.index(drive) for drive, content in contents.items()
                    if content.is_negated and (are_all or content.factor))
    if not negated:
        return []
    if are_all:
        negated = tuple(measured)  # those that tell nothing go with the others
    other = 'positions are' if len(model.drives) > 1 else 'its position is'
    return [OtherReading.of(
        'effort_sign', model.drives, negated, f'the effort of {named(model.drives, negated)} looks '
        f'like minus what the model says (or {other} negated)',
        scales=_effort_scales(model, negated, np.full(len(model.drives), -1.0)))]


def _of_shares(model: ForceModel, contents: Mapping[str, EffortContent]) -> list[OtherReading]:
    """Return whether efforts are shares of the largest of each drive."""
    told = [(k, contents[drive].factor) for k, drive in enumerate(model.drives)
            if drive in contents and contents[drive].factor > 0
            and np.isfinite(model.effort_limits[k])]
    if len(told) < 2:
        return []
    factors, limits = np.array([one for _, one in told]), model.effort_limits[[k for k, _ in told]]
    gains, every = np.log(factors * limits), tuple(range(len(model.drives)))
    are_one = np.std(np.log(factors)) > SEVERAL_FACTORS and np.std(gains) < ONE_FACTOR
    for share, name in SHARES.items():
        if are_one:
            is_share = 1 - NEARLY <= np.exp(gains.mean()) * share <= LARGEST_OVERLOAD
        else:  # of two drives the factors may be near, and yet just these
            is_share = bool(np.all(np.abs(factors * limits * share - 1) < NEARLY / 2)
                            and np.any(np.abs(np.log(factors)) > SEVERAL_FACTORS))
        if is_share:
            return [OtherReading.of(
                'effort_unit', model.drives, every, f'the effort of {named(model.drives, every)} '
                f"looks like {name} of the drives' largest",
                scales=_effort_scales(model, every, share * model.effort_limits))]
    return []


def _of_strokes(model: ForceModel, recording: Recording) -> Iterator[Defect]:
    """Yield what positions far outside of the strokes say without any effort."""
    lower, upper = model.strokes
    drives, ends = recording.drives, np.maximum(-lower, upper)
    reach = np.abs(recording.position).max(axis=0)
    for turns, names in ((False, LENGTHS), (True, ANGLES)):
        alike = [k for k, units_of_drive in enumerate(model.units) if units_of_drive.turns == turns]
        far = tuple(k for k in alike if reach[k] > FAR_OUT * ends[k])
        if not far:
            continue
        # Encoders of a robot's turning joints count alike; its rails may not.
        group = tuple(alike) if turns else far
        unit = next((unit for unit in names
                     if np.all(reach[list(group)] * unit <= ends[list(group)])), 1.0)
        farthest = max(far, key=lambda k: reach[k] / ends[k])
        yield OtherReading.of(
            POSITION_UNIT, drives, group, f'the positions of {named(drives, group)} reach '
            f'{reach[farthest]:.4g} {model.units[farthest].position}, far out of the stroke'
            + (f', as if they were in {names[unit]}' if unit != 1.0 else ''),
            scales=() if unit == 1.0 else _position_scales(model, rescaled(
                drives, group, unit, names[unit])))


def with_mistakes(model: ForceModel, recording: Recording, refuse: bool = False) -> Recording:
    """Return a recording with what its numbers rather mean among its findings.

    Raises
    ------
    MisreadError
        With `refuse`, where it looks as if it were in other units, signs or another order than it
        says.
    """
    mistakes = find_mistakes(model, recording)
    others = [mistake for mistake in mistakes if isinstance(mistake, OtherReading)]
    if refuse and others:
        raise MisreadError(recording.name, [other.what for other in others], [
            columns_line(others, model.recorded.columns is not None)])
    return replace(recording, findings=(*mistakes, *recording.findings))


def _of_velocities(recording: Recording, excerpt: Excerpt | None) -> Iterator[Defect]:
    """Yield what recorded velocities are instead of the derivatives of positions."""
    if excerpt is None or excerpt.velocity is None:
        return
    groups: dict[float, list[int]] = {}
    for drive in range(len(recording.drives)):
        known = np.isfinite(excerpt.velocity[:, drive])
        said, found = (values[known, drive] for values in (
            excerpt.velocity, excerpt.motion.velocity))
        size = float(found @ found) * float(said @ said)
        if size > 0 and abs(float(said @ found)) >= ALIKE * np.sqrt(size):
            factor = float(said @ found) / float(found @ found)
            for wrong in EFFORT_FACTORS[1:]:
                if abs(factor / wrong - 1) <= NEARLY:
                    groups.setdefault(wrong, []).append(drive)
    for factor, group in groups.items():
        times = 'minus' if factor == -1.0 else f'{factor:g} times'
        yield Mistake.of('velocity', recording.drives, group, 'the recorded velocity of '
                         f'{named(recording.drives, tuple(group))} is {times} the derivative of '
                         'the position')
