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

"""pprs compare: model against measurement, and where it fails."""

from __future__ import annotations

import argparse

from pprs_dynamics.commands.arguments import DEFAULT_MODEL, PAGE, add_details, output_file
from pprs_dynamics.commands.output import write_json
from pprs_dynamics.commands.recordings import add_recordings, read_recordings
from pprs_dynamics.diagnosis.comparison import compare
from pprs_dynamics.diagnosis.localisation import localise
from pprs_dynamics.diagnosis.next_step import GivenFiles
from pprs_dynamics.model.model_file import load_model
from pprs_dynamics.report.comparison_page import comparison_page
from pprs_dynamics.report.progress import progress_bar
from pprs_dynamics.report.tables import comparison_view
from pprs_dynamics.report.terminal import console, shown
from pprs_dynamics.residuals.measuring import measure_residuals


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    add_recordings(parser)
    add_details(parser)
    parser.add_argument('--report', metavar='FILE.html', type=output_file(*PAGE),
                        help='write a page with all figures')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    screen = console()
    model = load_model(options.model)
    recordings = read_recordings(options, screen, model)
    with progress_bar(screen, 'motion and model') as progress:
        residuals, notes = measure_residuals(model, recordings, progress)
    with progress_bar(screen, 'where it fails') as progress:
        where = localise(residuals, progress=lambda share: progress(share, 1.0))
    comparison = compare(residuals, where)
    files = GivenFiles(tuple(options.recordings), (),
                       '' if options.model == DEFAULT_MODEL else str(options.model))
    command = files.command('diagnose', '--report', 'why.html')
    screen.print(comparison_view(comparison, command, options.details))
    if options.json:
        write_json(options.json, {**comparison.to_json(), 'verdict': comparison.verdict})
    if options.report:
        page = comparison_page(model, recordings, residuals, comparison, notes, command)
        screen.print(f'page: {shown(page.write(options.report))}')
    return 0
