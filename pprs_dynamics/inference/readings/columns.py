# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Which columns are time, positions, velocities and efforts of joints, by names and numbers."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.drives import Column
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.readings import table
from pprs_dynamics.inference.readings.table import CURRENT, EFFORT, POSITION, VELOCITY
from pprs_dynamics.measurement.files.recording import (
    MOST_OF_TURN,
    TURN_ROUNDING,
    unwrapped,
)
from pprs_dynamics.measurement.files.samples import Series
from pprs_dynamics.measurement.files.table_files import (
    TIME_COLUMNS,
    TIME_LIKE,
    fraction_of_seconds,
)
from pprs_dynamics.system.plain_yaml import scalar

Columns = dict[tuple[str, str], Column]
TIME_WORDS = {'time', *TIME_LIKE}
QUANTITIES = {word for words in table.WORDS.values() for word in words}
KNOWN = QUANTITIES | table.OTHERS
ROLE = '(ist|soll|act|cmd|meas|fbk|des|ref)'
# Words that another may precede in one: Gelenkmoment, but not timestamp nor payload.
LONG, LONGER = ('|'.join(sorted((word for word in QUANTITIES if len(word) >= least), reverse=True))
                for least in (3, 5))
COMPOUND = re.compile(f'(?:j|{ROLE})?({LONG}|d?qd?)(?:e?[ns])?(?:{ROLE}(?:wert)?)?'
                      f'|([a-z]{{3,}})({LONGER})(?:e?[ns])?(?:{ROLE}(?:wert)?)?')


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
        self.lines = tuple(_line(joints, reading) for reading in readings)
        super().__init__(f'{what}, write one of them: '
                         + ' or '.join(f'columns: {{{line}}}' for line in self.lines))


def _line(joints: Sequence[str], reading: Columns) -> str:
    """Return the content of the block `columns` of a model file."""
    entries = {joint: ', '.join(f'{key}: {scalar(column)}' for (of, key), column in reading.items()
                                if of == joint) for joint in ('', *joints)}
    return ', '.join(f'{scalar(joint)}: {{{entry}}}' if joint else entry
                     for joint, entry in entries.items() if entry)


