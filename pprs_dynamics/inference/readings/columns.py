# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Which columns are time, positions, velocities and efforts of joints, by names and numbers."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import CHANNELS, Column
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.readings import table
from pprs_dynamics.inference.readings.check import Fit, Search
from pprs_dynamics.inference.readings.findings import columns_line
from pprs_dynamics.inference.readings.links import (
    Layout,
    in_motion,
    layouts,
    measured,
    roughness,
    running_on,
    turn_of,
    velocity_links,
)
from pprs_dynamics.inference.readings.names import (
    fit_of_name,
    joint_in,
    kinds_of,
    may_be,
    numbered,
    scale_of,
    unit_of,
    words_of,
)
from pprs_dynamics.inference.readings.table import CURRENT, EFFORT, POSITION, VELOCITY, Reading
from pprs_dynamics.inference.residuals.excerpt import excerpt_of
from pprs_dynamics.measurement.files.poses import held_poses
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.files.samples import Series
from pprs_dynamics.measurement.files.table_files import (
    TIME_COLUMNS,
    TIME_LIKE,
    fraction_of_seconds,
)
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.system.plain_text import counted

# What is written below `columns` of a model file, by drive, '' of none, and key.
Written = Mapping[tuple[str, str], Column | float]
Columns = dict[tuple[str, str], Column]
TIME_WORDS = {'time', *TIME_LIKE}


class GuessError(PprsError, ValueError):
    """Columns whose quantity cannot be decided."""


class AmbiguousColumns(GuessError):
    """Columns that can be read in two ways.

    Parameters
    ----------
    readings : sequence of mapping of (drive, key) to str, int or float
    what : str
        Why it is a question, as a clause.
    """

    def __init__(self, readings: Sequence[Written], what: str) -> None:
        self.has_times = any(not drive for reading in readings for drive, _ in reading)
        self.lines = tuple(columns_line((*key, value) for key, value in reading.items())
                           for reading in readings)
        super().__init__(f'{what}, write one of them: {" or ".join(self.lines)}')


class Guess(NamedTuple):
    """What is written below `columns`, and why.

    Parameters
    ----------
    columns : mapping of (drive, key) to str, int or float
    notes : list of str
        What was decided and why, for comments.
    effort_kind : str
        By their names, where it is neither measured nor current; else empty.
    """

    columns: Written
    notes: list[str]
    effort_kind: str = ''


