# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The robot drawn in three dimensions as it moves, and where it is weak.

A rod of the 3-PPRS is weak where it lies flat: its drives then move the platform much with little,
and forces grow as 1 / sin u_i. Rods are coloured by abs(sin u_i); the title gives the conditioning.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pprs_dynamics.app.report.charts import plotly_objects
from pprs_dynamics.app.report.page import Page
from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.force_model import ForceModel
from pprs_dynamics.physics.model.skeleton import DRIVE, GUIDE, LINK, Line, Skeleton

FRAMES = 60
SLIDE, LIFT, PLATFORM, PATH, ROD = '#0072B2', '#009E73', '#E69F00', '#999999', '#777777'
# Flat rods red, upright ones dark blue; readable for colour-blind eyes.
WEAKNESS = [[0.0, '#B2182B'], [0.35, '#F4A582'], [0.7, '#4393C3'], [1.0, '#053061']]


def animate_robot(model: ForceModel, motion: PlatformMotion | JointMotion,
                  title: str) -> Any:
    """Return a Plotly figure of the robot moving, with a play button and a slider.

    Parameters
    ----------
    model : ForceModel
    motion : PlatformMotion or JointMotion
        Thinned to 60 poses.
    title : str
    """
    go = plotly_objects()
    shown = motion[np.unique(np.linspace(0, len(motion) - 1, FRAMES).astype(int))]
    drawn = Skeleton.of(model, shown)
    sines, captions = _weakness(model, shown)
    fixed = [_lines(go, path, PATH, 'path of the platform', 2)
             for path in ([motion.position] if isinstance(motion, PlatformMotion) else [])]
    moving = _moving(go, drawn, sines, 0)
    first = len(fixed)
    figure = go.Figure(
        data=[*fixed, *moving],
        frames=[go.Frame(data=_moving(go, drawn, sines, k), name=str(k),
                         traces=list(range(first, first + len(moving))),
                         layout={'title': {'text': f'{title}<br><sub>{captions[k]}</sub>'}})
                for k in range(len(shown))])
    times = shown.time if shown.time is not None else np.arange(len(shown))
    figure.update_layout(
        title=f'{title}<br><sub>{captions[0]}</sub>', template='plotly_white', height=760,
        legend={'orientation': 'h', 'x': 0.0, 'y': 1.0, 'yanchor': 'top'},
        margin={'l': 0, 'r': 0, 't': 70, 'b': 70},
        scene={'aspectmode': 'data', 'domain': {'y': [0.1, 0.86]},
               'camera': {'eye': {'x': 1.4, 'y': -1.4, 'z': 0.75}},
               'xaxis_title': 'x [m]', 'yaxis_title': 'y [m]', 'zaxis_title': 'z [m]'},
        updatemenus=[{
            'type': 'buttons', 'x': 0.0, 'xanchor': 'left', 'y': 0.06, 'direction': 'right',
            'showactive': False,
            'buttons': [_button('Play', None, 60), _button('Pause', [None], 0)]}],
        sliders=[{'x': 0.36, 'len': 0.64, 'y': 0.06, 'currentvalue': {'prefix': 'time [s] '},
                  'steps': [_step(f'{time:.2f}', k) for k, time in enumerate(times)]}])
    return figure


def robot_page(model: ForceModel, motion: PlatformMotion | JointMotion, title: str,
               ) -> Page:
    """Return the animation as a page."""
    page = Page(title)
    page.figure(animate_robot(model, motion, title), 'The robot in motion; it plays on request.')
    return page


def _weakness(model: ForceModel, motion: Any) -> tuple[Array | None, list[str]]:
    """Return abs(sin u_i), (F, 3), of the 3-PPRS, and how near each pose is to a singular one."""
    if isinstance(model, DriveModel):
        sines = np.abs(model.mechanism(motion).chains.sin_u)
        return sines, [
            f'smallest |sin u| {sine:.2f} (0: singular) · condition number {number:.1f}'
            for sine, number in zip(sines.min(axis=1), model.condition_number(motion),
                                    strict=True)]
    if not model.robot.structure.loops:
        return None, [''] * len(motion)
    return None, [f'condition number {number:.1f} times that at home'
                  for number in model.mechanism(motion).links.condition]


def _moving(go: Any, drawn: Skeleton, sines: Array | None, k: int) -> list[Any]:
    points, gap = drawn.points[k], np.full(3, np.nan)

    def joined(lines: list[Line]) -> Array:
        return np.array([each for line in lines
                         for each in (points[line.start], points[line.end], gap)]).reshape(-1, 3)

    kinds = [(GUIDE, SLIDE, 'guides', 4), (DRIVE, LIFT, 'drives', 7)]
    if sines is None:
        kinds.append((LINK, ROD, 'links', 5))
    traces = [_lines(go, joined(lines), colour, name, width) for kind, colour, name, width in kinds
              if (lines := [line for line in drawn.lines if line.kind == kind])]
    rods = [] if sines is None else [line for line in drawn.lines if line.kind == LINK]
    for i, line in enumerate(rods):
        assert sines is not None
        x, y, z = points[[line.start, line.end]].T
        traces.append(go.Scatter3d(
            x=x, y=y, z=z, mode='lines', name=line.name, showlegend=False,
            hovertext=f'{line.name}: |sin u| = {sines[k, i]:.2f}', hoverinfo='text',
            line={'width': 9, 'color': [sines[k, i]] * 2, 'colorscale': WEAKNESS, 'cmin': 0.0,
                  'cmax': 1.0, 'showscale': i == 0,
                  'colorbar': {'title': 'rods: |sin u|<br>0: singular', 'len': 0.4,
                               'thickness': 14, 'x': 1.0, 'xanchor': 'right'}}))
    for found, name, colour in ((drawn.joints, 'joints', '#000000'), (drawn.loops, 'loops', LIFT)):
        if found:
            x, y, z = points[list(found.values())].T
            traces.append(go.Scatter3d(
                x=x, y=y, z=z, mode='markers', name=name, text=list(found), hoverinfo='text',
                marker={'size': 4, 'color': colour}))
    x, y, z = points[list(drawn.labels.values())].T
    traces.append(go.Scatter3d(x=x, y=y, z=z, mode='text', text=list(drawn.labels),
                               textposition='bottom center', showlegend=False, hoverinfo='skip'))
    if drawn.face:
        x, y, z = points[list(drawn.face)].T
        ends = range(1, len(x) - 1)
        traces.append(go.Mesh3d(
            x=x, y=y, z=z, i=[0 for _ in ends], j=list(ends), k=[end + 1 for end in ends],
            color=PLATFORM, opacity=0.7, name='platform', showlegend=True, hoverinfo='skip'))
    return traces


def _lines(go: Any, points: Array, colour: str, name: str, width: float) -> Any:
    x, y, z = points.T
    return go.Scatter3d(x=x, y=y, z=z, mode='lines', name=name, hoverinfo='skip',
                        line={'color': colour, 'width': width})


def _button(label: str, frames: Any, duration: int) -> dict[str, Any]:
    return {'label': label, 'method': 'animate', 'args': [frames, {
        'frame': {'duration': duration, 'redraw': True}, 'mode': 'immediate',
        'fromcurrent': True, 'transition': {'duration': 0}}]}


def _step(label: str, frame: int) -> dict[str, Any]:
    return {'label': label, 'method': 'animate', 'args': [[str(frame)], {
        'frame': {'duration': 0, 'redraw': True}, 'mode': 'immediate'}]}
