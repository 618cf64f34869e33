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

"""What `pprs diagnose --adopt-all` does after the diagnosis. Not a command of its own."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

from rich.markup import escape

from pprs_dynamics.adoption.ledger_entry import LedgerBook, check_output
from pprs_dynamics.adoption.loop import REFUSED, adopt_all
from pprs_dynamics.commands.output import write_json
from pprs_dynamics.diagnosis.diagnose import Diagnosis
from pprs_dynamics.measurement.recording import Recording
from pprs_dynamics.model.force_model import ForceModel
from pprs_dynamics.model.model_writer import write_model
from pprs_dynamics.report.adoption_tables import adoption_view, headline
from pprs_dynamics.report.progress import staged_bar
from pprs_dynamics.report.terminal import shown


def adopt_what_was_found(
    options: argparse.Namespace, model: ForceModel, recordings: Sequence[Recording],
    validate: Sequence[Recording], diagnosis: Diagnosis, screen: Any,
) -> int:
    """Adopt step by step, write the model file, and return the exit status.

    With nothing to adopt the file is written as it was; with a refusal, what was adopted before
    it, if anything.
    """
    base = check_output(options.output, options.model)
    book = LedgerBook.of(dict(zip(options.recordings, recordings, strict=True)),
                         dict(zip(options.validate, validate, strict=True)))
    with staged_bar(screen) as advance:
        outcome = adopt_all(model, recordings, validate, book.entered, advance, diagnosis)
    for step in outcome.steps:
        screen.print(adoption_view(step, details=True) if options.details
                     else escape(headline(step)))
    screen.print(f'[bold]{outcome.ended}[/]: {escape(outcome.reason)}')
    if options.json:
        write_json(options.json, {**diagnosis.to_json(), 'adoption': outcome.to_json()})
    if outcome.adopted or outcome.ended != REFUSED:
        write_model(options.output, outcome.model.values, base)
        count = len(outcome.adopted)
        screen.print(f'model, {count} effect{"s" * (count != 1)} added: {shown(options.output)}')
    return int(outcome.ended == REFUSED)
