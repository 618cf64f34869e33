# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""From measured drive positions to motion and treated effort, against simulated truth."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from model_recordings import with_effects
from numpy.testing import assert_allclose, assert_array_equal
from random_states import inverse_kinematics, paper_model

from pprs_dynamics.errors import MotionError, WorkspaceError
from pprs_dynamics.inference.residuals.reconstruction import reconstruct, treated_forces
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.motion.differentiation import LocalPolynomial
from pprs_dynamics.measurement.motion.drive_motion import smooth_drives
from pprs_dynamics.measurement.motion.live_reconstruction import LiveReconstruction
from pprs_dynamics.measurement.motion.treatment import Treatment
from pprs_dynamics.physics.mechanism.paths import Excitation

RATE, RESOLUTION, DURATION = 500.0, 1e-6, 8.0  # [Hz, m, s]
STEP = 1 / RATE
# What reconstruction alone may add to the forces [N rms], every drive.
FORCE_ERROR = 0.005
# Highest frequency [Hz], amplitude [m], tilt [rad]: accelerations of drives up to 6 m/s^2.
MOTIONS = [(0.5, 0.06, 0.15), (1.0, 0.06, 0.15), (2.0, 0.03, 0.08), (3.0, 0.03, 0.08)]
MODEL = paper_model()


@dataclass(frozen=True)
class Truth:
    """A motion, its drives and forces, exactly."""

    time: np.ndarray
    drives: object
    force: np.ndarray


def truth_at(time, frequency=1.0, amplitude=0.06, tilt=0.15, seed=1):
    """Return what the paper's robot does and needs at times within 0..DURATION."""
    path = Excitation(DURATION + 1, seed, amplitude, tilt, frequency)
    motion = path.motion(np.asarray(time) + 0.5)
    return Truth(np.asarray(time), inverse_kinematics(MODEL.robot.geometry, motion),
                 MODEL.drive_forces(motion).total)


@cache
def truth(frequency=1.0, amplitude=0.06, tilt=0.15, seed=1):
    """Return the truth at equal steps; without what is at rest at either end."""
    return truth_at(np.arange(0, DURATION, STEP), frequency, amplitude, tilt, seed)


def encoder(position):
    """Return positions as an encoder reads them."""
    return np.round(position / RESOLUTION) * RESOLUTION


def recording_of(real, effort=None, velocity=None, time=None, position=None):
    """Return a recording of a truth; the effort is the true force unless given."""
    return Recording.from_arrays(
        'simulated', real.time if time is None else time,
        encoder(real.drives.position) if position is None else position, velocity,
        real.force if effort is None else effort)


def force_error(recording, found=None):
    """Return model minus effort, both treated, (M, 6) [N]; effort is the model's own."""
    found = found or reconstruct(MODEL, recording)
    return treated_forces(MODEL, found)['total'] - found.treat(found.effort)


def rms(values, axis=0):
    """Return the root of the mean square."""
    return np.sqrt(np.mean(np.square(values), axis=axis))


# Forward motion ------------------------------------------------------------------------------


def test_drives_that_cannot_close_are_named_with_sample_and_time():
    real = truth()
    q = real.drives.position.copy()
    q[2000:] += np.linspace(0, 1, len(q) - 2000)[:, None] * [1, 0, 0, 0, 0, 0]
    with pytest.raises(WorkspaceError, match=r'at \d\.\d+ s the loops do not close') as caught:
        treated_forces(MODEL, reconstruct(MODEL, recording_of(real, position=encoder(q))))
    assert 2000 < caught.value.sample < len(q)


# Differentiation -----------------------------------------------------------------------------

@pytest.mark.parametrize('window', [17, 61, 401])
def test_local_polynomials_are_exact_for_polynomials_of_their_order(window):
    t = np.arange(window + 200) * STEP
    polynomial = np.polynomial.Polynomial([0.2, 1, -2, 3, -4, 5, -6, 7], domain=[0, t[-1]])
    filter_ = LocalPolynomial(window, STEP)
    inner = slice(filter_.half, -filter_.half)
    found = filter_.differentiated(np.stack((polynomial(t), 2 * polynomial(t)), axis=1))
    for derivative, tolerance in ((0, 1e-13), (1, 1e-10), (2, 1e-7)):
        expected = polynomial.deriv(derivative)(t)[inner] if derivative else polynomial(t)[inner]
        assert_allclose(found[derivative], np.stack((expected, 2 * expected), axis=1), rtol=0,
                        atol=tolerance * max(1.0, np.abs(expected).max()))


