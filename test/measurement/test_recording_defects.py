# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Defects of recordings: what is dropped, sorted, split or kept, and what is said of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import made_up_recordings as made
import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pprs_dynamics.drives import DRIVES
from pprs_dynamics.errors import MotionError
from pprs_dynamics.measurement.files.defects import Judgement
from pprs_dynamics.measurement.files.recording import Recording, read_recording
from pprs_dynamics.measurement.files.samples import Samples


@pytest.mark.parametrize('seed', range(2))
def test_a_sound_recording_has_nothing_to_tell(seed: int) -> None:
    # Pauses, slow and fast motion, jitter of a tenth of a step.
    arrays = made.measured(4000, seed=seed)
    rng = np.random.default_rng(seed)
    arrays['time'] = arrays['time'] + rng.uniform(-0.1, 0.1, 4000) * made.STEP
    pause = slice(1000, 2000)
    arrays['position'][pause] = arrays['position'][1000] + 1e-6 * rng.integers(-1, 2, (1000, 6))
    arrays['position'][2000:] += arrays['position'][1999] - arrays['position'][2000]
    recording = made.judged(arrays)
    assert recording.findings == ()
    assert recording.segments == (slice(0, 4000),)


def test_non_finite_times_and_positions_are_dropped() -> None:
    arrays = made.measured()
    arrays['time'][[100, 200]] = np.nan, np.inf
    arrays['position'][300, 0], arrays['position'][[301, 400], 4] = np.nan, -np.inf
    recording = made.judged(arrays)
    assert made.the_one(recording, 'non_finite_time').count == 2
    finding = made.the_one(recording, 'non_finite_position')
    assert finding.count == 3
    assert finding.spans == ((0.6, 0.602), (0.8, 0.8))
    assert finding.drives == ('slide_1', 'lift_2')
    kept = np.setdiff1d(np.arange(1000), [100, 200, 300, 301, 400])
    np.testing.assert_array_equal(recording.effort, arrays['effort'][kept])
    assert made.the_one(recording, 'lost_samples').count == 5
    assert recording.segments == (slice(0, 995),)


@pytest.mark.parametrize('noise', [0.0, 0.02])
def test_efforts_that_fall_to_zero_for_a_tick_were_not_measured(noise: float) -> None:
    rng = np.random.default_rng(2)
    time = np.arange(2000) * made.STEP
    position = 0.1 * np.sin(np.arange(2000)[:, None] * [0.01, 0.013])
    # One weighs 20 N, the other passes through 0 all the time.
    effort = np.array([20.0, 0.0]) + [2.0, 8.0] * np.cos(np.arange(2000)[:, None] * [0.01, 0.013])
    effort += 0.02 * rng.normal(size=effort.shape)
    sound = Recording.from_arrays('sound', time, position, None, effort, ('upright', 'level'))
    assert 'effort_zero' not in made.kinds(sound)
    lost = [300, 900, 901]
    effort[lost] = noise * rng.normal(size=(3, 2))
    recording = Recording.from_arrays('run', time, position, None, effort, ('upright', 'level'))
    finding = made.the_one(recording, 'effort_zero')
    assert finding.count == 3
    assert finding.text.endswith('they count as not measured')
    assert np.flatnonzero(np.isnan(recording.effort[:, 0])).tolist() == lost
    # The other's are lost at those moments only.
    assert set(np.flatnonzero(np.isnan(recording.effort[:, 1]))) <= set(lost)
    assert len(recording.time) == 2000


@settings(max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), reach=st.integers(1, 5))
def test_any_disorder_within_reach_is_undone(seed: int, reach: int) -> None:
    arrays = made.measured(200)
    shift = np.random.default_rng(seed).uniform(0, reach, 200)
    order = np.argsort(np.arange(200) + shift, kind='stable')
    recording = made.judged({name: values[order] for name, values in arrays.items()})
    made.assert_same(recording, arrays)
    assert recording.segments == (slice(0, 200),)


