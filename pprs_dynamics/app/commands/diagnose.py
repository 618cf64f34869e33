# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""pprs diagnose: which physical effect is missing in the model, and how sure that is."""

from __future__ import annotations

import argparse

from pprs_dynamics.app.commands.adopt_all import adopt_what_was_found
from pprs_dynamics.app.commands.arguments import (
    MODEL,
    PAGE,
    add_details,
    output_file,
)
from pprs_dynamics.app.commands.output import write_json
from pprs_dynamics.app.commands.recordings import (
    add_recordings,
    add_validation,
    given_files,
    read_recordings,
    read_validation,
)
from pprs_dynamics.app.report.diagnosis_page import diagnosis_page
from pprs_dynamics.app.report.diagnosis_tables import diagnosis_view
from pprs_dynamics.app.report.progress import progress_bar
from pprs_dynamics.app.report.terminal import console, shown
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.rivals import rival_effects
from pprs_dynamics.inference.diagnosis.sentences import word_diagnosis
from pprs_dynamics.inference.diagnosis.what_if import what_if
from pprs_dynamics.measurement.residuals.measuring import measure_residuals
from pprs_dynamics.physics.model.model_file import load_model


class OptionsError(PprsError, ValueError):
    """Options that do not go together."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    add_recordings(parser)
    add_validation(parser)
    add_details(parser)
    parser.add_argument('--report', metavar='FILE.html', type=output_file(*PAGE),
                        help='write a page with all figures')
    parser.add_argument('--adopt-all', action='store_true',
                        help='add what is found until nothing more can be told')
    parser.add_argument('--output', metavar='FILE.yaml', type=output_file(*MODEL),
                        help='model file that --adopt-all writes')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    _check(options)
    screen = console()
    model = load_model(options.model)
    recordings = read_recordings(options, screen, model)
    validate = read_validation(options, screen, model, recordings)
    with progress_bar(screen, 'diagnosing') as progress:
        diagnosis = diagnose(model, recordings, validate, lambda share: progress(share, 1.0))
    rivals = rival_effects(diagnosis, validate)
    words = word_diagnosis(diagnosis, given_files(options), rivals)
    screen.print(diagnosis_view(diagnosis, words, options.details))
    if options.json:
        write_json(options.json, diagnosis.to_dict())
    if options.report:
        with progress_bar(screen, 'page') as progress:
            after, _ = measure_residuals(diagnosis.adopted, recordings, progress)
            page = diagnosis_page(diagnosis, words, after, [one.name for one in recordings],
                                  [one.name for one in validate], rivals, what_if(diagnosis))
        screen.print(f'page: {shown(page.write(options.report))}')
    if options.adopt_all:
        return adopt_what_was_found(options, model, recordings, validate, diagnosis, screen)
    return 0


def _check(options: argparse.Namespace) -> None:
    if options.adopt_all and not options.output:
        raise OptionsError('--adopt-all: no --output FILE is given, must say where the new '
                           'model file goes')
    if options.output and not options.adopt_all:
        raise OptionsError('--output: it is given without --adopt-all, but nothing is written to '
                           'it then; --json and --report write the answer')
