# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What the efforts of a recording are: their unit, their sign, and whether they are measured.

What a drive applies accelerates bodies, carries their weight and overcomes friction, and what
measures it adds noise. A command, an error of position, an external torque or an effort without
gravity lacks some of these, and any missing effect that is found in it is wrong.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.readings import table
from pprs_dynamics.inference.readings.evidence import Shares, effort_contents
from pprs_dynamics.inference.readings.findings import NoMeasurement, OtherReading, columns_line
from pprs_dynamics.inference.readings.table import named
from pprs_dynamics.inference.residuals.excerpt import Excerpt, forces_on
from pprs_dynamics.measurement.files.recording import Recording, signed
from pprs_dynamics.measurement.files.samples import Defect
from pprs_dynamics.physics.model import recorded_names
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.recorded_names import EFFORT_KIND

KINDS = {recorded_names.COMMANDED: (table.COMMAND, 'commands'),
         recorded_names.EXTERNAL: (table.EXTERNAL, 'external torques')}

# -------------------------------------------------------------------------------------- units


def find_scales(model: DriveModel, contents: Mapping[str, Shares]) -> list[OtherReading]:
    """Return the unit of the efforts, by the factors of inertia and gravity over the model's."""
    factors = {k: contents[drive].scale for k, drive in enumerate(model.drives)
               if drive in contents}
    certain = {k: scale for k, (scale, doubt) in factors.items()
               if abs(scale) > table.CERTAIN * doubt}
    known = [contents[model.drives[k]] for k in certain]
    every = tuple(range(len(model.drives)))
    scales = np.array([*certain.values()])
    if not certain or np.ptp(np.sign(scales)) > 0 or (scales[0] < 0 and any(
            one.friction > table.CERTAIN * one.friction_by_chance for one in known)):
        return []
    # Masses of a description are right within a factor; inertia alone may be invented.
    has_weight = any(abs(one.gravity) > table.CERTAIN * one.gravity_doubt for one in known)
    sizes, sign = np.abs(scales), float(np.sign(scales[0]))
    for unit in table.EFFORTS:
        is_prefix = unit in table.PREFIXES
        tolerance = np.log(table.SAME_MASSES) if is_prefix and has_weight else table.NEAR_UNIT
        off = np.abs(np.log(sizes / unit))
        if np.all(off < tolerance) and (has_weight or is_prefix):
            found = unit_reading(model, every, sign * unit)
            if is_prefix or np.all(off < table.AT_UNIT):
                return [found]
            line = columns_line([found], model.recorded.columns is not None)
            return [OtherReading.of(
                'ambiguous', model.drives, every, f'{found.what}, or in amperes: the factors are '
                + ', '.join(f'{scale:.3g}' for scale in scales),
                f'{line} or {constants_reading(model, certain).line}')]
    limits = model.limits.efforts[[*certain]]
    if len(certain) > 1 and has_weight and np.all(np.isfinite(limits)):
        gains = np.log(sizes * limits)
        are_one = (np.std(np.log(sizes)) > table.SEVERAL_FACTORS
                   and np.std(gains) < table.ONE_FACTOR)
        for share, name in table.SHARES.items():
            if are_one:
                size = np.exp(gains.mean()) * share
                is_share = 1 - table.NEAR_ONE <= size <= table.LARGEST_OVERLOAD
            else:  # of two drives the factors may be near, and yet just these
                is_share = bool(np.all(np.abs(sizes * limits * share - 1) < table.NEAR_ONE / 2)
                                and np.any(np.abs(np.log(sizes)) > table.SEVERAL_FACTORS))
            if is_share:
                return [OtherReading.of(
                    'effort_unit', model.drives, every, 'the effort of '
                    f"{named(model.drives, every)} looks like {name} of the drives' largest",
                    scales=effort_scales(model, every, sign * share * model.limits.efforts))]
    # A load may multiply what one drive of several needs.
    if has_weight and len(certain) >= min(2, len(every)) and np.all(
            np.abs(np.log(sizes)) > np.log(table.SAME_MASSES)) and np.all(
            sizes > table.LARGEST_COMPLIANCE):
        return [constants_reading(model, certain)]
    return []


