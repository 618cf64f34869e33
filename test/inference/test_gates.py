# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The gates of an adoption and of a search, each alone, on numbers whose answer is known."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from made_up_diagnosis import (
    SUSPECT,
    found_effect,
    made_up_diagnosis,
    made_up_residuals,
    statement,
    white_noise,
)

from pprs_dynamics import DriveModel, MechanismModel
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.inference.adoption import objections
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.regression.joint_fit import JointFit
from pprs_dynamics.inference.regression.normal_equations import Block
from pprs_dynamics.inference.residuals.paired_errors import (
    BLOCKS,
    PairedGain,
    paired_gain,
    rms,
    rms_by_drive,
)
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.inference.search.candidates import Component, EffectCandidate
from pprs_dynamics.inference.search.decisions import Decisions
from pprs_dynamics.inference.search.estimates import Estimate
from pprs_dynamics.inference.search.form_error import FormErrors
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.model.model_file import build_model

PLAIN = DriveModel.load()
WITH_EFFECT = build_model({**PLAIN.values, 'effects.active': ['payload_mass'],
                           'effects.payload_mass.mass': 0.1})


def gain(in_errors: float) -> PairedGain:
    """Return a gain over ten blocks that is so many of its standard errors."""
    spread = np.tile([-1.0, 1.0], 5)
    return PairedGain(spread + in_errors * spread.std(ddof=1) / 10 ** 0.5, np.full(10, 1e-3))


# --- held-out errors ------------------------------------------------------------------------------


@pytest.mark.parametrize(('model', 'asked'), [(PLAIN, 1.0), (WITH_EFFECT, 2.0)])
def test_a_held_out_error_must_fall_beyond_its_uncertainty(model: Any, asked: float) -> None:
    def said(sure: float, after: float = 0.9) -> list[str]:
        return objections.of_held_out_error(1.0, after, gain(sure), model, 'the recordings')

    assert said(asked + 0.01) == []
    # It falls, but blocks disagree by more than it does.
    refused, = said(asked - 0.01)
    assert refused == ('the error on the recordings falls from 1 to 0.9 N, which is '
                       f'{asked - 0.01:.2g} standard errors, must be more than '
                       f'{asked:g}')
    # It does not fall, however sure the whitened gain.
    for after in (1.0, 1.1):
        refused, = said(9.0, after)
        assert refused == (f'the error on the recordings does not fall: 1 N before, {after:.4g} N '
                           'after')


def test_of_blocks_alike_the_certainty_is_the_mean_in_its_standard_errors() -> None:
    values = np.array([1.0, 2.0, 4.0, 5.0])
    # Mean 3, deviation sqrt(10 / 3), four of them.
    found = PairedGain(values, np.full(4, 0.1))
    assert found.certainty == pytest.approx(3 / (np.sqrt(10 / 3) / 2))
    # As far as noise alone does not make more of it.
    assert PairedGain(np.full(5, 2.0), np.full(5, 2.0)).certainty == pytest.approx(10 ** 0.5 / 2)
    assert PairedGain(np.full(5, -2.0), np.full(5, 2.0)).certainty < 0
    assert PairedGain(np.zeros(5), np.zeros(5)).certainty == 0


@pytest.mark.parametrize('blocks', [1, 2, 10])
@pytest.mark.parametrize('is_there', [True, False])
def test_certainty_is_in_standard_errors_wherever_an_effect_shows(
        blocks: int, is_there: bool) -> None:
    """Of recordings with and without an effect of known force, it has a deviation of one."""
    rng = np.random.default_rng(blocks)
    force = np.zeros((10, 200))
    force[:blocks] = rng.normal(size=(blocks, 200))
    force *= 6 / np.linalg.norm(force)
    found = []
    for _ in range(400):
        error = rng.normal(size=force.shape) + is_there * force
        found.append(PairedGain(np.sum(error ** 2 - (error - force) ** 2, axis=1),
                                np.sum(force ** 2, axis=1)).certainty)
    # |f|^2 over the deviation 2 |f| of 2 noise . f.
    assert np.mean(found) == pytest.approx(3 if is_there else -3, abs=0.4)
    assert 0.75 < np.std(found) < 1.1


