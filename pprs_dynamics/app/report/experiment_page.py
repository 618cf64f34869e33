# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The page of a designed experiment: the motion, its use of the limits, and what it promises."""

from __future__ import annotations

from typing import Any

from pprs_dynamics.app.report.comparison_figures import LEGEND, LINES, SECONDS, thinned
from pprs_dynamics.app.report.experiment_tables import (
    ACCURACY_HEADINGS,
    CONTEST_HEADINGS,
    accuracy_rows,
    contest_rows,
    limit_rows,
)
from pprs_dynamics.app.report.page import Page, plotly_objects
from pprs_dynamics.app.report.robot_view import animate_robot
from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import common_unit
from pprs_dynamics.inference.experiments.arm_motions import ArmExcitation
from pprs_dynamics.inference.experiments.next_experiment import Experiment
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.model.drive_model import DriveModel

Motion = PlatformMotion | JointMotion
POINTS = 500  # pairs of extremes shown of a curve


def experiment_page(experiment: Experiment, motion: Motion, command: str) -> Page:
    """Return the page, most important first.

    Parameters
    ----------
    experiment : Experiment
    motion : PlatformMotion or JointMotion
        As it is written.
    command : str
        That plays it; empty where there is none.
    """
    page = Page('The next experiment')
    page.text(experiment.text, 'lead')
    if experiment.contests:
        page.table(CONTEST_HEADINGS, contest_rows(experiment),
                   caption='What it would tell. Evidence is by how much the rival costs more in a '
                   'diagnosis of all recordings; the chance is that of the rival falling so far '
                   'behind that it is told as a rival no more.')
    if command:
        page.command('Play it, and record', command)
    if isinstance(motion, PlatformMotion):
        assert isinstance(experiment.model, DriveModel)
        page.figure(_platform(motion), 'The motion of the platform, from where it starts.',
                    over_time=True)
        with page.fold('The robot in motion'):
            page.figure(animate_robot(experiment.model, motion, 'The designed motion'),
                        'The designed motion; it plays on request.')
    with page.fold('Every drive'):
        page.figure(_drives(experiment, motion),
                    'Position, velocity, acceleration and effort of every drive.', over_time=True)
    with page.fold('Use of the limits'):
        page.figure(_limits(experiment), 'Use of every limit, of what the margin leaves of it; '
                    'checked at 500 Hz. Dashed: all of it.')
    if experiment.accuracies:
        with page.fold('How well numbers would be known'):
            page.table(ACCURACY_HEADINGS, accuracy_rows(experiment), caption='Standard '
                       'deviations; effects that may or may not be there each beside the model '
                       'alone. A number of an effect matters from the size in the fourth column; '
                       'for a number of the model that is what its tolerance says.')
    return page


def excitation_page(excitation: ArmExcitation) -> Page:
    """Return the page of an arm's first motion."""
    page = Page('The next experiment')
    page.text(excitation.text, 'lead')
    page.table(('limit', 'use'), [(name, f'{share:.0%}')
                                  for name, share in excitation.limits.items()])
    return page


def _platform(motion: PlatformMotion) -> Any:
    moved = motion.position - motion.position[0]
    return _stacked(motion, (
        ('position [m]', tuple(zip('xyz', moved.T, strict=True))),
        ('angle [rad]', (('tilt', motion.tilt), ('turn', motion.turn)))))


def _drives(experiment: Experiment, motion: Motion) -> Any:
    assert motion.time is not None
    forces = experiment.forces(motion.time)
    state = forces.mechanism
    return _stacked(motion, tuple(
        (f'{name} [{common_unit(experiment.model.units, unit).replace("^2", "²")}]',
         tuple(zip(experiment.model.drives, values.T, strict=True)))
        for name, unit, values in (
            ('position', 'm', state.position), ('velocity', 'm/s', state.velocity),
            ('acceleration', 'm/s^2', state.acceleration), ('effort', 'N', forces.total))))


def _stacked(motion: Motion, rows: tuple[tuple[str, tuple[tuple[str, Array], ...]], ...],
             ) -> Any:
    go = plotly_objects()
    from plotly.subplots import make_subplots

    assert motion.time is not None
    figure = make_subplots(rows=len(rows), cols=1, shared_xaxes=True, vertical_spacing=0.05)
    colours: dict[str, str] = {}
    for row, (label, curves) in enumerate(rows, start=1):
        for name, values in curves:
            time, shown = thinned(motion.time, values, points=POINTS)
            is_new = name not in colours
            colour = colours.setdefault(name, LINES[len(colours) % len(LINES)])
            figure.add_trace(go.Scatter(
                x=time, y=shown, name=name, mode='lines', legendgroup=name, showlegend=is_new,
                line={'color': colour, 'width': 1.3}), row=row, col=1)
        figure.update_yaxes(title_text=label, row=row, col=1)
    figure.update_xaxes(title_text='time [s]', row=len(rows), col=1, **SECONDS)
    figure.update_layout(height=170 * len(rows) + 80, legend=LEGEND,
                         margin={'l': 70, 'r': 15, 't': 40, 'b': 45})
    return figure


def _limits(experiment: Experiment) -> Any:
    go = plotly_objects()
    rows = limit_rows(experiment)[::-1]
    uses = [100 * experiment.limits[name] for name, _ in rows]
    figure = go.Figure(go.Bar(x=uses, y=[name for name, _ in rows], orientation='h',
                              marker_color=LINES[0], hovertemplate='%{y}: %{x:.0f} %'))
    figure.add_vline(x=100, line={'color': LINES[1], 'dash': 'dash'})
    figure.update_layout(height=70 + 20 * len(rows), xaxis_title='use [%]',
                         yaxis={'automargin': True, 'dtick': 1},
                         margin={'l': 10, 'r': 20, 't': 20, 'b': 45})
    return figure
