# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What changes in a fleet: every quantity of every robot over time, against itself and others.

A robot is changed where a quantity of it has a change that chance does not explain, at all of its
quantities together (Bonferroni). Effects are looked at before the model's own numbers, and these
before errors, which follow whatever else changes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pprs_dynamics.app.fleet.change_points import (
    NORMAL,
    ChangePoint,
    ChangePoints,
    find_change_points,
)
from pprs_dynamics.app.fleet.store import AUTO, OWN, Store
from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.catalogue import find_effect

# Share of robots with nothing wrong that may be flagged, with all their quantities together.
FALSE_ALARMS = 0.005
FIRST = 5  # recordings of a robot that it is compared with, and that are compared
LEAST_FLEET = 4  # robots from which on they are compared with each other
DAY = 86400.0  # [s]
ERRORS = {'rms': 'N', 'relative': '1', 'noise': 'N'}
QUANTILES = (0.025, 0.5, 0.975)


@dataclass(frozen=True)
class Quantity:
    """A tracked quantity: a parameter of an effect, a number of the model, or an error.

    Parameters
    ----------
    drive : str
        '' for the structure and the model's numbers.
    effect : str
        '' for errors.
    parameter : str
    unit : str
    """

    drive: str
    effect: str
    parameter: str
    unit: str = field(compare=False)

    @property
    def name(self) -> str:
        """As --limit takes it."""
        return (self.parameter if self.effect in ('', OWN)
                else f'{self.effect}.{self.parameter}')

    @property
    def label(self) -> str:
        """For people: drive and name."""
        return f'{self.drive}: {self.name}' if self.drive else self.name

    @property
    def rank(self) -> int:
        """0 for effects, 1 for the model's numbers, 2 for errors."""
        return 2 if not self.effect else 1 if self.effect == OWN else 0


@dataclass(frozen=True)
class Reach:
    """When a slope reaches a limit: (2.5 %, median, 97.5 %), [days since 1970]; inf for never."""

    limit: float
    times: tuple[float, float, float]


@dataclass(frozen=True)
class Trend:
    """A quantity of a robot over time.

    Parameters
    ----------
    robot : str
    quantity : Quantity
    time : (N,) array
        [days since 1970], ascending.
    value, std : (N,) arrays
    recordings : tuple of N str
        SHA-256.
    changes : ChangePoints
    flagged : bool
        True where the robot counts as changed by it.
    from_fleet, from_first : float
        Standard deviations from the fleet's median, and from the robot's own first recordings;
        NaN where there is nothing to compare with.
    reach : Reach, optional
    """

    robot: str
    quantity: Quantity
    time: Array
    value: Array
    std: Array
    recordings: tuple[str, ...]
    changes: ChangePoints
    flagged: bool
    from_fleet: float
    from_first: float
    reach: Reach | None = None

    @property
    def order(self) -> tuple[int, float]:
        """The first of a robot is what is told."""
        return (self.quantity.rank, -self.changes.statistic)


@dataclass(frozen=True)
class FleetTrends:
    """Trends of a store.

    Parameters
    ----------
    trends : tuple of Trend
    recordings : dict of str to mapping
        By SHA-256: recording, path, robot, time, conditions.
    errors : tuple of mapping
        Recordings without a result: robot, recording, error.
    left_out : int
        Results of other options, versions or models.
    options : str
    """

    trends: tuple[Trend, ...]
    recordings: Mapping[str, Mapping[str, Any]]
    errors: tuple[Mapping[str, Any], ...]
    left_out: int
    options: str

    @property
    def robots(self) -> tuple[str, ...]:
        """In order, numbers by their size."""
        return tuple(sorted({trend.robot for trend in self.trends}, key=_natural))

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """All that is followed: effects first."""
        return tuple(sorted({trend.quantity for trend in self.trends},
                            key=lambda q: (q.rank, q.name, q.drive)))

    def flagged(self, robot: str) -> list[Trend]:
        """Return what changed on a robot, what is told first."""
        return sorted((trend for trend in self.trends if trend.robot == robot and trend.flagged),
                      key=lambda trend: trend.order)


