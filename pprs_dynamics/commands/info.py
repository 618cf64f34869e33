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

"""pprs info: what is in a recording, and what is wrong with it."""

from __future__ import annotations

import argparse
from dataclasses import asdict

from pprs_dynamics.commands.output import write_json
from pprs_dynamics.commands.recordings import add_recordings, read_each
from pprs_dynamics.measurement.recording import describe
from pprs_dynamics.measurement.repeats import find_repeat
from pprs_dynamics.model.model_file import load_model
from pprs_dynamics.report.tables import recording_table
from pprs_dynamics.report.terminal import console, shown


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    add_recordings(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    screen = console()
    model = load_model(options.model)
    recordings = read_each(options.recordings, options, screen, model)
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
