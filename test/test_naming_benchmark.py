# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The naming benchmark scores as its protocol says: entrants whose score is known get it."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from benchmarks.naming import run
from benchmarks.naming.entrants import ENTRANTS, Entrant
from benchmarks.naming.entrants.controls import perfect
from benchmarks.naming.entrants.cross_validation import block_cross_validation
from benchmarks.naming.entrants.pprs import answer_of
from benchmarks.naming.entrants.spike_and_slab import spike_and_slab
from benchmarks.naming.entrants.stepwise import stepwise
from benchmarks.naming.generate import draws
from benchmarks.naming.page import (
    fails_table,
    is_right,
    write_page,
)
from benchmarks.naming.problems import (
    Answer,
    AnswerError,
    Column,
    Named,
    Problem,
    Truth,
)
from benchmarks.naming.run import enter_all, make_all, score_all
from benchmarks.naming.scoring import FIGURES, Rate, Scored, figures, judge

pytestmark = pytest.mark.slow

DRIVES = ('a', 'b')
EFFECTS = ('viscous', 'coulomb', 'spring', 'offset')
DRIFT = Truth('p', 'axis', 'single', 'white', 1.0, (Named('spring', ('b',), {
    'b.stiffness': (3.0, None)}),))
PAIR = Truth('p', 'axis', 'two', 'white', 1.0, (Named('spring', ('b',)), Named('offset', ('a',))))
NOTHING = Truth('p', 'axis', 'nothing', 'white', 0.0, ())
UNKNOWN = Truth('p', 'axis', 'unknown', 'white', 5.0, (Named('bump', ('a',)),))
FORM = Truth('p', 'axis', 'form', 'white', 5.0, (Named('viscous', ('a',)),))


TRUTHS = (DRIFT, PAIR, NOTHING, UNKNOWN, FORM)


def problem(seed: int, hidden: dict[tuple[str, str], float], noise: float = 0.1,
            correlation: float = 0.0) -> Problem:
    """Return a made-up regression with columns that are hidden with coefficients."""
    rng = np.random.default_rng(seed)
    n = 1500
    time = np.arange(n) * 0.01
    rows, columns = [], []
    error = np.empty((n, 2))
    for d, drive in enumerate(DRIVES):
        phase = rng.uniform(0, 6, 4)
        position = sum(np.sin((k + 1) * 0.7 * time + phase[k]) for k in range(4))
        velocity = np.gradient(position, time)
        for effect, values in zip(EFFECTS, (velocity, np.sign(velocity), position, np.ones(n)),
                                  strict=True):
            row = np.zeros((n, 2))
            row[:, d] = values
            rows.append(row)
            columns.append(Column(effect, 'c', drive))
        white = rng.normal(size=n)
        error[:, d] = noise * white
        for k in range(1, n if correlation else 0):
            error[k, d] += correlation * error[k - 1, d]
    for (effect, drive), size in hidden.items():
        error += size * rows[columns.index(Column(effect, 'c', drive))]
    return Problem(DRIVES, time, error, np.zeros((0, n, 2)), tuple(columns), np.array(rows))


def scored(answer: object) -> Scored:
    found = [(truth, answer(truth) if callable(answer) else answer) for truth in TRUTHS]
    return [(truth, said, judge(truth, said)) for truth, said in found]


def test_the_perfect_entrant_gets_everything() -> None:
    for name, rate in figures(scored(perfect)).items():
        better = next((up for figure, _, _, up in FIGURES if figure == name), True)
        assert rate.count == 0 or rate.share == (1.0 if better else 0.0), name


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


def test_intervals_are_held_against_the_truth() -> None:
    def said(value: float, std: float | None) -> Answer:
        return Answer.of([Named('spring', ('b',), {'b.stiffness': (value, std)})])

    assert judge(DRIFT, said(3.1, 0.1)).covered == (True,)
    assert judge(DRIFT, said(3.3, 0.1)).covered == (False,)
    assert judge(DRIFT, said(3.3, None)).covered == ()


def test_wilson() -> None:
    # E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209: 8 of 10 at 95 %.
    low, high = Rate(8, 10).interval
    assert (round(low, 3), round(high, 3)) == (0.490, 0.943)


@pytest.mark.parametrize('text', [
    {'verdict': 'sure', 'sets': []}, {'sets': []}, {'verdict': 'effect', 'sets': []},
    {'verdict': 'effect', 'sets': [[{'drives': None}]]},
    {'verdict': 'none', 'sets': [[{'name': 'spring'}]]}])
def test_answers_of_another_form_are_refused(text: dict[str, object]) -> None:
    with pytest.raises(AnswerError):
        Answer.from_dict(text)


