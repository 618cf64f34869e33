# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""This package as an entrant: `pprs diagnose` on the recording and the model file."""

from __future__ import annotations

from typing import Any

from benchmarks.naming.problems import Answer, Named, Problem
from pprs_dynamics.app.api.diagnose import diagnose

VERDICT = {'adequate': 'none', 'effect': 'effect', 'ambiguous': 'ambiguous', 'unknown': 'unknown'}


def pprs(problem: Problem) -> Answer:
    """Return what `pprs diagnose` says."""
    assert problem.folder is not None
    return answer_of(diagnose(problem.folder / 'model.yaml',
                              problem.folder / 'recording.csv').to_dict())


def answer_of(said: dict[str, Any]) -> Answer:
    """Return the JSON of a diagnosis as an answer of the protocol."""
    best = [Named(effect['name'], None if effect['drives'] is None else tuple(effect['drives']),
                  {key: (value['value'], value['std'])
                   for key, value in effect['parameters'].items()}) for effect in said['effects']]
    sets = [tuple(best)] if best else []
    for alike in said['indistinguishable']:
        at = next((k for k, effect in enumerate(best) if effect.name in alike), None)
        for name in alike:
            if at is not None and name != best[at].name:
                plain = name.partition(':')[0]
                sets.append((*best[:at], Named(plain), *best[at + 1:]))
    verdict = VERDICT[said['verdict']]
    return Answer(verdict, tuple(sets) if verdict != 'none' else ())
