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

"""The best sets of effects in words, with their costs."""

from __future__ import annotations

from pprs_dynamics.diagnosis.diagnose import Diagnosis
from pprs_dynamics.diagnosis.quantities import listed, plain, with_drives
from pprs_dynamics.diagnosis.unknown_words import place_of


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