def constants_reading(model: DriveModel, factors: Mapping[int, float]) -> OtherReading:
    """Return the finding that efforts are multiples of the model's, by drive: currents."""
    every = tuple(range(len(model.drives)))
    listed = ', '.join(f'{factor:.3g} ({model.drives[k]})' for k, factor in factors.items())
    gains = ', '.join('1.0' if factors.get(k, 1.0) == 1 else f'{1 / factors[k]:.3g}' for k in every)
    return OtherReading.of(
        'drive_constant', model.drives, every, f'the effort of {named(model.drives, every)} is '
        f'another multiple of what the masses need: {listed}: it looks like currents in amperes, '
        'or another unit', f'effort_kind: current, and beside urdf or mjcf  gain: [{gains}]')


def unit_reading(model: DriveModel, group: Sequence[int], scale: float) -> OtherReading:
    """Return the finding that efforts of some drives are the model's in another unit or sign."""
    drives, kind = model.drives, 'effort_sign' if abs(scale) == 1 else 'effort_unit'
    times = 'minus' if scale == -1.0 else f'{scale:.4g} times'
    what = f'the effort of {named(drives, tuple(group))} looks like {times} what the model says'
    if abs(scale) != 1:
        units = dict.fromkeys(table.EFFORTS[abs(scale)].format(model.units[k].effort)
                              for k in group)
        what += f', as if it were in {" or ".join(units)}'
    if scale < 0 and len(group) == len(drives):
        what += f' (or {"its position is" if len(drives) == 1 else "positions are"} negated)'
    return OtherReading.of(kind, drives, group, what, scales=effort_scales(
        model, group, np.full(len(drives), 1 / scale)))


def effort_scales(model: DriveModel, group: Sequence[int], factors: Array,
                  ) -> tuple[tuple[str, str, float], ...]:
    """Return the factors below `columns` with which efforts are multiplied by others, (D,)."""
    before = model.recorded.columns
    return tuple((drive, 'effort_scale', float(factors[k]) * (
        1.0 if before is None else before.drives[drive].effort_scale))
        for k, drive in enumerate(model.drives) if k in group)


def find_sign_bit(recording: Recording) -> Iterator[Defect]:
    """Yield efforts that are magnitudes with a bit for their sign, as servos report loads."""
    found: dict[int, list[int]] = {}
    for d in range(len(recording.drives)):
        effort = recording.effort[np.isfinite(recording.effort[:, d]), d]
        if len(effort) < 2 or np.any(effort < 0) or np.any(effort != np.rint(effort)):
            continue
        for bit in table.SIGN_BITS:
            is_set = effort >= 2.0 ** bit
            if 0.02 < is_set.mean() < 0.98 and effort.max() < 2.0 ** (bit + 1) and (
                    np.abs(np.diff(signed(effort, bit))).sum()
                    < table.CALMER * np.abs(np.diff(effort)).sum()):
                found.setdefault(bit, []).append(d)
    for bit, group in found.items():
        yield OtherReading.of(
            'effort_sign_bit', recording.drives, group,
            f'the effort of {named(recording.drives, tuple(group))} looks like a magnitude whose '
            f'sign is bit {bit} ({2 ** bit})',
            scales=tuple((recording.drives[d], 'effort_sign_bit', float(bit)) for d in group))


# ------------------------------------------------------------- signs and units in one part