# The figure that counts ----------------------------------------------------------------------

@pytest.mark.parametrize('motion', MOTIONS)
def test_reconstruction_alone_costs_less_than_5_mN_on_every_drive(motion):
    real = truth(*motion)
    error = rms(force_error(recording_of(real)))
    assert np.all(error < FORCE_ERROR)


# Treatment -----------------------------------------------------------------------------------

def test_model_and_effort_get_the_same_operation():
    # The model's forces run through chunks and parts; the same forces as "effort" do not.
    real = truth()
    found = reconstruct(MODEL, recording_of(real))
    forces = MODEL.drive_forces(found.motion)
    treated = treated_forces(MODEL, found)
    assert_allclose(treated['total'], found.treat(forces.total), rtol=0, atol=1e-12)
    assert_allclose(sum(treated[name] for name in forces.parts), treated['total'], rtol=0,
                    atol=1e-12)
    for values in (np.ones(len(found)), found.time, np.sign(found.velocity)):
        pieces = [chunk.treat(values[chunk.samples]) for chunk in found.chunks(173)]
        assert_array_equal(np.concatenate(pieces), found.treat(values))
    assert_allclose(found.treat(3 * found.velocity + 2), 3 * found.treat(found.velocity) + 2,
                    rtol=0, atol=1e-14)


def test_missing_efforts_take_their_blocks_out_and_nothing_else():
    real = truth()
    effort = real.force.copy()
    effort[1003, 2] = np.nan
    effort[2000:2100, 4] = np.nan
    whole, holed = (reconstruct(MODEL, recording_of(real, F)) for F in (real.force, effort))
    before, after = whole.treat(whole.effort), holed.treat(holed.effort)
    touched = whole.treat(np.isnan(effort[whole.index]).astype(float)) > 0
    assert touched[:, 2].sum() == 1
    assert 20 <= touched[:, 4].sum() <= 21
    assert not touched[:, [0, 1, 3, 5]].any()
    assert_array_equal(np.isnan(after), touched)
    assert_array_equal(after[~touched], before[~touched])
    assert_array_equal(whole.position, holed.position)


def test_efforts_that_come_less_often_than_positions_are_compared_sample_by_sample():
    real = truth()
    effort = np.full_like(real.force, np.nan)
    effort[::4] = real.force[::4]
    found = reconstruct(MODEL, recording_of(real, effort))
    assert found.block == 1
    error = force_error(None, found)
    assert np.isfinite(error).sum() == np.isfinite(effort[found.index]).sum() > 0
    assert np.sqrt(np.nanmean(error ** 2)) < 2 * FORCE_ERROR  # single samples, not means
    assert any('less often' in note for note in found.notes)


# Edges and segments --------------------------------------------------------------------------

def test_edges_are_dropped_at_both_ends_of_every_segment_and_blocks_stay_within():
    real = truth()
    keep = np.r_[0:1500, 1600:3000, 3200:3260, 3500:4000]  # the third is too short
    found = reconstruct(MODEL, recording_of(
        real, real.force[keep], time=real.time[keep], position=encoder(real.drives.position[keep])))
    half = found.smoothing.polynomial(STEP).half
    assert len(found.segments) == 3
    for segment, (first, end) in zip(found.segments, ((0, 1500), (1600, 3000), (3500, 4000)),
                                     strict=True):
        original = keep[found.index[segment]]
        assert original[0] == first + half
        assert end - half - found.block < original[-1] < end - half
        assert_array_equal(np.diff(original), 1)
        assert segment.start in found.treat.starts
    assert_array_equal(np.diff(found.treat.starts), found.block)
    dropped = int(found.notes[-1].split()[0])
    assert len(found) + dropped in (len(keep), len(keep) - 60)
    assert rms(force_error(None, found)).max() < FORCE_ERROR


