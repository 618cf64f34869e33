# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""pprs fit: the base model that recordings of free motion call for."""

from __future__ import annotations

import argparse

from rich.markup import escape

from pprs_dynamics.app.commands.arguments import MODEL, PAGE, output_file
from pprs_dynamics.app.commands.output import write_json
from pprs_dynamics.app.commands.recordings import (
    add_recordings,
    add_validation,
    read_recordings,
    read_validation,
)
from pprs_dynamics.app.report.fit_page import fit_page
from pprs_dynamics.app.report.fit_tables import fit_table, numbers_table
from pprs_dynamics.app.report.progress import progress_bar
from pprs_dynamics.app.report.terminal import console, shown
from pprs_dynamics.inference.fit.base_fit import fit_base
from pprs_dynamics.physics.model.model_file import load_model
from pprs_dynamics.physics.model.model_writer import write_model
from pprs_dynamics.physics.model.parameter_file import find_file


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    add_recordings(parser)
    add_validation(parser)
    parser.add_argument('--output', metavar='FILE.yaml', type=output_file(*MODEL), required=True,
                        help='model file that is written')
    parser.add_argument('--report', metavar='FILE.html', type=output_file(*PAGE),
                        help='write a page with all figures')
    parser.add_argument('--details', action='store_true', help='print every fitted number')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    screen = console()
    model = load_model(options.model)
    recordings = read_recordings(options, screen, model)
    validate = read_validation(options, screen, model, recordings)
    with progress_bar(screen, 'fitting') as progress:
        fit = fit_base(model, recordings, validate, lambda share: progress(share, 1.0))
    write_model(options.output, fit.model.values, find_file(options.model))
    screen.print(fit_table(model, fit))
    for sentence in fit.told:
        screen.print(escape(sentence))
    if options.details:
        screen.print(numbers_table(fit))
    screen.print(f'model: {shown(options.output)}')
    if options.json:
        write_json(options.json, fit.to_dict())
    if options.report:
        page = fit_page(model, fit, [one.name for one in recordings],
                        [one.name for one in validate])
        screen.print(f'page: {shown(page.write(options.report))}')
    return 0
