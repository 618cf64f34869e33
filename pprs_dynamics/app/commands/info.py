# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`pprs info`: show what a recording contains, and what is wrong with it."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any, TypedDict

from pprs_dynamics.app.api.inputs import read_checked
from pprs_dynamics.app.commands.arguments import UsageError, add_shared, write_json
from pprs_dynamics.app.report.figures import recording_page
from pprs_dynamics.app.report.terminal import console, escape, shown, staged_bar, text_table
from pprs_dynamics.drives import CHANNELS, RecordedDrives
from pprs_dynamics.inference.readings.findings import effort_looks_like, lines_of
from pprs_dynamics.measurement.files.recording import Recording, Summary, describe
from pprs_dynamics.measurement.files.repeats import find_repeat
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.system.plain_text import counted

EXAMPLE = 'pprs info run.mcap --model robot.yaml'


class MechanismJson(TypedDict):
    """Bodies, joints and loops of an arm or a robot with loops.

    Parameters
    ----------
    bodies : dict of str to float
        Mass of each link that has one [kg].
    joints : dict of str to str
        Role of each joint: driven, held or passive.
    loops : dict of str to str
        Kind of each joint that closes a loop.
    drives : list of str
        Driven joints, in the order of all results.
    degrees_of_freedom : int
        At home.
    condition_number : float
        Of the closures at home.
    """

    bodies: dict[str, float]
    joints: dict[str, str]
    loops: dict[str, str]
    drives: list[str]
    degrees_of_freedom: int
    condition_number: float


class InfoJson(TypedDict):
    """Contents of recordings and of a robot.

    Parameters
    ----------
    robot : MechanismJson
        Of an arm or a robot with loops, else null.
    recordings : list of Summary
    effort_looks_like : dict
        Kind of each drive's effort that is no measurement; null for none.
    """

    robot: MechanismJson | None
    recordings: list[Summary]
    effort_looks_like: dict[str, str] | None


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    add_shared(parser, 'recordings', 'topic', 'report', required=False,
               report='write a page with positions and efforts over time')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    screen = console()
    model = DriveModel.load(options.model)
    if model.has_bodies:
        for line in mechanism_lines(model):
            screen.print(shown(line))
        description = model.robot.structure.description
        for remark in (*description.faults, *description.remarks):
            screen.print(f'[yellow]![/] {shown(remark)}')
    elif not options.recordings:
        raise UsageError('a RECORDING is needed: without one, info describes an arm or a robot '
                         'with loops')
    if options.report and len(options.recordings) != 1:
        raise UsageError('--report shows one RECORDING: one must be given')
    recordings, summaries = show_recordings(model, options.recordings, options.topic, screen)
    if options.report:
        recording_page(recordings[0], model.units).write(options.report)
        screen.print(f'page: {shown(options.report)}', soft_wrap=True)
    if options.json:
        write_json(options.json, InfoJson(
            robot=describe_mechanism(model) if model.has_bodies else None,
            recordings=summaries,
            effort_looks_like=effort_looks_like(summary.findings for summary in summaries)))
    return 0


def show_recordings(model: DriveModel, paths: Sequence[str], topic: str | None, screen: Any,
                    ) -> tuple[list[Recording], list[Summary]]:
    """Print how the columns of recordings are read, and their faults, and return both."""
    with staged_bar(screen) as progress:
        recordings = [read_checked(model, path, topic, progress) for path in paths]
    summaries = [describe(recording) for recording in recordings]
    for summary in summaries:
        screen.print(reading_table(summary, model.recorded))
        for finding in summary.findings:
            screen.print(f'[yellow]![/] {shown(finding.text)}')
        for line in lines_of(summary.findings, model.recorded.columns is not None):
            screen.print(f'  if so, write into the model file  {shown(line)}')
        if not summary.findings:
            screen.print('[green]nothing wrong found[/]')
    repeat = find_repeat(recordings)
    if repeat is not None:
        index, clause = repeat
        screen.print(f'[yellow]![/] {shown(summaries[index].name)}: {shown(clause)}')
    return recordings, summaries