@pytest.mark.parametrize('back', [0.2, 2.0, 1.7e9])
def test_a_clock_that_is_set_back_splits(back: float) -> None:
    arrays = made.measured()
    arrays['time'] = arrays['time'] + np.where(np.arange(1000) < 600, back, 0.0)
    recording = made.judged(arrays)
    finding = made.the(recording, 'clock_reset')
    assert finding.count == 1
    assert finding.spans == ((1.2, 1.2),)
    assert recording.segments == (slice(0, 600), slice(600, 1000))
    np.testing.assert_array_equal(recording.position, arrays['position'])


def test_stamps_from_before_the_clock_was_set_do_not_cost_digits(tmp_path: Path) -> None:
    arrays = made.measured(600)
    states = made.states_of(arrays, time=arrays['time'] + 1_700_000_000)
    states[0] = made.message(0, DRIVES, *(arrays[name][0] for name in made.QUANTITIES))
    recording = read_recording(made.write_plain_bag(tmp_path / 'bag', {'/joint_states': states}))
    assert recording.epoch == 1_700_000_000
    assert recording.segments == (slice(1, 600),)
    # The test itself made these stamps from floats of seconds since 1970, good to 0.24 us.
    assert np.abs(np.diff(recording.time[1:]) - made.STEP).max() < 1e-6
    assert made.kinds(recording) == {'gap', 'short_segment'}


def test_of_equal_stamps_the_first_sample_is_kept() -> None:
    arrays = made.measured()
    order = np.sort(np.concatenate((np.arange(1000), [10, 10, 700])))
    doubled = {name: values[order] for name, values in arrays.items()}
    doubled['effort'][[11, 12]] = 99
    recording = made.judged(doubled)
    made.assert_same(recording, arrays)
    finding = made.the(recording, 'duplicate_stamps')
    assert finding.count == 3
    assert finding.spans == ((0.02, 0.02), (1.4, 1.4))


@pytest.mark.parametrize('length', [1, 3])
def test_spikes_of_position_are_dropped(length: int) -> None:
    arrays = made.measured()
    arrays['position'][400:400 + length, 3] += 0.03
    recording = made.judged(arrays)
    finding = made.the_one(recording, 'position_spike')
    assert (finding.count, finding.drives) == (length, ('lift_1',))
    assert finding.spans == ((pytest.approx(0.8), pytest.approx(0.8 + made.STEP * (length - 1))),)
    assert made.the_one(recording, 'lost_samples').count == length
    kept = np.setdiff1d(np.arange(1000), np.arange(400, 400 + length))
    np.testing.assert_array_equal(recording.position, arrays['position'][kept])
    assert recording.segments == (slice(0, 1000 - length),)


def test_a_position_that_jumps_splits() -> None:
    arrays = made.measured()
    arrays['position'][500:, 1] -= 0.03
    recording = made.judged(arrays)
    finding = made.the(recording, 'position_jump')
    assert (finding.count, finding.drives, finding.spans) == (1, ('slide_2',), ((1.0, 1.0),))
    assert recording.segments == (slice(0, 500), slice(500, 1000))


@pytest.mark.parametrize('factor', [0.5, 5])
def test_a_rate_that_changes_is_one_motion_with_irregular_steps(factor: float) -> None:
    arrays = made.measured()
    steps = np.full(1000, made.STEP)
    steps[450:] *= factor
    arrays['time'] = np.cumsum(steps)
    recording = made.judged(arrays)
    made.the(recording, 'irregular_steps')
    assert recording.segments == (slice(0, 1000),)


def test_gaps_split_and_lost_samples_do_not() -> None:
    arrays = made.measured()
    gone = [100, 300, 301, *range(500, 509), *range(700, 710)]
    kept = np.setdiff1d(np.arange(1000), gone)
    recording = made.judged({name: values[kept] for name, values in arrays.items()})
    assert made.kinds(recording) == {'gap', 'lost_samples'}
    lost = made.the_one(recording, 'lost_samples')
    # Nine lost samples make a step of 20 ms, no longer than a cubic can bridge; ten make a gap.
    assert lost.count == 1 + 2 + 9
    np.testing.assert_allclose(lost.spans, [(0.198, 0.202), (0.598, 0.604), (0.998, 1.018)])
    gap = made.the_one(recording, 'gap')
    assert gap.count == 1
    np.testing.assert_allclose(gap.spans, [(1.398, 1.42)])
    assert recording.segments == (slice(0, 688), slice(688, 978))


