# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What a mechanism is: bodies, joints, loops, mobility; as text, as JSON, and drawn at home."""

from __future__ import annotations

from os import PathLike
from typing import Any

import numpy as np

from pprs_dynamics.app.report.charts import plotly_objects
from pprs_dynamics.app.report.page import Page
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.skeleton import Skeleton
from pprs_dynamics.system.plain_text import counted

COLOURS = {'driven': '#0072B2', 'passive': '#009E73', 'held': '#999999'}
LOOP = '#E69F00'


def describe_mechanism(model: DriveModel) -> dict[str, Any]:
    """Return bodies, joints, loops, mobility and conditioning, for JSON."""
    robot = model.robot
    s = robot.structure
    home = dict(zip(s.coordinates, s.home.tolist(), strict=True))
    joints = []
    for name, row in s.rows.items():
        joint = s.description.joints[name]
        joints.append({
            'name': name, 'kind': joint.kind, 'moves': s.moved_by.get(row, ''),
            'role': _role(model, name),
            'home': float(s.tables.ratio[row] * s.home[s.tables.coordinate[row]]
                          + s.tables.offset[row]),
            **({'mimics': joint.mimic.joint} if joint.mimic else {})})
    return {
        'bodies': [{'link': link, 'mass': float(mass)} for link, mass in zip(
            robot.body_names, robot.masses, strict=True)],
        'joints': joints,
        'loops': [{'name': loop.name, 'type': loop.kind, 'a': loop.a, 'b': loop.b}
                  for loop in s.loops],
        'drives': list(s.drives), 'held': list(s.held), 'home': home,
        'degrees_of_freedom': s.mobility.freedoms, 'independent_rows': len(s.mobility.rows),
        'condition_number': s.mobility.condition, 'faults': list(s.description.faults),
        'remarks': list(s.description.remarks)}


def mechanism_lines(model: DriveModel) -> list[str]:
    """Return the same as sentences for the terminal."""
    found = describe_mechanism(model)
    s = model.robot.structure
    held = f': {", ".join(found["held"])} held' if found['held'] else ''
    lines = [
        f'{counted(len(found["bodies"]), "body")}, {model.robot.masses.sum():.4g} kg in total, '
        f'{counted(len(s.rows), "joint")}, {counted(len(s.loops), "loop")}',
        f'{counted(found["degrees_of_freedom"], "degree of freedom")}, '
        f'{counted(len(s.drives), "drive")} ({", ".join(s.drives)}){held}']
    if s.loops:
        lines.append('loops: ' + ', '.join(f'{one["name"]} ({one["type"]}, {one["a"]} on '
                                           f'{one["b"]})' for one in found['loops']))
        lines.append(f'{found["independent_rows"]} independent rows close them at home; condition '
                     f'number {found["condition_number"]:.3g} (lengths in units of '
                     f'{s.size:.3g} m)')
    lines.append('home: ' + ', '.join(
        f'{name} {value:.4g} {"rad" if unit.turns else "m"}' for name, value, unit in zip(
            s.drives, s.home[s.tables.drives], model.units, strict=True)))
    return lines


def _role(model: DriveModel, name: str) -> str:
    s = model.robot.structure
    c = int(s.tables.coordinate[s.rows[name]])
    return ('driven' if c in s.tables.drives else 'held' if c in s.mobility.held else 'passive')


def write_mechanism_page(path: str | PathLike[str], model: DriveModel, title: str) -> None:
    """Write what a mechanism is as one HTML file that needs no network."""
    page = Page(title)
    for line in mechanism_lines(model):
        page.text(line)
    page.figure(draw_mechanism(model, title), 'Joints at home, each joined with those that it '
                'carries; loops as diamonds.')
    page.write(path)


def draw_mechanism(model: DriveModel, title: str) -> Any:
    """Return a Plotly figure of the joints at home: seen from the front, and from above."""
    from plotly.subplots import make_subplots

    go = plotly_objects()
    s = model.robot.structure
    home = s.home[None, s.tables.drives]
    drawn = Skeleton.of(model, JointMotion(home, np.zeros_like(home), np.zeros_like(home)))
    placed = drawn.points[0]
    around = zip(drawn.face, (*drawn.face[1:], *drawn.face[:1]), strict=True)
    links = np.concatenate([
        [placed[start], placed[end], np.full(3, np.nan)]
        for start, end in (*((line.start, line.end) for line in drawn.lines), *around)])
    figure = make_subplots(1, 2, subplot_titles=('from the front', 'from above'))
    for column, (across, up) in enumerate(((0, 2), (0, 1)), 1):
        marks = [(f'{role} joints', colour, 'circle', {
            name: placed[at] for name, at in drawn.joints.items()
            if _role(model, name) == role})
            for role, colour in reversed(COLOURS.items())]  # driven ones above passive ones
        marks.append(('loops', LOOP, 'diamond', {
            name: placed[at] for name, at in drawn.loops.items()}))
        figure.add_trace(go.Scatter(
            x=links[:, across], y=links[:, up], mode='lines', name='links', hoverinfo='skip',
            showlegend=column == 1, line={'color': '#777777', 'width': 3}), row=1, col=column)
        for name, colour, symbol, points in marks:
            if points:
                at = np.array(list(points.values()))
                figure.add_trace(go.Scatter(
                    x=at[:, across], y=at[:, up], mode='markers', name=name, text=list(points),
                    hoverinfo='text', showlegend=column == 1,
                    marker={'size': 9, 'color': colour, 'symbol': symbol}), row=1, col=column)
        figure.update_xaxes(title_text=f'{"xyz"[across]} [m]', row=1, col=column)
        figure.update_yaxes(title_text=f'{"xyz"[up]} [m]', scaleanchor=f'x{column}', row=1,
                            col=column)
    figure.update_layout(title=title, template='plotly_white', height=560,
                         legend={'orientation': 'h', 'y': -0.2})
    return figure
