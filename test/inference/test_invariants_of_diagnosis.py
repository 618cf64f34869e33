# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What is true of every diagnosis: on a single axis and on an arm, for effects of each kind."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from model_recordings import with_effects
from planar_arm import planar_arm
from single_axis import AXIS, TIME, Effects, axis, axis_motion, axis_recording

from pprs_dynamics import DriveModel, JointMotion, compare
from pprs_dynamics.arrays import root_mean_square
from pprs_dynamics.inference.adoption.adopt import adopt_all
from pprs_dynamics.inference.adoption.adoption import LedgerBook, RecordingEntry
from pprs_dynamics.inference.diagnosis.answer import rival_effects
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.diagnosis.sentences import Sentences
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.residuals.residuals import rms
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.table import ModelTable
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.ledger import read_steps

NOISE = 0.1  # [N]
LATER = 4321.0  # [s] on the recording's clock
HIDDEN: dict[str, Effects] = {
    'nothing': {}, 'dry': {'coulomb_friction': {'force': 1.2}},
    'viscous': {'viscous_friction': {'coefficient': 12.0}},
    'spring': {'drive_spring': {'stiffness': 60.0, 'position': 0.02}},
    'inertia': {'drive_inertia': {'mass': 2.0}}, 'offset': {'effort_offset': {'force': 0.8}},
    'gain': {'effort_gain': {'gain': 0.1}}, 'delay': {'time_delay': {'delay': 0.0173}},
    'friction': {'coulomb_friction': {'force': 1.2}, 'viscous_friction': {'coefficient': 12.0}},
    'two': {'drive_inertia': {'mass': 3.0}, 'viscous_friction': {'coefficient': 20.0}}}
SOMETHING = [name for name in HIDDEN if name != 'nothing']
DRY = axis(HIDDEN['dry'])


@cache
def recorded(name: str, seed: int) -> Recording:
    """Return a recording of an axis with effects, which differs by motion and noise."""
    return axis_recording(axis(HIDDEN[name]), seed, NOISE)


@cache
def diagnosed(name: str, *seeds: int) -> Diagnosis:
    return diagnose(axis(), [recorded(name, seed) for seed in seeds])


def answer(found: Diagnosis) -> tuple[str, list[tuple[str, tuple[str, ...] | None]]]:
    return found.verdict, [(effect.name, effect.drives) for effect in found.effects]


def possible(found: Diagnosis) -> set[str]:
    """Return the names of the reported effects and of their rivals."""
    return {effect.name for effect in found.effects}.union(*found.indistinguishable)


def table_of(found: Diagnosis) -> ModelTable:
    assert found.selection is not None
    return found.selection


@pytest.mark.parametrize('name', HIDDEN)
def test_what_is_hidden_is_reported_with_its_values_and_nothing_else(name: str) -> None:
    found = diagnosed(name, 1)
    assert found.verdict in (('effect', 'ambiguous') if HIDDEN[name] else ('adequate',))
    assert possible(found) >= set(HIDDEN[name])
    assert len(found.effects) == len(HIDDEN[name])
    # What lowers the error most comes first, of the reported effects and of those tried alone.
    errors, evidence = ([effect.error_before for effect in found.effects],
                        [candidate.evidence for candidate in found.candidates])
    assert errors == sorted(errors, reverse=True)
    assert evidence == sorted(evidence, reverse=True)
    for effect in found.effects:
        assert effect.course is None
        for key, value in HIDDEN[name].get(effect.name, {}).items():
            estimate = effect.parameters[f'{AXIS}.{key}']
            assert abs(estimate.value - value) < 4 * estimate.std < 0.6 * abs(value), key