def test_effects_with_memory_run_through_a_segment_and_start_afresh_in_the_next():
    real = truth()
    model = with_effects(MODEL, {'hysteresis': {'lift_1.force': 1.0, 'lift_1.distance': 1e-3}})
    keep = np.r_[0:2000, 2200:4000]
    found = reconstruct(model, recording_of(
        real, real.force[keep], time=real.time[keep], position=encoder(real.drives.position[keep])))
    expected = []
    for segment in found.segments:
        motion = found.motion[segment].with_time(found.time[segment])
        expected.append(model.drive_forces(motion).parts['hysteresis'])
    treated = treated_forces(model, found)['hysteresis']
    assert_allclose(treated, found.treat(np.concatenate(expected)), rtol=0, atol=1e-12)
    assert np.abs(treated).max() > 0.5


def test_a_single_axis_is_smoothed_but_has_no_platform():
    real = truth()
    recording = Recording.from_arrays(
        'axis', real.time, encoder(real.drives.position[:, :1]), real.drives.velocity[:, :1],
        drives=('axis',))
    found = smooth_drives(recording)
    assert rms(found.velocity - real.drives.velocity[found.index, :1]) < 1e-5
    assert any('velocities of axis' in note for note in found.notes)
    with pytest.raises(MotionError, match='they are axis, must be slide_1'):
        reconstruct(MODEL, recording)


# Stamps --------------------------------------------------------------------------------------

JITTER = 1e-4  # [s rms]: at 0.1 m/s ten times the resolution of the encoder


def jittered(rng):
    """Return equal steps, and the same with jitter, strictly increasing."""
    time = np.arange(0, DURATION, STEP)
    return time, time + np.clip(rng.normal(scale=JITTER, size=len(time)), -4e-4, 4e-4)


def test_samples_that_were_taken_when_the_stamps_say_are_read_so():
    _, stamps = jittered(np.random.default_rng(11))
    real = truth_at(stamps, 2.0, 0.03, 0.08)
    found = reconstruct(MODEL, recording_of(real))
    assert any('smoother when the stamps are taken as true' in note for note in found.notes)
    assert rms(force_error(None, found)).max() < FORCE_ERROR


def test_samples_at_equal_steps_with_late_stamps_are_read_so():
    _, stamps = jittered(np.random.default_rng(12))
    real = truth(2.0, 0.03, 0.08)
    found = reconstruct(MODEL, recording_of(real, time=stamps))
    assert any('steps are taken as equal' in note for note in found.notes)
    assert rms(force_error(None, found)).max() < FORCE_ERROR


def test_lost_samples_are_bridged_in_positions_and_stay_unknown_in_efforts():
    real = truth(2.0, 0.03, 0.08)
    keep = np.ones(len(real.time), dtype=bool)
    keep[np.random.default_rng(13).choice(np.arange(10, 3990, 7), 60, replace=False)] = False
    found = reconstruct(MODEL, recording_of(
        real, real.force[keep], time=real.time[keep], position=encoder(real.drives.position)[keep]))
    assert len(found.segments) == 1
    assert any('60 lost samples' in note for note in found.notes)
    assert_array_equal(found.effort, real.force[keep][found.index])
    assert rms(force_error(None, found)).max() < FORCE_ERROR
    lengths = np.diff(np.append(found.treat.starts, len(found)))
    assert set(lengths) == {found.block - 1, found.block}


# Recorded velocities -------------------------------------------------------------------------

VELOCITIES = {
    # name: (velocity from the truth, whether velocities and accelerations are better so)
    'exact': (lambda real, rng: real.velocity, (True, True)),
    'noise of 60 um/s': (
        lambda real, rng: real.velocity + rng.normal(scale=6e-5, size=real.velocity.shape),
        (False, False)),
    'differences of the encoder': (
        lambda real, rng: np.diff(encoder(real.position), axis=0, prepend=0) / STEP,
        (False, False)),
}