@pytest.mark.parametrize('scale', [1e3, 1e9])
def test_stamps_of_another_unit_are_read_as_they_are(scale: float, tmp_path: Path) -> None:
    arrays = made.measured(1001)
    stamps = np.rint(scale * arrays['time']).astype(np.int64)
    header = ['time', *(f'{drive}/position' for drive in DRIVES)]
    path = tmp_path / 'run.csv'
    path.write_text('\n'.join([','.join(header), *(
        ','.join(map(str, [stamp, *row])) for stamp, row in zip(
            stamps.tolist(), arrays['position'].tolist(), strict=True))]))
    recording = read_recording(path)
    assert len(recording.time) == 1001
    assert recording.time[-1] - recording.time[0] == pytest.approx(
        scale * arrays['time'][-1], rel=1e-6)
    slow, = (finding for finding in recording.findings if finding.kind == 'slow_rate')
    assert f'only one sample in {0.002 * scale:.4g} s' in slow.text


def test_what_pandas_has_for_missing_values_counts_as_missing() -> None:
    arrays = made.measured(500)
    frames = {name: pd.DataFrame(values).astype('Float64') for name, values in arrays.items()
              if name != 'time'}
    frames['effort'].iloc[10, 2] = frames['velocity'].iloc[20, 3] = pd.NA
    frames['position'].iloc[30, 1] = pd.NA
    given = frames | {'effort': frames['effort'].astype(object), 'velocity': [
        [None if pd.isna(cell) else cell for cell in row]
        for row in frames['velocity'].to_numpy(dtype=object)]}
    dates = pd.Series(pd.to_datetime(1.7e9 + arrays['time'], unit='s'))
    recording = Recording.from_arrays('frame', dates, **given)
    assert np.isnan(recording.effort[10, 2])
    assert np.isnan(recording.effort).sum() == 1
    assert np.isnan(recording.velocity[20, 3])
    assert np.isnan(recording.velocity).sum() == 1
    assert len(recording.time) == 499
    assert np.median(np.diff(recording.time)) == pytest.approx(0.002, abs=1e-6)


@pytest.mark.parametrize(('quantity', 'values'), [
    ('time', [['a']]), ('position', 'many'), ('effort', {'slide_1': 3})])
def test_what_is_no_number_is_named(quantity: str, values: Any) -> None:
    with pytest.raises(MotionError, match=f'^{quantity}: '):
        Recording.from_arrays('wrong', **{**made.measured(100), quantity: values})


def test_efforts_that_are_not_finite_count_as_not_measured() -> None:
    arrays = made.measured()
    arrays['effort'][10:20, 2], arrays['effort'][15:40, 5], arrays['effort'][90, 0] = (
        np.nan, np.inf, -np.inf)
    recording = made.judged(arrays)
    finding = made.the(recording, 'effort_not_measured')
    assert finding.count == 10 + 25 + 1
    assert finding.spans == ((0.02, 0.078), (0.18, 0.18))
    assert finding.drives == ('slide_1', 'slide_3', 'lift_3')
    assert 'lift_3 (2.5 % of the samples)' in finding.text
    assert np.isnan(recording.effort).sum() == 36
    np.testing.assert_array_equal(recording.position, arrays['position'])
    assert np.isinf(arrays['effort']).sum() == 26, 'the caller keeps his own array'


