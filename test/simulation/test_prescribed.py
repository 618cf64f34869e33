# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The robot along a prescribed motion: the plant's efforts, the model's where nothing is hidden."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.hidden.driven_motion import DrivenMotion
from benchmarks.hidden.prescribed import PrescribedPlant
from pprs_dynamics import DriveModel
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.errors import MotionError, SingularityError
from pprs_dynamics.physics.mechanism.paths import Excitation
from pprs_dynamics.simulation.drive_control import ControlSettings
from pprs_dynamics.simulation.injected_bodies import PayloadPickUp
from pprs_dynamics.simulation.injected_effect import InjectedEffect
from pprs_dynamics.simulation.injected_effects import INJECTED_EFFECTS, draw_effect
from pprs_dynamics.simulation.injected_forces import Hysteresis, coulomb_friction, effort_offset
from pprs_dynamics.simulation.plant import PlantSettings
from pprs_dynamics.simulation.sensors import (
    EffortGain,
    EffortNoise,
    HomingError,
    SensorSettings,
    TimeDelay,
)
from pprs_dynamics.simulation.virtual_robot import DriveReference, SimulatedRun, simulate

MODEL = DriveModel.load('config/paper.yaml')
# The plant iterates loads until what is left in the forces is below mu times 3e-5 N.
AGREEMENT = 1e-5  # [N]
RATE = 500.0
HOME = MODEL.mechanism(Excitation().motion([0.0])).position[0]
MEMORY = ('hysteresis', 'friction_drift', 'friction_temperature')
SENSORS = ('effort_filter', 'effort_gain', 'homing_error', 'lost_motion', 'time_delay')
GROUPS = {
    'friction': ('viscous_friction', 'coulomb_friction', 'asymmetric_friction',
                 'stribeck_friction', 'quadratic_friction', 'load_friction', 'gear_efficiency'),
    'forces': ('effort_offset', 'drive_spring', 'stop_contact', 'force_ripple', 'local_bump',
               'vibration', 'drive_coupling'),
    'joints and platform': ('joint_friction', 'joint_spring', 'external_wrench', 'tool_drag'),
    'bodies': ('drive_inertia', 'payload_mass', 'payload_offset', 'platform_inertia',
               'base_tilt', 'link_mass'),
}


def excited(model: DriveModel, duration: float = 1.0, rate: float = RATE) -> tuple[
        DrivenMotion, np.ndarray]:
    """Return part of an excitation as the engine moves, and the model's forces along it."""
    time = 6.0 + np.arange(round(duration * rate)) / rate
    platform = Excitation(seed=3, highest_frequency=2.0).motion(time)
    forces = model.drive_forces(platform)
    drives = forces.mechanism
    return (DrivenMotion.of_drives(model.values, time - time[0], drives.position,
                                   drives.velocity, drives.acceleration), forces.total)


@pytest.fixture(scope='module')
def motion() -> DrivenMotion:
    return excited(MODEL)[0]


@pytest.mark.parametrize('change', [
    {}, {'masses.centre': [0.01, -0.02, 0.03], 'masses.rods': [0.1, 0.3, 0.5]},
    {'gravity': [1.0, -2.0, -9.0], 'friction.reversal_velocity': 0.0002},
    {'geometry.platform_angles': [0.1, 2.2, 4.1], 'masses.slides': [0.0, 0.2, 1.0]},
], ids=['paper', 'masses', 'gravity', 'angles'])
def test_with_nothing_hidden_the_drives_need_what_the_model_says(change: dict[str, object]) -> None:
    model = DriveModel.from_parameters({**MODEL.values, **change})
    motion, forces = excited(model, 0.4)
    found = PrescribedPlant(model.values, motion).efforts().total
    # A slide without mass has 1e-9 kg in the engine.
    assert np.abs(found - forces).max() < 1e-8


def run_plant(effects: list[InjectedEffect], actual_loads: bool = False) -> SimulatedRun:
    """Return a run of the plant in which every drive reverses."""
    time = np.arange(150)[:, None] / RATE
    rates = 2 * np.pi * np.array([1.9, 2.3, 2.1, 1.7, 2.0, 1.8])
    phases = np.array([0.0, 1.0, 2.0, 0.5, 1.5, 2.5])
    size = 0.01
    reference = DriveReference(
        HOME + size * (np.sin(rates * time + phases) - np.sin(phases)),
        size * rates * np.cos(rates * time + phases))
    quiet = SensorSettings(quantisation=0.0, true_velocity=True, white_noise=0.0,
                           coloured_noise=0.0)
    return simulate(MODEL.values, reference, effects, sensors=quiet,
                    plant=PlantSettings(actual_loads=actual_loads),
                    control=ControlSettings(gravity_compensation=True))