def residuals_of(error: np.ndarray) -> Residuals:
    """Return drives with an error (N, D), 10 ms apart."""
    samples, width = error.shape
    return Residuals(tuple(f'drive_{k}' for k in range(width)), 0.01 * np.arange(samples),
                     np.zeros(samples, dtype=int), error, np.zeros_like(error), {}, {}, 0.01)


def test_errors_are_roots_of_mean_squares_of_what_was_measured() -> None:
    error = np.array([[3.0, np.nan, np.nan], [4.0, 5.0, np.nan]])
    assert rms(residuals_of(error)) == pytest.approx((50 / 3) ** 0.5)
    by_drive = rms_by_drive(residuals_of(error))
    assert by_drive == pytest.approx({'drive_0': 12.5 ** 0.5, 'drive_1': 5.0})


def test_a_block_gains_what_an_error_in_it_loses_over_the_noise() -> None:
    rng = np.random.default_rng(1)
    noise = 0.05 * rng.normal(size=(2000, 3))
    error = noise.copy()
    error[400:600, 1] += 0.2 * np.sign(rng.normal(size=200))  # of no colour, in the third block
    # The last drive was measured for 99 samples: too few to count.
    for one in (error, noise):
        one[99:, 2] = np.nan
    before, after = residuals_of(error), residuals_of(noise)
    noises = {'drive_0': white_noise(), 'drive_1': white_noise(), 'drive_2': white_noise()}
    found = paired_gain(before, after, noises)
    assert found.gains.shape == found.sizes.shape == (BLOCKS,)
    expected = float(np.sum(error[400:600, 1] ** 2 - noise[400:600, 1] ** 2)) / 0.05 ** 2
    assert found.gains[2] == pytest.approx(expected, rel=1e-6)
    size = np.sum((error - noise)[400:600, 1] ** 2) / 0.05 ** 2
    assert found.sizes[2] == pytest.approx(size, rel=1e-6)
    for one in (found.gains, found.sizes):
        assert np.delete(one, 2) == pytest.approx(np.zeros(BLOCKS - 1), abs=1e-6)
    # Both ways, and without a drive whose noise is not known.
    assert paired_gain(after, before, noises).gains == pytest.approx(-found.gains)
    del noises['drive_0']
    assert paired_gain(before, after, noises).gains == pytest.approx(found.gains)
    del noises['drive_1']
    assert paired_gain(before, after, noises).gains == pytest.approx(np.zeros(BLOCKS))


@pytest.mark.parametrize('samples', [99, 100])
def test_a_drive_counts_from_a_hundred_samples_on(samples: int) -> None:
    error = np.full((2000, 1), np.nan)
    error[:samples] = np.random.default_rng(2).normal(size=(samples, 1))
    found = paired_gain(residuals_of(error), residuals_of(0.5 * error), {'drive_0': white_noise()})
    assert bool(found.gains.sum() > 0) is (samples == 100)


# --- what else speaks against an effect -----------------------------------------------------------


def fit(effect: str, drives: tuple[str, ...] | None = ('lift_2',), evidence: float = 50.0,
        own_share: float = 1.0, parameters: dict[str, Estimate] | None = None,
        model: Any = PLAIN) -> Any:
    """Return what the gates look at of a fit."""
    return SimpleNamespace(request=EffectRequest(model.bound(CATALOGUE[effect]), drives),
                           drives=drives, evidence=evidence, own_share=own_share,
                           parameters=parameters or {},
                           model=model, plain=model, nothing_left=())


def others(effect: str, diagnosis: Any, **options: Any) -> list[str]:
    one = fit(effect, **options)
    return objections.of_other_effects(one.request, one, diagnosis)


def test_an_effect_on_the_drives_that_show_it_is_not_objected_to() -> None:
    found = made_up_diagnosis(effects=(found_effect('coulomb_friction', ('lift_1', 'lift_2')),))
    assert others('coulomb_friction', found) == []
    refused, = others('coulomb_friction', found, drives=('lift_2', 'slide_1'))
    assert refused == 'the recordings show coulomb_friction on lift_1, lift_2, not on slide_1'
    refused, = others('coulomb_friction', found, evidence=0.0)
    assert refused == 'on lift_2 the evidence is 0, where 0 is the threshold'


def test_an_effect_beside_another_is_told_to_wait_for_it() -> None:
    found = made_up_diagnosis(effects=(found_effect('drive_spring'),
                                       found_effect('coulomb_friction')))
    refused, = others('coulomb_friction', found, evidence=-3.0)
    assert 'it shows only beside drive_spring: adopt that first (evidence -3 ' in refused