@pytest.mark.parametrize('name', SOMETHING)
def test_reported_effects_lower_the_error_held_out_too(name: str) -> None:
    found, run = diagnosed(name, 1), recorded(name, 1)
    other = diagnose(axis(), [run], [recorded(name, 2)])  # a motion that the search has not seen
    for effect in (*found.effects, *other.effects):
        assert effect.held_out_after < effect.held_out_before
        assert effect.error_after < effect.error_before
        assert effect.evidence > 0
    # Without the forces of all effects is the error of the input model, as no number of it moved.
    error = found.to_dict()['refit']
    assert error['error_after'] == pytest.approx(error['error_before'], rel=1e-4)
    if len(found.effects) == 1:
        assert found.effects[0].error_before == pytest.approx(error['error_before'], rel=1e-4)
    # What is promised is what the model with the effects does.
    assert found.effects[0].error_after == pytest.approx(
        rms(measure_residuals(found.adopted, [run])[0]), rel=1e-3)
    assert other.effects[0].held_out_after == pytest.approx(
        rms(measure_residuals(other.adopted, [recorded(name, 2)])[0]), rel=1e-3)


@pytest.mark.parametrize('name', HIDDEN)
def test_the_reported_set_is_the_row_of_least_cost_and_costs_add_up(name: str) -> None:
    found = diagnosed(name, 1)
    table, costs = table_of(found), [row.cost for row in found.sets]
    assert table.best.cost == min(row.cost for row in table.rows)
    assert all(row.is_exact for row in table.rows
               if row.cost < table.best.cost + DECISIONS.rival_margin)
    assert {effect.name for effect in (*found.effects, *found.unconfirmed)} == {
        candidate.name for candidate in table.best.effects}
    assert costs == sorted(costs)
    assert costs[0] == 0
    assert [effect.name for effect in found.sets[0].effects] == [
        candidate.name for candidate in table.best.fitted.candidates]
    for fitted in found.sets:
        assert sum(vars(fitted.terms).values()) == pytest.approx(fitted.cost, abs=1e-6)
    for effect in found.effects:
        without = min(row.cost for row in table.rows
                      if effect.name not in {candidate.name for candidate in row.effects})
        assert effect.without is not None
        assert effect.evidence == pytest.approx(effect.without.cost, abs=1e-6)
        assert effect.evidence == pytest.approx(without - table.best.cost, abs=1e-6)


@pytest.mark.parametrize(('name', 's', 'k'), [*((name, 1.0, 1e3) for name in HIDDEN), *(
    pytest.param(name, 5.0, 100.0, marks=[pytest.mark.slow] * (name not in ('dry', 'delay', 'two')))
    for name in HIDDEN)])
def test_the_answer_does_not_depend_on_units_size_or_the_origin_of_time(
    name: str, s: float, k: float,
) -> None:
    """Lengths times s, times times sqrt(s), forces times k, so that gravity stays (Froude)."""
    given = axis().values
    powers = {'links.mass': k, 'friction.viscous': k / s ** 0.5, 'friction.coulomb': k,
              'friction.offset': k, 'friction.reversal_velocity': s ** 0.5}
    model = DriveModel.from_parameters({
        **given, **{key: np.multiply(given[key], by).tolist() for key, by in powers.items()}})
    run, usual = recorded(name, 1), diagnosed(name, 1)
    found = diagnose(model, [Recording.from_arrays(
        'scaled', s ** 0.5 * run.time + LATER, s * run.position, None, k * run.effort, (AXIS,))])
    assert answer(found)[1] == answer(usual)[1]
    if s == 1:
        assert found.verdict == usual.verdict
        assert found.noise_floor == pytest.approx(k * usual.noise_floor, rel=1e-3)