def guess_columns(series: Sequence[Series], joints: Sequence[str], quantity: str | None = None,
                  others: Collection[str] = (), rate: float | None = None,
                  model: DriveModel | None = None) -> Guess:
    """Return the columns of times, positions, velocities and efforts.

    Parameters
    ----------
    series : sequence of Series
        All columns with numbers, in the order of the file.
    joints : sequence of D str
        From the base to the tool.
    quantity : str, optional
        What all columns are of, where the file's name says so.
    others : collection of str
        Further joints of the robot: columns with their names are no columns of these.
    rate : float, optional
        Samples per second, as given [Hz].
    model : DriveModel, optional
        Of the joints: it says which columns without names are efforts.

    Raises
    ------
    GuessError
        Where positions of the joints cannot be found, or two readings are as likely.
    """
    lengths = [len(item.values) for item in series]
    usual = max(lengths, key=lengths.count, default=0)
    notes = [f'{item.title} has {len(item.values)} numbers, others have {usual}: not used'
             for item in series if len(item.values) != usual]
    by_column = {item.column: item for item in series if len(item.values) == usual}
    time, stamp = _time([*by_column.values()], rate is not None, notes)
    known = [item.values for item in by_column.values() if item.column in stamp.values()]
    # pandas numbers rows in a column without a title, as other programs do; programs that record
    # channels apart repeat the times.
    left = [item for item in by_column.values() if item.column not in stamp.values() and not (
        _rises(item.values) and (any(np.array_equal(item.values, times) for times in known) or (
            not item.title and _counts_rows(item.values))))]
    if not left:
        raise GuessError('no column has numbers other than times, must be positions of the '
                         'joints in addition to times')
    if not left[0].title and len(left) < len(joints) and (quantity or len(left) == 1):
        raise GuessError(
            f'each line has {counted(len(left), "number")}, must have one for each of '
            f'{len(joints)} joints ({", ".join(joints)}): give --drives '
            f'{",".join(joints[:len(left)])}, or '
            f'`paste {"- " * len(joints)}< FILE > NEW` joins {len(joints)} lines to one')
    titled = [item for item in left if item.title]
    main = quantity or POSITION
    columns = _by_names(titled, joints, quantity, others, notes) if titled else {}
    kinds, by_numbers = {kind for _, kind in columns}, False
    if quantity and not titled:
        columns = {(joint, quantity): item.column
                   for joint, item in zip(joints, left, strict=False)}
    elif model is not None and not (main in kinds and {EFFORT, CURRENT} & kinds):
        by_numbers = not columns
        columns = _by_numbers(left, joints, time, rate, stamp, notes, model, columns)
    found = {joint: by_column[column] for (joint, kind), column in columns.items() if kind == main}
    later = {} if quantity or by_numbers else _measured_by_numbers(found, left, columns)
    if later:
        raise AmbiguousColumns(
            [{**stamp, **columns, **later}, {**stamp, **columns}],
            f'{" and ".join(map(str, later.values()))} may be measured, of which '
            f'{" and ".join(str(columns[key]) for key in later)} are the command')
    if found and not quantity and not {EFFORT, CURRENT} & {kind for _, kind in columns}:
        efforts = [item.column for item in left if item.column not in columns.values() and (
            may_be(item.title, EFFORT) if by_numbers else EFFORT in kinds_of(words_of(item.title)))]
        if len(joints) > 1 and efforts:
            raise AmbiguousColumns(
                [{**stamp, **columns, (joint, EFFORT): efforts[0]} for joint in joints[:2]],
                f'no {len(joints)} columns are efforts of {", ".join(joints)}; column '
                f'{efforts[0]} may be that of one joint')
    if not found:
        example = next((item.column for item in left if may_be(item.title, main)), '…')
        raise GuessError(
            f'no names of columns say that they are {main}s: ' + ', '.join(
                item.title or str(item.column) for item in left[:12])
            + f'; write them into columns, e.g. {{{joints[0]}: {{{main}: {example}}}}}')
    scales = {(joint, f'{EFFORT if kind == CURRENT else kind}_scale'): scale
              for (joint, kind), column in columns.items()
              if (scale := scale_of(by_column[column].title, kind)) is not None}
    bare = [joint for joint, item in found.items() if unit_of(item.title) is None]
    turn = min((turn_of(found[joint].values) for joint in bare), default=np.inf)
    if main == POSITION and turn < np.inf:
        notes.append(f'positions begin again after {turn:.6g}: taken as a turn')
        # Encoders of a robot's joints count alike.
        scales |= {(joint, 'position_scale'): 2 * np.pi / turn for joint in bare
                   if turn != 2 * np.pi}
    outside = [column for (_, kind), column in columns.items() if kind == EFFORT
               and {*words_of(by_column[column].title)} & table.FROM_OUTSIDE]
    if outside:
        notes.append(f'{by_column[outside[0]].title} is an external torque by its name, from which '
                     'a model was taken out')
    if time is None and rate is None and len(held_poses(np.column_stack([
            item.values for item in found.values()]), np.arange(float(usual)), None)):
        rate = 1.0
        notes.append('poses are held, each for as long as any: rate 1 Hz')
    if not quantity:
        rate = _rate_of(columns, by_column, time, rate, notes)
    if time is None and rate is not None:
        stamp = {('', 'rate'): rate}
    return Guess({**stamp, **columns, **scales}, notes, table.EXTERNAL if outside else '')


def _rate_of(columns: Columns, series: Mapping[Column, Series], time: Array | None,
             rate: float | None, notes: list[str]) -> float | None:
    """Return the rate that velocities show where none is known; take out those that are none."""
    joints = [joint for joint, kind in columns if kind == VELOCITY and (joint, POSITION) in columns]
    pairs = [[series[columns[joint, kind]].values for kind in (POSITION, VELOCITY)]
             for joint in joints]
    stamps = np.arange(float(len(pairs[0][0]) if pairs else 0)) if time is None else time
    rates = []
    for joint, (alike, factor) in zip(joints, velocity_links(pairs, stamps), strict=True):
        if abs(alike) < table.ALIKE:
            notes.append(f'{columns.pop((joint, VELOCITY))} is called a velocity, but is not the '
                         f'derivative of {columns[joint, POSITION]} (correlation {alike:.2f}): '
                         'not used')
        elif np.isfinite(factor):
            rates.append(factor)
    if time is not None or rate is not None or not rates:
        return rate
    rate = float(f'{abs(np.median(rates)):.3g}')
    notes.append(f'rate {rate:g} Hz: the velocities are the derivatives of the positions at '
                 'this rate')
    return rate


