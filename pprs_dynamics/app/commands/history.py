# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`pprs history`: show what was added to a model, or undo the last step."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TypedDict

from pprs_dynamics.app.commands.arguments import add_shared, require_output, write_json
from pprs_dynamics.app.report.terminal import console, shown
from pprs_dynamics.drives import common_effort
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.ledger import Step, read_steps, without_last_step
from pprs_dynamics.physics.model.model_writer import write_model
from pprs_dynamics.physics.model.parameter_file import find_file

EXAMPLE = 'pprs history better.yaml --report history.html'


class HistoryJson(TypedDict):
    """The steps of a model's history, oldest first."""

    steps: list[Step]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    parser.add_argument('file', metavar='FILE', help='model file')
    parser.add_argument('--undo', action='store_true', help='undo the last step')
    add_shared(parser, 'output', 'report', required=False, output='model file that --undo writes',
               report='write a page that shows how the error fell')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    require_output(options, 'undo')
    screen = console()
    # Here, as --help draws nothing.
    from pprs_dynamics.app.report.history_report import history_page, history_view

    base = find_file(options.file)
    model = DriveModel.load(base)
    steps, unit = read_steps(model.values), common_effort(model.units)
    if options.undo and not steps:
        print(f'pprs history: {options.file} has no step to undo', file=sys.stderr)
        return 1
    screen.print(history_view(steps, unit))
    if options.json:
        write_json(options.json, HistoryJson(steps=steps))
    if options.report:
        page = history_page(Path(options.file).name, steps, unit)
        screen.print(f'page: {shown(page.write(options.report))}', soft_wrap=True)
    if options.undo:
        values, step = without_last_step(model.values)
        write_model(options.output, values, base)
        screen.print(f'{step.effect} removed: {shown(options.output)}', soft_wrap=True)
    return 0