def test_a_rival_that_explains_as_much_is_not_objected_to() -> None:
    found = made_up_diagnosis(effects=(found_effect('coulomb_friction'),),
                              indistinguishable=(('coulomb_friction', 'hysteresis'),))
    assert others('hysteresis', found) == []
    refused, = others('drive_spring', found, evidence=2.0)
    assert refused == ('coulomb_friction on lift_2 explains these recordings better: evidence 120 '
                       'against 2')
    structure = made_up_diagnosis(effects=(found_effect('payload_mass', None),))
    refused, = others('drive_spring', structure)
    assert refused.startswith('payload_mass explains these recordings better')


def test_what_the_recordings_do_not_call_for_is_refused_with_the_reason() -> None:
    refused, = others('drive_spring', made_up_diagnosis(depends_on=(statement(),)))
    assert refused.startswith('no effect of the catalogue has the form of the error: slide_1')
    nothing = made_up_diagnosis('adequate')
    refused, = others('effort_offset', nothing, evidence=1.0)
    assert refused == 'it does not predict parts of the recordings that it was not fitted to'
    refused, = others('effort_offset', nothing, evidence=0.0)
    assert refused == 'these recordings do not call for it: evidence 0, where 0 is the threshold'
    suspected = made_up_diagnosis('adequate', suspects=(SUSPECT,))
    refused, = others('effort_offset', suspected, evidence=1.0)
    assert refused.endswith('slow noise would explain it as well; repeat the recording')


def test_parameters_within_two_deviations_of_nothing_are_told_by_nothing() -> None:
    def said(**values: tuple[float, float]) -> list[str]:
        return objections.of_identifiability(fit('stribeck_friction', parameters={
            f'lift_2.{name}': Estimate(*value, 'N') for name, value in values.items()}))

    assert said(force=(2.1, 1.0), velocity=(0.01, 0.1)) == []
    assert said(force=(-2.1, 1.0)) == []
    # A force that may be 0 is none, however sure the velocity of it.
    refused, = said(force=(1.9, 1.0), velocity=(0.5, 0.1))
    assert refused == ('its parameters are not identifiable from these recordings: '
                       'lift_2.force = 1.9 ± 2.0 N')
    # A drive that tells its own is enough; and 0 is a value that nobody fitted.
    two = fit('coulomb_friction', ('lift_1', 'lift_2'), parameters={
        'lift_1.force': Estimate(1.0, 1.0, 'N'), 'lift_2.force': Estimate(3.0, 1.0, 'N')})
    assert objections.of_identifiability(two) == []
    assert said(force=(0.0, 1.0), velocity=(0.0, 1.0)) == []


def test_a_column_of_others_tells_nothing() -> None:
    assert objections.of_identifiability(fit('payload_mass', None, own_share=1e-6)) == []
    refused, = objections.of_identifiability(fit('payload_mass', None, own_share=9e-7))
    assert refused.endswith('of its square only 9.0e-07 is its own')


def test_an_angle_is_as_large_as_it_is() -> None:
    """A direction of 0 rad is as good as any: only sizes must differ from 0."""
    angular = next(effect for effect in CATALOGUE.values()
                   if any(p.is_angle for p in effect.parameters) and effect.linear)
    one = {p.name: Estimate(0.1, 1.0, '1') if p.is_angle else Estimate(1.0, 0.1, '1')
           for p in angular.parameters}
    assert objections.of_identifiability(fit(angular.name, None, parameters=one)) == []


def test_a_mass_must_not_be_negative_beyond_doubt() -> None:
    def said(value: float) -> list[str]:
        one = fit('drive_inertia', parameters={'lift_2.mass': Estimate(value, 0.1, 'kg')})
        return objections.of_physics(one, made_up_residuals())

    assert said(-0.19) == []
    assert said(-0.21) == ['lift_2.mass would be -0.21 ± 0.20 kg, must not be negative']


