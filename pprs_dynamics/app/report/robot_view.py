# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The robot drawn in three dimensions: its chains, and where it is weak.

A rod is weak where it lies flat: its drives then move the platform much with little, and forces
grow as 1 / sin u_i. Rods are coloured by abs(sin u_i); the title gives the conditioning.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pprs_dynamics.app.report.page import Page, plotly_objects
from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.three_pprs.inverse_kinematics import JointPositions, joint_positions

FRAMES = 60
SLIDE, LIFT, PLATFORM, PATH = '#0072B2', '#009E73', '#E69F00', '#999999'
# Flat rods red, upright ones dark blue; readable for colour-blind eyes.
WEAKNESS = [[0.0, '#B2182B'], [0.35, '#F4A582'], [0.7, '#4393C3'], [1.0, '#053061']]


def animate_robot(model: DriveModel, motion: PlatformMotion, title: str) -> Any:
    """Return a Plotly figure of the robot moving, with a play button and a slider.

    Parameters
    ----------
    model : DriveModel
    motion : PlatformMotion
        Thinned to 60 poses.
    title : str
    """
    go = plotly_objects()
    shown = motion[np.unique(np.linspace(0, len(motion) - 1, FRAMES).astype(int))]
    joints = joint_positions(model.robot.geometry, shown)
    mechanism = model.mechanism(shown)
    sines = np.abs(mechanism.chains.sin_u)
    condition = model.condition_number(shown)
    captions = [
        f'smallest |sin u| {sine:.2f} (0: singular) · condition number {number:.1f}'
        for sine, number in zip(sines.min(axis=1), condition, strict=True)]
    fixed = _rails(go, model, joints, motion)
    moving = _moving(go, joints, sines, 0)
    first = len(fixed)
    figure = go.Figure(
        data=[*fixed, *moving],
        frames=[go.Frame(data=_moving(go, joints, sines, k), name=str(k),
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


def robot_page(model: DriveModel, motion: PlatformMotion, title: str) -> Page:
    """Return the animation as a page."""
    page = Page(title)
    page.figure(animate_robot(model, motion, title), 'The robot in motion; it plays on request.')
    return page


def _rails(go: Any, model: DriveModel, joints: JointPositions, motion: PlatformMotion) -> list[Any]:
    """Return what does not move: the slides' guides, the base, and the platform's path."""
    geometry = model.robot.geometry
    frames = geometry.frames
    e = np.stack((frames.cos, frames.sin, np.zeros(3)), axis=1)
    n = np.stack((-frames.sin, frames.cos, np.zeros(3)), axis=1)
    lower, upper = model.limits.slide_stroke
    rails = np.concatenate([
        [geometry.base_radius * e[i] + s * n[i] for s in (lower, upper)] + [[np.nan] * 3]
        for i in range(3)])
    path = motion.position
    return [
        _lines(go, rails, SLIDE, 'guides of the slides', width=4),
        _lines(go, path, PATH, 'path of the platform', width=2),
        go.Scatter3d(
            x=[1.02 * geometry.base_radius * v[0] for v in e],
            y=[1.02 * geometry.base_radius * v[1] for v in e], z=[0.0] * 3, mode='text',
            text=['chain 1', 'chain 2', 'chain 3'], showlegend=False, hoverinfo='skip'),
    ]


def _moving(go: Any, joints: JointPositions, sines: Array, k: int) -> list[Any]:
    foot, elbow, tip = joints.foot[k], joints.elbow[k], joints.tip[k]
    gap = np.full((3, 1, 3), np.nan)
    lifts = np.concatenate((foot[:, None], elbow[:, None], gap), axis=1).reshape(-1, 3)
    rods = [go.Scatter3d(
        x=[elbow[i, 0], tip[i, 0]], y=[elbow[i, 1], tip[i, 1]], z=[elbow[i, 2], tip[i, 2]],
        mode='lines', name=f'rod {i + 1}', showlegend=False,
        hovertext=f'rod {i + 1}: |sin u| = {sines[k, i]:.2f}', hoverinfo='text',
        line={'width': 9, 'color': [sines[k, i]] * 2, 'colorscale': WEAKNESS, 'cmin': 0.0,
              'cmax': 1.0, 'showscale': i == 0,
              'colorbar': {'title': 'rods: |sin u|<br>0: singular', 'len': 0.4, 'thickness': 14,
                           'x': 1.0, 'xanchor': 'right'}}) for i in range(3)]
    return [
        _lines(go, lifts, LIFT, 'lifts', width=6),
        *rods,
        go.Scatter3d(x=foot[:, 0], y=foot[:, 1], z=foot[:, 2], mode='markers', name='slides',
                     marker={'size': 5, 'color': SLIDE, 'symbol': 'square'}),
        go.Scatter3d(x=elbow[:, 0], y=elbow[:, 1], z=elbow[:, 2], mode='markers',
                     name='revolute joints C', marker={'size': 5, 'color': LIFT}),
        go.Scatter3d(x=tip[:, 0], y=tip[:, 1], z=tip[:, 2], mode='markers', name='ball joints A',
                     marker={'size': 5, 'color': '#000000'}),
        go.Mesh3d(x=tip[:, 0], y=tip[:, 1], z=tip[:, 2], i=[0], j=[1], k=[2], color=PLATFORM,
                  opacity=0.7, name='platform', showlegend=True, hoverinfo='skip'),
    ]


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

