# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Which columns are time, positions, velocities and efforts of joints, by names and numbers."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise, starmap

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import Column
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.readings import table
from pprs_dynamics.inference.readings.check import Fit, Search
from pprs_dynamics.inference.readings.findings import columns_line, near
from pprs_dynamics.inference.readings.links import (
    Layout,
    Links,
    in_motion,
    layouts,
    measured,
    move_alike,
    roughness,
    running_on,
    turn_of,
)
from pprs_dynamics.inference.readings.names import (
    fit_of_name,
    joint_in,
    may_be,
    numbered,
    scale_of,
    unit_of,
    words_of,
)
from pprs_dynamics.inference.readings.table import CURRENT, EFFORT, POSITION, VELOCITY, Reading
from pprs_dynamics.inference.residuals.excerpt import excerpt_of
from pprs_dynamics.measurement.files.poses import FEW, NO_MOTION, held_poses
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.files.samples import Series
from pprs_dynamics.measurement.files.table_files import (
    TIME_COLUMNS,
    TIME_LIKE,
    fraction_of_seconds,
)
from pprs_dynamics.physics.model.drive_model import DriveModel

Columns = dict[tuple[str, str], Column]
TIME_WORDS = {'time', *TIME_LIKE}


class GuessError(PprsError, ValueError):
    """Columns whose quantity cannot be decided."""


class AmbiguousColumns(GuessError):
    """Columns that can be read in two ways.

    Parameters
    ----------
    joints : sequence of str
    readings : sequence of mapping of (joint, quantity) to str or int
        Columns; of no joint, times.
    what : str
        Why it is a question, as a clause.
    """

    def __init__(self, joints: Sequence[str], readings: Sequence[Columns], what: str) -> None:
        self.lines = tuple(columns_line((joint, key, reading[of, key]) for joint in ('', *joints)
                                        for of, key in reading if of == joint)
                           for reading in readings)
        super().__init__(f'{what}, write one of them: {" or ".join(self.lines)}')


