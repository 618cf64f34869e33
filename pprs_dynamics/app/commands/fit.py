# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`pprs fit`: fit the base model to recordings of free motion."""

from __future__ import annotations

import argparse

from pprs_dynamics.app.api.fit import fit
from pprs_dynamics.app.commands.arguments import add_shared, answer, show
from pprs_dynamics.app.report.terminal import shown

EXAMPLE = 'pprs fit free_1.csv free_2.csv --model robot.yaml --output base.yaml'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    add_shared(parser, 'recordings', 'topic', 'as-it-is', 'validate', 'output', 'report')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    screen, result = answer(fit, options)
    result.save(options.output)
    show(result, options, screen)
    screen.print(f'model: {shown(options.output)}', soft_wrap=True)
    return 0
