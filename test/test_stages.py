"""Two ways to the first place: which is taken, and when the other's effect is a rival."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from pprs_dynamics.diagnosis import stages
from pprs_dynamics.diagnosis.stages import Stage, Way, find_way
from pprs_dynamics.effects.catalogue import CATALOGUE


class Weighed:
    """A regression in which an effect explains 10 000, whitened."""

    def solve(self, active: list[Any], noises: Any) -> tuple[None, None, float]:
        return None, None, 10_000.0 * (1 - len(active))


def judged(name: str, evidence: float = 100.0) -> Any:
    candidate = SimpleNamespace(name=name, effect=CATALOGUE[name], penalty=20.0,
                                active=(SimpleNamespace(),))
    return SimpleNamespace(candidate=candidate, evidence=evidence, fit=None)


def stage(deviance: float, *adopted: Any, candidates: Any = (), rivals: Any = None) -> Stage:
    selection = SimpleNamespace(adopted=list(adopted), candidates=list(candidates),
                                fit=SimpleNamespace(deviance=deviance, noises={}),
                                rivals=dict(rivals or {}))
    selector = SimpleNamespace(stands_alone=lambda one: one.evidence > 0)
    return cast(Stage, SimpleNamespace(selection=selection, regression=Weighed(), design=None,
                                       selector=selector))


@pytest.fixture
def chosen(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return what is chosen of a wrench alone and of a tilted base, gone to their ends."""
    wrench, tilt = judged('external_wrench'), judged('base_tilt', 80.0)

    def choose(straight: float, bent: float, *beside: Any, rivals: Any = None) -> Way:
        first = stage(straight, wrench, candidates=[wrench, tilt], rivals=rivals)
        with_tilt = Way(first, (tilt,), stage(bent, *beside))
        monkeypatch.setattr(stages.Stage, 'of', lambda *_: first)
        monkeypatch.setattr(stages, '_followed', lambda one, *_: (
            Way(first, (), first) if one is first else with_tilt))
        monkeypatch.setattr(first, 'with_only', lambda one: stage(0.0, one), raising=False)
        return find_way(cast(Any, None), [], lambda share: None)

    return choose


def names(way: Way) -> list[str]:
    return [one.candidate.name for one in way.adopted]


def test_the_way_that_explains_more_at_its_end_is_taken(chosen: Any) -> None:
    assert names(chosen(-1000.0, -1100.0)) == ['base_tilt']
    assert names(chosen(-1000.0, -900.0)) == ['external_wrench']


def test_hardly_worse_is_a_rival_and_much_worse_is_none(chosen: Any) -> None:
    assert chosen(-1000.0, -995.0).rivals == {'external_wrench': ['base_tilt']}
    assert chosen(-1000.0, -900.0, rivals={'external_wrench': ['base_tilt', 'effort_offset']}
                  ).rivals == {'external_wrench': ['effort_offset']}
    between = {'external_wrench': ['base_tilt']}
    assert chosen(-1000.0, -980.0, rivals=between).rivals == between


def test_more_effects_must_explain_more_than_the_form_of_fewer(chosen: Any) -> None:
    beside = judged('external_wrench'), judged('revolute_stiffness')
    # A wrench of 10 000 may leave 100; two effects more cost 60.
    assert names(chosen(-1000.0, -1150.0, *beside)) == ['external_wrench']
    assert names(chosen(-1000.0, -1170.0, *beside)) == [
        'base_tilt', 'external_wrench', 'revolute_stiffness']


def test_what_is_far_behind_is_not_followed(chosen: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stages, 'COMPETES', 0.9)
    assert names(chosen(-1000.0, -np.inf)) == ['external_wrench']
