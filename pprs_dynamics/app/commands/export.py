# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`pprs export`: write the model as URDF or MJCF.

The file is replayed in MuJoCo by inverse dynamics, against the model's own forces.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import Any, TypedDict

from pprs_dynamics.app.commands.arguments import UsageError, output_file, write_json
from pprs_dynamics.app.report.terminal import console, shown, text_table
from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.keys import FILES
from pprs_dynamics.simulation.export.exported_robot import (
    FORMATS,
    MJCF,
    URDF,
    export_robot,
    written,
)
from pprs_dynamics.simulation.export.replay import replay
from pprs_dynamics.system.files import write_text
from pprs_dynamics.system.plain_text import displayed, first_of

ENDINGS = {URDF: ('.urdf',), MJCF: ('.xml', '.mjcf')}
FEW = 8  # names that the terminal lists

EXAMPLE = 'pprs export better.yaml --to mjcf --output better.xml'


class ExportJson(TypedDict):
    """A model in the format of another program.

    Parameters
    ----------
    not_expressed : list of str
        Parts of the model that the format cannot express.
    replay_error, effort : float
        RMS, over all drives, of the file's effort errors and of the model's efforts [N, N m].
    """

    not_expressed: list[str]
    replay_error: float
    effort: float


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    parser.add_argument('file', metavar='MODEL', help='model file')
    parser.add_argument('--to', choices=FORMATS, required=True, help='format of the file')
    parser.add_argument('--output', metavar='FILE', type=output_file(*(
        ending for endings in ENDINGS.values() for ending in endings)), required=True,
                        help='robot file to write: .urdf for urdf, .xml or .mjcf for mjcf')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    screen = console()
    if Path(options.output).suffix not in ENDINGS[options.to]:
        raise UsageError(f'--output is {displayed(options.output)}, must end in '
                         f'{" or ".join(ENDINGS[options.to])} for --to {options.to}')
    model = DriveModel.load(options.file)
    described = (model.values.get(key) for key in FILES)
    if any(path and os.path.realpath(path) == os.path.realpath(options.output)
           for path in described):
        raise UsageError(f'{displayed(options.output)}: {displayed(options.file)} reads the robot '
                         'from it, must be another name for --output')
    robot = export_robot(model, options.to)
    text = written(robot, options.to)
    error, effort = replay(model, robot, text, options.to)
    write_text(options.output, text)
    if options.json:
        write_json(options.json, ExportJson(
            not_expressed=list(robot.not_expressed), replay_error=root_mean_square(error),
            effort=root_mean_square(effort)))
    _print_summary(screen, model, error, effort, robot.not_expressed)
    screen.print(f'{options.to}: {shown(options.output)}', soft_wrap=True)
    return 0


def _print_summary(screen: Any, model: DriveModel, error: Array, effort: Array,
                   left: tuple[str, ...]) -> None:
    screen.print('Replayed in MuJoCo: the efforts of the model and the error of the file, rms')
    screen.print(text_table(
        ('drive', 'effort', 'error'),
        [(shown(name), *(f'{number:.3g} {unit}' for number in numbers))
         for name, unit, *numbers in zip(
             model.drives, (units.effort for units in model.units), effort, error,
             strict=True)]))
    screen.print(f'Not expressed in the file: {shown(first_of(left, FEW) or "nothing")}')
