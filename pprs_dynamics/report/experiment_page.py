# Copyright 2026 The pprs_dynamics founders
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The page of a designed experiment: the motion, its use of the limits, and what it promises."""

from __future__ import annotations

from typing import Any

import numpy as np

from pprs_dynamics.experiments.next_experiment import Experiment
from pprs_dynamics.mechanism.motion import PlatformMotion
from pprs_dynamics.mechanism.robot import DRIVES
from pprs_dynamics.report.comparison_figures import LINES
from pprs_dynamics.report.experiment_tables import (
    ACCURACY_HEADINGS,
    CONTEST_HEADINGS,
    accuracy_rows,
    contest_rows,
    limit_rows,
)
from pprs_dynamics.report.page import Page, plotly_objects
from pprs_dynamics.report.robot_view import animate_robot


def experiment_page(experiment: Experiment, motion: PlatformMotion) -> Page:
    """Return the page, most important first.

    Parameters
    ----------
    experiment : Experiment
    motion : PlatformMotion
        As it is written.
    """
    page = Page('The next experiment')
    page.text(experiment.text, 'lead')
    if experiment.contests:
        page.heading('What it would tell')
        page.text('Evidence is by how much the rival costs more in a diagnosis of all recordings; '
                  'the chance is that of the rival falling so far behind that it is told as a '
                  'rival no more.', 'note')
        page.table(CONTEST_HEADINGS, contest_rows(experiment))
    page.heading('The motion')
    page.figure(animate_robot(experiment.model, motion, 'The designed motion'))
    page.figure(_platform(motion))
    page.figure(_drives(experiment, motion))
    page.heading('Use of the limits')
    page.text('Of what the margin leaves of each limit; checked at 500 Hz.', 'note')
    page.figure(_limits(experiment))
    if experiment.accuracies:
        page.heading('How well numbers would be known')
        page.text('Standard deviations; effects that may or may not be there each beside the '
                  'model alone. A number of an effect matters from the size in the fourth column; '
                  'for a number of the model that is what its tolerance says.', 'note')
        page.table(ACCURACY_HEADINGS, accuracy_rows(experiment))
    return page


def _platform(motion: PlatformMotion) -> Any:
    moved = motion.position - motion.position[0]
    return _stacked(motion, (
        ('position from the start [m]', tuple(zip('xyz', moved.T, strict=True))),
        ('tilt and turn [rad]', (('tilt', motion.tilt), ('turn', motion.turn))),
        ('angular velocity [rad/s]', tuple(zip(('about x', 'about y', 'about z'),
                                               motion.angular_velocity.T, strict=True)))),
        'The platform')


def _drives(experiment: Experiment, motion: PlatformMotion) -> Any:
    assert motion.time is not None
    forces = experiment.forces(motion.time)
    state = forces.mechanism
    return _stacked(motion, tuple(
        (label, tuple(zip(DRIVES, values.T, strict=True))) for label, values in (
            ('position [m]', state.position), ('velocity [m/s]', state.velocity),
            ('acceleration [m/s²]', state.acceleration), ('effort of the model [N]',
                                                          forces.total))), 'The drives')


def _stacked(motion: PlatformMotion, rows: Any, title: str) -> Any:
    go = plotly_objects()
    from plotly.subplots import make_subplots

    figure = make_subplots(rows=len(rows), cols=1, shared_xaxes=True, vertical_spacing=0.04)
    for row, (label, curves) in enumerate(rows, start=1):
        for (name, values), colour in zip(curves, LINES, strict=False):
            figure.add_trace(go.Scatter(
                x=motion.time, y=np.asarray(values), name=name, mode='lines', legendgroup=name,
                showlegend=title != 'The drives' or row == 1,
                line={'color': colour, 'width': 1.3}), row=row, col=1)
        figure.update_yaxes(title_text=label, row=row, col=1)
    figure.update_xaxes(title_text='time [s]', row=len(rows), col=1)
    figure.update_layout(template='plotly_white', height=190 * len(rows) + 90, title=title,
                         margin={'l': 70, 'r': 20, 't': 50, 'b': 45})
    return figure


def _limits(experiment: Experiment) -> Any:
    go = plotly_objects()
    rows = limit_rows(experiment)[::-1]
    uses = [100 * experiment.limits[name] for name, _ in rows]
    figure = go.Figure(go.Bar(x=uses, y=[name for name, _ in rows], orientation='h',
                              marker_color=LINES[0]))
    figure.add_vline(x=100, line={'color': LINES[1], 'dash': 'dash'})
    figure.update_layout(template='plotly_white', height=70 + 20 * len(rows),
                         xaxis_title='use [%]', margin={'l': 190, 'r': 20, 't': 20, 'b': 45})
    return figure
