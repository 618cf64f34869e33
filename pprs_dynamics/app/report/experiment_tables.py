# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A designed experiment in the terminal, drawn with rich."""

from __future__ import annotations

from typing import Any

from pprs_dynamics.app.report.terminal import text_table
from pprs_dynamics.inference.experiments.arm_motions import ArmExcitation
from pprs_dynamics.inference.experiments.next_experiment import Experiment

MOST_SHOWN = 12
HIGH = 0.5  # use of a limit, from which on it is shown


def experiment_view(experiment: Experiment) -> Any:
    """Return what a motion is for, what it promises, and which limits it uses."""
    from rich.console import Group
    from rich.markup import escape

    parts: list[Any] = [f'[bold]{escape(experiment.text)}[/]']
    if experiment.contests:
        parts.append(_table('What it would tell', CONTEST_HEADINGS, contest_rows(experiment)))
    if experiment.accuracies:
        parts.append(_table('Standard deviations', ACCURACY_HEADINGS,
                            accuracy_rows(experiment)[:MOST_SHOWN]))
        if len(experiment.accuracies) > MOST_SHOWN:
            parts.append(f'… and {len(experiment.accuracies) - MOST_SHOWN} more, in --json and '
                         '--report')
    used = [row for row in limit_rows(experiment) if float(row[1].rstrip(' %')) >= 100 * HIGH]
    parts.append('limits, of what their margin leaves: ' + ', '.join(
        f'{name} {share}' for name, share in used[:6]) + '; all others less')
    return Group(*parts)


def excitation_view(excitation: ArmExcitation) -> Any:
    """Return what an arm's first motion is for, and which limits it uses."""
    from rich.console import Group
    from rich.markup import escape

    return Group(escape(excitation.text), 'limits, of what their margin leaves: ' + ', '.join(
        f'{name} {share:.0%}' for name, share in excitation.limits.items()))


CONTEST_HEADINGS = ('if the truth is', 'and the rival', 'evidence now', 'expected', 'chance')
ACCURACY_HEADINGS = ('number', 'before', 'after', 'matters from', 'unit')


def contest_rows(experiment: Experiment) -> list[tuple[str, ...]]:
    """Return one row of text per contest; the page and the terminal show them."""
    return [(one.truth, one.rival, f'{one.now:.0f}', f'{one.expected:.0f}',
             f'{one.probability:.0%}') for one in experiment.contests]


def accuracy_rows(experiment: Experiment) -> list[tuple[str, ...]]:
    """Return one row of text per number."""
    return [(one.label, _number(one.before), _number(one.after), f'{one.scale:.3g}', one.unit)
            for one in experiment.accuracies]


def limit_rows(experiment: Experiment) -> list[tuple[str, str]]:
    """Return every limit with its use, the fullest first."""
    ranked = sorted(experiment.limits.items(), key=lambda item: -item[1])
    return [(name, f'{100 * use:.0f} %') for name, use in ranked]


def _number(value: float) -> str:
    return 'unknown' if value == float('inf') else f'{value:.3g}'


def _table(title: str, headings: tuple[str, ...], rows: list[tuple[str, ...]]) -> Any:
    from rich.markup import escape

    return text_table(headings, [tuple(map(escape, row)) for row in rows], right=(), frame='head',
                      title=title)
