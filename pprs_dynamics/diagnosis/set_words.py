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
    every = diagnosis.residuals.drives
    best, second = ([with_drives(_plain_name(name), drives, every) for name, drives in one.names]
                    for one in diagnosis.sets[:2])
    missing = listed([one for one in best if one not in second])
    instead = listed([one for one in second if one not in best])
    words = (f'{instead} instead of {missing}' if missing and instead
             else f'{instead} as well' if instead else f'without {missing}')
    return f'{words}, cost +{plain(diagnosis.sets[1].cost, 2)}'


def _plain_name(name: str) -> str:
    unknown, comma, variable = name.partition(', ')
    return f'a pattern {place_of(variable)}' if comma and unknown == 'unknown' else name