def along(run: SimulatedRun, actual_loads: bool = False) -> PrescribedPlant:
    """Return the prescribed robot along the true motion of a run."""
    assert run.truth is not None
    motion = DrivenMotion.of_drives(MODEL.values, run.time, run.truth.position,
                                    run.truth.velocity, run.truth.acceleration)
    return PrescribedPlant(MODEL.values, motion, PlantSettings(actual_loads=actual_loads))


@pytest.mark.parametrize(('group', 'actual_loads'), [
    *((group, False) for group in GROUPS), ('friction', True), ('joints and platform', True)])
def test_along_the_plants_own_motion_it_needs_the_plants_efforts(
    group: str, actual_loads: bool,
) -> None:
    def effects() -> list[InjectedEffect]:
        rng = np.random.default_rng(11)
        return [draw_effect(name, rng) for name in GROUPS[group]]

    run = run_plant(effects(), actual_loads)
    assert run.truth is not None
    hidden = along(run, actual_loads)
    found = hidden.efforts(effects())
    assert np.abs(found.total - run.truth.effort).max() < AGREEMENT
    assert np.abs(found.loads[:, :6] - run.truth.guide_load).max() < 1e-4
    assert np.abs(found.total - hidden.efforts().total).max() > 0.1


def test_every_hidden_effect_is_compared_with_the_plant() -> None:
    compared = {name for group in GROUPS.values() for name in group}
    assert compared | {*MEMORY, *SENSORS, 'payload_pick_up'} == set(INJECTED_EFFECTS)


@pytest.mark.parametrize('name', MEMORY)
def test_memory_advances_as_in_the_plant(name: str) -> None:
    # The plant advances it by time steps, here it goes from sample to sample.
    def effect() -> InjectedEffect:
        return draw_effect(name, np.random.default_rng(5))

    run = run_plant([effect()])
    assert run.truth is not None
    hidden = along(run)
    found, without = hidden.efforts([effect()]).total, hidden.efforts().total
    size = np.abs(found - without).max()
    assert size > 0.1
    assert np.sqrt(np.mean((found - run.truth.effort) ** 2)) < 0.01 * size


def test_a_payload_is_picked_up_as_in_the_plant() -> None:
    def effect() -> PayloadPickUp:
        return PayloadPickUp(mass=0.4, time=0.1, x=0.01, y=0.02, z=0.05)

    run = run_plant([effect()])
    assert run.truth is not None
    found = along(run).efforts([effect()]).total
    # What the plant observes is half a time step old while the weight goes over in 0.2 s.
    assert np.abs(found - run.truth.effort).max() < 0.4 * 15 * 0.00025 / 0.2


@pytest.mark.parametrize('name', sorted(INJECTED_EFFECTS))
def test_every_hidden_effect_changes_what_is_measured_and_starts_afresh(
    name: str, motion: DrivenMotion,
) -> None:
    plant = PrescribedPlant(MODEL.values, motion)
    effect = draw_effect(name, np.random.default_rng(1))
    if name == 'payload_pick_up':
        effect.parameters['time'] = 0.5
    first, again, plain = plant.readings([effect]), plant.readings([effect]), plant.readings()
    np.testing.assert_array_equal(first.effort, again.effort)
    moved = np.abs(first.position - plain.position).max()
    assert np.abs(first.effort - plain.effort).max() > 0.01 or moved > 1e-4


def test_a_delay_of_whole_samples_shifts_the_effort(motion: DrivenMotion) -> None:
    plant = PrescribedPlant(MODEL.values, motion)
    late = TimeDelay({'lift_2': {'delay': 3 / RATE}, 'slide_1': {'delay': -2 / RATE}})
    found, plain = plant.readings([late]), plant.readings()
    # The encoders are two samples late; so is, for its own five, the effort of lift_2.
    np.testing.assert_allclose(found.effort[5:, 4], plain.effort[:-5, 4], rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.effort[:, 0], plain.effort[:, 0], rtol=0, atol=1e-12)
    for name in ('position', 'velocity', 'acceleration'):
        values, before = getattr(found, name), getattr(plain, name)
        np.testing.assert_allclose(values[2:], before[:-2], rtol=0, atol=1e-9)