def fleet_trends(store: Store, limits: Mapping[str, float] | None = None) -> FleetTrends:
    """Return the trends of a store.

    Parameters
    ----------
    store : Store
    limits : mapping of str to float, optional
        By name of a quantity, [its unit]; for slopes the time is told at which it is reached.

    Raises
    ------
    UnreadableFileError
        Where there is no store.
    """
    table = store.read(('robot', 'recording', 'path', 'sha256', 'time', 'model', 'options',
                        'version', 'drive', 'effect', 'parameter', 'value', 'std', 'unit', 'rms',
                        'relative', 'noise', 'conditions', 'error'))
    rows = _Rows(table)
    series = rows.series()
    per_robot = Counter(robot for robot, _ in series)
    trends = []
    spreads = _fleet_levels(series)
    for (robot, quantity), values in series.items():
        time, value = values.time, values.value
        changes = find_change_points(time, value, FALSE_ALARMS / per_robot[robot])
        level, spread = spreads.get(quantity, (np.nan, np.nan))
        trends.append(Trend(
            robot, quantity, time, value, values.std, values.recordings, changes,
            bool(changes.found),
            _deviations(float(np.median(value[-FIRST:])) - level, spread),
            _from_first(value, changes.scatter if not changes.found else _noise(value)),
            _reach(changes, time, value, (limits or {}).get(quantity.name))))
    return FleetTrends(tuple(trends), rows.recordings, tuple(rows.errors), rows.left_out,
                       rows.options)


@dataclass(frozen=True)
class _Values:
    time: Array
    value: Array
    std: Array
    recordings: tuple[str, ...]


class _Rows:
    """A store's table, as columns of numpy; only what goes together is used."""

    def __init__(self, table: Any) -> None:
        get = {name: table.column(name) for name in table.column_names}
        text = {name: np.array([one or '' for one in get[name].to_pylist()], dtype=object)
                for name in ('robot', 'recording', 'path', 'sha256', 'model', 'options', 'version',
                             'drive', 'effect', 'parameter', 'unit', 'error')}
        self.text = text
        self.time = np.asarray(get['time'].cast('int64').to_numpy(), float) / (1e6 * DAY)
        self.numbers = {name: np.asarray(get[name].to_numpy(), dtype=float)
                        for name in ('value', 'std', *ERRORS)}
        bad = text['error'] != ''
        self.errors = [{'robot': text['robot'][k], 'recording': text['recording'][k],
                        'path': text['path'][k], 'error': text['error'][k]}
                       for k in np.flatnonzero(bad)]
        self.options, self.used, self.left_out = self._selected(~bad)
        conditions = get['conditions']
        self.recordings: dict[str, dict[str, Any]] = {}
        for k in np.flatnonzero(self.used):
            if text['sha256'][k] not in self.recordings:
                self.recordings[text['sha256'][k]] = {
                    'recording': text['recording'][k], 'path': text['path'][k],
                    'robot': text['robot'][k], 'time': float(self.time[k]),
                    'conditions': dict(conditions[int(k)].as_py() or ())}

    def _selected(self, good: Any) -> tuple[str, Any, int]:
        """Return options, rows in use, and how many results are left out.

        Values of other options or versions are other quantities; so are those of another model.
        """
        text = self.text
        results = {(r, s, m, o, v) for r, s, m, o, v in zip(
            *(text[name][good] for name in ('robot', 'sha256', 'model', 'options', 'version')),
            strict=True)}
        if not results:
            return '', good, 0
        (options, version), _ = max(Counter((o, v) for *_, o, v in results).items(),
                                    key=lambda item: (item[1], item[0]))
        models: dict[str, Counter[str]] = {}
        for robot, _, model, o, v in results:
            if (o, v) == (options, version):
                models.setdefault(robot, Counter())[model] += 1
        chosen = {robot: max(one.items(), key=lambda item: (item[1], item[0]))[0]
                  for robot, one in models.items()}
        mine = np.array([chosen.get(robot) == model for robot, model
                         in zip(text['robot'], text['model'], strict=True)], dtype=bool)
        used = good & (text['options'] == options) & (text['version'] == version) & mine
        kept = sum((o, v) == (options, version) and chosen[r] == m for r, _, m, o, v in results)
        return options, used, len(results) - kept

    def series(self) -> dict[tuple[str, Quantity], _Values]:
        """Return values by robot and quantity, in order of time."""
        gathered: dict[tuple[str, Quantity], list[tuple[float, float, float, str]]] = {}
        every: dict[str, dict[str, float]] = {}
        for robot, quantity, time, value, std, sha256 in self._values():
            every.setdefault(robot, {})[sha256] = time
            if np.isfinite(value):
                gathered.setdefault((robot, quantity), []).append((time, value, std, sha256))
        if self.options == AUTO:
            _add_absent(gathered, every)
        found = {}
        for key, values in gathered.items():
            values.sort(key=lambda one: one[0])
            time, value, std = np.array([one[:3] for one in values], dtype=float).T
            found[key] = _Values(time, value, std, tuple(one[3] for one in values))
        return found

    def _values(self) -> Iterator[tuple[str, Quantity, float, float, float, str]]:
        text, numbers = self.text, self.numbers
        for k in np.flatnonzero(self.used):
            place = text['robot'][k]
            if text['effect'][k]:
                quantity = Quantity(text['drive'][k], text['effect'][k], text['parameter'][k],
                                    text['unit'][k])
                yield (place, quantity, self.time[k], numbers['value'][k], numbers['std'][k],
                       text['sha256'][k])
            else:
                for name, unit in ERRORS.items():
                    yield (place, Quantity(text['drive'][k], '', name, unit), self.time[k],
                           numbers[name][k], np.nan, text['sha256'][k])


