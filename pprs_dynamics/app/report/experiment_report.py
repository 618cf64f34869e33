# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A designed experiment: the motion, its use of the limits, and what it promises."""

from __future__ import annotations

from typing import Any

from pprs_dynamics.app.report import charts
from pprs_dynamics.app.report.page import Page
from pprs_dynamics.app.report.terminal import PlainTable, escape, stacked, titled_table
from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import common_unit
from pprs_dynamics.inference.experiments.next_experiment import Experiment
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.motion import PlatformMotion

Motion = PlatformMotion | JointMotion
Rows = dict[str, dict[str, Array]]  # curves by quantity and name
MOST_SHOWN, MOST_LIMITS = 12, 6
HIGH = 0.5  # use of a limit, from which on it is shown


def contests_table(experiment: Experiment) -> PlainTable:
    """Return pairs of effects with their evidence, now and expected."""
    return ('if the truth is', 'and the rival', 'now', 'expected', 'chance'), [
        (contest.truth, contest.rival, f'{contest.evidence_now:.0f}',
         f'{contest.expected_evidence:.0f}', f'{contest.probability:.0%}')
        for contest in experiment.contests]


def accuracies_table(experiment: Experiment) -> PlainTable:
    """Return numbers with their standard deviations, before and after."""
    return ('parameter', 'std now', 'std after', 'relevant from', 'unit'), [
        (accuracy.label, _number(accuracy.std_before), _number(accuracy.std_after),
         f'{accuracy.scale:.3g}', accuracy.unit)
        for accuracy in experiment.accuracies]


def limit_rows(experiment: Experiment) -> list[tuple[str, str]]:
    """Return every limit with its use, the fullest first."""
    ranked = sorted(experiment.limits.items(), key=lambda item: -item[1])
    return [(name, f'{100 * use:.0f} %') for name, use in ranked]


def _number(value: float) -> str:
    return 'unknown' if value == float('inf') else f'{value:.3g}'


def experiment_view(experiment: Experiment) -> Any:
    """Return what a motion is for, what it promises, and which limits it uses."""
    parts: list[Any] = [f'[bold]{escape(experiment.text)}[/]']
    if experiment.contests:
        parts.append(titled_table('Evidence, now and expected', contests_table(experiment),
                                  right=()))
    if experiment.accuracies:
        headings, rows = accuracies_table(experiment)
        parts.append(titled_table('Standard deviations of parameters, now and after this motion',
                                  (headings, rows[:MOST_SHOWN]), right=(1, 2, 3)))
        if len(rows) > MOST_SHOWN:
            parts.append(f'… and {len(rows) - MOST_SHOWN} more, in --json')
    used = [row for row in limit_rows(experiment) if float(row[1].rstrip(' %')) >= 100 * HIGH]
    parts.append('Use of the limits: ' + ', '.join(
        f'{name} {share}' for name, share in used[:MOST_LIMITS]) + '; all others less.')
    return stacked(*parts)


def experiment_page(experiment: Experiment, motion: Motion) -> Page:
    """Return the page, most important first.

    Parameters
    ----------
    experiment : Experiment
    motion : PlatformMotion or JointMotion
        Sampled as in the file.
    """
    assert motion.time is not None
    page = Page('The next experiment')
    page.text(experiment.text, 'lead')
    if experiment.contests:
        page.table(*contests_table(experiment),
                   caption='Evidence is the cost of the rival minus that of the truth, in a '
                   'diagnosis of all recordings. The chance is that of the rival no longer '
                   'being reported.')
    if isinstance(motion, PlatformMotion):
        page.figure(charts.stacked(motion.time, platform_rows(motion)),
                    'The motion of the platform, from where it starts.', over_time=True)
    with page.fold('Every drive'):
        page.figure(charts.stacked(motion.time, drive_rows(experiment, motion)),
                    'Position, velocity, acceleration and effort of every drive.', over_time=True)
    with page.fold('Use of the limits'):
        page.table(('limit', 'use'), limit_rows(experiment),
                   caption='Share of each limit, less a margin, that the motion uses; checked at '
                   '500 Hz.')
    if experiment.accuracies:
        with page.fold('How well parameters would be known'):
            page.table(*accuracies_table(experiment), caption='Standard '
                       'deviations (std). Each uncertain effect is fitted alone with the model. '
                       'A parameter is relevant from the size in the fourth column on; for '
                       'numbers of the model this is their tolerance.')
    return page


def platform_rows(motion: PlatformMotion) -> Rows:
    """Return position and orientation of the platform over time, from where it starts."""
    return {'position [m]': dict(zip('xyz', (motion.position - motion.position[0]).T,
                                     strict=True)),
            'angle [rad]': {'tilt': motion.tilt, 'turn': motion.turn}}


def drive_rows(experiment: Experiment, motion: Motion) -> Rows:
    """Return position, velocity, acceleration and effort of every drive over time."""
    assert motion.time is not None
    forces = experiment.forces(motion.time)
    state, model = forces.mechanism, experiment.model
    return {f'{name} [{common_unit(model.units, unit).replace("^2", "²")}]':
            dict(zip(model.drives, values.T, strict=True))
            for name, unit, values in (
                ('position', 'm', state.position), ('velocity', 'm/s', state.velocity),
                ('acceleration', 'm/s^2', state.acceleration), ('effort', 'N', forces.total))}
