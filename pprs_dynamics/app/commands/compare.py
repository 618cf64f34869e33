# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""pprs compare: model against measurement, and where it fails."""

from __future__ import annotations

import argparse

from pprs_dynamics.app.commands.arguments import PAGE, add_details, output_file
from pprs_dynamics.app.commands.output import write_json
from pprs_dynamics.app.commands.recordings import add_recordings, given_files, read_recordings
from pprs_dynamics.app.report.comparison_page import comparison_page
from pprs_dynamics.app.report.progress import progress_bar
from pprs_dynamics.app.report.tables import comparison_view
from pprs_dynamics.app.report.terminal import console, shown
from pprs_dynamics.inference.diagnosis.comparison import compare
from pprs_dynamics.inference.diagnosis.localisation import localise
from pprs_dynamics.measurement.residuals.measuring import measure_residuals
from pprs_dynamics.physics.model.model_file import load_model


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
    command = given_files(options).command('diagnose', '--report', 'why.html')
    screen.print(comparison_view(comparison, command, options.details))
    if options.json:
        write_json(options.json, {**comparison.to_dict(), 'verdict': comparison.verdict})
    if options.report:
        page = comparison_page(model, recordings, residuals, comparison, notes, command)
        screen.print(f'page: {shown(page.write(options.report))}')
    return 0