@pytest.mark.parametrize('size', [1e308, 1e13])
def test_numbers_that_nothing_can_have_measured_are_no_measurements(size: float) -> None:
    arrays = made.measured()
    arrays['effort'][10:20, 2], arrays['velocity'][30, 1], arrays['position'][40, 0] = (
        size, size, size)
    recording = made.judged(arrays)
    assert made.the_one(recording, 'impossible_effort').drives == ('slide_3',)
    assert made.the_one(recording, 'impossible_effort').count == 10
    assert made.the_one(recording, 'impossible_velocity').count == 1
    dropped = made.the_one(recording, 'impossible_position')
    # One remark each: what was discarded is not missing in addition.
    assert not {finding.kind for finding in recording.findings} & {
        'non_finite_position', 'effort_not_measured', 'missing_velocity'}
    assert 'far from all others, at 0.08 s; those samples are dropped' in dropped.text
    assert np.isnan(recording.effort).sum() == 10
    assert len(recording.time) == len(arrays['time']) - 1
    assert np.nanmax(np.abs(recording.effort)) < 1e3


def test_efforts_at_the_limit_of_a_drive_are_left_out() -> None:
    arrays = made.measured()
    limit = 0.5 * float(np.abs(arrays['effort'][:, 1]).max())
    beyond = np.abs(arrays['effort'][:, 1]) > limit
    clipped = np.clip(arrays['effort'], -limit, limit)
    noise = np.random.default_rng(0).normal(0.0, 1e-3 * limit, clipped.shape)
    samples = Samples(DRIVES, arrays['time'], arrays['position'], arrays['velocity'],
                      np.where(np.arange(6) == 1, clipped + noise, arrays['effort']),
                      effort_limits=(np.inf, limit, *[np.inf] * 4))
    judgement = Judgement(samples)
    assert made.the_one(judgement, 'saturated_effort').drives == ('slide_2',)
    assert np.isnan(judgement.samples.effort[beyond, 1]).all()
    assert np.isfinite(judgement.samples.effort[:, [0, 2, 3, 4, 5]]).all()


def test_an_effort_that_stands_still_while_its_drive_moves_is_told() -> None:
    arrays = made.measured()
    arrays['effort'][200:600, 3] = 1.5
    finding = made.the(made.judged(arrays), 'constant_effort')
    assert (finding.count, finding.drives) == (1, ('lift_1',))
    assert finding.spans == ((0.4, pytest.approx(1.198)),)
    # At rest a coarse sensor may well say the same for long.
    arrays['position'][200:600, 3] = arrays['position'][200, 3]
    arrays['position'][600:, 3] += arrays['position'][599, 3] - arrays['position'][600, 3]
    assert made.judged(arrays).findings == ()
    # A drive without a sensor has none all the time.
    arrays = made.measured()
    arrays['effort'][:, 5] = 0.0
    assert made.the(made.judged(arrays), 'unmeasured_effort').drives == ('lift_3',)
    assert np.isnan(made.judged(arrays).effort[:, 5]).all()


@pytest.mark.parametrize('quantity', ['position', 'effort'])
def test_values_that_a_slower_source_repeats_are_used_once(quantity: str) -> None:
    arrays = made.measured()
    held = np.arange(len(arrays['time'])) // 4 * 4
    arrays[quantity] = arrays[quantity][held]
    recording = made.judged(arrays)
    assert '125 new ones a second' in made.the(recording, {
        'position': 'held_position', 'effort': 'held_effort'}[quantity]).text
    used = recording.position if quantity == 'position' else recording.effort
    assert np.isfinite(used).all(axis=1).sum() == len(held) // 4


def test_efforts_that_are_cut_off_on_one_side_are_left_out() -> None:
    arrays = made.measured()
    limit = float(np.quantile(arrays['effort'][:, 1], 0.9))
    arrays['effort'][:, 1] = np.minimum(arrays['effort'][:, 1], limit)
    recording = made.judged(arrays)
    assert f'cut off at {limit:.4g}' in made.the(recording, 'saturated_effort').text
    assert np.nanmax(recording.effort[:, 1]) < limit


