# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`pprs reproduce`: compute the paper's figures and check its claims.

Writes figure_8.png, figure_9.png, forces.csv and claims.json into the output folder.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TypedDict

from pprs_dynamics.app.commands.arguments import output_folder, write_json
from pprs_dynamics.app.report.pictures import draw_figure_8, draw_figure_9
from pprs_dynamics.app.report.terminal import console, escape, shown, text_table
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.errors import WorkspaceError
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.reproduction import Claim, Reproduction, reproduce
from pprs_dynamics.system.csv_tables import write_table

EXAMPLE = 'pprs reproduce --output output'


class ReproductionJson(TypedDict):
    """The paper's claims, with the equations of the model file: `corrected` or `printed`."""

    equations: str
    claims: tuple[Claim, ...]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    parser.add_argument('--output', metavar='DIR', required=True, type=output_folder,
                        help='folder for pictures, curves and claims')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    screen = console()
    model = DriveModel.load(options.model)
    with screen.status('running the paper\'s simulation'):
        try:
            result = reproduce(model)
        except WorkspaceError as error:
            print(f'pprs reproduce: this robot cannot follow the paper\'s path: {error}',
                  file=sys.stderr)
            return 1
        folder = Path(options.output)
        folder.mkdir(parents=True, exist_ok=True)
        written = [draw_figure_8(folder / 'figure_8.png', result),
                   draw_figure_9(folder / 'figure_9.png', result),
                   _write_curves(folder / 'forces.csv', result)]
    content = ReproductionJson(equations=model.values['equations'], claims=result.claims)
    for file in filter(None, (folder / 'claims.json', options.json)):
        write_json(file, content)
    screen.print(text_table(
        ('claim', 'paper', 'found', 'reproduced'),
        [(escape(claim.claim), escape(claim.paper), escape(claim.found),
          '[green]yes[/]' if claim.reproduced else '[red]no[/]') for claim in result.claims],
        right=(), whole=(3,), show_lines=True, title='The paper\'s claims and their reproduction'))
    screen.print('written: ' + ', '.join(map(shown, (*written, folder / 'claims.json'))))
    return 0


def _write_curves(path: Path, result: Reproduction) -> Path:
    columns = {'time': result.time[:, None], 'Q': result.rigid_body, 'active': result.active,
               **result.passive}
    header = ['time'] + [f'{drive}/{name}' for name in columns if name != 'time'
                         for drive in DRIVES]
    write_table(path, header, list(columns.values()))
    return path