def _add_absent(gathered: dict[tuple[str, Quantity], list[tuple[float, float, float, str]]],
                every: Mapping[str, Mapping[str, float]]) -> None:
    """Add 0 for effects that a diagnosis did not find, where 0 means that they are not there."""
    for (robot, quantity), found in gathered.items():
        effect = find_effect(quantity.effect) if quantity.rank == 0 else None
        if effect is not None and quantity.parameter in {p.name for p in effect.linear}:
            known = {one[3] for one in found}
            found += [(time, 0.0, np.nan, sha256) for sha256, time in every[robot].items()
                      if sha256 not in known]


def _fleet_levels(series: Mapping[tuple[str, Quantity], _Values],
                  ) -> dict[Quantity, tuple[float, float]]:
    """Return median and robust standard deviation over robots, by quantity."""
    levels: dict[Quantity, list[float]] = {}
    for (_, quantity), values in series.items():
        levels.setdefault(quantity, []).append(float(np.median(values.value[-FIRST:])))
    found = {}
    for quantity, values_of in levels.items():
        if len(values_of) >= LEAST_FLEET:
            middle = float(np.median(values_of))
            spread = NORMAL * float(np.median(np.abs(np.array(values_of) - middle)))
            found[quantity] = (middle, spread)
    return found


def _noise(value: Array) -> float:
    steps = np.diff(value) / 2 ** 0.5
    return NORMAL * float(np.median(np.abs(steps - np.median(steps))))


def _from_first(value: Array, scatter: float) -> float:
    """Return how far the last recordings lie from the first, in deviations of single ones."""
    if len(value) < 2 * FIRST:
        return float('nan')
    return _deviations(float(np.median(value[-FIRST:]) - np.median(value[:FIRST])), scatter)


def _deviations(difference: float, spread: float) -> float:
    return difference / spread if spread > 0 and np.isfinite(difference) else float('nan')


def _reach(changes: ChangePoints, time: Array, value: Array, limit: float | None) -> Reach | None:
    """Return when a slope reaches a limit; None without one, or where it is reached already."""
    if limit is None or not changes.found or changes.found[0].kind != 'slope':
        return None
    day, slope, level = changes.draws.T
    now = level + slope * (time[-1] - day)
    ahead = (limit - np.median(now)) * np.median(slope) > 0
    if not ahead:
        return None
    with np.errstate(divide='ignore', invalid='ignore'):
        days = np.where((limit - now) * slope > 0, (limit - now) / slope, np.inf)
    low, middle, high = (float(time[-1] + q) for q in np.quantile(days, QUANTILES, method='lower'))
    return Reach(limit, (low, middle, high))


def _natural(name: str) -> tuple[Any, ...]:
    digits = ''.join(c for c in name if c.isdigit())
    return (''.join(c for c in name if not c.isdigit()), int(digits or 0), name)


def main_change(trend: Trend) -> ChangePoint:
    """Return the change that is told of a flagged trend: the largest."""
    return max(trend.changes.found, key=lambda one: abs(one.size) / max(one.size_std, 1e-300))
