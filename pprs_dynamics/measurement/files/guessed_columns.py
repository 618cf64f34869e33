# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Which columns are time, positions, velocities and efforts of joints, by names and numbers.

A guess, for a person to check: nothing is read by it unless it stands in a model file.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import Column
from pprs_dynamics.errors import PprsError
from pprs_dynamics.measurement.files.contents import Series
from pprs_dynamics.measurement.files.table_files import LATEST_SECOND, TIME_COLUMNS, TIME_LIKE

POSITION, VELOCITY, EFFORT, CURRENT = 'position', 'velocity', 'effort', 'current'
# Words of a title, and the quantity that they tell.
WORDS = {
    POSITION: ('position', 'positions', 'pos', 'q', 'angle', 'angles', 'theta', 'state', 'qpos',
               'joint', 'joints'),
    VELOCITY: ('velocity', 'velocities', 'vel', 'dq', 'qd', 'qdot', 'dtheta', 'speed', 'omega',
               'qvel', 'dpos', 'v'),
    EFFORT: ('effort', 'efforts', 'tau', 'torque', 'torques', 'trq', 'force', 'moment', 'load',
             'tq', 'qfrc', 'u'),
    CURRENT: ('current', 'currents', 'cur', 'curr', 'amp', 'amps', 'ampere', 'amperes', 'i', 'iq',
              'ma'),
}
# The same of what may be measured beside.
CHANNEL_WORDS = {'temperature': {'temperature', 'temperatures', 'temp', 'temps'},
                 'pressure': {'pressure', 'pressures'}}
PLURALS = {POSITION: 'positions', VELOCITY: 'velocities', EFFORT: 'efforts', CURRENT: 'currents'}
# Titles with one of these tell of something else than a joint's measured motion or effort.
OTHERS = frozenset((
    'acc', 'acceleration', 'accelerations', 'ddq', 'qdd', 'qddot', 'temp', 'temperature',
    'temperatures', 'voltage', 'power', 'tcp', 'cartesian', 'pose', 'ee', 'twist', 'wrench',
    'gravity', 'limit', 'error', 'err', 'action', 'reward', 'index', 'episode', 'frame', 'done',
    'tracking'))
# These tell of a command: taken only where nothing measured is there.
COMMANDS = frozenset((
    'cmd', 'command', 'commands', 'commanded', 'target', 'targets', 'des', 'desired', 'ref',
    'reference', 'goal', 'setpoint', 'sp', 'set', 'demand', 'demanded'))
MEASURED = frozenset((
    'meas', 'measured', 'actual', 'act', 'real', 'fb', 'feedback', 'msr', 'sensor', 'link'))
SCALES = {POSITION: {'deg': math.pi / 180, 'degs': math.pi / 180, 'degree': math.pi / 180,
                     'degrees': math.pi / 180, 'mm': 1e-3, 'mrad': 1e-3},
          VELOCITY: {'deg': math.pi / 180, 'degs': math.pi / 180, 'rpm': math.pi / 30,
                     'mm': 1e-3, 'mms': 1e-3},
          EFFORT: {'mnm': 1e-3, 'nmm': 1e-3, 'knm': 1e3},
          CURRENT: {'ma': 1e-3}}
TIMES = {'ms': 1e-3, 'msec': 1e-3, 'millis': 1e-3, 'milliseconds': 1e-3, 'us': 1e-6, 'usec': 1e-6,
         'micros': 1e-6, 'ns': 1e-9, 'nsec': 1e-9, 'nanoseconds': 1e-9}
ALIKE = 0.9  # correlation of a series with the derivative of another, from which it is a velocity
COPY = 0.99  # correlation from which a series is what another was asked to be
SLOWEST = 0.5  # [s], steps beyond which times of a robot count something else than seconds
BEYOND = 1.5  # of a limit, from which a position in radians is none


