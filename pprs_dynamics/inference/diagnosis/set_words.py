# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The best sets of effects in words, with their costs."""

from __future__ import annotations

from pprs_dynamics.inference.diagnosis.diagnose import Diagnosis
from pprs_dynamics.inference.diagnosis.quantities import listed, plain, with_drives
from pprs_dynamics.inference.diagnosis.unknown_words import place_of


def set_rows(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    """Return the best sets of effects in words, each with its cost above the best."""
    every = diagnosis.residuals.drives
    return [(' and '.join(with_drives(_plain_name(name), drives, every)
                          for name, drives in one.names) or 'nothing missing',
             f'+{plain(one.cost, 2)}' if number else 'the best')
            for number, one in enumerate(diagnosis.sets)]


def runner_up(diagnosis: Diagnosis) -> str:
    """Return how the second best set differs from the best, with its cost; '' for none."""
    if len(diagnosis.sets) < 2:
        return ''
    best, second = (set(one.names) for one in diagnosis.sets[:2])
    missing, instead = best - second, second - best
    moved = {name for name, _ in missing} & {name for name, _ in instead}
    if len(missing | instead) <= 2:
        moved = set()  # one on other drives: both are told
    left, put = (listed([with_drives(_plain_name(name), drives, diagnosis.residuals.drives)
                         for name, drives in one.names
                         if (name, drives) in apart and name not in moved])
                 for one, apart in zip(diagnosis.sets[:2], (missing, instead), strict=True))
    words = [f'{put} instead of {left}' if put and left else f'{put} as well' if put
             else f'without {left}' if left else '',
             f'{listed(sorted(moved))} on other drives' if moved else '']
    return ', '.join([*filter(None, words), f'cost +{plain(diagnosis.sets[1].cost, 2)}'])


def _plain_name(name: str) -> str:
    unknown, comma, variable = name.partition(', ')
    return f'a pattern {place_of(variable)}' if comma and unknown == 'unknown' else name