def _measured_by_numbers(found: Mapping[str, Series], series: Sequence[Series],
                         columns: Columns) -> Columns:
    """Return columns without a clear name that follow all positions found by name, or have noise.

    Parameters
    ----------
    found : mapping of str to Series
        Positions by joint.
    series : sequence of Series
        All columns.
    columns : dict
        Those that are read.
    """
    unclear = [item for item in series if item.column not in columns.values()
               and kinds_of(words := words_of(item.title)) <= {POSITION}
               and not {*words} & (table.COMMANDS | table.FROM_OUTSIDE | table.SECONDARY)]
    moving = {joint: item for joint, item in found.items() if np.ptp(item.values)}
    later = {(joint, POSITION): other.column for joint, item in moving.items() for other in unclear
             if measured(np.column_stack([item.values, other.values]), [[0], [1]])}
    return later if len(later) == len(moving) else {}


# ------------------------------------------------------------------------------------- time


def _time(series: Sequence[Series], has_rate: bool, notes: list[str],
          ) -> tuple[Array | None, Written]:
    """Return times [s] and the columns that have them."""
    rising = [item for item in series if _rises(item.values)]
    # Stamps may be coarser than the samples.
    named = [item for item in series if item.title in TIME_COLUMNS and _rises(item.values, True)]
    for whole, part in () if named else pairwise(series):
        if _counts_parts(whole.values, part.values):
            notes.append(f'column {part.column} has the fractions of the seconds in column '
                         f'{whole.column}')
            return whole.values + fraction_of_seconds(part.values), {
                ('', 'time'): whole.column, ('', 'time_fraction'): part.column}
    named = named or [item for item in series
                      if _is_time(words_of(item.title)) and _rises(item.values, True)]
    # Positions may rise as well: with a rate no column is needed.
    even = [] if has_rate or named else [
        item for item in rising if _is_even(item.values)
        and (not item.title or (item is series[0] and not _counts_rows(item.values)))]
    if not named and not even:
        return None, {}
    # A counter of rows may come first.
    found = named[0] if named else even[len(even) > 1 and _counts_rows(even[0].values)]
    if not named:
        notes.append(f'column {found.column} rises all the time: taken as time')
    scale = scale_of(found.title, table.TIME)
    return found.values * (scale or 1.0), {
        ('', 'time'): found.column, **({('', 'time_scale'): scale} if scale else {})}


def _counts_parts(whole: Array, part: Array) -> bool:
    """Return whether numbers are whole parts of seconds: they fall whenever those rise."""
    both = np.column_stack([whole, part])
    both = both[np.isfinite(both).all(axis=1)]
    steps, parts = np.diff(both, axis=0).T
    return bool(np.any(steps > 0) and np.all(both % 1 == 0) and np.all(steps >= 0)
                and np.all((both[:, 1] >= 0) & (both[:, 1] < 1e9))
                and np.mean((steps > 0) == (parts < 0)) > 0.99)


def _is_time(words: Sequence[str]) -> bool:
    units = {word for word in words if word.startswith('<')}
    return f'<{table.TIME}>' in units or bool(not units and {*words} & TIME_WORDS)


def _rises(values: Array, may_rest: bool = False) -> bool:
    steps = np.diff(values[np.isfinite(values)])
    # Episodes of a dataset begin again.
    return bool(len(steps) > 2 and np.sum(steps) > 0 and np.mean(
        (steps > 0) | ((steps == 0) & may_rest)) > 0.95)


def _is_even(values: Array) -> bool:
    steps = np.diff(values[np.isfinite(values)])
    return bool(np.mean(np.abs(steps - np.median(steps)) < 4 * np.median(steps)) > 0.9)


def _counts_rows(values: Array) -> bool:
    return bool(np.all(np.diff(values[np.isfinite(values)]) == 1))


# ------------------------------------------------------------------------------------ names


