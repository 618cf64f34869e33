# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""pprs info: what is in a recording, and what is wrong with it."""

from __future__ import annotations

import argparse
from dataclasses import asdict

from pprs_dynamics.app.commands.output import write_json
from pprs_dynamics.app.commands.recordings import add_recordings
from pprs_dynamics.app.front_door.inputs import read_checked
from pprs_dynamics.app.report.progress import staged_bar
from pprs_dynamics.app.report.tables import recording_table
from pprs_dynamics.app.report.terminal import console, shown
from pprs_dynamics.measurement.files.recording import describe
from pprs_dynamics.measurement.files.repeats import find_repeat
from pprs_dynamics.physics.model.model_file import load_model


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    add_recordings(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    screen = console()
    model = load_model(options.model)
    with staged_bar(screen) as progress:
        recordings = [read_checked(model, path, options.topic, progress)
                      for path in options.recordings]
    summaries = [describe(recording) for recording in recordings]
    for summary in summaries:
        for table in recording_table(summary, model.units):
            screen.print(table)
        for finding in summary.findings:
            screen.print(f'[yellow]![/] {shown(finding.text)}')
        if not summary.findings:
            screen.print('[green]nothing wrong found[/]')
    repeat = find_repeat(recordings)
    if repeat is not None:
        index, clause = repeat
        screen.print(f'[yellow]![/] {shown(summaries[index].name)}: {shown(clause)}')
    if options.json:
        write_json(options.json, {'recordings': [asdict(summary) for summary in summaries]})
    return 0
