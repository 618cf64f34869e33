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

"""pprs history: the ledger of a model file, and how the error fell with each effect."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from pprs_dynamics.adoption.ledger_entry import check_output
from pprs_dynamics.commands.arguments import MODEL, PAGE, output_file
from pprs_dynamics.commands.output import write_json
from pprs_dynamics.errors import ModelError
from pprs_dynamics.mechanism.units import common_effort
from pprs_dynamics.model.ledger import read_steps, without_last_step
from pprs_dynamics.model.model_file import load_model
from pprs_dynamics.model.model_writer import write_model
from pprs_dynamics.report.history_figures import draw_history
from pprs_dynamics.report.history_page import history_page
from pprs_dynamics.report.history_tables import history_view
from pprs_dynamics.report.terminal import console, shown


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    parser.add_argument('file', metavar='FILE', help='model file')
    parser.add_argument('--undo', action='store_true', help='take the last step back')
    parser.add_argument('--output', metavar='FILE.yaml', type=output_file(*MODEL),
                        help='model file that --undo writes')
    parser.add_argument('--report', metavar='FILE', type=output_file(*PAGE, '.png'),
                        help='draw the falling error: a page (.html) or a picture (.png)')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    if options.undo != bool(options.output):
        raise ModelError('--output', options.output, 'be given with --undo, and only then')
    screen = console()
    base = check_output(options.output, options.file) if options.undo else options.file
    model = load_model(base)
    steps, unit = read_steps(model.values), common_effort(model.units)
    if options.undo and not steps:
        print(f'pprs history: {options.file} holds no step that could be taken back',
              file=sys.stderr)
        return 1
    screen.print(history_view(steps, unit))
    if options.json:
        write_json(options.json, {'steps': [step.to_json() for step in steps]})
    if options.report and options.report.endswith('.png'):
        screen.print(f'picture: {shown(draw_history(options.report, steps, unit))}')
    elif options.report:
        page = history_page(Path(options.file).name, steps, unit)
        screen.print(f'page: {shown(page.write(options.report))}')
    if options.undo:
        values, step = without_last_step(model.values)
        write_model(options.output, values, base)
        screen.print(f'{step.effect} taken back: {shown(options.output)}')
    return 0
