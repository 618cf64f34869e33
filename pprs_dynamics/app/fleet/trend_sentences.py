# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Sentences of trends: what changed, since when, by how much, and when a limit is reached."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from pprs_dynamics.app.fleet.trend import FleetTrends, Trend, main_change
from pprs_dynamics.system.plain_text import counted

MONTH = 30.0  # [days], for slopes
APART = 6.0  # standard deviations from the fleet's median beyond which a robot is mentioned
MOST_APART = 5
FAR = 3650.0  # [days]; a limit that is farther away is not reached
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def date(days: float) -> str:
    """Return a day since 1970 as a date."""
    return (EPOCH + timedelta(days=days)).strftime('%Y-%m-%d')


def value_text(value: float, uncertainty: float, unit: str) -> str:
    """Return a value with as many digits as its uncertainty allows."""
    shown = '' if unit == '1' else f' {unit}'
    if not np.isfinite(uncertainty) or uncertainty <= 0:
        return f'{value:.3g}{shown}'
    digits = max(0, 1 - int(np.floor(np.log10(uncertainty))))
    if digits > 5:
        return f'({value * 10 ** (digits - 1):.1f} ± {uncertainty * 10 ** (digits - 1):.1f})e-' \
               f'{digits - 1:02d}{shown}'
    return f'{value:.{digits}f} ± {uncertainty:.{digits}f}{shown}'


def change_text(trend: Trend) -> str:
    """Return what a flagged trend does, without robot and place."""
    change, unit = main_change(trend), trend.quantity.unit
    day = date(change.time)
    # A date without its uncertainty would be believed to the day.
    about = f' (± {2 * change.time_std:.0f} days)' if change.time_std >= 0.75 else ''
    if change.kind == 'slope':
        verb = 'grows' if change.size > 0 else 'falls'
        size = value_text(abs(change.size) * MONTH, 2 * change.size_std * MONTH, unit)
        return f'{verb} by {size} per month since {day}{about}'
    size = value_text(abs(change.size), 2 * change.size_std, unit)
    again = len(trend.changes.found) - 1
    others = f', and {again} more step{"s" * (again > 1)}' if again else ''
    return f'{"rises" if change.size > 0 else "drops"} by {size} on {day}{about}{others}'


def reach_text(trend: Trend) -> str:
    """Return when the limit is reached, as a further clause; empty without one."""
    if trend.reach is None:
        return ''
    low, middle, high = (one - trend.time[-1] for one in trend.reach.times)
    limit = f'; limit {trend.reach.limit:g} {trend.quantity.unit}'
    if not middle < FAR:
        return f'{limit} not within {FAR / 365:.0f} years'
    first, about, last = _span(low), _span(middle), _span(high) if high < FAR else 'more'
    around = '' if first == about == last else f' ({first} to {last})'
    return f'{limit} in about {about}{around}'


def _span(days: float) -> str:
    if days < 14:
        return f'{days:.0f} days'
    return f'{days / 7:.0f} weeks' if days < 120 else f'{days / MONTH:.0f} months'


def together(first: Trend, others: Sequence[Trend]) -> tuple[list[Trend], list[Trend]]:
    """Return trends that change with the first within their uncertainties, and all others."""
    at = main_change(first)
    with_it: list[Trend] = []
    apart: list[Trend] = []
    for trend in others:
        other = main_change(trend)
        reach = 3 * float(np.hypot(at.time_std, other.time_std)) + 1.0
        same = abs(other.time - at.time) <= reach or trend.quantity.rank == 2
        (with_it if same else apart).append(trend)
    return with_it, apart


def robot_text(robot: str) -> str:
    """Return a robot's name as it stands in sentences."""
    return robot if robot.lower().startswith('robot') else f'robot {robot}'


def sentences(fleet: FleetTrends) -> list[str]:
    """Return the sentences about a fleet, the most certain change first."""
    return list(_sentences(fleet))


def _sentences(fleet: FleetTrends) -> Iterator[str]:
    changed = [(robot, found) for robot in fleet.robots if (found := fleet.flagged(robot))]
    changed.sort(key=lambda one: one[1][0].order)
    for _, (first, *others) in changed:
        with_it, apart = together(first, others)
        more = f' ({len(with_it)} other quantities change with it)' if len(with_it) > 1 else (
            f' ({with_it[0].quantity.label} changes with it)' if with_it else '')
        yield f'{_place(first)} {change_text(first)}{reach_text(first)}{more}'
        for other in apart[:1]:
            yield f'{_place(other)} {change_text(other)}{reach_text(other)}'
    if not changed:
        yield f'No change on {counted(len(fleet.robots), "robot")}.'
    yield from _lying_apart(fleet, {robot for robot, _ in changed})
    if fleet.errors:
        yield f'{counted(len(fleet.errors), "recording")} gave no result.'
    if fleet.left_out:
        yield (f'{counted(fleet.left_out, "result")} of other options, models or versions left '
               f'out; these are of --effects {fleet.options}.')


def _lying_apart(fleet: FleetTrends, changed: set[str]) -> Iterator[str]:
    """Yield effects in which robots that did not change differ from all others."""
    apart = [trend for trend in fleet.trends if trend.robot not in changed
             and trend.quantity.rank == 0 and abs(trend.from_fleet) > APART]
    apart.sort(key=lambda trend: -abs(trend.from_fleet))
    for trend in apart[:MOST_APART]:
        last = float(np.median(trend.value[-5:]))
        yield (f'{_place(trend)} is {value_text(last, np.nan, trend.quantity.unit)}, '
               f'{abs(trend.from_fleet):.0f} standard deviations '
               f'{"above" if trend.from_fleet > 0 else "below"} the fleet\'s median')


def _place(trend: Trend) -> str:
    drive = f', {trend.quantity.drive}' if trend.quantity.drive else ''
    return f'{robot_text(trend.robot)}{drive}: {trend.quantity.name}'


def to_dict(fleet: FleetTrends) -> dict[str, Any]:
    """Return the trends as data for JSON."""
    return {
        'sentences': sentences(fleet), 'options': fleet.options, 'robots': list(fleet.robots),
        'errors': [dict(one) for one in fleet.errors], 'left_out': fleet.left_out,
        'changes': [
            {'robot': trend.robot, 'drive': trend.quantity.drive or None,
             'effect': trend.quantity.effect or None, 'parameter': trend.quantity.parameter,
             'unit': trend.quantity.unit, 'rank': rank,
             'probability': trend.changes.probability, 'statistic': trend.changes.statistic,
             'limit': None if trend.reach is None else trend.reach.limit,
             'limit_reached': None if trend.reach is None else [
                 date(one) if one < FAR * 10 else None for one in trend.reach.times],
             'changes': [{'kind': one.kind, 'date': date(one.time), 'day': one.time,
                          'day_std': one.time_std, 'size': one.size, 'size_std': one.size_std,
                          'level': one.level} for one in trend.changes.found]}
            for robot in fleet.robots for rank, trend in enumerate(fleet.flagged(robot))],
        'deviations': [
            {'robot': trend.robot, 'drive': trend.quantity.drive or None,
             'quantity': trend.quantity.name, 'from_fleet': trend.from_fleet,
             'from_first': trend.from_first} for trend in fleet.trends]}