def reading_table(summary: Summary, recorded: RecordedDrives) -> Any:
    """Return how the columns of a recording are read: column, drive, quantity, unit, range."""
    rows = []
    for drive, joint, units in zip(recorded.names, recorded.joints, recorded.units, strict=True):
        found = summary.drives[drive]
        columns = recorded.columns_of(drive)
        current = 'current' in columns.names
        in_amperes = any(finding.kind == 'no_gain' and drive in finding.drives
                         for finding in summary.findings)
        for quantity, bounds, unit, factor in (
                ('position', found.position, units.position, columns.position_scale),
                ('velocity', found.velocity, f'{units.position}/s', columns.velocity_scale),
                ('current' if current else 'effort', found.effort,
                 'A' if in_amperes else units.effort, columns.effort_scale),
                *((name, bounds, units.of(CHANNELS[name]), 1.0)
                  for name, bounds in found.channels.items())):
            if bounds is not None:
                column = columns.names.get(quantity, f'{joint}/{quantity}')
                scale = f', {factor:.4g} of the column' if factor != 1 else ''
                share = (f' ({found.measured:.1%} measured)'
                         if quantity in ('current', 'effort') and found.measured < 1 else '')
                rows.append((escape(str(column)), escape(drive), quantity, f'{unit}{scale}',
                             f'{bounds[0]:.4g} … {bounds[1]:.4g}{share}'))
    return text_table(('column', 'drive', 'quantity', 'unit', 'range'), rows, right=(),
                      caption=escape(summary.source), title=escape(
                          f'{summary.name}: {summary.used} of {summary.samples} samples in '
                          f'{counted(len(summary.segments), "segment")}, '
                          f'{summary.duration:.2f} s at {summary.rate:.6g} Hz'))


def describe_mechanism(model: DriveModel) -> MechanismJson:
    """Return bodies, joints, loops, mobility and conditioning, for JSON."""
    s = model.robot.structure

    def role(row: int) -> str:
        c = int(s.tables.coordinate[row])
        return 'driven' if c in s.tables.drives else 'held' if c in s.mobility.held else 'passive'
    return {
        'bodies': dict(zip(model.robot.body_names, model.robot.masses.tolist(), strict=True)),
        'joints': {name: role(row) for name, row in s.rows.items()},
        'loops': {loop.name: loop.kind for loop in s.loops},
        'drives': list(s.drives), 'degrees_of_freedom': s.mobility.freedoms,
        'condition_number': s.mobility.condition}


def mechanism_lines(model: DriveModel) -> list[str]:
    """Return bodies, joints, loops and home as sentences for the terminal."""
    s = model.robot.structure
    held = f': {", ".join(s.held)} held' if s.held else ''
    lines = [
        f'{counted(len(model.robot.masses), "body")}, {model.robot.masses.sum():.4g} kg in total, '
        f'{counted(len(s.rows), "joint")}, {counted(len(s.loops), "loop")}',
        f'{counted(s.mobility.freedoms, "degree of freedom")}, '
        f'{counted(len(s.drives), "drive")} ({", ".join(s.drives)}){held}']
    if s.loops:
        lines += ['loops: ' + ', '.join(f'{loop.name} ({loop.kind}, {loop.a} on {loop.b})'
                                        for loop in s.loops),
                  f'{len(s.mobility.rows)} independent constraints close them at home; condition '
                  f'number {s.mobility.condition:.3g} (lengths in units of {s.size:.3g} m)']
    lines.append('home: ' + ', '.join(
        f'{name} {value:.4g} {"rad" if unit.turns else "m"}' for name, value, unit in zip(
            s.drives, s.home[s.tables.drives], model.units, strict=True)))
    return lines