@pytest.mark.parametrize('kind', list(VELOCITIES))
def test_recorded_velocities_are_used_only_where_they_are_better(kind):
    make, better = VELOCITIES[kind]
    real = truth()
    velocity = make(real.drives, np.random.default_rng(14))
    found = reconstruct(MODEL, recording_of(real, velocity=velocity))
    assert_array_equal(found.from_recorded, np.transpose([better] * 6))
    assert any('recorded velocities' in note for note in found.notes)
    alone = reconstruct(MODEL, recording_of(real))
    for name, used in zip(('velocity', 'acceleration'), better, strict=True):
        if used:
            with_it, without = (rms(getattr(r, name) - getattr(real.drives, name)[r.index], None)
                                for r in (found, alone))
            assert with_it < 0.75 * without
        else:
            assert_array_equal(getattr(found, name), getattr(alone, name))
    assert rms(force_error(None, found)).max() < FORCE_ERROR


# Live ----------------------------------------------------------------------------------------

def play(recording, polynomial, block):
    """Return live samples, and the blocks of effort and velocity in each stretch."""
    live = LiveReconstruction(polynomial)
    samples, stretches = [], []
    for time, q, F in zip(recording.time, recording.position, recording.effort, strict=True):
        sample = live.push(time, q, F)
        if sample is None:
            continue
        if sample.is_start:
            stretches.append([])
        samples.append(sample)
        stretches[-1].append(np.concatenate((sample.effort, sample.velocity)))
    blocks = []
    for stretch in stretches:
        whole = len(stretch) // block * block
        blocks.append(Treatment(np.arange(0, whole, block), whole)(np.array(stretch[:whole])))
    return live, samples, np.concatenate(blocks)


def test_live_and_offline_agree_to_rounding_across_a_gap():
    real = truth()
    keep = np.r_[0:1303, 1400:2500]
    effort = real.force[keep]
    effort[700, 1] = np.nan
    recording = recording_of(real, effort, time=real.time[keep],
                             position=encoder(real.drives.position[keep]))
    found = reconstruct(MODEL, recording)
    live, samples, blocks = play(recording, found.smoothing.polynomial(STEP), found.block)
    assert live.gaps == 1
    assert [k for k, sample in enumerate(samples) if sample.is_start] == [
        0, 1303 - 2 * live.polynomial.half]
    by_time = {sample.time: sample for sample in samples}
    online = [by_time[time] for time in found.time]
    # Stamps of the recording set its step to 1e-12, relative; FFT rounds to 1e-16 of 0.3 m,
    # times the weights of the second derivative.
    for name, tolerance in (('position', 1e-14), ('velocity', 1e-11), ('acceleration', 1e-8)):
        assert_allclose([getattr(sample, name) for sample in online], getattr(found, name),
                        rtol=0, atol=tolerance)
    assert_array_equal([sample.effort for sample in online], found.effort)
    offline = np.concatenate((found.treat(found.effort), found.treat(found.velocity)), axis=1)
    assert_allclose(blocks, offline, rtol=0, atol=1e-11)
    assert np.isnan(blocks).sum() == 1


@pytest.mark.parametrize('late', [False, True])
def test_uneven_stamps_are_taken_as_true_or_as_late_whichever_is_smoother(late):
    rng = np.random.default_rng(3)
    even = np.arange(0, 4.0, 0.01)
    stamps = even + rng.uniform(-1e-3, 1e-3, len(even))
    taken = even if late else stamps
    speed, turn = 0.8, 2.0  # [rad, rad/s] of a joint
    polynomial = LocalPolynomial(13, 0.01)
    live, found = LiveReconstruction(polynomial), []
    for k, stamp in enumerate(stamps):
        sample = live.push(stamp, [speed * np.sin(turn * taken[k])], [0.0])
        if sample is not None:
            found.append((speed * turn ** 2 * -np.sin(turn * taken[k - polynomial.half]),
                          sample.acceleration[0]))
    true, seen = np.array(found).T
    # Samples at wrong times would leave 0.2 rad/s^2 here: a millisecond at 1.6 rad/s.
    assert rms(seen - true) < 0.02