@dataclass(frozen=True)
class Guess:
    """Which columns are what.

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
                  others: Collection[str] = (), rate: float | None = None) -> Guess:
    """Return which columns are what.

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

    Raises
    ------
    GuessError
        Where positions of the joints cannot be found, or two readings are as likely.
    """
    time, fraction, time_scale, notes = _time(series, rate is not None)
    left = [item for item in series if time is None or item.column not in (time.column, fraction)]
    # pandas numbers rows in a column without a title, as other programs do.
    left = [item for item in left if item.title or not _rises(item.values)
            or not _counts_rows(item.values)]
    if not left:
        raise GuessError('no column has numbers other than times, must be positions of the '
                         'joints beside times')
    stamp: Columns = {('', key): column for key, column in (
        ('time', None if time is None else time.column), ('time_fraction', fraction))
        if column is not None}
    titled = [item for item in left if item.title]
    if titled:
        columns, found = _by_names(titled, joints, quantity, others)
    else:
        count = max((len(each.values) for each in left), default=0)
        stamps = np.arange(count) / (rate or 1.0) if time is None else time.values
        columns, found = _by_numbers(left, joints, stamps, quantity, stamp, notes), []
    notes += found
    main = quantity or POSITION
    known = [joint for joint in joints if (joint, main) in columns]
    if known and not quantity and not {EFFORT, CURRENT} & {kind for _, kind in columns}:
        _ask_for_one(joints, stamp | columns, [
            each.column for each in titled if each.column not in columns.values()
            and _fit(tuple(words_of(each.title)), {'': each.column}, EFFORT, None)[0] > 0])
    if not known:
        raise GuessError(
            f'no columns of {main}s are told by their names: ' + ', '.join(
                each.title or str(each.column) for each in left[:12])
            + f'; write them into columns, e.g. {{{joints[0]}: {{{main}: {left[0].column}}}}}')
    by_column = {item.column: item for item in series}
    scales = {key: scale for key, column in columns.items()
              if (scale := _scale(by_column[column].title, key[1])) is not None}
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
    guess = Guess(None if time is None else time.column, columns, scales, time_scale, notes, rate,
                  table.EXTERNAL if outside else '', fraction)
    return guess if quantity else _judge_velocities(guess, by_column, time)


def words_of(title: str) -> list[str]:
    """Return the words and numbers of a name, in lower case; a unit as its quantity, `<effort>`."""
    plain, unit = _without_unit(title)
    return plain if unit is None else [*plain, f'<{unit[0]}>']


def unit_of(title: str) -> tuple[str, float] | None:
    """Return the quantity that the unit in a name is of, and its factor to SI; None for none."""
    return _without_unit(title)[1]


def _without_unit(title: str) -> tuple[list[str], tuple[str, float] | None]:
    """Return the words of a name without its unit, and the unit."""
    for bracket in re.finditer(r'[\[(]([^\])]*)[\])]', title):
        if unit := _unit(re.sub(r'[ ._*·^-]', '', bracket[1].lower())):
            return _words(title[:bracket.start()] + ' ' + title[bracket.end():]), unit
    words = _words(title)
    for length in (2, 1):
        for at in range(len(words) - length, -1, -1):
            some = words[at:at + length]
            # Single letters are units in brackets alone.
            if (len(some[0]) > 1 or not some[0].isalpha()) and (
                    unit := _unit('/'.join(some)) or _unit(''.join(some))):
                return words[:at] + words[at + length:], unit
    return words, None


def _unit(name: str) -> tuple[str, float] | None:
    return next(((quantity, units[name]) for quantity, units in table.UNITS.items()
                 if name in units), None)


def _words(text: str) -> list[str]:
    parts = re.sub(r'([a-z])(?<!\bm)([A-Z])', r'\1 \2', text.replace('_', ' '))  # not in mA
    found = re.findall(r'[^\W\d_]+|\d+|[°%‰]', parts.lower())
    return [each for word in found for each in _split(word)]


def _split(word: str) -> list[str]:
    """Return the parts of a word that is several in one: posa, taum, Istposition, Gelenkwinkel.

    The last letter of a quantity says actual or desired. A German or joined word ends in a
    quantity, perhaps followed by ist or soll.
    """
    if word in KNOWN or not word.isalpha():
        return [word]
    if word[:-1] in QUANTITIES and (len(word) > 3 or word[0] in 'qd') and (
            word[-1] in table.LETTERS):
        return [word[:-1], table.LETTERS[word[-1]]]
    compound = COMPOUND.fullmatch(word)
    return [part for part in compound.groups() if part] if compound else [word]


# ------------------------------------------------------------------------------------- time


def _time(series: Sequence[Series], has_rate: bool,
          ) -> tuple[Series | None, Column | None, float | None, list[str]]:
    """Return the times, a column of their fractions, their unit if not [s], and comments."""
    rising = [each for each in series if _rises(each.values)]
    ours = [each for each in rising if each.title in TIME_COLUMNS]
    for whole, part in () if ours else pairwise(series):
        if _counts_parts(whole.values, part.values):
            return replace(whole, values=whole.values + fraction_of_seconds(part.values)), (
                part.column), None, [f'column {part.column} has the fractions of the seconds in '
                                     f'column {whole.column}']
    named = ours or [each for each in rising if _is_time(words_of(each.title))]
    found = next(iter(named), None)
    notes: list[str] = []
    if found is None:
        # Positions may rise as well: with a rate no column is needed.
        even = [] if has_rate else [
            each for each in rising if _is_even(each.values)
            and (not each.title or (each is series[0] and not _counts_rows(each.values)))]
        if not even:
            return None, None, None, notes
        # A counter of rows may come first.
        found = even[len(even) > 1 and _counts_rows(even[0].values)]
        notes.append(f'column {found.column} rises all the time: taken as time')
    scale = _scale(found.title, table.TIME)
    step = float(np.median(np.diff(found.values[np.isfinite(found.values)])))
    if scale is None and step > table.SLOWEST:
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
    for key, numbers in _numbered(unnamed).items():
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
    values = np.column_stack([each.values for each in series])
    places = {each.column: k for k, each in enumerate(series)}
    currents_are_measured = False
    wanted = (quantity,) if quantity else (POSITION, VELOCITY, CURRENT, EFFORT)
    for each in wanted:
        best = max(groups, key=lambda key: _fit(key, groups[key], each, quantity), default=None)
        if best is None or _fit(best, groups[best], each, quantity)[0] <= 0:
            continue
        # Efforts come before currents, but what was measured before all else.
        is_measured = not {*best} & (table.COMMANDS | table.FROM_OUTSIDE)
        if each == EFFORT and not is_measured and currents_are_measured:
            continue
        currents_are_measured = each == CURRENT and is_measured
        rivals = [key for key in groups if _fit(key, groups[key], each, quantity)
                  == _fit(best, groups[best], each, quantity)]
        # Of groups that move alike commands come first in time.
        shared = [joint for joint in groups[best] if all(joint in groups[key] for key in rivals)]
        blocks = [[places[groups[key][joint]] for joint in shared] for key in rivals]
        best = rivals[_measured(values, blocks)] if shared else best
        if each == EFFORT:
            columns = {key: column for key, column in columns.items() if key[1] != CURRENT}
        columns.update({(joint, each): column for joint, column in groups[best].items()})
    for channel, telling in table.CHANNEL_WORDS.items() if quantity is None else ():
        told = [key for key in groups if {*key} & telling and not {*key} & table.COMMANDS]
        if told:
            columns.update({(joint, channel): column for joint, column in groups[max(
                told, key=lambda key: len(groups[key]))].items()})
    return columns, notes


def _lag(values: Array, other: Array) -> int | None:
    """Return by how many samples other values come later; None where they do not move alike."""
    first, second = np.diff(np.nan_to_num(values)), np.diff(np.nan_to_num(other))
    count = len(first) - table.LONGEST_LAG
    if count < table.LEAST_ROWS or not (np.any(first) and np.any(second)):
        return None
    found = {sign * k: float(np.corrcoef(early[:count], late[k:count + k])[0, 1])
             for sign, early, late in ((-1, second, first), (1, first, second))
             for k in range(table.LONGEST_LAG)}
    best = max(found, key=lambda lag: found[lag])
    return best if found[best] > table.COPY else None


def _fit(key: tuple[str, ...], members: dict[str, Column], quantity: str, given: str | None,
         ) -> tuple[float, ...]:
    """Return how well a group of columns fits a quantity; not at all below 0."""
    told = {kind for kind in (*table.WORDS, table.TIME, table.NEITHER) if f'<{kind}>' in key}
    for words in ({word for word in key if len(word) > 1}, {*key}):
        # A single letter beside a word is a prefix of programmers.
        told = told or {kind for kind, known in table.WORDS.items() if words & {*known}}
    is_german = bool({*key} & {'ist', 'soll'})
    if not told and is_german and 'm' in key:
        told.add(EFFORT)
    if not told and ({*key} & table.OF_JOINTS or (is_german and 'a' in key)):
        told.add(POSITION)  # "joint torque" is no position
    if CURRENT in told and EFFORT in told:
        told.discard(EFFORT)
    # The name of the joint alone is a position, as in `shoulder_pan`.
    plain = not told and not {*key} - {'*', 'observation'} - table.MEASURED
    fits = given is not None or quantity in told or (quantity == POSITION and plain)
    if quantity == POSITION and VELOCITY in told:
        fits = False
    if not fits or {*key} & table.OTHERS:
        return (-1.0,)
    return (float(len(members)), float(not {*key} & (table.COMMANDS | table.FROM_OUTSIDE)),
            float(not {*key} & table.SECONDARY), float(bool({*key} & table.MEASURED)),
            -float(len(key)))


def joint_in(words: Sequence[str], joints: Sequence[str]) -> tuple[str, int, int] | None:
    """Return the joint whose name is among the words, where, and how long it is."""
    best: tuple[str, int, int] | None = None
    for joint in joints:
        own = words_of(joint)
        shorter = [word for word in own if word != 'joint'] or own
        for name in (own, shorter):
            if name == ['joint'] or all(word.isdigit() for word in name):
                continue
            for at in range(len(words) - len(name) + 1):
                if list(words[at:at + len(name)]) == name and (
                        best is None or len(name) > best[2]):
                    best = (joint, at, len(name))
    return best


def _numbered(series: Sequence[Series]) -> dict[tuple[str, ...], dict[int, Column]]:
    """Return columns that differ in a number alone, by their other words; gaps end them."""
    found: dict[tuple[str, ...], dict[int, Column]] = {}
    for item in series:
        words = words_of(item.title)
        for at, word in enumerate(words):
            if word.isdigit() and len(word) < 4:
                key = (*words[:at], '*', *words[at + 1:])
                found.setdefault(key, {}).setdefault(int(word), item.column)
    return {key: numbers for key, numbers in found.items()
            if len(numbers) > 1 and max(numbers) - min(numbers) == len(numbers) - 1}


# ------------------------------------------------------------------------------- derivatives


@dataclass(frozen=True)
class Links:
    """Which columns are derivatives of which, from M columns of N samples.

    Parameters
    ----------
    correlation, slope : (M, M) arrays
        Of column j with the derivative of column i, over steps of several lengths; NaN where one
        of them does not move.
    alike : (M, M) array
        Correlation of the changes of columns.
    """

    correlation: Array
    slope: Array
    alike: Array

    @classmethod
    def of(cls, values: Array, time: Array) -> Links:
        """Compare changes of every column, (N, M), with the integral of every other one.

        Integrals forgive quantisation and noise, which differences multiply.
        """
        known = np.isfinite(values).all(axis=1) & np.isfinite(time)
        known[known] = np.concatenate([[True], np.diff(time[known]) > 0])
        values, time = running_on(values[known]), time[known]
        count = values.shape[1]
        best = [np.full((count, count), np.nan) for _ in range(3)]
        if len(time) < table.LEAST_ROWS:
            return cls(*best)
        steps = np.diff(time)[:, None]
        area = np.vstack([np.zeros(count), np.cumsum(
            0.5 * (values[1:] + values[:-1]) * steps, axis=0)])
        for length in (step for step in table.LENGTHS_OF_STEPS if step < len(time) // 4):
            change, covered = (each[length:] - each[:-length] for each in (values, area))
            change, covered = change - change.mean(axis=0), covered - covered.mean(axis=0)
            with np.errstate(divide='ignore', invalid='ignore'):
                sizes, areas = (np.sqrt(np.sum(each ** 2, axis=0)) for each in (change, covered))
                product = change.T @ covered
                found = product / np.outer(sizes, areas)
                slope = np.outer(1 / sizes, areas) / np.where(found == 0, np.nan, found)
                alike = change.T @ change / np.outer(sizes, sizes)
            better = ~(np.abs(found) <= np.abs(best[0])) & np.isfinite(found)
            slope = (np.sum(covered ** 2, axis=0)[None, :]
                     / np.where(product == 0, np.nan, product))
            best = [np.where(better, new, old) for new, old in zip(
                (found, slope, alike), best, strict=True)]
        return cls(*best)


def turn_of(values: Array) -> float:
    """Return after how much the angles of a column, (N,), begin again; infinite if they do not."""
    known = values[np.isfinite(values)]
    span, step = np.ptp(known), np.abs(np.diff(known)).max(initial=0.0)
    return next((turn for unit in (1.0, *table.ANGLES, *table.COUNTS)
                 if table.NEARLY < span / (turn := 2 * np.pi / unit) <= 1 + TURN_ROUNDING
                 and step > MOST_OF_TURN * turn), np.inf)


def running_on(values: Array) -> Array:
    """Return columns, (N, M), of which angles run on that begin again after a turn."""
    return unwrapped(values, [turn_of(column) for column in values.T])[0]


def _by_numbers(series: Sequence[Series], joints: Sequence[str], time: Array,
                quantity: str | None, stamp: Columns, notes: list[str]) -> Columns:
    """Return columns without names by what they are of each other, in any order."""
    count = len(joints)
    if quantity:
        return {(joint, quantity): each.column
                for joint, each in zip(joints, series, strict=False)}
    values = np.column_stack([each.values for each in series])
    links = Links.of(values, time)
    candidates = [*_chains(values, links, count)] or [*_layouts(links, count)]
    if not candidates:
        raise GuessError(
            f'there is no header, and {len(series)} columns beside time are no blocks of {count} '
            f'joints ({", ".join(joints)}), nor are there as many positions with their '
            f'velocities: write columns: {{time: 1, {joints[0]}: {{position: 2, effort: …}}}} '
            'with numbers from 1')
    scored = [(float(np.mean(_shares(values[:, group], values[:, kinds[POSITION]], time) or -1)),
               kinds, group) for kinds, groups in candidates for group in groups]
    # Of positions that explain as much the smoothest, as no effort is.
    near = [each for each in scored if each[0] > max(scored)[0] - table.CLEAR]
    kinds = min([each[1] for each in near] or [candidates[0][0]],
                key=lambda kinds: _roughness(values[:, kinds[POSITION]]))
    efforts = [group for _, other, group in near if other is kinds]
    with np.errstate(invalid='ignore'):  # of columns that do not change
        unlike = next((group for group in efforts if not np.nanmin(
            links.alike[efforts[0], group]) > table.COPY), None)
    used = {place for places in kinds.values() for place in places}
    known = stamp | {(joint, kind): series[place].column for kind, places in kinds.items()
                     for joint, place in zip(joints, places, strict=False)}
    if unlike:
        raise AmbiguousColumns(joints, [known | {
            (joint, EFFORT): series[place].column for joint, place in zip(
                joints, group, strict=False)} for group in (efforts[0], unlike)],
            'two readings of the columns are as likely')
    shares = _shares(values[:, efforts[0]], values[:, kinds[POSITION]], time) if efforts else []
    if not efforts or min(shares) < table.UNLIKE_EFFORT < max(shares):
        _ask_for_one(joints, known, [
            each.column for place, each in enumerate(series) if place not in used])
    if len(series) == count and not count % 2:
        half = [(joint, kind) for kind in (POSITION, EFFORT) for joint in joints[:count // 2]]
        raise AmbiguousColumns(
            joints, [known, stamp | dict(zip(half, (each.column for each in series), strict=True))],
            f'there are positions of {count} joints, or positions and efforts of {count // 2} '
            f'(then give --drives {",".join(joints[:count // 2])})')
    if efforts:
        kinds = {**kinds, EFFORT: efforts[_measured(values, efforts)]}
    told = [f'{_span(series, places)} taken as {table.PLURALS[kind]}'
            for kind, places in kinds.items()]
    unused = [place for place in range(len(series))
              if place not in {k for places in kinds.values() for k in places}]
    notes.append('no header: ' + ', '.join(told) + (
        f'; {_span(series, unused)} not used' if unused else ''))
    return {(joint, kind): series[place].column for kind, places in kinds.items()
            for joint, place in zip(joints, places, strict=False)}


def _ask_for_one(joints: Sequence[str], known: Columns, efforts: Sequence[Column]) -> None:
    """Raise AmbiguousColumns: a column may be the effort of one joint, or of another."""
    if len(joints) > 1 and efforts:
        raise AmbiguousColumns(joints, [known | {(joint, EFFORT): column} for column in efforts[:2]
                                        for joint in joints],
                               f'no {len(joints)} columns are efforts of {", ".join(joints)}; '
                               f'column {efforts[0]} may be that of one joint')


def _span(series: Sequence[Series], places: Sequence[int]) -> str:
    columns = [str(series[place].column) for place in places]
    if len(places) > 1 and [*places] == [*range(places[0], places[-1] + 1)]:
        return f'columns {columns[0]} to {columns[-1]}'
    return f'column{"s" * (len(columns) > 1)} {", ".join(columns)}'


Candidate = tuple[dict[str, list[int]], list[list[int]]]  # positions, velocities; other blocks


def _chains(values: Array, links: Links, count: int) -> Iterator[Candidate]:
    """Yield positions and velocities by derivatives, where each joint has both."""
    with np.errstate(invalid='ignore'):
        derived = (links.correlation > table.ALIKE) & (links.slope > 0)
        # What has a velocity is followed by it best: an effort may resemble a position.
        derived &= links.correlation > np.nanmax(np.where(
            derived, links.correlation, -1.0), axis=0) - table.AS_WELL
        same = links.alike > table.COPY
    np.fill_diagonal(derived, False)
    # What is asked for moves as what is measured, which the velocity follows more exactly.
    places = [i for i in range(len(derived)) if derived[i].any() and not derived[:, i].any()]
    groups: list[list[int]] = []
    for i in places:
        group = next((group for group in groups if same[group[0], i]), None)
        if group is None:
            groups.append([i])
        else:
            group.append(i)
    pairs = []
    for group in groups:
        i = group[_measured(values, [[k] for k in group])]
        speeds = np.flatnonzero(derived[i]).tolist()
        most = max(speeds, key=lambda k: links.correlation[i, k])
        speeds = [most, *(k for k in speeds if same[most, k] and k != most)]
        pairs.append((i, speeds[_measured(values, [[k] for k in speeds])]))
    pairs.sort()
    # Velocities of one robot are in one unit.
    slopes = [float(np.log(links.slope[pair])) for pair in pairs]
    if (len(pairs) == count == len({j for _, j in pairs})
            and np.ptp(slopes) <= table.SAME_UNIT):
        # Of what was asked for the derivatives are known, too.
        used = [place for pair in pairs for place in pair]
        used += [place for place in range(values.shape[1]) if place not in used and any(
            _lag(values[:, each], values[:, place]) is not None for each in used)]
        rest = [place for place in range(values.shape[1])
                if place not in used and not _is_known(links, place, used)]
        yield {POSITION: [i for i, _ in pairs], VELOCITY: [j for _, j in pairs]}, [
            rest[k:k + count] for k in range(0, len(rest) - count + 1, count)]


def _layouts(links: Links, count: int) -> Iterator[Candidate]:
    """Yield positions, and velocities if there are any, in blocks or in every so many columns."""
    width = len(links.alike)
    if width % count or not width:
        return
    number = width // count
    layouts = [[[*range(b * count, (b + 1) * count)] for b in range(number)]]
    if count > 1 and number > 1:
        layouts.append([[*range(b, width, number)] for b in range(number)])
    for layout in layouts:
        # A block has the derivatives of another where most joints that move have them.
        found = np.nan_to_num(np.array([[np.median(moving) if len(
            moving := (values := links.correlation[block, other])[np.isfinite(values)]) else 0.0
            for other in layout] for block in layout]))
        is_rate = (found > table.ALIKE) & ~np.eye(number, dtype=bool)
        for b, block in enumerate(layout):
            if not is_rate[:, b].any():
                speeds = [layout[k] for k in np.flatnonzero(is_rate[b]).tolist()]
                yield {POSITION: block, **({VELOCITY: speeds[0]} if speeds else {})}, [
                    other for other in layout if other is not block and other not in speeds]


def _measured(values: Array, blocks: Sequence[Sequence[int]]) -> int:
    """Return the place of the block that is measured, of those that move as the first one does.

    That is the last one, or the one with noise: commands have none.
    """
    lags = [[_lag(values[:, first], values[:, other]) for first, other in zip(
        blocks[0], block, strict=True)] for block in blocks]
    alike = [k for k, each in enumerate(lags) if k == 0 or None not in each]
    rough = [_roughness(values[:, block]) for block in blocks]
    least = table.ROUGHER * min(rough[k] for k in alike)
    return max(alike, key=lambda k: (float(np.median([lag or 0 for lag in lags[k]])),
                                     rough[k] > least))


def _roughness(values: Array) -> float:
    """Return the size of third differences over that of the first ones: small for a motion."""
    moved = np.std(np.diff(values, axis=0), axis=0)
    return float(np.median(np.std(np.diff(values, 3, axis=0), axis=0) / np.maximum(moved, 1e-300)))


def _is_known(links: Links, place: int, used: Collection[int]) -> bool:
    """Return whether a column is the derivative of a used one in its units, or alike one."""
    for k in used:
        if links.alike[k, place] > table.COPY or (links.correlation[k, place] > table.COPY and any(
                abs(links.slope[k, place] / links.slope[i, j] - 1) < table.SAME_UNIT
                for i in used for j in used if links.correlation[i, j] > table.ALIKE)):
            return True
    return False


def _shares(efforts: Array, position: Array, time: Array) -> list[float]:
    """Return the shares of efforts that change, which gravity, friction and inertia may explain.

    Positions may be in any unit of angles.
    """
    known = (np.isfinite(efforts).all(axis=1) & np.isfinite(position).all(axis=1)
             & np.isfinite(time))
    efforts, position, time = efforts[known], running_on(position[known]), time[known]
    swing = np.var(efforts, axis=0)
    moves = swing > 0
    if len(time) < table.LEAST_ROWS or not np.all(np.diff(time) > 0):
        return [0.0]
    half = max(2, len(time) // 200)

    def rate_of(values: Array) -> Array:
        found = np.zeros_like(values)
        found[half:-half] = (values[2 * half:] - values[:-2 * half]) / (
            time[2 * half:] - time[:-2 * half])[:, None]
        return found

    speed = rate_of(position)
    width = root_mean_square(speed) / 10 or 1.0
    rate = rate_of(speed)
    common = [np.ones(len(time)), speed, np.tanh(speed / width), rate]
    shares: list[list[float]] = []
    for unit in (1.0, *table.ANGLES, *table.COUNTS):
        angle = unit * position
        total = np.cumsum(angle, axis=1)
        columns = np.column_stack([
            *common, np.sin(angle), np.cos(angle), np.sin(total), np.cos(total),
            *(each * rate for each in np.cos(angle).T[1:, :, None])])
        columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        rest = efforts - columns @ np.linalg.lstsq(columns, efforts, rcond=1e-8)[0]
        shares.append((1 - np.var(rest, axis=0)[moves] / swing[moves]).tolist())
    return max(shares, key=sum)


# ------------------------------------------------------------------------------------ units


def _scale(title: str, quantity: str) -> float | None:
    unit = unit_of(title)
    return unit[1] if unit and unit[1] != 1 and (
        unit[0] == quantity or (unit[0] == table.SHARE and quantity == EFFORT)) else None


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