@pytest.mark.parametrize('name', ['coulomb_friction', 'effort_offset', 'time_delay'])
def test_the_answer_does_not_depend_on_the_order_of_drives(tmp_path: Path, name: str) -> None:
    """One arm and one recording, whose drives are listed from the base and from the tool."""
    size = {'coulomb_friction': {'force': 1.2}, 'effort_offset': {'force': 0.8},
            'time_delay': {'delay': 0.02}}[name]
    planar_arm(tmp_path, 2)
    path = tmp_path / 'arm.yaml'
    model = DriveModel.load(path)
    hidden = with_effects(model, {name: {f'j2.{key}': value for key, value in size.items()}})
    size, omega = np.array([0.6, 0.8]), 2 * np.pi * np.array([0.5, 0.75])
    phase = TIME[:, None] * omega + [0.3, 1.1]
    moved = JointMotion(size * np.sin(phase), size * omega * np.cos(phase),
                        -size * omega ** 2 * np.sin(phase), time=TIME)
    effort = hidden.measured(hidden.drive_forces(moved)).total
    effort = effort + 0.02 * np.random.default_rng(0).normal(size=effort.shape)
    found = []
    for order in ([0, 1], [1, 0]):
        drives = tuple(('j1', 'j2')[k] for k in order)
        path.write_text(path.read_text().replace('[j1, j2]', f'[{", ".join(drives)}]'))
        found.append(diagnose(DriveModel.load(path), [Recording.from_arrays(
            'run', TIME, moved.position[:, order], None, effort[:, order], drives)]))
    assert answer(found[0]) == answer(found[1])
    assert (name, ('j2',)) in answer(found[0])[1]
    for effect, other in zip(found[0].effects, found[1].effects, strict=True):
        assert effect.evidence == pytest.approx(other.evidence, rel=1e-3, abs=0.1)


@pytest.mark.parametrize('name', SOMETHING)
def test_twice_the_data_never_removes_an_effect_and_makes_its_size_surer(name: str) -> None:
    once, twice = diagnosed(name, 1), diagnosed(name, 1, 2)
    assert possible(twice) >= set(HIDDEN[name])
    before, after = ({f'{effect.name}.{key}': estimate.std for effect in found.effects
                      for key, estimate in effect.parameters.items()} for found in (once, twice))
    for key in before.keys() & after.keys():
        assert after[key] < before[key], key


def test_the_order_of_recordings_does_not_matter() -> None:
    forth, back = diagnosed('two', 1, 2), diagnosed('two', 2, 1)
    assert answer(forth) == answer(back)
    assert [effect.evidence for effect in forth.effects] == pytest.approx(
        [effect.evidence for effect in back.effects], abs=0.01)


@pytest.mark.parametrize('name', ['viscous', 'spring', 'delay'])
def test_with_all_that_is_reported_in_the_model_nothing_is_missing(name: str) -> None:
    walk = adopt_all(axis(), [recorded(name, 1)], [recorded(name, 2)])
    assert walk.ended == 'adequate'
    assert set(walk.model.values['effects.active']) == set(HIDDEN[name])
    assert answer(diagnose(walk.model, [recorded(name, 3)])) == ('adequate', [])


def test_each_of_several_adopted_effects_has_its_step_in_the_ledger() -> None:
    recordings = [recorded('two', 1), recorded('two', 2)]
    book = LedgerBook(tuple(map(RecordingEntry, recordings)), ())
    walk = adopt_all(axis(), recordings, record=book.entered, diagnosis=diagnosed('two', 1, 2))
    assert {step.effect for step in read_steps(walk.model.values)} == set(HIDDEN['two'])


def test_friction_has_the_sign_of_friction() -> None:
    table = table_of(diagnosed('dry', 1))
    # The prior has its probability on one side, but for the odds of a wrong sign.
    assert table.best.terms.signs == pytest.approx(
        -2 * np.log(2 * (1 - DECISIONS.wrong_sign_odds)), abs=1e-3)