def _by_names(series: Sequence[Series], joints: Sequence[str], quantity: str | None,
              others: Collection[str], notes: list[str]) -> Columns:
    groups: dict[tuple[str, ...], dict[str, Column]] = {}
    unnamed = []
    for item in series:
        words = words_of(item.title)
        place = joint_in(words, list(dict.fromkeys((*joints, *others))))
        if place is None:
            unnamed.append(item)
        elif place[0] in joints:
            joint, at, length = place
            key = (*words[:at], '*', *words[at + length:])
            groups.setdefault(key, {}).setdefault(joint, item.column)
    for key, numbers in numbered(unnamed).items():
        if key not in groups and (len(numbers) >= len(joints) or len(joints) == 1):
            chosen = [numbers[number] for number in sorted(numbers)][:len(joints)]
            groups[key] = dict(zip(joints, chosen, strict=False))
            if len(joints) > 1 and len(numbers) > len(joints):
                notes.append(f'{" ".join(key)}: {len(numbers)} columns, of which the first '
                             f'{len(joints)} are taken as the joints from base to tool')
    if len(joints) == 1:
        for item in series:
            groups.setdefault(tuple(words_of(item.title)), {}).setdefault(joints[0], item.column)
    columns: Columns = {}
    values = np.column_stack([item.values for item in series])
    places = {item.column: k for k, item in enumerate(series)}
    currents_are_measured = False
    for kind in (quantity,) if quantity else (POSITION, VELOCITY, CURRENT, EFFORT, *CHANNELS):
        fits = {key: fit_of_name(key, members, kind, quantity) for key, members in groups.items()}
        best = max(fits, key=lambda key: fits[key], default=())
        if not best or fits[best][0] <= 0:
            continue
        # Efforts come before currents, but what was measured before all else.
        is_measured = not {*best} & (table.COMMANDS | table.FROM_OUTSIDE)
        if not is_measured and (kind in CHANNELS or (kind == EFFORT and currents_are_measured)):
            continue
        currents_are_measured = kind == CURRENT and is_measured
        rivals = [key for key in groups if fits[key] == fits[best]]
        # Of groups that move alike commands come first in time.
        shared = [joint for joint in groups[best] if all(joint in groups[key] for key in rivals)]
        blocks = [[places[groups[key][joint]] for joint in shared] for key in rivals]
        best = rivals[measured(values, blocks)] if shared else best
        if kind == EFFORT:
            columns = {key: column for key, column in columns.items() if key[1] != CURRENT}
        columns.update({(joint, kind): column for joint, column in groups[best].items()})
    return columns


# ---------------------------------------------------------------------------------- numbers


