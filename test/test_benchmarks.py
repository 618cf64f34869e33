# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Every benchmark can be imported, and those that are run tell what they take."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

import pytest

from benchmarks import mutants
from benchmarks.naming.entrants.controls import perfect
from benchmarks.naming.problems import Answer, Named, Truth
from benchmarks.naming.scoring import FIGURES, Scored, figures, judge

PROJECT = Path(__file__).parents[1]
MODULES = sorted('.'.join(file.relative_to(PROJECT).with_suffix('').parts)
                 for file in (PROJECT / 'benchmarks').rglob('*.py') if file.stem != '__init__')
RUN_BY_MAKE = re.findall(r'-m (benchmarks[\w.]+)', (PROJECT / 'Makefile').read_text())


@pytest.mark.parametrize('name', MODULES)
def test_a_benchmark_imports_what_there_is(name: str) -> None:
    import_module(name)


def test_what_make_runs_is_there() -> None:
    assert len(RUN_BY_MAKE) > 8
    assert set(RUN_BY_MAKE) <= set(MODULES)


def test_mutants_have_tests_that_there_are() -> None:
    listed = mutants.listed()
    assert sum(len(entry['mutants']) for name, entry in listed.items()
               if name.startswith(('inference/search', 'inference/diagnosis'))) >= 40
    assert all((PROJECT / 'test' / name).is_file()
               for entry in listed.values() for name in entry['tests'])


def test_mutants_are_mistakes_in_code_that_there_is() -> None:
    assert mutants.stale() == []


# The naming benchmark scores as its protocol says: entrants whose score is known get it.

DRIFT = Truth('p', 'axis', 'single', 'white', 1.0, (Named('spring', ('b',), {
    'b.stiffness': (3.0, None)}),))
PAIR = Truth('p', 'axis', 'two', 'white', 1.0, (Named('spring', ('b',)), Named('offset', ('a',))))
NOTHING = Truth('p', 'axis', 'nothing', 'white', 0.0, ())
UNKNOWN = Truth('p', 'axis', 'unknown', 'white', 5.0, (Named('bump', ('a',)),))
FORM = Truth('p', 'axis', 'form', 'white', 5.0, (Named('viscous', ('a',)),))


TRUTHS = (DRIFT, PAIR, NOTHING, UNKNOWN, FORM)


def scored(answer: object) -> Scored:
    found = [(truth, answer(truth) if callable(answer) else answer) for truth in TRUTHS]
    return [(truth, said, judge(truth, said)) for truth, said in found]


@pytest.mark.slow
def test_the_perfect_entrant_gets_everything() -> None:
    for name, rate in figures(scored(perfect)).items():
        better = next((up for figure, _, _, up in FIGURES if figure == name), True)
        assert rate.count == 0 or rate.share == (1.0 if better else 0.0), name


@pytest.mark.slow
@pytest.mark.parametrize(('truth', 'answer', 'what', 'right'), [
    (DRIFT, Answer.of([Named('spring', ('b',))]), 'exact', True),
    (DRIFT, Answer.of([Named('spring', ('a',))]), 'drives', False),
    (DRIFT, Answer.of([Named('spring', ('b',)), Named('offset', ('a',))]), 'exact', False),
    (DRIFT, Answer.of([Named('offset', ('a',)), Named('spring', ('b',))]), 'first', False),
    (DRIFT, Answer.of([Named('offset', ('b',))]), 'wrong_alone', True),
    # Doubt that is told is not a wrong answer told for sure.
    (DRIFT, Answer('ambiguous', ((Named('offset'),), (Named('viscous'),))), 'wrong_alone', False),
    (DRIFT, Answer('ambiguous', ((Named('offset'),), (Named('spring'),))), 'named', True),
    (DRIFT, Answer('unknown', ((Named('spring', ('b',)),),)), 'exact', False),
    (PAIR, Answer.of([Named('offset', ('a',)), Named('spring', ('b',))]), 'exact', True),
    (PAIR, Answer('ambiguous', ((Named('offset'),), (Named('spring'),))), 'named', False),
    (PAIR, Answer.of([Named('offset', ('a',))]), 'wrong_alone', False),
    (NOTHING, Answer('unknown'), 'false_alarm', True),
    (NOTHING, Answer('none'), 'false_alarm', False),
    (UNKNOWN, Answer.of([Named('spring', ('a',))]), 'wrong_alone', True),
    (UNKNOWN, Answer('unknown'), 'unknown', True),
])
def test_what_counts(truth: Truth, answer: Answer, what: str, right: bool) -> None:
    assert getattr(judge(truth, answer), what) is right


@pytest.mark.slow
def test_intervals_are_held_against_the_truth() -> None:
    def said(value: float, std: float | None) -> Answer:
        return Answer.of([Named('spring', ('b',), {'b.stiffness': (value, std)})])

    assert judge(DRIFT, said(3.1, 0.1)).covered == (True,)
    assert judge(DRIFT, said(3.3, 0.1)).covered == (False,)
    assert judge(DRIFT, said(3.3, None)).covered == ()