@pytest.mark.parametrize('kept', [0.03, 0.4])
def test_a_drive_whose_efforts_are_nearly_all_cut_off_is_not_judged(kept: float) -> None:
    arrays = made.measured()
    limit = float(np.quantile(np.abs(arrays['effort'][:, 1]), kept))
    arrays['effort'][:, 1] = np.clip(arrays['effort'][:, 1], -limit, limit)
    recording = made.judged(arrays)
    is_lost = kept < 0.1
    finding = made.the(recording, 'mostly_saturated' if is_lost else 'saturated_effort')
    assert finding.drives == ('slide_2',)
    assert ('too few efforts remain to judge this drive' in finding.text) == is_lost
    assert np.isnan(recording.effort[:, 1]).mean() == pytest.approx(
        1.0 if is_lost else 1 - kept, abs=0.01)
    assert np.isfinite(recording.effort[:, [0, 2, 3, 4, 5]]).all()


def test_repeated_messages_are_told() -> None:
    arrays = made.measured()
    for name in made.QUANTITIES:
        arrays[name][300:360] = arrays[name][300]
        arrays[name][700:705] = arrays[name][700]
    recording = made.judged(arrays)
    finding = made.the_one(recording, 'frozen_samples')
    assert finding.count == 59
    assert finding.spans == ((0.6, pytest.approx(0.718)),)


def test_a_robot_at_rest_without_efforts_is_not_called_frozen() -> None:
    arrays = {**made.measured(), 'effort': None, 'velocity': None}
    arrays['position'][300:500] = arrays['position'][300]
    arrays['position'][500:] += arrays['position'][499] - arrays['position'][500]
    assert made.kinds(made.judged(arrays)) == {'no_effort', 'missing_velocity'}


def test_segments_too_short_to_filter_are_not_used() -> None:
    arrays = made.measured()
    arrays['time'][100:119] += 1
    arrays['time'][119:] += 2
    recording = made.judged(arrays)
    finding = made.the_one(recording, 'short_segment')
    assert finding.count == 1
    np.testing.assert_allclose(finding.spans, [(1.2, 1.236)])
    assert recording.segments == (slice(0, 100), slice(119, 1000))
    assert len(recording.time) == 1000


@settings(max_examples=60)
@example(times=[0.0, -8.98846567431158e+307, 0.0, 1.0, 0.5], seed=0)
@given(times=st.lists(st.one_of(st.floats(), st.floats(0, 3).map(lambda t: round(t, 2))),
                      min_size=1, max_size=80), seed=st.integers(0, 99))
def test_whatever_the_stamps_segments_are_ordered_and_everything_is_finite(
    times: list[float], seed: int,
) -> None:
    position = np.random.default_rng(seed).choice([0, 0, 1, 1e9, np.nan], (len(times), 1),
                                                  p=[0.4, 0.2, 0.2, 0.15, 0.05])
    try:
        recording = Recording.from_arrays('x', np.array(times), position, drives=('axis',))
    except MotionError:
        assert not np.any(np.isfinite(times) & np.isfinite(position[:, 0]))
        return
    assert np.all(np.isfinite(recording.time))
    assert np.all(np.isfinite(recording.position))
    for part in recording.segments:
        assert np.all(np.diff(recording.time[part]) > 0)
    starts = [part.start for part in recording.segments]
    assert starts == sorted(starts)


@pytest.mark.parametrize(('rows', 'value'), [
    (slice(0, 10), 253.0), (slice(3000, 3002), -253.0), ([1000, 4000], 1e282), ([5999], 253.0)])
def test_a_few_damaged_rows_are_discarded_and_counted(rows: Any, value: float) -> None:
    time = np.arange(6000) * 0.008
    position = np.column_stack([np.sin(time), np.cos(1.3 * time)])
    effort = 4.0 * np.gradient(position, time, axis=0)
    damaged = position.copy(), effort.copy()
    for values in damaged:
        values[rows] = value
    recording = Recording.from_arrays('log', time, damaged[0], effort=damaged[1], drives=('a', 'b'))
    kept = np.ones(len(time), dtype=bool)
    kept[rows] = False
    np.testing.assert_array_equal(recording.position, position[kept])
    np.testing.assert_array_equal(recording.effort, effort[kept])
    found = {finding.kind: finding for finding in recording.findings}
    assert found['impossible_position'].count == (~kept).sum()
    assert f'{abs(value):.3g}' in found['impossible_position'].text