class GuessError(PprsError, ValueError):
    """Columns that cannot be told."""


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
        What was guessed from what, for comments.
    """

    time: Column | None
    columns: dict[tuple[str, str], Column]
    scales: dict[tuple[str, str], float] = field(default_factory=dict)
    time_scale: float | None = None
    notes: list[str] = field(default_factory=list)


def guess_columns(series: Sequence[Series], joints: Sequence[str], limits: Sequence[float],
                  quantity: str | None = None, others: Collection[str] = ()) -> Guess:
    """Return which columns are what.

    Parameters
    ----------
    series : sequence of Series
        All columns with numbers, in the order of the file.
    joints : sequence of D str
        From the base to the tool.
    limits : sequence of D float
        Largest absolute positions by the description, infinite where there are none or for slides.
    quantity : str, optional
        What all columns are of, where the file's name says so.
    others : collection of str
        Further joints of the robot: columns with their names are no columns of these.

    Raises
    ------
    GuessError
        Where positions of the joints cannot be told.
    """
    time, time_scale, notes = _time(series)
    left = [one for one in series if time is None or one.column != time.column]
    # pandas numbers rows in a column without a title.
    titled = [one for one in left if one.title]
    if titled:
        columns, found = _by_names(titled, joints, quantity, others)
    else:
        columns, found = _by_blocks(left, joints, time, quantity)
    notes += found
    main = quantity or POSITION
    known = [joint for joint in joints if (joint, main) in columns]
    if not known:
        raise GuessError(
            f'no columns of {main}s are told by their names: {_listed(left)}; write them '
            f'into columns, e.g. {{{joints[0]}: {{{main}: {_first(left)}}}}}')
    by_column = {one.column: one for one in series}
    scales = {key: scale for key, column in columns.items()
              if (scale := _scale(by_column[column].title, key[1])) is not None}
    _judge_units(columns, scales, by_column, dict(zip(joints, limits, strict=True)), time,
                 time_scale, notes)
    return Guess(None if time is None else time.column, columns, scales, time_scale, notes)


def words_of(title: str) -> list[str]:
    """Return the words and numbers that a name is made of, in lower case."""
    parts = re.sub(r'([a-z])([A-Z])', r'\1 \2', title)
    return re.findall(r'[a-z]+|\d+', parts.lower())


def _listed(series: Sequence[Series]) -> str:
    return ', '.join(one.title or str(one.column) for one in series[:12]) or 'none'


def _first(series: Sequence[Series]) -> str:
    return str(series[0].column) if series else 'q1'


# ------------------------------------------------------------------------------------- time


def _time(series: Sequence[Series]) -> tuple[Series | None, float | None, list[str]]:
    """Return the column of times, the seconds that it counts in, and what was guessed."""
    rising = [one for one in series if _rises(one.values)]
    named = [one for one in rising if one.title in TIME_COLUMNS] or [
        one for one in rising if {*words_of(one.title)} & {'time', *TIME_LIKE}]
    found = next(iter(named), None)
    notes: list[str] = []
    if found is None:
        unnamed = [one for one in rising if not one.title]
        if not unnamed:
            return None, None, notes
        found = unnamed[0]
        notes.append(f'column {found.column} rises all the time: taken as time')
    scale = next((TIMES[word] for word in words_of(found.title) if word in TIMES), None)
    known = found.values[np.isfinite(found.values)]
    if known[0] > LATEST_SECOND:  # since 1970: as the reader takes them
        while known[0] > LATEST_SECOND:
            known = known / 1e3
        return replace(found, values=found.values * (known[0] / found.values[
            np.isfinite(found.values)][0])), scale, notes
    step = float(np.median(np.diff(known)))
    if scale is None and step > SLOWEST:
        scale = next(one for one in (1e-3, 1e-6, 1e-9, 0.0) if step * one <= SLOWEST) or 1e-9
        notes.append(f'times rise by {step:g}: taken as units of {scale:g} s')
    return found, scale, notes


def _rises(values: Array) -> bool:
    known = values[np.isfinite(values)]
    steps = np.diff(known)
    # Episodes of a dataset begin again.
    return bool(len(steps) > 2 and np.median(steps) > 0 and np.mean(steps > 0) > 0.95
                and np.mean(np.abs(steps - np.median(steps)) < 4 * np.median(steps)) > 0.9)


# ------------------------------------------------------------------------------------ names


def _by_names(series: Sequence[Series], joints: Sequence[str], quantity: str | None,
              others: Collection[str]) -> tuple[dict[tuple[str, str], Column], list[str]]:
    groups: dict[tuple[str, ...], dict[str, Column]] = {}
    unnamed = []
    for one in series:
        words = words_of(one.title)
        place = _joint_in(words, list(dict.fromkeys((*joints, *others))))
        if place is None:
            unnamed.append(one)
        elif place[0] in joints:
            joint, at, length = place
            key = (*words[:at], '*', *words[at + length:])
            groups.setdefault(key, {}).setdefault(joint, one.column)
    notes = []
    for key, numbers in _numbered(unnamed).items():
        if key not in groups and (len(numbers) >= len(joints) or len(joints) == 1):
            chosen = [numbers[number] for number in sorted(numbers)][:len(joints)]
            groups[key] = dict(zip(joints, chosen, strict=False))
            if len(joints) > 1 and len(numbers) > len(joints):
                notes.append(f'{" ".join(key)}: {len(numbers)} columns, of which the first '
                             f'{len(joints)} are taken as the joints from base to tool')
    if len(joints) == 1:
        for one in series:
            groups.setdefault(tuple(words_of(one.title)), {}).setdefault(joints[0], one.column)
    columns: dict[tuple[str, str], Column] = {}
    wanted = (quantity,) if quantity else (POSITION, VELOCITY, EFFORT, CURRENT)
    for each in wanted:
        best = max(groups, key=lambda key: _fit(key, groups[key], each, quantity), default=None)
        if best is None or _fit(best, groups[best], each, quantity)[0] <= 0:
            continue
        if each == CURRENT and any(kind == EFFORT for _, kind in columns):
            continue
        if {*best} & COMMANDS:
            notes.append(f'{each}: only commands are there ({" ".join(best)})')
        columns.update({(joint, each): column for joint, column in groups[best].items()})
    for channel, telling in CHANNEL_WORDS.items() if quantity is None else ():
        told = [key for key in groups if {*key} & telling and not {*key} & COMMANDS]
        if told:
            columns.update({(joint, channel): column for joint, column in groups[max(
                told, key=lambda key: len(groups[key]))].items()})
    return columns, notes


def _fit(key: tuple[str, ...], members: dict[str, Column], quantity: str, given: str | None,
         ) -> tuple[float, ...]:
    """Return how well a group of columns fits a quantity; not at all below 0."""
    told = {kind for kind, words in WORDS.items() if {*key} & {*words}}
    if {*key} & {'joint', 'joints', 'state'} and len(told) > 1:
        told.discard(POSITION)  # "joint torque" is no position
    if {*key} & {*WORDS[POSITION][:7]}:
        told.add(POSITION)
    if CURRENT in told and EFFORT in told:
        told.discard(EFFORT)
    # The name of the joint alone is a position, as in `shoulder_pan`.
    plain = not told and not {*key} - {'*', 'observation'}
    fits = given is not None or quantity in told or (quantity == POSITION and plain)
    if quantity == POSITION and VELOCITY in told:
        fits = False
    if not fits or {*key} & OTHERS:
        return (-1.0,)
    return (float(len(members)), float(not {*key} & COMMANDS), float(bool({*key} & MEASURED)),
            -float(len(key)))


def _joint_in(words: Sequence[str], joints: Sequence[str]) -> tuple[str, int, int] | None:
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
    for one in series:
        words = words_of(one.title)
        for at, word in enumerate(words):
            if word.isdigit() and len(word) < 4:
                key = (*words[:at], '*', *words[at + 1:])
                found.setdefault(key, {}).setdefault(int(word), one.column)
    return {key: numbers for key, numbers in found.items()
            if len(numbers) > 1 and max(numbers) - min(numbers) == len(numbers) - 1}


# ----------------------------------------------------------------------------------- blocks


def _by_blocks(series: Sequence[Series], joints: Sequence[str], time: Series | None,
               quantity: str | None) -> tuple[dict[tuple[str, str], Column], list[str]]:
    """Tell columns without names: blocks of as many as there are joints, one after another."""
    count = len(joints)
    if len(series) % count or not series:
        raise GuessError(
            f'there is no header, and {len(series)} columns beside time are no blocks of {count} '
            f'joints ({", ".join(joints)}): write columns: {{time: 1, {joints[0]}: {{position: '
            '2, effort: …}}} with numbers from 1')
    blocks = [series[k:k + count] for k in range(0, len(series), count)]
    if quantity:
        kinds = {0: quantity}
    else:
        kinds = {0: POSITION}
        speeds = [b for b in range(1, len(blocks)) if _is_derivative(blocks[b], blocks[0], time)]
        if speeds:
            kinds[speeds[0]] = VELOCITY
        # Accelerations, and what positions and velocities were asked to be, are no efforts.
        known = [0, *speeds[:1]]
        rest = [b for b in range(1, len(blocks)) if b not in speeds and not any(
            _is_derivative(blocks[b], blocks[k], time) or _is_alike(blocks[b], blocks[k])
            for k in known)]
        if rest:
            kinds[rest[0]] = EFFORT
    columns = {(joint, kind): one.column for b, kind in kinds.items()
               for joint, one in zip(joints, blocks[b], strict=True)}
    told = [f'columns {blocks[b][0].column} to {blocks[b][-1].column} taken as {PLURALS[kind]}'
            for b, kind in sorted(kinds.items())]
    unused = [f'{blocks[b][0].column} to {blocks[b][-1].column}'
              for b in range(len(blocks)) if b not in kinds]
    return columns, ['no header: ' + ', '.join(told) + (
        f'; {", ".join(unused)} are not used' if unused else '')]


def _is_derivative(block: Sequence[Series], of: Sequence[Series], time: Series | None) -> bool:
    return float(np.nanmedian([_slope(rate.values, position.values, time)[1]
                               for rate, position in zip(block, of, strict=True)])) > ALIKE


def _is_alike(block: Sequence[Series], other: Sequence[Series]) -> bool:
    """Return whether two blocks move alike, as what is asked for and what is measured do."""
    found = []
    for one, two in zip(block, other, strict=True):
        known = np.isfinite(one.values) & np.isfinite(two.values)
        a, b = (each.values[known] - np.mean(each.values[known]) for each in (one, two))
        size = float(np.linalg.norm(a) * np.linalg.norm(b))
        found.append(float(a @ b) / size if size > 0 else math.nan)
    return bool(np.nanmedian(found) > COPY) if np.isfinite(found).any() else False


def _slope(rate: Array, position: Array, time: Series | None, scale: float = 1.0,
           ) -> tuple[float, float]:
    """Return rate over the derivative of a position, and their correlation."""
    count = min(len(rate), len(position))
    t = np.arange(count, dtype=float) if time is None else scale * time.values[:count]
    known = np.isfinite(rate[:count]) & np.isfinite(position[:count]) & np.isfinite(t)
    known &= np.concatenate([[True], np.diff(t) > 0])
    if known.sum() < 8:
        return math.nan, math.nan
    derivative, rate = np.gradient(position[:count][known], t[known]), rate[:count][known]
    size = float(np.linalg.norm(derivative) * np.linalg.norm(rate))
    if not size > 0:
        return math.nan, math.nan
    product = float(derivative @ rate)
    return product / float(derivative @ derivative), product / size


# ------------------------------------------------------------------------------------ units


def _scale(title: str, quantity: str) -> float | None:
    known = SCALES.get(quantity, {})
    return next((known[word] for word in words_of(title) if word in known), None)


def _judge_units(
    columns: dict[tuple[str, str], Column], scales: dict[tuple[str, str], float],
    series: dict[Column, Series], limits: dict[str, float], time: Series | None,
    time_scale: float | None, notes: list[str],
) -> None:
    """Tell degrees by limits, and velocities in other units than positions by derivatives."""
    positions = {joint: series[column].values for (joint, kind), column in columns.items()
                 if kind == POSITION}
    beyond = {joint: float(np.nanmax(np.abs(values))) for joint, values in positions.items()
              if np.isfinite(limits[joint])
              and np.nanmax(np.abs(values)) > BEYOND * max(limits[joint], math.pi)}
    if beyond and not any(kind == POSITION for _, kind in scales):
        joint = max(beyond, key=lambda one: beyond[one])
        for each in positions:
            if np.isfinite(limits[each]):
                scales[each, POSITION] = math.pi / 180
        notes.append(f'{joint} reaches {beyond[joint]:.4g}, beyond its limit of '
                     f'{limits[joint]:.4g} rad: positions taken as degrees')
    for joint, values in positions.items():
        column = columns.get((joint, VELOCITY))
        factor = scales.get((joint, POSITION), 1.0)
        if column is None or factor == 1 or (joint, VELOCITY) in scales:
            continue
        ratio, alike = _slope(series[column].values, values, time, time_scale or 1.0)
        if alike > ALIKE:
            # Of degrees: 1 where velocities are in degrees, too, pi / 180 where they are not.
            scales[joint, VELOCITY] = (1.0 if abs(math.log(ratio / factor)) < abs(math.log(ratio))
                                       else factor)
