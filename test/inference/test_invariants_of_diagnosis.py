# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What is true of every diagnosis: on a single axis and on an arm, for effects of each kind."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from planar_arm import planar_arm
from single_axis import AXIS, axis_values

from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.inference.adoption.loop import adopt_all
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.measurement.files.recording import Recording

RATE, DURATION = 200.0, 8.0  # [Hz, s]
NOISE = 0.1  # [N]
LATER = 4321.0  # [s] on the recording's clock
EFFORTS = 20.0, 40.0, 6.0, -2.0
HIDDEN = {
    'nothing': {}, 'coulomb_friction': {'force': 1.2}, 'viscous_friction': {'coefficient': 12.0},
    'drive_spring': {'stiffness': 60.0, 'position': 0.02}, 'drive_inertia': {'mass': 2.0},
    'effort_offset': {'force': 0.8}, 'effort_gain': {'gain': 0.1}, 'time_delay': {'delay': 0.02}}
EFFECTS = [name for name in HIDDEN if name != 'nothing']


def axis_model() -> DriveModel:
    return DriveModel.from_parameters(axis_values(*EFFORTS))


@cache
def recorded(name: str, seed: int) -> Recording:
    """Return a recording of an axis with an effect, which differs by motion and noise."""
    effect = {f'effects.{name}.{AXIS}.{key}': one for key, one in HIDDEN[name].items()}
    model = DriveModel.from_parameters({**axis_values(*EFFORTS), **effect,
                         'effects.active': [name] if effect else []})
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, DURATION, 1 / RATE)
    omega = 2 * np.pi * np.array([0.25, 0.5, 1.0])[:, None]
    phase = omega * time + rng.uniform(0, 2 * np.pi, (3, 1))
    size = np.array([0.08, 0.04, 0.015])[:, None]
    moved = JointMotion(*((each).sum(axis=0)[:, None] for each in (
        size * np.sin(phase), size * omega * np.cos(phase), -size * omega ** 2 * np.sin(phase))),
        time=time)
    effort = model.measured(model.drive_forces(moved)).total
    return Recording.from_arrays(f'run_{seed}', time, moved.position, None,
                                 effort + NOISE * rng.normal(size=effort.shape), (AXIS,))


@cache
def diagnosed(name: str, *seeds: int) -> Diagnosis:
    return diagnose(axis_model(), [recorded(name, seed) for seed in seeds])


def answer(found: Diagnosis) -> tuple[str, list[tuple[str, tuple[str, ...] | None]]]:
    return found.verdict, [(one.name, one.drives) for one in found.effects]


@pytest.mark.parametrize('name', HIDDEN)
def test_what_is_hidden_is_reported_and_nothing_where_nothing_is(name: str) -> None:
    found = diagnosed(name, 1)
    possible = {one.name for one in found.effects}.union(*found.indistinguishable)
    assert name in possible if name in EFFECTS else not possible
    assert all(one.course is None for one in found.effects)


@pytest.mark.parametrize('name', EFFECTS)
def test_a_reported_effect_lowers_the_held_out_error(name: str) -> None:
    found = diagnosed(name, 1)
    assert found.verdict in ('effect', 'ambiguous')
    for one in found.effects:
        assert one.held_out_after < one.held_out_before
        assert one.error_after < one.error_before
    # On another motion, which no part of the search has seen.
    other = diagnose(axis_model(), [recorded(name, 1)], [recorded(name, 2)])
    assert other.effects
    for one in other.effects:
        assert one.held_out_after < one.held_out_before


@pytest.mark.parametrize('name', HIDDEN)
def test_costs_add_up_and_the_best_set_is_first(name: str) -> None:
    found = diagnosed(name, 1)
    costs = [one.cost for one in found.sets]
    assert costs == sorted(costs)
    assert costs[0] == 0
    for one in found.sets:
        assert sum(one.terms.to_dict().values()) == pytest.approx(one.cost, abs=1e-6)
    for effect in found.effects:
        assert effect.evidence > 0
        assert effect.without is not None
        assert effect.without.cost == pytest.approx(effect.evidence, abs=1e-6)


