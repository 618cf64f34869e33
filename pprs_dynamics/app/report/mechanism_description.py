# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Bodies, joints, loops and mobility of a mechanism, as text and as JSON."""

from __future__ import annotations

from typing import Any

from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.system.plain_text import counted


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
        lines.append('loops: ' + ', '.join(f'{entry["name"]} ({entry["type"]}, {entry["a"]} on '
                                           f'{entry["b"]})' for entry in found['loops']))
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