@dataclass(frozen=True)
class Guess:
    """Columns by joint and quantity, and how they are read.

    Parameters
    ----------
    time : str, int or None
    columns : dict of (joint, quantity) to str or int
    scales : dict of (joint, quantity) to float
        Where they are not 1.
    time_scale : float or None
    notes : list of str
        What was decided and why, for comments.
    rate : float, optional
        Samples per second of a table without times [Hz].
    effort_kind : str
        By their names, where it is neither measured nor current; else empty.
    time_fraction : str or int, optional
        Parts of the seconds in `time`.
    """

    time: Column | None
    columns: Columns
    scales: dict[tuple[str, str], float] = field(default_factory=dict)
    time_scale: float | None = None
    notes: list[str] = field(default_factory=list)
    rate: float | None = None
    effort_kind: str = ''
    time_fraction: Column | None = None


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
    others_long = [item for item in series if len(item.values) != usual]
    series = [item for item in series if len(item.values) == usual]
    time, fraction, time_scale, notes = _time(series, rate is not None)
    notes += [f'{item.title} has {len(item.values)} numbers, others have {usual}: not used'
              for item in others_long]
    left = [item for item in series if time is None or item.column not in (time.column, fraction)]
    times = next((item.values for item in series if time and item.column == time.column),
                 np.zeros(0))
    # pandas numbers rows in a column without a title, as other programs do; programs that record
    # channels apart repeat the times.
    left = [item for item in left if not _rises(item.values) or not (
        np.array_equal(item.values, times) or (not item.title and _counts_rows(item.values)))]
    if not left:
        raise GuessError('no column has numbers other than times, must be positions of the '
                         'joints in addition to times')
    if len(left) == 1 < len(joints) and not left[0].title:
        raise GuessError(
            f'each line has one number, must have one for each of {len(joints)} joints '
            f'({", ".join(joints)}; --drives names fewer): '
            f'`paste {"- " * len(joints)}< FILE > NEW` joins {len(joints)} lines to one')
    if quantity and not left[0].title and len(left) < len(joints):
        raise GuessError(f'{len(left)} columns of {quantity}s, must have one for each of '
                         f'{len(joints)} joints ({", ".join(joints)}): give --drives '
                         + ','.join(joints[:len(left)]))
    stamp: Columns = {('', key): column for key, column in (
        ('time', None if time is None else time.column), ('time_fraction', fraction))
        if column is not None}
    titled = [item for item in left if item.title]
    main = quantity or POSITION
    columns, found = _by_names(titled, joints, quantity, others) if titled else ({}, [])
    notes += found
    if quantity and not titled:
        columns = {(joint, quantity): item.column
                   for joint, item in zip(joints, left, strict=False)}
    elif model is not None and main not in {kind for _, kind in columns}:
        count = max((len(item.values) for item in left), default=0)
        stamps = np.arange(count) / (rate or 1.0) if time is None else time.values
        columns = _by_numbers(left, joints, stamps, time is not None, rate is not None,
                              stamp, notes, model)
    known = [joint for joint in joints if (joint, main) in columns]
    if known and not quantity and not {EFFORT, CURRENT} & {kind for _, kind in columns}:
        _ask_for_one(joints, stamp | columns, [
            item.column for item in titled if item.column not in columns.values()
            and fit_of_name(tuple(words_of(item.title)), {'': item.column}, EFFORT, None)[0] > 0])
    if not known:
        example = next((item.column for item in left if may_be(item.title, main)), '…')
        raise GuessError(
            f'no names of columns say that they are {main}s: ' + ', '.join(
                item.title or str(item.column) for item in left[:12])
            + f'; write them into columns, e.g. {{{joints[0]}: {{{main}: {example}}}}}')
    by_column = {item.column: item for item in series}
    scales = {key: scale for key, column in columns.items()
              if (scale := scale_of(by_column[column].title, key[1])) is not None}
    without_unit = [key for key, column in columns.items() if key[1] == POSITION
                    and unit_of(by_column[column].title) is None]
    turn = min((turn_of(by_column[columns[key]].values) for key in without_unit), default=np.inf)
    if turn < np.inf:
        notes.append(f'positions begin again after {turn:.6g}: taken as a turn')
        # Encoders of a robot's joints count alike.
        scales.update(dict.fromkeys(without_unit, 2 * np.pi / turn) if turn != 2 * np.pi else {})
    outside = [column for (_, kind), column in columns.items() if kind == EFFORT
               and {*words_of(by_column[column].title)} & table.FROM_OUTSIDE]
    if outside:
        notes.append(f'{by_column[outside[0]].title} is an external torque by its name, from which '
                     'a model was taken out')
    if time is None and rate is None and len(held_poses(np.column_stack([
            by_column[columns[joint, main]].values for joint in known]))):
        rate = 1.0
        notes.append('poses are held, each for as long as any: rate 1 Hz')
    guess = Guess(None if time is None else time.column, columns, scales, time_scale, notes, rate,
                  table.EXTERNAL if outside else '', fraction)
    return guess if quantity else _judge_velocities(guess, by_column, time)


# ------------------------------------------------------------------------------------- time


def _time(series: Sequence[Series], has_rate: bool,
          ) -> tuple[Series | None, Column | None, float | None, list[str]]:
    """Return the times, a column of their fractions, their unit if not [s], and comments."""
    rising = [item for item in series if _rises(item.values)]
    ours = [item for item in rising if item.title in TIME_COLUMNS]
    for whole, part in () if ours else pairwise(series):
        if _counts_parts(whole.values, part.values):
            return replace(whole, values=whole.values + fraction_of_seconds(part.values)), (
                part.column), None, [f'column {part.column} has the fractions of the seconds in '
                                     f'column {whole.column}']
    named = ours or [item for item in rising if _is_time(words_of(item.title))]
    found = next(iter(named), None)
    notes: list[str] = []
    if found is None:
        # Positions may rise as well: with a rate no column is needed.
        even = [] if has_rate else [
            item for item in rising if _is_even(item.values)
            and (not item.title or (item is series[0] and not _counts_rows(item.values)))]
        if not even:
            return None, None, None, notes
        # A counter of rows may come first.
        found = even[len(even) > 1 and _counts_rows(even[0].values)]
        notes.append(f'column {found.column} rises all the time: taken as time')
    scale = scale_of(found.title, table.TIME)
    step = float(np.median(np.diff(found.values[np.isfinite(found.values)])))
    # Poses that are held may be seconds apart.
    if scale is None and step > table.SLOWEST and any(
            roughness(item.values[:, None]) < NO_MOTION for item in series
            if item not in rising and np.any(np.diff(item.values))) and len(found.values) > FEW:
        scale = next(unit for unit in table.TIMES if step * unit <= table.SLOWEST)
        notes.append(f'times rise by {step:g}: taken as units of {scale:g} s')
    return replace(found, values=found.values * (scale or 1.0)), None, scale, notes