def test_rivals_have_the_values_that_explain_the_same() -> None:
    """On one sine a spring is a negative mass."""
    spring, omega = 55.0, np.pi
    time = np.arange(0.0, 20.0, 0.004)
    q = 0.08 * np.sin(omega * time)[:, None]
    moved = JointMotion(q, 0.08 * omega * np.cos(omega * time)[:, None], -omega ** 2 * q, time)
    force = axis().drive_forces(moved).total + spring * q
    force += 0.05 * np.random.default_rng(3).normal(size=force.shape)
    found = diagnose(axis(), [Recording.from_arrays('sine', time, q, None, force, (AXIS,))])
    assert found.verdict == 'ambiguous'
    best, rivals = found.effects[0], rival_effects(found)
    assert {name for _, *names in found.indistinguishable for name in names} == {
        rival.found.name for rival in rivals}
    values = {found.name: found.parameters for found in (best, *(rival.found for rival in rivals))}
    for name, key, value in (('drive_spring', 'stiffness', spring),
                             ('drive_inertia', 'mass', -spring / omega ** 2)):
        estimate = values[name][f'{AXIS}.{key}']
        assert estimate.value == pytest.approx(value, abs=4 * estimate.std)
    for rival in rivals:
        assert 0 <= rival.cost <= DECISIONS.rival_margin
        assert rival.found.name not in {effect.name for effect in found.effects}
        if rival.found.name in ('drive_spring', 'drive_inertia'):
            left = rival.found.force - best.force
            assert np.sqrt(np.mean(left ** 2)) < 0.1 * np.sqrt(np.mean(best.force ** 2))
            assert rival.found.error_after == pytest.approx(best.error_after, rel=0.05)
            assert rival.found.held_out_after == pytest.approx(best.held_out_after, rel=0.05)


def test_an_effect_that_raises_the_error_of_held_out_recordings_is_unknown() -> None:
    found = diagnose(axis(), [recorded('dry', 1)], [recorded('nothing', 2)])
    assert (found.verdict, found.effects) == ('unknown', ())
    (refuted,) = found.unconfirmed
    assert refuted.name == 'coulomb_friction'
    assert refuted.held_out_after > refuted.held_out_before
    assert refuted.held_out_certainty < -2
    assert 'predicted worse with it, by' in refuted.objection
    # The model that is handed on does not have it.
    assert found.adopted.values['effects.active'] == []


@cache
def diagnosed_half_way(is_there: bool) -> Diagnosis:
    """Return the diagnosis of friction that begins; a held-out recording has it, or not."""
    begun = axis_recording(DRY, before=axis(), begins=4.0)
    begun = replace(begun, time=begun.time + LATER)
    return diagnose(axis(), [begun], [recorded('dry' if is_there else 'nothing', 2)])


@pytest.mark.parametrize('is_there', [True, False])
def test_an_effect_that_begins_has_a_time_and_held_out_recordings_count(is_there: bool) -> None:
    found = diagnosed_half_way(is_there)
    other = recorded('dry' if is_there else 'nothing', 2)
    (effect,) = found.effects if is_there else found.unconfirmed
    assert found.verdict == ('effect' if is_there else 'unknown')
    assert effect.to_dict()['since'] == pytest.approx(4.0, abs=0.1)
    before = rms(measure_residuals(axis(), [other])[0])
    assert (effect.held_out_after < before) is is_there
    assert effect.held_out_before == pytest.approx(before, rel=0.05)
    # All the time it is a row as well, which costs more.
    constant = next(row for row in table_of(found).rows if row.effects and not row.fitted.is_dated)
    assert constant.cost > table_of(found).best.cost + DECISIONS.rival_margin


@pytest.mark.parametrize('is_there', [True, False])
def test_no_sentence_asks_for_the_cause_of_an_effect_that_held_out_data_refute(
    is_there: bool,
) -> None:
    words = Sentences(diagnosed_half_way(is_there))
    asks = [words.headline, words.following, words.command,
            *(f'{effect.title} {effect.what} {effect.cause}' for effect in words.effects)]
    assert any('coulomb_friction' in question for question in asks) is is_there
    assert ('what happened to the machine' in words.following) is is_there


def of_force(hidden: Effects) -> float:
    """Return the rms of what effects add to the force along the first motion [N]."""
    motion = axis_motion(TIME, 1)
    real, model = (robot.drive_forces(motion).total for robot in (axis(hidden), axis()))
    return root_mean_square(real - model)


