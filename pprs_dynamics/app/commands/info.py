# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`pprs info`: show what a recording contains, and what is wrong with it."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from pprs_dynamics.app.api.inputs import read_checked
from pprs_dynamics.app.commands.arguments import UsageError, add_shared
from pprs_dynamics.app.commands.input_output import write_json
from pprs_dynamics.app.report.mechanism_description import (
    describe_mechanism,
    mechanism_lines,
)
from pprs_dynamics.app.report.tables import reading_table, recording_page
from pprs_dynamics.app.report.terminal import console, shown, staged_bar
from pprs_dynamics.inference.readings.findings import (
    Mistake,
    OtherReading,
    columns_line,
    effort_looks_like,
)
from pprs_dynamics.measurement.files.recording import Recording, Summary, describe
from pprs_dynamics.measurement.files.repeats import find_repeat
from pprs_dynamics.physics.model.drive_model import DriveModel

EXAMPLE = 'pprs info run.mcap --model robot.yaml'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    add_shared(parser, 'recordings', 'topic', 'report', required=False,
               report='write a page with positions and efforts over time')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    screen = console()
    model = DriveModel.load(options.model)
    content: dict[str, Any] = {}
    if model.is_mechanism:
        content['robot'] = describe_mechanism(model)
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
        write_json(options.json, {
            **content,
            'effort_looks_like': effort_looks_like(summary.findings for summary in summaries),
            'recordings': [asdict(summary) for summary in summaries]})
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
        others = [finding for finding in summary.findings if isinstance(finding, OtherReading)]
        if line := columns_line(others, model.recorded.columns is not None):
            screen.print(f'  if so, write into the model file  {shown(line)}')
        for finding in summary.findings:
            if isinstance(finding, Mistake) and finding.line:
                screen.print(f'  if so, write into the model file  {shown(finding.line)}')
        if not summary.findings:
            screen.print('[green]nothing wrong found[/]')
    repeat = find_repeat(recordings)
    if repeat is not None:
        index, clause = repeat
        screen.print(f'[yellow]![/] {shown(summaries[index].name)}: {shown(clause)}')
    return recordings, summaries