def friction_residuals(push: float, moving: float = 1.0) -> Residuals:
    """Return friction of the drives and in joints, which pushes in a share of the moving time."""
    given = made_up_residuals()
    samples = len(given.time)
    velocity = np.where(np.arange(samples)[:, None] < moving * samples, 1.0, 0.0) * np.ones((1, 6))
    forward = np.arange(samples)[:, None] >= push * moving * samples
    own = np.where(forward, 2.0, -2.0) * np.ones((1, 6))
    half = {'active_friction': 0.5 * own, 'coulomb_friction': 0.5 * own}
    return replace(given, parts={**half, 'passive_friction': np.zeros_like(own)},
                   variables={**given.variables, 'velocity': velocity})


FRICTION = build_model({**PLAIN.values, 'effects.active': ['coulomb_friction'],
                        'effects.coulomb_friction.lift_2.force': -1.0})


@pytest.mark.parametrize('moving', [1.0, 0.5])
def test_friction_must_not_push_in_a_tenth_of_the_moving_time(moving: float) -> None:
    low = {'lift_2.force': Estimate(-1.0, 0.1, 'N')}
    one = fit('coulomb_friction', parameters=low, model=FRICTION)
    assert objections.of_physics(one, friction_residuals(0.09, moving)) == []
    refused, = objections.of_physics(one, friction_residuals(0.2, moving))
    assert refused == ('lift_2.force would be -1.00 ± 0.20 N: with all friction of the model, '
                       'friction on lift_2 would push along the motion in 20% of the moving time')
    # Of a drive whose own value is not negative, nothing is said.
    other = fit('coulomb_friction', ('lift_1', 'lift_2'), parameters={
        'lift_1.force': Estimate(-1.0, 0.1, 'N'), 'lift_2.force': Estimate(1.0, 0.1, 'N')},
        model=FRICTION)
    refused, = objections.of_physics(other, friction_residuals(0.2))
    assert 'friction on lift_1 would push' in refused


def test_what_is_no_friction_does_not_push() -> None:
    """Inertia gives back what it took: no matter how much of it is beside the friction."""
    both = build_model({**FRICTION.values, 'effects.active': ['coulomb_friction', 'drive_inertia'],
                        'effects.drive_inertia.lift_2.mass': 1.0})
    given = friction_residuals(0.0)
    pulling = replace(given, parts={**given.parts,
                                    'drive_inertia': -10 * given.parts['active_friction']})
    one = fit('coulomb_friction', parameters={'lift_2.force': Estimate(-1.0, 0.1, 'N')}, model=both)
    assert objections.of_physics(one, pulling) == []


def test_friction_in_joints_must_not_give_power_to_the_robot() -> None:
    one = fit('joint_friction', None, parameters={'revolute.torque': Estimate(-1.0, 0.1, 'N m')})
    assert objections.of_physics(one, friction_residuals(0.09)) == []
    refused, = objections.of_physics(one, friction_residuals(0.2))
    assert refused.endswith('the joints would give power back in 20% of the moving time')
    # Power of drives and joints together: passive friction that pushes half as much is paid for.
    parts = friction_residuals(0.0).parts
    paid = replace(friction_residuals(0.0), parts={
        **parts, 'passive_friction': -0.4 * parts['active_friction']})
    assert objections.of_physics(one, paid) == []


def test_a_model_may_leave_half_more_than_its_linear_fit() -> None:
    assert objections.of_linearity(1.0, 1.5, 'N') == []
    assert len(objections.of_linearity(1.0, 1.51, 'N')) == 1


# --- lack of fit ----------------------------------------------------------------------------------


class Rows:
    """A regression of one drive with unit noise, whose columns are given: whitened, and known."""

    def __init__(self, parts: dict[str, np.ndarray]) -> None:
        self.residuals = SimpleNamespace(parts=parts)
        self.drives = (0,)
        self.series = {0: SimpleNamespace(transform=lambda force: force,
                                          spread=lambda weights: 1.0)}

    @staticmethod
    def weights(_: Any, __: int) -> np.ndarray:
        return np.ones(1)

    @staticmethod
    def products(first: Any, others: Any, d: int) -> list[np.ndarray]:
        return [(first.rows[d] @ one.rows[d].T)[None] for one in others]



