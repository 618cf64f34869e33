# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Trend of a store: quantities of robots that change in steps, found by ruptures.

A step is reported if it lowers the sum of squares, in units of the scatter from recording to
recording, by more than 2 ln(N S / 0.01) for S series of N recordings. Chance alone then reports a
step in about one of a hundred stores. A slow change is reported as one or more steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pprs_dynamics.app.fleet.recordings import AUTO, MODEL, pandas, read_rows
from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import optional_library
from pprs_dynamics.inference.diagnosis.quantities import in_unit, with_uncertainty
from pprs_dynamics.physics.effects.catalogue import find_effect
from pprs_dynamics.system.json_records import JsonRecord
from pprs_dynamics.system.plain_text import counted, displayed

FALSE_ALARMS = 0.01  # stores in which nothing changes and a step is reported
LEAST_RECORDINGS, LEAST_SEGMENT = 8, 3  # of a series, and before and after a step
NORMAL = 1.4826  # standard deviation over median absolute deviation of Gaussian noise
ROUNDING = 1e-6  # relative scatter below which a series is a constant
QUANTITY = ['robot', 'drive', 'effect', 'parameter', 'unit']
SAME = ['model', 'options', 'version']  # rows that differ in these are different series


@dataclass(frozen=True)
class TrendStep:
    """A step of a quantity.

    Parameters
    ----------
    time : str
        Time of the first recording after it, ISO 8601.
    before, after, std : float
        Mean values, and the standard deviation of their difference.
    """

    time: str
    before: float
    after: float
    std: float


@dataclass(frozen=True, eq=False)
class Trend(JsonRecord):
    """A quantity of a robot over time.

    Parameters
    ----------
    robot, drive, effect, parameter, unit : str
        '' for a drive or an effect that it does not have.
    time, value : (N,) arrays
    steps : tuple of TrendStep
        In order.
    """

    json_keys = ('robot', 'drive', 'effect', 'parameter', 'unit', 'steps')

    robot: str
    drive: str
    effect: str
    parameter: str
    unit: str
    time: Any
    value: Array
    steps: tuple[TrendStep, ...]

    @property
    def name(self) -> str:
        """Drive, effect and parameter in words."""
        known = (self.drive, '' if self.effect == MODEL else self.effect, self.parameter)
        return ' '.join(filter(None, known))

    @property
    def text(self) -> str:
        """The steps in a sentence."""
        steps = '; '.join(f'{step.time[:10]}: {in_unit(step.before, self.unit)} → '
                          f'{with_uncertainty(step.after, step.std, self.unit)}'
                          for step in self.steps)
        return f'{displayed(self.robot)}, {self.name}: {steps}'


@dataclass(frozen=True)
class FleetTrends(JsonRecord):
    """All trends of a store.

    Parameters
    ----------
    trends : tuple of Trend
    refused : dict of str to str
        Recordings without a result, with the reason.
    """

    json_keys = ('robots', 'changes', 'refused', 'text')

    trends: tuple[Trend, ...]
    refused: dict[str, str]

    @property
    def changes(self) -> list[Trend]:
        """Trends with steps, the clearest first."""
        return sorted((trend for trend in self.trends if trend.steps), key=lambda trend: -max(
            abs(step.after - step.before) / max(step.std, 1e-300) for step in trend.steps))

    @property
    def robots(self) -> list[str]:
        """Names of the robots."""
        return sorted({trend.robot for trend in self.trends})

    @property
    def text(self) -> list[str]:
        """Changes, one sentence for each quantity."""
        sentences = ([trend.text for trend in self.changes]
                     or [f'No change on {counted(len(self.robots), "robot")}.'])
        if self.refused:
            sentences.append(f'{counted(len(self.refused), "recording")} gave no result.')
        return sentences


def fleet_trends(store: str) -> FleetTrends:
    """Return the trends of a store of `pprs survey`.

    Raises
    ------
    UnreadableFileError
        If there is no store.
    """
    rows = read_rows(store)
    refused = rows[rows.error.notna()]
    rows = rows[rows.error.isna()]
    errors = rows[rows.effect.isna()].assign(parameter='rms', value=rows.rms, unit='')
    values = pandas().concat([rows[rows.effect.notna()], errors]).dropna(subset='value')
    values = values.fillna({'drive': '', 'effect': '', 'parameter': '', 'unit': ''})
    times = {key: group.groupby('sha256').time.first()
             for key, group in rows.groupby(['robot', *SAME])}
    groups = list(values.groupby([*SAME, *QUANTITY]))
    trends = []
    for (model, options, version, *names), entry in groups:
        robot, drive, effect, parameter, unit = names
        series = entry.set_index('sha256').value
        series = series[~series.index.duplicated()]
        when = times[robot, model, options, version]
        if options == AUTO and _is_strength(effect, parameter):
            series = series.reindex(when.index, fill_value=0.0)  # not found means not there
        when = when[series.index].sort_values()
        value = series[when.index].to_numpy(float)
        trends.append(Trend(robot, drive, effect, parameter, unit, when, value,
                            find_steps(when, value, len(groups))))
    return FleetTrends(tuple(trends), dict(zip(refused.path, refused.error, strict=True)))


def _is_strength(effect: str, parameter: str) -> bool:
    found = find_effect(effect) if effect not in ('', MODEL) else None
    return found is not None and parameter in {linear.name for linear in found.linear}


def find_steps(time: Any, value: Array, series: int = 1) -> tuple[TrendStep, ...]:
    """Return the steps of a series.

    Parameters
    ----------
    time : (N,) pandas Series
        Ascending.
    value : (N,) array
    series : int
        How many are looked at.
    """
    library = optional_library('ruptures', 'ruptures', 'finding changes', 'fleet')
    changes = np.diff(value) / 2 ** 0.5
    scatter = (NORMAL * float(np.median(np.abs(changes - np.median(changes))))
               if len(value) > 1 else 0.0)
    count = len(value)
    if count < LEAST_RECORDINGS or scatter <= ROUNDING * float(np.abs(value).max()):
        return ()
    penalty = 2 * np.log(count * series / FALSE_ALARMS)
    search = library.KernelCPD(kernel='linear', min_size=LEAST_SEGMENT)
    places = search.fit(value[:, None] / scatter).predict(pen=penalty)
    parts = np.split(value, places[:-1])
    return tuple(
        TrendStep(time.iloc[place].isoformat(), float(before.mean()), float(after.mean()),
                  scatter * (1 / len(before) + 1 / len(after)) ** 0.5)
        for place, before, after in zip(places, parts, parts[1:], strict=False))