def find_changed_efforts(model: DriveModel, recording: Recording, excerpt: Excerpt | None,
                         ) -> Iterator[OtherReading]:
    """Yield efforts without their sign, and units or signs that are others from a time on."""
    forces = None if excerpt is None else forces_on(model, excerpt.motion, excerpt.time)
    if excerpt is None or forces is None:
        return
    size = np.sqrt(np.mean(forces ** 2, axis=0))
    told = tuple(d for d in range(len(size)) if size[d] > table.WEAK * size.max()
                 and np.isfinite(excerpt.effort[:, d]).sum() > 2 / table.LEAST_PART)
    effort, force = excerpt.effort / size, forces / size
    unsigned = tuple(d for d in told if _is_unsigned(
        recording.effort[:, d], effort[:, d], force[:, d]))
    if unsigned:
        yield OtherReading.of(
            'effort_absolute', model.drives, unsigned,
            f'the effort of {named(model.drives, unsigned)} looks like its absolute value: it is '
            'never below 0, where the model changes sign; it must be recorded with its sign')
        return
    for group in dict.fromkeys((told, *((d,) for d in told))) if told else ():
        change = _change(effort[:, group], force[:, group])
        if change is not None:
            factor, at, is_after = change
            every = tuple(range(len(model.drives))) if group == told else group
            unit = table.CHANGES[factor].format(model.units[group[0]].effort)
            yield OtherReading.of(
                'effort_unit' if factor > 0 else 'effort_sign', model.drives, every,
                f'the effort of {named(model.drives, every)} looks {unit} '
                f'{"from" if is_after else "until"} about {excerpt.time[at]:.3g} s'
                f'{" on" if is_after else ""}, unlike in the rest; the parts must be recordings '
                'of their own')
            return


def _unlike(effort: Array, force: Array) -> Array:
    """Return by how much efforts and forces, (N, d), differ and how large they are, (2, N)."""
    found: Array = np.nansum([(effort - force) ** 2, effort ** 2 + force ** 2], axis=2)
    return found


def _share(sums: Array) -> Any:
    """Return how much of the size the differences are: 0 for equal, 1 for unrelated."""
    return sums[0] / np.maximum(sums[1], 1e-300)


def _is_unsigned(recorded: Array, effort: Array, force: Array) -> bool:
    below = np.sum(np.minimum(force, 0.0) ** 2) / np.sum(force ** 2)
    known = recorded[np.isfinite(recorded)]
    signed, without = (_share(_unlike(effort[:, None], each[:, None]).sum(axis=1))
                       for each in (force, np.abs(force)))
    return bool(table.BOTH_SIGNS < below < 1 - table.BOTH_SIGNS and np.all(known >= 0)
                and np.any(known) and table.CLEARLY * without < signed)


def _change(effort: Array, force: Array) -> tuple[float, int, bool] | None:
    """Return by which factor efforts (N, d) change, at which sample, and in which part."""
    margin = max(1, int(table.LEAST_PART * len(effort)))
    as_said, found = _unlike(effort, force), []
    for factor in table.CHANGES:
        changed = _unlike(effort / factor, force)
        least = min(_share(as_said.sum(axis=1)), _share(changed.sum(axis=1))) / table.CLEARLY
        for is_after in (True, False):
            before, after = (as_said, changed) if is_after else (changed, as_said)
            sums = (np.cumsum(before, axis=1)[:, :-1]
                    + np.cumsum(after[:, ::-1], axis=1)[:, -2::-1])
            at = margin + int(np.argmin(_share(sums)[margin:-margin]))
            part = changed[:, at + 1:] if is_after else changed[:, :at + 1]
            # What changed must itself be as the model has it.
            if max(_share(part.sum(axis=1)), _share(sums[:, at])) < table.GOOD_FIT and (
                    _share(sums[:, at]) < least):
                found.append((float(_share(sums[:, at])), factor, at + is_after, is_after))
    return min(found)[1:] if found else None


# ------------------------------------------------------------------------------- measurements