def set_of(**columns: tuple[str, float, float]) -> Any:
    """Return a set: every column is 10 long, (effect, size of its force, of it its own)."""
    candidates, blocks, places, coefficients = [], [], {}, []
    for number, (effect, size, _) in enumerate(columns.values()):
        block = Block({0: np.array([[10.0]])}, np.zeros((1, 1)))
        component = Component.of(CATALOGUE[effect], 0, {}, ('size',))
        candidates.append(EffectCandidate(CATALOGUE[effect], (component,)))
        blocks.append(block)
        places[block] = slice(number, number + 1)
        coefficients.append(size / 10)
    own = [one for *_, one in columns.values()]
    # The covariance of a coefficient is 1 over the square of what is the column's own.
    covariance = np.diag([1 / (10 * share) ** 2 for share in own])
    nothing = np.zeros((1, 1))
    fitted = JointFit(tuple(blocks), np.array(coefficients), covariance, nothing, nothing, 0.0,
                      nothing, places)
    return SimpleNamespace(
        effects=tuple(candidates), candidates=tuple(candidates), fit=fitted,
        blocks_of=lambda one: [block for candidate, block in zip(candidates, blocks, strict=True)
                               if candidate is one])


DECIDED = Decisions(form_share=0.1, exact_share=0.02)


def share(found: Any, which: int, parts: dict[str, np.ndarray] | None = None,
          model: Any = PLAIN) -> tuple[float, tuple[str, ...]]:
    """Return the force of a candidate over the form errors beside it, and whose they are."""
    design: Any = SimpleNamespace(given=model, carried=None)
    regression: Any = Rows(parts or {})
    errors, candidate = FormErrors(design, regression, DECIDED), found.candidates[which]
    allowed, names = errors.beside(found, candidate, set(found.blocks_of(candidate)[0].rows))
    own = errors._beyond_others(found, candidate)
    return float(np.sqrt(own / max(allowed, 1e-300))), names


def test_an_idealised_effect_may_leave_a_tenth_in_another_and_a_fiftieth_in_an_exact_one() -> None:
    # 20 of friction beside 100 of a spring: twice a tenth of it.
    found = set_of(a=('drive_spring', 100.0, 1.0), b=('coulomb_friction', 20.0, 1.0))
    assert CATALOGUE['drive_spring'].idealised
    assert share(found, 1) == (pytest.approx(2.0), ('drive_spring',))
    # Half of what it is, if half its column is its own.
    found = set_of(a=('drive_spring', 100.0, 1.0), b=('coulomb_friction', 20.0, 0.5))
    assert share(found, 1)[0] == pytest.approx(1.0)
    # A mass is exact: ten times a fiftieth.
    for exact in ('drive_inertia', 'payload_mass'):
        assert not CATALOGUE[exact].idealised
        found = set_of(a=('drive_spring', 100.0, 1.0), b=(exact, 20.0, 1.0))
        assert share(found, 1) == (pytest.approx(10.0), ('drive_spring',))
    # And leaves nothing itself.
    found = set_of(a=('drive_inertia', 100.0, 1.0), b=('coulomb_friction', 20.0, 1.0))
    assert share(found, 1)[0] > 1e100


def test_lack_of_fit_stays_on_its_drives() -> None:
    found = set_of(a=('drive_spring', 100.0, 1.0), b=('coulomb_friction', 20.0, 1.0))
    (block,) = found.blocks_of(found.candidates[0])
    block.rows[1] = block.rows.pop(0)
    size, names = share(found, 1)
    assert size > 1e100
    assert names == ()


def test_lack_of_fit_adds_up_in_squares_and_counts_that_of_the_model() -> None:
    found = set_of(a=('drive_spring', 30.0, 1.0), b=('coulomb_friction', 40.0, 1.0),
                   c=('viscous_friction', 10.0, 1.0))
    size, names = share(found, 2)
    assert (size, names) == (pytest.approx(10 / 5), ('drive_spring', 'coulomb_friction'))


def test_an_adopted_effect_leaves_as_much_as_one_that_is_found() -> None:
    found = set_of(a=('viscous_friction', 10.0, 1.0))
    size, names = share(found, 0, {'coulomb_friction': np.full((4, 6), 25.0)}, FRICTION)
    # 25 in four samples are 50 in all.
    assert (size, names) == (pytest.approx(2.0), ('coulomb_friction',))


def test_an_axis_has_units_too() -> None:
    model = MechanismModel.load('config/single_axis.yaml')
    assert 'N' in objections.of_held_out_error(1.0, 2.0, gain(3), model, 'x')[0]
    assert DRIVES[4] == 'lift_2'
