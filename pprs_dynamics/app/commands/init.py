# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`pprs init`: write a model file from a URDF or MJCF."""

from __future__ import annotations

import argparse
import os
from shlex import quote
from typing import TypedDict

from pprs_dynamics.app.api.first_model import first_model
from pprs_dynamics.app.commands.arguments import (
    MODEL,
    UsageError,
    add_shared,
    number,
    output_file,
    write_json,
)
from pprs_dynamics.app.commands.info import mechanism_lines, show_recordings
from pprs_dynamics.app.report.charts import recording_rows
from pprs_dynamics.app.report.pictures import plot_over_time, save
from pprs_dynamics.app.report.terminal import console, shell_command, shown
from pprs_dynamics.inference.diagnosis.next_step import SECOND
from pprs_dynamics.measurement.files.recording import Summary
from pprs_dynamics.system.files import write_text
from pprs_dynamics.system.plain_text import displayed

EXAMPLE = 'pprs init ur10e.urdf run.csv --output robot.yaml'
FASTEST = 1e6  # [Hz]
NOT_SURE = ('[bold]Not sure[/]: the lines are comments in the model file; write what is true '
            'there, or go on with compare, diagnose or fit and --as-it-is')


class InitJson(TypedDict):
    """A new model file.

    Parameters
    ----------
    notes : list of str
        What was guessed, and what is not known.
    drives : list of str
        Driven joints.
    recordings : list of Summary
    questions : list of str
        Lines of the model file of which one is true, where two readings are possible.
    """

    notes: list[str]
    drives: list[str]
    recordings: list[Summary]
    questions: list[str]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    parser.add_argument('robot', metavar='ROBOT', help='URDF or MJCF')
    parser.add_argument('recordings', metavar='RECORDING', nargs='*',
                        help='recordings of this robot; the first gives the names of joints and '
                        'columns; files of one quantity each (q.csv tau.csv), or their folder, '
                        'count as one recording')
    add_shared(parser, 'topic')
    parser.add_argument('--output', metavar='FILE.yaml', type=output_file(*MODEL),
                        default='robot.yaml', help='model file to write (default robot.yaml)')
    parser.add_argument('--tool', metavar='LINK', default='', help='the link that carries the load')
    parser.add_argument('--drives', metavar='JOINT,JOINT', default='', help='joints with drives')
    parser.add_argument('--rate', metavar='HZ', type=number(0.0, FASTEST, 'Hz', above=True),
                        help='samples per second of a table without times')
    parser.add_argument('--picture', metavar='FILE.png', type=output_file('.png'),
                        help='picture to write: positions and efforts over time, as read')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    if os.path.lexists(options.output):
        raise UsageError(f'{displayed(options.output)}: it exists already, and may have been '
                         'edited: delete it, or give another name for --output')
    if options.picture and not options.recordings:
        raise UsageError('--picture shows a RECORDING: one must be given')
    screen = console()
    drives = [name for name in options.drives.split(',') if name]
    if options.drives and not drives:
        raise UsageError(f'--drives is {displayed(options.drives)}, must name joints')
    first = first_model(options.robot, options.recordings, options.output,
                        tool=options.tool, drives=drives, rate=options.rate,
                        topic=options.topic)
    write_text(options.output, first.text)
    model = first.model
    for line in mechanism_lines(model):
        screen.print(shown(line))
    for note in first.notes:
        screen.print(f'[yellow]![/] {shown(note)}')
    recordings, summaries = show_recordings(
        model, list(map(str, first.recordings)), options.topic, screen) if first.is_read else (
            [], [])
    if options.picture and recordings:
        save(plot_over_time(recordings[0].time, recording_rows(recordings[0], model.units)),
             options.picture)
        screen.print(f'picture: {shown(options.picture)}', soft_wrap=True)
    screen.print(f'model: {shown(options.output)} (its comments list what was guessed)')
    names = ' '.join(quote(str(recording)) for recording in first.recordings) or 'RECORDING'
    names += f' --topic {quote(options.topic)}' if options.topic else ''
    file = quote(options.output)
    if first.questions:
        screen.print(NOT_SURE)
    elif first.has_efforts and not any(
            finding.kind == 'no_effort' for summary in summaries for finding in summary.findings):
        screen.print('[bold]Next[/] Fit the model, then diagnose another run:')
        screen.print(shell_command(f'pprs fit {names} --model {file} --output base.yaml'))
        screen.print(shell_command(f'pprs diagnose {SECOND} --model base.yaml'))
        screen.print('Fit a healthy run without load: a fault in the fitted run becomes part of '
                     'the model, and cannot be found later.')
    else:
        screen.print('[bold]Next[/] See what the recording contains:')
        screen.print(shell_command(f'pprs info {names} --model {file}'))
    if options.json:
        write_json(options.json, InitJson(notes=first.notes, drives=list(model.drives),
                                          recordings=summaries, questions=first.questions))
    return 1 if first.questions else 0