def folder_of(tmp_path: Path, *problems: str) -> Path:
    """Return a folder with problems in which a spring is hidden."""
    (tmp_path / 'truth').mkdir()
    for name in problems:
        (tmp_path / 'problems' / name).mkdir(parents=True)
        problem(len(name), {('spring', 'b'): 1.0}).write(tmp_path / 'problems' / name)
        (tmp_path / 'problems' / name / 'recording.csv').write_text(name)
        (tmp_path / 'truth' / f'{name}.json').write_text(json.dumps(
            {**DRIFT.to_dict(), 'problem': name}))
    return tmp_path


def named(asked: Problem, value: float = 1.0) -> Answer:
    """Return the spring; how often it was asked stands in a file."""
    assert asked.folder is not None
    with (asked.folder / 'asked').open('a') as file:
        file.write(f'{value:g} ')
    if value < 0:
        raise ValueError('columns are alike')
    return Answer.of([Named('spring', ('b',))])


def asked(folder: Path, name: str) -> str:
    return (folder / 'problems' / name / 'asked').read_text()


def test_a_slice_is_made_entered_and_scored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    chosen = [draw for draw in draws(1, 24) if draw.robot == 'axis']
    monkeypatch.setattr(run, 'draws', lambda seed, count: chosen)
    assert make_all(tmp_path, 1, 24, 1) == 0
    entered = {name: ENTRANTS[name] for name in ('silent', 'random', 'stepwise BIC, AR')}
    assert enter_all(tmp_path, entered, 1) == 0
    (tmp_path / 'answers' / 'perfect').mkdir()
    for file in (tmp_path / 'truth').glob('*.json'):
        answer = perfect(Truth.from_dict(json.loads(file.read_text())))
        (tmp_path / 'answers' / 'perfect' / file.name).write_text(json.dumps(answer.to_dict()))
    found = score_all(tmp_path)
    nothing = sum(draw.kind == 'nothing' for draw in chosen)
    right = {name: sum(is_right(judged) for *_, judged in found[name]) for name in found}
    assert 0 < nothing < len(chosen)
    assert (right['perfect'], right['silent']) == (len(chosen), nothing)
    assert all(judged.false_alarm is not False for *_, judged in found['random'])
    assert not any(answer.error for _, answer, _ in found['stepwise BIC, AR'])
    write_page(found, {}, tmp_path / 'page.md')
    assert f'right, of {len(chosen)}' in (tmp_path / 'page.md').read_text()
    assert (tmp_path / 'images' / 'naming.png').stat().st_size > 0


def test_who_ends_in_an_error_is_silent_and_is_told_so(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, 'one')
    assert enter_all(folder, {'mine': Entrant(named, {'value': -1.0})}, 1) == 0
    (_, answer, judged), = score_all(folder)['mine']
    assert (answer.verdict, answer.error) == ('none', 'ValueError: columns are alike')
    assert judged.exact is False
    assert fails_table(score_all(folder))[-1].split('|')[-2].strip() == '1'


def test_problems_come_back_from_their_files(tmp_path: Path) -> None:
    made = problem(3, {('spring', 'b'): 1.0})
    made.write(tmp_path)
    read = Problem.read(tmp_path)
    assert read.columns == made.columns
    np.testing.assert_allclose(read.rows, made.rows, rtol=1e-6)


def test_peers_find_what_stands_out_of_white_noise() -> None:
    asked = problem(1, {('spring', 'b'): 0.2, ('coulomb', 'a'): 0.15})
    for answer in (stepwise(asked, whiten=False), stepwise(asked, whiten=True),
                   block_cross_validation(asked), spike_and_slab(asked)):
        assert {(one.name, one.drives) for one in answer.sets[0]} >= {
            ('spring', ('b',)), ('coulomb', ('a',))}
        value, std = answer.sets[0][[one.name for one in answer.sets[0]].index('spring')
                                    ].parameters['b.c']
        assert std is not None
        assert abs(value - 0.2) < 4 * std


def test_a_diagnosis_is_an_answer_with_its_rivals() -> None:
    effect = {'name': 'rod_mass', 'drives': None,
              'parameters': {'mass': {'value': 0.1, 'std': 0.01, 'unit': 'kg'}}}
    said = {'verdict': 'ambiguous', 'effects': [effect],
            'indistinguishable': [['rod_mass', 'payload_mass']]}
    assert [[one.name for one in found] for found in answer_of(said).sets] == [
        ['rod_mass'], ['payload_mass']]


def test_seeds_give_the_same_problems_and_names_that_tell_nothing() -> None:
    first, again = list(draws(5, 72)), list(draws(5, 72))
    assert first == again
    assert len({draw.name for draw in first}) == 72
    assert first[:12] == list(draws(5, 12))
    count = Counter(draw.kind for draw in first)
    assert count == {'single': 36, 'nothing': 12, 'two': 6, 'three': 6, 'unknown': 6, 'form': 6}
    for what in ('robot', 'noise'):
        assert min(Counter(getattr(draw, what) for draw in first).values()) >= 10
    assert {draw.snr for draw in first if draw.kind == 'single'} == {0.5, 1.0, 2.0, 5.0, 20.0}
    assert not any(name in draw.name for draw in first for name in draw.names)
