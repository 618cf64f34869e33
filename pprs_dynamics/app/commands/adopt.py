# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`pprs adopt`: add an effect to the model after a check on held-out data.

Writes a new model file with its entry in the ledger, or refuses with the figures (status 1).
"""

from __future__ import annotations

import argparse

from pprs_dynamics.app.api.adopt import adopt
from pprs_dynamics.app.commands.arguments import add_shared, answer, show
from pprs_dynamics.app.report.terminal import shown
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.physics.effects.catalogue import catalogue
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.parameter_file import find_file

EXAMPLE = 'pprs adopt stribeck_friction run.mcap --validate other.mcap --output better.yaml'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    effect = parser.add_argument(
        'effect', metavar='EFFECT', help='name of an effect, placed on the drives where it '
        'reduces the error most; EFFECT:drive,drive names the drives; '
        'measured_curve:DRIVE@VARIABLE is a correction table for what no effect explains')
    effect.completer = lambda **_: catalogue()  # type: ignore[attr-defined]  # of argcomplete
    add_shared(parser, 'recordings', 'topic', 'as-it-is', 'validate', 'reference', 'output',
               'report')
    parser.add_argument('--force', action='store_true',
                        help='adopt it although the check objects; the history records why')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    # What does not exist is said before recordings are read.
    EffectRequest.of(options.effect, DriveModel.load(find_file(options.model)))
    screen, result = answer(adopt, options, effect=options.effect, force=options.force,
                            reference=options.reference)
    if result.adopted:
        result.save(options.output)
    show(result, options, screen, lambda: result.page(options.output))
    if not result.adopted:
        return 1
    screen.print(f'model: {shown(options.output)}', soft_wrap=True)
    return 0