def _by_numbers(series: Sequence[Series], joints: Sequence[str], time: Array | None,
                rate: float | None, stamp: Written, notes: list[str], model: DriveModel,
                known: Columns) -> Columns:
    """Return columns without names: positions by derivatives, efforts by what explains them.

    And those that are known by their names; these alone, if no others are efforts.
    """
    count, is_titled = len(joints), bool(series[0].title)
    values = running_on(np.column_stack([item.values for item in series]))
    stamps = np.arange(len(values)) / (rate or 1.0) if time is None else time

    def read(blocks: Mapping[str, Sequence[int]]) -> Columns:
        return {(joint, kind): series[place].column for kind, places in blocks.items()
                for joint, place in zip(joints, places, strict=False)}

    # A column is what its name says, whatever its numbers look like.
    found = [layout for layout in layouts(values, stamps, count) if not is_titled or (
        EFFORT in layout.blocks and known.items() <= read(layout.blocks).items() and all(
            may_be(series[place].title, kind) for kind, block in layout.blocks.items()
            for place in block))]
    if not found and is_titled:
        return known
    if not found:
        raise GuessError(
            f'there is no header, and {len(series)} columns without time are no blocks of {count} '
            f'joints ({", ".join(joints)}): give --drives with the joints that it has, or write '
            f'columns: {{time: 1, {joints[0]}: {{position: 2, effort: …}}}} with numbers from 1')
    fits: list[tuple[Fit, Layout]] = []
    most = -0.5 * table.SAMPLES * np.log(table.CLOSEST)
    for layout in found:
        # No effort is explained better than completely.
        possible = layout.evidence + most * np.sum(in_motion(values, layout.blocks[POSITION]))
        if fits and possible < max(fit.score for fit, _ in fits) - table.SURE:
            break
        # Velocities say at which rate they are the derivatives.
        ratio = abs(layout.rate) if time is None and rate is None else 0.0
        fits.append((_fit(model, values, stamps / (ratio or 1.0), layout,
                          1.0 if time is None else None), layout))
    fits.sort(key=lambda pair: -pair[0].score)
    if known and fits[0][0].residual > table.EXPLAINED:
        return known
    copies = [pair for pair in fits if _are_alike(values, pair[1], fits[0][1])]
    # What was asked for has no noise, and is explained better than what was measured.
    noise = [roughness(values[:, other.blocks.get(EFFORT, other.blocks[POSITION])])
             for _, other in copies]
    rougher = [pair for pair, own in zip(copies, noise, strict=True)
               if own > table.ROUGHER * noise[0]]
    best, layout = (rougher or copies)[0]
    # A share of the same numbers is no second reading.
    settled = [other for _, other in copies if rougher or _are_alike(
        values, other, layout, table.COPY)]
    # What a model explains as well may be the efforts, too; a thermometer is a constant.
    rivals = [other for fit, other in fits if all(other is not one for one in settled) and (
        fit.score > best.score - table.SURE or best.residual > table.GOOD_FIT or (
            EFFORT in other.blocks and EFFORT in layout.blocks and fit.residual < table.EXPLAINED
            and other.blocks[POSITION] == layout.blocks[POSITION]
            and _varies(values[:, other.blocks[EFFORT]])))]
    if rivals:
        raise AmbiguousColumns([{**stamp, **read(other.blocks)} for other in (layout, rivals[0])],
                               'two readings of the columns are possible')
    if min(best.residuals) < table.NO_EFFORT < max(best.residuals):
        layout.blocks.pop(EFFORT, None)  # a column is the effort of one joint, another one is not
    if len(series) == count and not count % 2:
        half = [(joint, kind) for kind in (POSITION, EFFORT) for joint in joints[:count // 2]]
        raise AmbiguousColumns(
            [{**stamp, **columns} for columns in (read(layout.blocks), dict(zip(
                half, (item.column for item in series), strict=True)))],
            f'there are positions of {count} joints, or positions and efforts of {count // 2} '
            f'(then give --drives {",".join(joints[:count // 2])})')
    columns = read(layout.blocks)
    missing = ('name of an effort' if known else 'name of a position') if is_titled else 'header'
    notes.append(f'no {missing}: ' + '; '.join(
        f'{table.PLURALS[kind]} are columns {", ".join(str(series[k].column) for k in places)}'
        for kind, places in layout.blocks.items()))
    return columns


def _varies(values: Array) -> bool:
    """Return whether some of the columns, (N, M), is no constant with a little drift."""
    return bool(np.any(np.std(values, axis=0) > table.STEADY * np.abs(np.mean(values, axis=0))))


def _are_alike(values: Array, layout: Layout, other: Layout, least: float = table.ALIKE) -> bool:
    """Return whether two layouts have the same positions and efforts that are alike."""
    if layout is other or EFFORT not in layout.blocks or EFFORT not in other.blocks or (
            layout.blocks[POSITION] != other.blocks[POSITION]):
        return layout is other
    first, second = (np.concatenate([column - column.mean() for column in values[
        :, each.blocks[EFFORT]].T]) for each in (layout, other))
    size = float(np.linalg.norm(first) * np.linalg.norm(second))
    return float(first @ second) > least * size


def _fit(model: DriveModel, values: Array, time: Array, layout: Layout, rate: float | None) -> Fit:
    """Return how likely a layout is; with a rate, if no times were recorded."""
    velocity, effort = (values[:, layout.blocks[kind]] if kind in layout.blocks else None
                        for kind in (VELOCITY, EFFORT))
    try:
        recording = Recording.from_arrays('', time, values[:, layout.blocks[POSITION]], velocity,
                                          effort, model.drives)
        excerpt = excerpt_of(recording, table.STRETCHES)
    except PprsError:
        excerpt = None
    if excerpt is None:
        return Fit(Reading.plain(len(model.drives)), layout.evidence)
    search = Search(model, recording, excerpt, is_first=True, rate=rate)
    # A thermometer of a robot looks like the weight that a controller commands.
    search.rows = [row for row in search.rows if row.kind not in table.LACKING]
    fit = search.best()
    return replace(fit, score=fit.score + layout.evidence)