@pytest.mark.parametrize('name', MEMORY)
def test_what_has_a_memory_is_delayed_as_it_is(name: str, motion: DrivenMotion) -> None:
    plant = PrescribedPlant(MODEL.values, motion)
    effect = draw_effect(name, np.random.default_rng(5))
    late = TimeDelay({drive: {'delay': 4 / RATE} for drive in DRIVES})
    found, plain = (plant.readings(effects).effort for effects in ([effect, late], [effect]))
    np.testing.assert_allclose(found[4:], plain[:-4], rtol=0, atol=1e-6)


def test_friction_that_turns_over_between_samples_is_delayed_without_rounding_it_off() -> None:
    fine, _ = excited(MODEL, rate=2 * RATE)
    coarse, _ = excited(MODEL)
    hidden = [coulomb_friction({drive: {'force': 1.0, 'width': 0.0005} for drive in (
        'slide_1', 'slide_2', 'slide_3')})]
    between = TimeDelay({f'slide_{i}': {'delay': 0.5 / RATE} for i in (1, 2, 3)})
    found = PrescribedPlant(MODEL.values, coarse).readings([*hidden, between]).effort[1:, :3]
    exact = PrescribedPlant(MODEL.values, fine).readings(hidden).effort[1::2, :3]
    assert np.abs(np.diff(exact, axis=0)).max() > 0.5
    assert np.abs(found - exact[:-1]).max() < 0.02


def test_gain_and_zero_change_what_is_measured_and_not_the_robot(motion: DrivenMotion) -> None:
    plant = PrescribedPlant(MODEL.values, motion)
    offset = effort_offset({'slide_1': {'force': 0.7}})
    faults = [EffortGain({'slide_1': {'gain': 0.1}}), HomingError({'lift_3': {'zero': 0.002}})]
    found, true = plant.readings([offset, *faults]), plant.readings([offset])
    np.testing.assert_allclose(found.effort, true.effort * [1.1, 1, 1, 1, 1, 1], rtol=1e-12)
    np.testing.assert_allclose(found.position - true.position,
                               np.tile([0, 0, 0, 0, 0, 0.002], (len(motion), 1)), atol=1e-12)


def test_hysteresis_hardly_depends_on_the_rate_of_sampling() -> None:
    def effort(rate: float) -> np.ndarray:
        driven, _ = excited(MODEL, rate=rate)
        effect = Hysteresis({'lift_1': {'share': 1.0, 'distance': 0.0005, 'power': 1.5}})
        plant = PrescribedPlant(MODEL.values, driven)
        added: np.ndarray = plant.efforts([effect]).total - plant.efforts().total
        return added[::round(rate / RATE), 3]

    coarse, fine = effort(RATE), effort(4 * RATE)
    assert np.sqrt(np.mean((coarse - fine) ** 2)) < 0.02 * np.abs(fine).max()


def test_noise_at_once_is_the_noise_sample_by_sample_and_has_the_covariance_it_says() -> None:
    settings = SensorSettings(white_noise=0.05, coloured_noise=0.06, noise_correlation=0.8,
                              pink_noise=0.02)
    one, all_of_it = (EffortNoise(settings, np.random.default_rng(4)) for _ in range(2))
    np.testing.assert_allclose([one.sample() for _ in range(30)],
                               np.vstack((all_of_it.samples(10), all_of_it.samples(20))),
                               rtol=0, atol=1e-14)
    lags = np.array([0, 1, 3, 10])
    quick = SensorSettings(white_noise=0.05, coloured_noise=0.06, noise_correlation=0.8)
    noise = EffortNoise(quick, np.random.default_rng(5)).samples(200_000)
    found = [np.mean(noise[lag:] * noise[:len(noise) - lag]) for lag in lags]
    np.testing.assert_allclose(
        found, EffortNoise(quick, np.random.default_rng(0)).autocovariance(lags), atol=3e-5)


def test_motions_that_cannot_be_followed_are_refused(motion: DrivenMotion) -> None:
    q, zero = motion.position[:3].copy(), np.zeros((3, 6))
    with pytest.raises(MotionError, match=r'drive velocity.*\(2, 6\)'):
        DrivenMotion.of_drives(MODEL.values, [0.0, 0.1, 0.2], q, zero[:2], zero)
    q[2, 3:] += [0.0, 0.0, 0.6]
    with pytest.raises(SingularityError) as refused:
        DrivenMotion.of_drives(MODEL.values, [0.0, 0.1, 0.2], q, zero, zero)
    assert refused.value.sample == 2
