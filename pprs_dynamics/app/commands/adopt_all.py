# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What `pprs diagnose --adopt-all` does after the diagnosis. Not a command of its own."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

from rich.markup import escape

from pprs_dynamics.app.commands.output import write_json
from pprs_dynamics.app.report.adoption_tables import adoption_view, headline
from pprs_dynamics.app.report.progress import staged_bar
from pprs_dynamics.app.report.terminal import shown
from pprs_dynamics.inference.adoption.ledger_entry import LedgerBook
from pprs_dynamics.inference.adoption.loop import REFUSED, adopt_all
from pprs_dynamics.inference.diagnosis.diagnose import Diagnosis
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.force_model import ForceModel
from pprs_dynamics.physics.model.model_writer import write_model
from pprs_dynamics.physics.model.parameter_file import find_file


def adopt_what_was_found(
    options: argparse.Namespace, model: ForceModel, recordings: Sequence[Recording],
    validate: Sequence[Recording], diagnosis: Diagnosis, screen: Any,
) -> int:
    """Adopt step by step, write the model file, and return the exit status.

    With nothing to adopt the file is written as it was; with a refusal, what was adopted before
    it, if anything.
    """
    base = find_file(options.model)
    book = LedgerBook.of(dict(zip(options.recordings, recordings, strict=True)),
                         dict(zip(options.validate, validate, strict=True)))
    with staged_bar(screen) as advance:
        outcome = adopt_all(model, recordings, validate, book.entered, advance, diagnosis)
    for step in outcome.steps:
        screen.print(adoption_view(step, details=True) if options.details
                     else escape(headline(step)))
    screen.print(f'[bold]{outcome.ended}[/]: {escape(outcome.reason)}')
    if options.json:
        write_json(options.json, {**diagnosis.to_dict(), 'adoption': outcome.to_dict()})
    if outcome.adopted or outcome.ended != REFUSED:
        write_model(options.output, outcome.model.values, base)
        count = len(outcome.adopted)
        screen.print(f'model, {count} effect{"s" * (count != 1)} added: {shown(options.output)}')
    return int(outcome.ended == REFUSED)