def find_no_measurements(model: DriveModel, contents: Mapping[str, Shares],
                         ) -> tuple[NoMeasurement, ...]:
    """Return what efforts look like that are no measurement, a finding for each kind.

    Parameters
    ----------
    model : DriveModel
    contents : mapping of str to Shares
        By drive; of a recording in the units and signs that it says.
    """
    if model.effort_kind in KINDS:
        kind, noun = KINDS[model.effort_kind]
        return (NoMeasurement.of(kind, model.drives, range(len(model.drives)), f'the efforts are '
                                 f'{noun}, as the model file says with {EFFORT_KIND}: '
                                 f'{model.effort_kind}'),)
    kinds = {drive: content.kind for drive, content in contents.items()}
    # What one drive shows certainly is true of all: they are recorded in the same way.
    weighs = any(content.shows_gravity and not content.lacks_gravity
                 for content in contents.values())
    moves = any(content.inertia_doubt < table.LEAST_SHARE and not content.lacks_inertia
                for content in contents.values())
    excluded = ({table.WITHOUT_GRAVITY, table.EXTERNAL} if weighs else set()) | (
        {table.COMMAND, table.POSITION_ERROR, table.EXTERNAL} if moves else set())
    kinds = {drive: '' if kind in excluded else kind for drive, kind in kinds.items()}
    return tuple(_finding(model, contents, [drive for drive in kinds if kinds[drive] == kind], kind)
                 for kind in dict.fromkeys(kinds.values()) if kind)


def looks_like(model: DriveModel, recordings: Sequence[Recording]) -> dict[str, NoMeasurement]:
    """Return the finding for each drive whose effort is no measurement in one of the recordings."""
    found: dict[str, NoMeasurement] = {}
    for recording in recordings:
        for finding in find_no_measurements(model, effort_contents(model, recording)):
            found = {**dict.fromkeys(finding.drives, finding), **found}
    return {drive: found[drive] for drive in model.drives if drive in found}


def kinds_of(findings: Mapping[str, NoMeasurement]) -> dict[str, str] | None:
    """Return the kind of each drive's finding; None where there is none."""
    return {drive: finding.kind for drive, finding in findings.items()} or None


def _finding(model: DriveModel, contents: Mapping[str, Shares], drives: Sequence[str],
             kind: str) -> NoMeasurement:
    group = tuple(model.drives.index(drive) for drive in drives)
    content = contents[drives[0]]
    of = f'the effort of {named(model.drives, group)}'
    gravity = f'gravity ({_amount(content.gravity, content.gravity_doubt)})'
    inertia = f'inertia ({_amount(content.inertia, content.inertia_doubt)})'
    beside = [gravity] * content.lacks_gravity + ['friction'] * (not content.has_friction)
    lacks = f'{of} holds no {" nor ".join([inertia, *beside])}: it looks like'
    what = {
        table.WITHOUT_GRAVITY: f'{of} holds no {gravity}: it looks as if gravity was taken out '
        'already; else a counterweight bears it, or the base stands otherwise than the model says',
        table.EXTERNAL: f'{of} holds no {inertia} nor {gravity}: it looks like an external torque, '
        'from which a model was taken out already',
        table.NOISE_FREE: f'{of} holds no noise: it looks computed, not measured',
        table.POSITION_ERROR: f'{of} is {content.compliance:.2g} times what the model says: it '
        'looks like an error of position under the effort, or is in another unit'
        if content.compliance else f'{lacks} an error of position, which grows with the velocity, '
        'not like a measurement',
        table.COMMAND: f'{lacks} what a controller commands, not like a measurement'}[kind]
    line = {table.COMMAND: recorded_names.COMMANDED, table.EXTERNAL: kind,
            table.WITHOUT_GRAVITY: kind}.get(kind)
    return NoMeasurement.of(kind, model.drives, group, what,
                            f'{EFFORT_KIND}: {line}' if line else '')


def _amount(share: float, doubt: float) -> str:
    # Adding 0 makes minus nothing nothing.
    return f'{round(share, 2) + 0.0:.2f} ± {doubt:.2f} of what the model has'