def test_an_effect_is_credited_with_what_its_force_removes_the_largest_first() -> None:
    found = diagnosed('two', 1)
    sizes = {name: of_force({name: values}) for name, values in HIDDEN['two'].items()}
    assert [effect.name for effect in found.effects] == sorted(sizes, key=lambda name: -sizes[name])
    for effect in found.effects:
        removed = np.sqrt(effect.error_before ** 2 - effect.error_after ** 2)
        assert removed == pytest.approx(sizes[effect.name], rel=0.05)


def test_what_another_number_of_the_model_removes_is_credited_to_no_effect() -> None:
    """The mass is 5 % more than in the model file, which says that it is known to 10 %."""
    dry = {'coulomb_friction': {'force': 0.6}}
    real = axis(dry, **{'links.mass': (21.0,)})
    found = diagnose(axis(**{'tolerances.links.mass': 0.1}), [axis_recording(real, 1, NOISE)])
    effect, = found.effects
    assert effect.name == 'coulomb_friction'
    removed = np.sqrt(effect.error_before ** 2 - effect.error_after ** 2)
    assert removed == pytest.approx(of_force(dry), rel=0.05)
    refit = found.to_dict()['refit']
    assert refit['error_after'] == pytest.approx(effect.error_before, rel=1e-3)
    heavier = of_force({'drive_inertia': {'mass': 1.0}})
    assert refit['error_before'] ** 2 - refit['error_after'] ** 2 == pytest.approx(
        heavier ** 2, rel=0.1)


@pytest.mark.parametrize('name', ['nothing', 'spring', 'dry', 'two'])
def test_compare_and_diagnose_print_the_same_noise(name: str) -> None:
    compared = compare(axis(), recorded(name, 1)).comparison.drives[AXIS].noise_floor
    assert compared == pytest.approx(diagnosed(name, 1).noise_floors[AXIS], rel=1e-6)
    # White noise in means over 10 ms, of two samples each.
    assert compared == pytest.approx(NOISE / 2 ** 0.5, rel=0.05)


def test_the_noise_of_compare_is_an_upper_estimate_where_a_recording_is_short() -> None:
    """Of the largest fit, which has no exact shape; the reported set then shows less."""
    run = axis_recording(axis({'stribeck_friction': {'force': 1.2, 'velocity': 0.02}}), 2,
                         NOISE / 2, time=np.arange(0.0, 6.0, 0.005))
    found = diagnose(axis(), [run]).noise_floors[AXIS]
    assert found == pytest.approx(NOISE / 2 / 2 ** 0.5, rel=0.05)
    assert found < compare(axis(), run).comparison.drives[AXIS].noise_floor < 1.4 * found


def test_a_force_of_no_catalogue_is_unknown_with_its_place() -> None:
    run = recorded('nothing', 1)
    bump = 0.3 * np.exp(-((run.position - 0.02) / 0.01) ** 2)
    found = diagnose(axis(), [replace(run, effort=run.effort + bump)])
    assert answer(found) == ('unknown', [])
    first = found.depends_on[0]
    assert (first.drive, first.variable) == (AXIS, 'position')
    assert first.range == pytest.approx((0.01, 0.03), abs=0.006)
    assert dict(found.above_noise) == {}  # too small to be seen in the residual of the whole


def test_what_drifts_is_unknown_and_reported_as_drifting() -> None:
    run = recorded('nothing', 1)
    found = diagnose(axis(), [replace(run, effort=run.effort + 3.0 * TIME[:, None] / TIME[-1])])
    assert answer(found) == ('unknown', [('effort_offset', (AXIS,))])
    assert found.to_dict()['effects'][0]['course'] == 'drift'
    assert found.effects[0].parameters[f'{AXIS}.force'].value == pytest.approx(3.0, abs=0.05)
