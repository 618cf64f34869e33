"""pprs compare: model against measurement, and where it fails."""

from __future__ import annotations

import argparse

from rich.markup import escape

from pprs_dynamics.commands.arguments import PAGE, output_file
from pprs_dynamics.commands.output import write_json
from pprs_dynamics.commands.recordings import add_recordings, read_recordings
from pprs_dynamics.diagnosis.comparison import compare
from pprs_dynamics.diagnosis.localisation import localise
from pprs_dynamics.model.model_file import load_model
from pprs_dynamics.report.comparison_page import comparison_page
from pprs_dynamics.report.progress import progress_bar
from pprs_dynamics.report.tables import comparison_table
from pprs_dynamics.report.terminal import console, shown
from pprs_dynamics.residuals.measuring import measure_residuals

MOST_SHOWN = 8


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    add_recordings(parser)
    parser.add_argument('--report', metavar='FILE.html', type=output_file(*PAGE),
                        help='write a page with all figures')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    screen = console()
    model = load_model(options.model)
    recordings = read_recordings(options, screen, model)
    with progress_bar(screen, 'motion and model') as progress:
        residuals, notes = measure_residuals(model, recordings, progress)
    with progress_bar(screen, 'where it fails') as progress:
        where = localise(residuals, progress=lambda share: progress(share, 1.0))
    comparison = compare(residuals, where)
    screen.print(comparison_table(comparison))
    screen.print(escape(comparison.verdict))
    for number, statement in enumerate(where.statements[:MOST_SHOWN], start=1):
        screen.print(f'{number}. {escape(statement.text)}')
    if not where.statements:
        screen.print('Nowhere in particular: nothing stands out against noise.')
    if len(where.statements) > MOST_SHOWN:
        screen.print(f'… and {len(where.statements) - MOST_SHOWN} more, in --json and --report')
    if options.json:
        write_json(options.json, {**comparison.to_json(), 'verdict': comparison.verdict})
    if options.report:
        page = comparison_page(model, recordings, residuals, comparison, notes)
        screen.print(f'page: {shown(page.write(options.report))}')
    return 0