def _counts_parts(whole: Array, part: Array) -> bool:
    """Return whether numbers are whole parts of seconds: they fall whenever those rise."""
    both = np.column_stack([whole, part])
    steps = np.diff(both[np.isfinite(both).all(axis=1)], axis=0)
    rises = steps[:, 0] > 0
    return bool(np.any(rises) and np.all(both[np.isfinite(both)] % 1 == 0)
                and np.all(steps[:, 0] >= 0) and np.nanmin(part) >= 0 and np.nanmax(part) < 1e9
                and np.mean(rises == (steps[:, 1] < 0)) > 0.99
                and _rises(whole + fraction_of_seconds(part)))


def _is_time(words: Sequence[str]) -> bool:
    units = {word for word in words if word.startswith('<')}
    return f'<{table.TIME}>' in units or bool(not units and {*words} & TIME_WORDS)


def _rises(values: Array) -> bool:
    steps = np.diff(values[np.isfinite(values)])
    # Episodes of a dataset begin again.
    return bool(len(steps) > 2 and np.median(steps) > 0 and np.mean(steps > 0) > 0.95)


def _is_even(values: Array) -> bool:
    steps = np.diff(values[np.isfinite(values)])
    return bool(np.mean(np.abs(steps - np.median(steps)) < 4 * np.median(steps)) > 0.9)


def _counts_rows(values: Array) -> bool:
    return bool(np.all(np.diff(values[np.isfinite(values)]) == 1))


# ------------------------------------------------------------------------------------ names


def _by_names(series: Sequence[Series], joints: Sequence[str], quantity: str | None,
              others: Collection[str]) -> tuple[Columns, list[str]]:
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
    notes = []
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
    wanted = (quantity,) if quantity else (POSITION, VELOCITY, CURRENT, EFFORT)
    for kind in wanted:
        fits = {key: fit_of_name(key, members, kind, quantity) for key, members in groups.items()}
        best = max(fits, key=lambda key: fits[key], default=())
        if not best or fits[best][0] <= 0:
            continue
        # Efforts come before currents, but what was measured before all else.
        is_measured = not {*best} & (table.COMMANDS | table.FROM_OUTSIDE)
        if kind == EFFORT and not is_measured and currents_are_measured:
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
    for channel, of_channel in table.CHANNEL_WORDS.items() if quantity is None else ():
        named = [key for key in groups if {*key} & of_channel and not {*key} & table.COMMANDS]
        if named:
            columns.update({(joint, channel): column for joint, column in groups[max(
                named, key=lambda key: len(groups[key]))].items()})
    return columns, notes


# ---------------------------------------------------------------------------------- numbers


