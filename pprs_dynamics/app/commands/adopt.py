# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""pprs adopt: add a physical effect to the model, fitted and checked on held-out data.

Writes a new model file with its entry in the ledger, or refuses with the figures (status 1).
"""

from __future__ import annotations

import argparse

from pprs_dynamics.app.commands.arguments import MODEL, PAGE, add_details, output_file
from pprs_dynamics.app.commands.output import write_json
from pprs_dynamics.app.commands.recordings import (
    add_recordings,
    add_validation,
    given_files,
    read_recordings,
    read_validation,
)
from pprs_dynamics.app.report.adoption_page import adoption_page
from pprs_dynamics.app.report.adoption_tables import adoption_view
from pprs_dynamics.app.report.progress import progress_bar
from pprs_dynamics.app.report.terminal import console, shown
from pprs_dynamics.inference.adoption.adopt import adopt
from pprs_dynamics.inference.adoption.ledger_entry import LedgerBook
from pprs_dynamics.inference.adoption.request import requested
from pprs_dynamics.physics.model.model_file import load_model
from pprs_dynamics.physics.model.model_writer import write_model
from pprs_dynamics.physics.model.parameter_file import find_file


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    parser.add_argument('effect', metavar='EFFECT', help='name of an effect, on the drives that '
                        'the recordings call for; or EFFECT:drive,drive; or '
                        'measured_curve:DRIVE@VARIABLE for what no effect explains')
    add_recordings(parser)
    add_validation(parser)
    parser.add_argument('--output', metavar='FILE.yaml', type=output_file(*MODEL), required=True,
                        help='model file to write')
    parser.add_argument('--force', action='store_true',
                        help='adopt it in spite of objections, which the ledger then holds')
    add_details(parser)
    parser.add_argument('--report', metavar='FILE.html', type=output_file(*PAGE),
                        help='write a page with all figures')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    screen = console()
    base = find_file(options.model)
    model = load_model(base)
    request = requested(options.effect, model)
    recordings = read_recordings(options, screen, model)
    validation = read_validation(options, screen, model, recordings)
    with progress_bar(screen, f'adopting {request.name}') as progress:
        answer = adopt(model, request, recordings, validation, options.force,
                       lambda share: progress(share, 1.0))
    screen.print(adoption_view(answer, options.details))
    if options.json:
        write_json(options.json, answer.to_dict())
    if options.report:
        files = given_files(options, options.output)
        page = adoption_page(answer, recordings, validation,
                             files.command('diagnose', held_out=True))
        screen.print(f'page: {shown(page.write(options.report))}')
    if not answer.adopted:
        return 1
    book = LedgerBook.of(dict(zip(options.recordings, recordings, strict=True)),
                         dict(zip(options.validate, validation, strict=True)))
    write_model(options.output, book.entered(answer).values, base)
    screen.print(f'model: {shown(options.output)}')
    return 0