@pytest.mark.parametrize('name', HIDDEN)
def test_the_answer_does_not_depend_on_the_origin_of_time(name: str) -> None:
    run = recorded(name, 1)
    later = diagnose(axis_model(), [replace(run, time=run.time + LATER)])
    assert answer(later) == answer(diagnosed(name, 1))
    for one, other in zip(later.effects, diagnosed(name, 1).effects, strict=True):
        assert one.evidence == pytest.approx(other.evidence, rel=1e-3, abs=0.1)


@pytest.mark.parametrize('name', HIDDEN)
@pytest.mark.parametrize(('s', 'k'), [(1.0, 1e3), (5.0, 100.0)], ids=['mN', 'large'])
def test_the_answer_does_not_depend_on_units_or_size(name: str, s: float, k: float) -> None:
    """Lengths times s, times times sqrt(s), forces times k, so that gravity stays (Froude)."""
    given = axis_model().values
    powers = {'links.mass': k, 'friction.viscous': k / s ** 0.5, 'friction.coulomb': k,
              'friction.offset': k, 'friction.reversal_velocity': s ** 0.5}
    model = DriveModel.from_parameters({
        **given, **{key: np.multiply(given[key], by).tolist() for key, by in powers.items()}})
    run, usual = recorded(name, 1), diagnosed(name, 1)
    found = diagnose(model, [Recording.from_arrays(
        'scaled', s ** 0.5 * run.time, s * run.position, None, k * run.effort, (AXIS,))])
    assert answer(found)[1] == answer(usual)[1]
    if s == 1:
        assert found.verdict == usual.verdict
        assert found.noise_floor == pytest.approx(k * usual.noise_floor, rel=1e-3)


@pytest.mark.parametrize('name', ['coulomb_friction', 'effort_offset', 'time_delay'])
def test_the_answer_does_not_depend_on_the_order_of_drives(tmp_path: Path, name: str) -> None:
    """One arm and one recording, whose drives are listed from the base and from the tool."""
    planar_arm(tmp_path, 2)
    path = tmp_path / 'arm.yaml'
    model = DriveModel.load(path)
    hidden = DriveModel.from_parameters({**model.values, 'effects.active': [name], **{
        f'effects.{name}.j2.{key}': one for key, one in HIDDEN[name].items()}}, model.source)
    time = np.arange(0.0, DURATION, 1 / RATE)
    size, omega = np.array([0.6, 0.8]), 2 * np.pi * np.array([0.5, 0.75])
    phase = time[:, None] * omega + [0.3, 1.1]
    moved = JointMotion(size * np.sin(phase), size * omega * np.cos(phase),
                        -size * omega ** 2 * np.sin(phase), time=time)
    effort = hidden.measured(hidden.drive_forces(moved)).total
    effort = effort + 0.02 * np.random.default_rng(0).normal(size=effort.shape)
    found = []
    for order in ([0, 1], [1, 0]):
        drives = tuple(('j1', 'j2')[k] for k in order)
        path.write_text(path.read_text().replace('[j1, j2]', f'[{", ".join(drives)}]'))
        found.append(diagnose(DriveModel.load(path), [Recording.from_arrays(
            'run', time, moved.position[:, order], None, effort[:, order], drives)]))
    assert answer(found[0]) == answer(found[1])
    assert (name, ('j2',)) in answer(found[0])[1]
    for one, other in zip(found[0].effects, found[1].effects, strict=True):
        assert one.evidence == pytest.approx(other.evidence, rel=1e-3, abs=0.1)


@pytest.mark.parametrize('name', EFFECTS)
def test_twice_the_data_never_removes_an_effect_and_makes_its_size_surer(name: str) -> None:
    once, twice = diagnosed(name, 1), diagnosed(name, 1, 2)
    assert name in {one.name for one in twice.effects}.union(*twice.indistinguishable)
    before, after = ({f'{one.name}.{key}': each.std for one in found.effects
                      for key, each in one.parameters.items()} for found in (once, twice))
    for key in before.keys() & after.keys():
        assert after[key] < before[key], key


@pytest.mark.parametrize('name', ['viscous_friction', 'drive_spring', 'time_delay'])
def test_with_all_that_is_reported_in_the_model_nothing_is_missing(name: str) -> None:
    walk = adopt_all(axis_model(), [recorded(name, 1)], [recorded(name, 2)])
    assert walk.ended == 'adequate'
    assert name in walk.model.values['effects.active']
    assert answer(diagnose(walk.model, [recorded(name, 3)])) == ('adequate', [])