def _by_numbers(series: Sequence[Series], joints: Sequence[str], time: Array, has_times: bool,
                has_rate: bool, stamp: Columns, notes: list[str], model: DriveModel) -> Columns:
    """Return columns without names: positions by derivatives, efforts by what explains them."""
    count, values = len(joints), np.column_stack([item.values for item in series])
    is_titled = bool(series[0].title)
    # A column is what its name says, whatever its numbers look like.
    found = [layout for layout in layouts(values, time, count) if not is_titled or (
        EFFORT in layout.blocks and all(
            may_be(series[place].title, kind) for kind, block in layout.blocks.items()
            for place in block))]
    if not found and is_titled:
        return {}
    if not found:
        raise GuessError(
            f'there is no header, and {len(series)} columns without time are no blocks of {count} '
            f'joints ({", ".join(joints)}): give --drives with the joints that it has, or write '
            f'columns: {{time: 1, {joints[0]}: {{position: 2, effort: …}}}} with numbers from 1')

    def read(blocks: Mapping[str, Sequence[int]]) -> Columns:
        return stamp | {(joint, kind): series[place].column for kind, places in blocks.items()
                        for joint, place in zip(joints, places, strict=False)}

    fits: list[tuple[Fit, Layout]] = []
    most = -0.5 * table.SAMPLES * np.log(table.CLOSEST)
    for layout in found:
        # No effort is explained better than completely.
        possible = layout.evidence + most * np.sum(in_motion(values, layout.blocks[POSITION]))
        if fits and possible < max(fit.score for fit, _ in fits) - table.SURE:
            break
        # Velocities say at which rate they are the derivatives, whichever is given.
        rate = 1.0 if has_times or (has_rate and near(
            abs(layout.rate), (1.0, *table.VELOCITY_UNITS))) else layout.rate or 1.0
        fits.append((_fit(model, values, time / rate, layout, None if has_times else 1.0), layout))
    fits.sort(key=lambda pair: -pair[0].score)
    copies = [pair for pair in fits if _are_alike(values, pair[1], fits[0][1])]
    # What was asked for has no noise, and is explained better than what was measured.
    noise = [_noise(values[:, other.blocks.get(EFFORT, other.blocks[POSITION])])
             for _, other in copies]
    best, layout = next((pair for pair, own in zip(copies, noise, strict=True)
                         if own > table.ROUGHER * noise[0]), copies[0])
    used = [place for block in layout.blocks.values() for place in block]
    unused = [place for place in range(len(series)) if place not in used]
    # What a model explains as well may be the efforts, too; a thermometer is a constant.
    rivals = [other for fit, other in fits if all(other is not copy for _, copy in copies) and (
        fit.score > best.score - table.SURE or best.residual > table.GOOD_FIT or (
            EFFORT in other.blocks and EFFORT in layout.blocks and fit.residual < table.EXPLAINED
            and other.blocks[POSITION] == layout.blocks[POSITION]
            and abs(other.evidence - layout.evidence) < table.SURE
            and _varies(values[:, other.blocks[EFFORT]])))]
    if rivals:
        raise AmbiguousColumns(joints, [read(layout.blocks), read(rivals[0].blocks)],
                               'two readings of the columns are possible')
    if EFFORT not in layout.blocks or (best.least_residual < table.NO_EFFORT < best.largest_residual
                                       and not best.is_rigid):
        known = {kind: block for kind, block in layout.blocks.items() if kind != EFFORT}
        used = [place for block in known.values() for place in block]
        _ask_for_one(joints, read(known), [
            item.column for place, item in enumerate(series) if place not in used])
    if len(series) == count and not count % 2:
        half = [(joint, kind) for kind in (POSITION, EFFORT) for joint in joints[:count // 2]]
        raise AmbiguousColumns(
            joints, [read(layout.blocks), stamp | dict(zip(
                half, (item.column for item in series), strict=True))],
            f'there are positions of {count} joints, or positions and efforts of {count // 2} '
            f'(then give --drives {",".join(joints[:count // 2])})')
    taken = [f'{_span(series, places)} taken as {table.PLURALS[kind]}'
             for kind, places in layout.blocks.items()]
    notes.append(f'no {"name of a position" if is_titled else "header"}: ' + ', '.join(taken) + (
        f'; {_span(series, unused)} not used' if unused else ''))
    return {key: column for key, column in read(layout.blocks).items() if key not in stamp}


def _noise(values: Array) -> float:
    """Return the third differences of columns, (N, M), over their sizes, without single jumps."""
    sizes = np.maximum(np.std(values, axis=0), 1e-300)
    return float(np.median(np.abs(np.diff(values, 3, axis=0)) / sizes))


def _varies(values: Array) -> bool:
    """Return whether some of the columns, (N, M), is no constant with a little drift."""
    return bool(np.any(np.std(values, axis=0) > table.STEADY * np.abs(np.mean(values, axis=0))))


def _are_alike(values: Array, layout: Layout, other: Layout) -> bool:
    """Return whether two layouts have positions and efforts that are alike."""
    if layout is other or EFFORT not in layout.blocks or EFFORT not in other.blocks or (
            not move_alike(values, layout.blocks[POSITION], other.blocks[POSITION])):
        return layout is other
    first, second = (values[:, each.blocks[EFFORT]] for each in (layout, other))
    moving = np.any(np.diff(first, axis=0), axis=0) & np.any(np.diff(second, axis=0), axis=0)
    return bool(np.any(moving)) and all(
        np.corrcoef(first[:, k], second[:, k])[0, 1] > table.ALIKE
        for k in np.flatnonzero(moving))


def _fit(model: DriveModel, values: Array, time: Array, layout: Layout, rate: float | None) -> Fit:
    """Return how likely a layout is; with a rate, if no times were recorded."""
    position = values[:, layout.blocks[POSITION]]
    known = np.isfinite(position).all(axis=1) & np.isfinite(time)
    known[known] = np.concatenate([[True], np.diff(time[known]) > 0])
    position = running_on(position[known])
    efforts = values[known][:, layout.blocks[EFFORT]] if EFFORT in layout.blocks else (
        np.full(position.shape, np.nan))
    velocity = values[known][:, layout.blocks[VELOCITY]] if VELOCITY in layout.blocks else None
    firsts = held_poses(position, time[known], velocity)
    edges = [*firsts.tolist(), len(position)] if len(firsts) else [0, len(position)]
    recording = Recording(
        model.drives, time[known], position, velocity, efforts, name='',
        segments=tuple(starmap(slice, pairwise(edges))), are_poses=len(firsts) > 0)
    excerpt = excerpt_of(recording, table.STRETCHES)
    if excerpt is None:
        return Fit(Reading.plain(len(model.drives)), layout.evidence)
    search = Search(model, recording, excerpt, is_first=True, rate=rate)
    # A thermometer of a robot looks like the weight that a controller commands.
    search.rows = [row for row in search.rows if row.kind not in table.LACKING]
    fit = search.best()
    evidence = search.evidence(fit.reading)
    # A column that certainly holds inertia or weight is an effort in some unit.
    rigid = evidence is not None and all(np.isfinite(evidence.factor(d, d))
                                         for d in range(len(model.drives)))
    return replace(fit, is_rigid=rigid, score=fit.score + layout.evidence)


def _ask_for_one(joints: Sequence[str], known: Columns, efforts: Sequence[Column]) -> None:
    """Raise AmbiguousColumns: a column may be the effort of one joint, or of another."""
    if len(joints) > 1 and efforts:
        raise AmbiguousColumns(
            joints, [known | {(joint, EFFORT): efforts[0]} for joint in joints[:2]],
            f'no {len(joints)} columns are efforts of {", ".join(joints)}; column {efforts[0]} may '
            'be that of one joint')


def _span(series: Sequence[Series], places: Sequence[int]) -> str:
    columns = [str(series[place].column) for place in places]
    if len(places) > 1 and [*places] == [*range(places[0], places[-1] + 1)]:
        return f'columns {columns[0]} to {columns[-1]}'
    return f'column{"s" * (len(columns) > 1)} {", ".join(columns)}'


# ------------------------------------------------------------------------------- velocities


def _judge_velocities(guess: Guess, series: Mapping[Column, Series], time: Series | None) -> Guess:
    """Return a guess with the rate that velocities show, without those that are none."""
    rates = []
    for joint in [joint for joint, kind in guess.columns if kind == VELOCITY]:
        position, velocity = (guess.columns.get((joint, kind)) for kind in (POSITION, VELOCITY))
        if position is None or velocity is None:
            continue
        pair = np.column_stack([series[column].values for column in (position, velocity)])
        links = Links.of(pair, np.arange(float(len(pair))) if time is None else time.values)
        if links.correlation[0, 1] > table.ALIKE:
            rates.append(float(links.slope[0, 1]))
        elif abs(links.correlation[0, 1]) < table.UNLIKE:
            guess.notes.append(f'{velocity} is called a velocity, but is not the derivative of '
                               f'{position} (correlation {links.correlation[0, 1]:.2f}): not used')
            del guess.columns[joint, VELOCITY]
    if time is not None or guess.rate is not None or not rates:
        return guess
    rate = float(f'{np.median(rates):.3g}')
    guess.notes.append(f'rate {rate:g} Hz: the velocities are the derivatives of the positions at '
                       'this rate')
    return replace(guess, rate=rate)
