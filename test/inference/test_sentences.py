# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What a diagnosis is put into: sentences, the terminal, and what is drawn of it."""

from __future__ import annotations

import io
import re
import shlex
from dataclasses import replace
from pathlib import Path
from typing import Any

import made_up_arm as arm
import numpy as np
import pytest
from made_up_diagnosis import (
    NOISE,
    SUSPECT,
    calibration,
    found_effect,
    made_up_diagnosis,
    made_up_residuals,
    ranked_set,
    ranked_sets,
    statement,
)
from rich.console import Console

from pprs_dynamics.app.commands.pprs import _parser
from pprs_dynamics.app.report.diagnosis_figures import unknown_picture
from pprs_dynamics.app.report.diagnosis_report import diagnosis_page, diagnosis_view
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.diagnosis.found_effects import RivalEffect
from pprs_dynamics.inference.diagnosis.next_step import GivenFiles, next_step
from pprs_dynamics.inference.diagnosis.partial_errors import error_steps, partial_residual
from pprs_dynamics.inference.diagnosis.quantities import (
    change,
    name_drives,
    percent,
    with_uncertainty,
)
from pprs_dynamics.inference.diagnosis.sentences import set_rows, word_diagnosis
from pprs_dynamics.inference.search.candidates import DRIFT, SINCE, Course
from pprs_dynamics.inference.search.estimates import Calibration
from pprs_dynamics.inference.search.patterns import OWN, PLATFORM
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.effects.drive_effect import DriveEffect

VARIABLES = (*OWN, *PLATFORM, 'velocity', 'direction', 'time', 'frequency', 'position of lift_1',
             'velocity of slide_3')


def one_effect(**changes: Any) -> Diagnosis:
    return made_up_diagnosis(effects=(found_effect('coulomb_friction'),), **changes)


def ambiguous() -> Diagnosis:
    return made_up_diagnosis(
        'ambiguous', effects=(found_effect('base_tilt', None),),
        indistinguishable=(('base_tilt', 'external_wrench'),))


def unknown() -> Diagnosis:
    return made_up_diagnosis('unknown', depends_on=(statement(),))


def everything() -> Diagnosis:
    """Return a diagnosis with something in every place, on many drives."""
    return made_up_diagnosis(
        'unknown', effects=(found_effect('stribeck_friction', DRIVES),
                            found_effect('asymmetric_friction', DRIVES[:5]),
                            found_effect('payload_offset', None)),
        indistinguishable=(('payload_offset', 'external_wrench'),), depends_on=(statement(),),
        suspects=(SUSPECT,),
        calibrated=(calibration(),), warnings=('effort of slide_1 looks filtered',))


def test_an_effect_is_told_with_drive_values_errors_and_its_card() -> None:
    words = word_diagnosis(one_effect())
    assert words.headline == ('The model lacks coulomb_friction on lift_2. With it the error falls '
                              'from 0.25 N to 0.0502 N, which is the noise.')
    finding = words.effects[0]
    assert '(F) 0.600 ± 0.020 N' in finding.what
    assert 'from 0.25 N to 0.051 N' in finding.why
    assert 'Evidence 120' in finding.why
    card = CATALOGUE['coulomb_friction'].card
    assert finding.cause[1:-1] == card.causes[1:]
    assert finding.confirm[1:-1] == card.confirm[1:]
    assert words.command == ('pprs adopt coulomb_friction RECORDING --output '
                             'with_coulomb_friction.yaml')


@pytest.mark.parametrize(('kind', 'said'), [
    (SINCE, 'hysteresis since 4 s'), (DRIFT, 'hysteresis, growing from nothing at the start')])
def test_what_changes_within_a_recording_is_not_added_throughout(kind: str, said: str) -> None:
    changing = made_up_diagnosis(effects=(
        found_effect('hysteresis', course=Course(kind, 4.0, 15.0)),
        found_effect('coulomb_friction')))
    words = word_diagnosis(changing)
    assert said in words.following
    assert words.command == 'pprs diagnose SECOND_RECORDING'


def test_a_held_out_error_that_rises_stands_in_the_headline_and_forbids_adoption() -> None:
    worse = made_up_diagnosis('adequate', unconfirmed=(
        found_effect('hysteresis', held_out_after=0.3,
                     objection='held-out data are predicted worse with it'),))
    words = word_diagnosis(worse)
    assert 'lacks' not in words.headline
    assert words.headline == 'No effect is supported by held-out data.'
    assert not words.effects
    assert words.following.startswith('Do not add hysteresis')
    assert 'adopt' not in words.command


@pytest.mark.parametrize(('objection', 'command'), [
    ('it would be measured 1.6 times too large', 'pprs fit RECORDING --output base.yaml'),
    ('', 'pprs diagnose RECORDING SECOND_RECORDING')])
def test_a_model_of_another_machine_is_fitted_before_another_motion_is_recorded(
    tmp_path: Path, objection: str, command: str,
) -> None:
    impossible = replace(made_up_diagnosis('unknown', unconfirmed=(
        found_effect('effort_gain', objection=objection),)), model=arm.real_arm(tmp_path))
    assert word_diagnosis(impossible).command == command


def test_a_drive_that_keeps_more_than_its_noise_is_named_beside_what_was_found() -> None:
    words = word_diagnosis(made_up_diagnosis(
        'unknown', remaining=1.6 * made_up_residuals().error,
        effects=(found_effect('coulomb_friction'),),
        above_noise={'slide_3': 2.13}))
    assert words.headline.startswith(
        'An error remains that no effect of the catalogue explains: the error of slide_3 is 2.1 '
        'times its noise. In addition, the model lacks coulomb_friction')
    assert words.headline.endswith('; with it the error falls from 0.25 N to 0.0804 N.')
    assert words.following.startswith('Confirm it on the machine')


def test_ambiguous_names_all_and_says_how_to_tell_them_apart() -> None:
    words = word_diagnosis(ambiguous())
    assert 'base_tilt or external_wrench (the data do not separate these)' in words.headline
    assert 'from external_wrench' in words.effects[0].remarks[0]
    assert words.command == 'pprs next-experiment RECORDING --output next.csv'


def test_adequate_claims_no_more_than_the_noise_allows() -> None:
    words = word_diagnosis(made_up_diagnosis('adequate'))
    assert words.headline.startswith('No effect is missing: the error is the noise, 0.05 N rms.')
    assert 'cannot be seen' in words.headline
    assert words.effects == words.unexplained == ()


def test_unknown_names_drive_variable_shape_and_share_and_nothing_of_the_catalogue() -> None:
    words = word_diagnosis(unknown())
    assert words.headline == ('An error remains that no effect of the catalogue explains: on '
                              'slide_1, depending on position.')
    finding = words.unexplained[0]
    for part in ('slide_1', 'position', 'a shift within a range', '41%'):
        assert part in finding.what
    assert not any(name in finding.what for name in CATALOGUE)
    assert finding.cause
    assert finding.confirm


@pytest.mark.parametrize('variable', VARIABLES)
def test_every_variable_has_words_a_lead_and_a_picture(variable: str) -> None:
    found = statement(variable=variable, limits=(0.0, 1.0) if variable == 'frequency' else None)
    diagnosis = made_up_diagnosis('unknown', depends_on=(found,))
    finding = word_diagnosis(diagnosis).unexplained[0]
    assert finding.cause != finding.confirm
    picture = unknown_picture(diagnosis, found)
    assert picture is not None
    assert all(np.isfinite(np.asarray(curve.y, dtype=float)).all() for curve in picture.data)


def test_a_width_of_reversal_that_moved_is_not_told_as_what_it_was() -> None:
    moved = Calibration('friction.reversal_velocities', 0, 0.001, 0.0009962, 0.0, 'm/s')
    told = word_diagnosis(made_up_diagnosis('adequate', calibrated=(moved,))).calibrated[0]
    assert told == 'friction.reversal_velocities[1]: 1 mm/s becomes about 0.996 mm/s: calibrated'


def test_negative_friction_is_said_to_be_impossible() -> None:
    for value, sure in ((-0.6, True), (-0.015, False)):
        diagnosis = made_up_diagnosis(effects=(found_effect('coulomb_friction', value=value),))
        remark = word_diagnosis(diagnosis).effects[0].remarks[0]
        assert 'is negative' in remark
        assert 'Negative friction is impossible' in remark
        assert ('zero is within its uncertainty' not in remark) is sure
    assert word_diagnosis(one_effect()).effects[0].remarks == ()


def test_dry_asymmetric_friction_is_also_told_as_the_two_that_it_equals() -> None:
    found = found_effect('asymmetric_friction', only=('force_forward',))
    remarks = word_diagnosis(made_up_diagnosis(effects=(found,))).effects[0].remarks
    # 0.6 N forwards and 0 backwards.
    assert any('coulomb_friction of 0.3 N plus effort_offset of 0.3 N' in one for one in remarks)
    viscous = found_effect('asymmetric_friction', only=('viscous_forward',))
    assert word_diagnosis(made_up_diagnosis(effects=(viscous,))).effects[0].remarks == ()


@pytest.mark.parametrize('name', CATALOGUE)
def test_every_effect_of_the_catalogue_is_told_with_all_its_parameters(name: str) -> None:
    drives = DRIVES[:1] if issubclass(CATALOGUE[name], DriveEffect) else None
    words = word_diagnosis(made_up_diagnosis(effects=(found_effect(name, drives),)))
    for parameter in CATALOGUE[name].parameters:
        assert f'{parameter.description} ({parameter.symbol})' in words.effects[0].what


@pytest.mark.parametrize(('value', 'std', 'unit', 'text'), [
    (0.0102, 0.0002, 'm/s', '10.20 ± 0.40 mm/s'), (1.2345, 0.05, 'N', '1.23 ± 0.10 N'),
    (0.5, 0.01, 'rad', '28.6 ± 1.1°'), (0.004, 0.0001, 's', '4.00 ± 0.20 ms'),
    (12.0, 0.7, 's', '12.0 ± 1.4 s'), (1234.0, 60.0, 'N/m', '1230 ± 120 N/m'),
    (0.043, 0.001, '1', '0.0430 ± 0.0020'), (0.25, 0.0, 'kg', '0.25 kg'),
    (0.002, 0.0005, 'kg m^2', '0.0020 ± 0.0010 kg m²'),
    (1.0, float('inf'), 'N', '1 N (not determined)'),
    (-0.2, 0.004, 'kg', '-0.2000 ± 0.0080 kg')])
def test_values_are_read_with_the_digits_that_are_known(
    value: float, std: float, unit: str, text: str,
) -> None:
    assert with_uncertainty(value, std, unit) == text


def test_drives_are_named_together_where_they_are_all() -> None:
    assert name_drives(DRIVES[::-1], DRIVES) == 'all six drives'
    assert name_drives(('lift_3', 'lift_1', 'lift_2'), DRIVES) == 'all three lifts'
    assert name_drives(('lift_3', 'slide_1'), DRIVES) == 'slide_1 and lift_3'
    assert name_drives(('axis',), ('axis',)) == 'axis'


def printed(diagnosis: Diagnosis, width: int, details: bool) -> str:
    file = io.StringIO()
    Console(file=file, width=width).print(diagnosis_view(
        diagnosis, word_diagnosis(diagnosis), details))
    return file.getvalue()


def in_one_line(text: str) -> str:
    return re.sub(r'[\s│]+', ' ', text)


@pytest.mark.parametrize('width', [80, 120])
@pytest.mark.parametrize('make', [one_effect, ambiguous, unknown, everything])
def test_with_details_the_terminal_shows_everything_within_its_width(
    make: Any, width: int,
) -> None:
    diagnosis = make()
    words = word_diagnosis(diagnosis)
    text = printed(diagnosis, width, details=True)
    assert max(map(len, text.splitlines())) <= width
    assert '…' not in text, 'nothing is cut off'
    shown = in_one_line(text)
    for sentence in (words.headline, words.following, *words.suspects, *words.calibrated,
                     *words.barred, *words.warnings):
        assert sentence in shown
    for finding in (*words.effects, *words.unexplained):
        for sentence in (finding.what, finding.why, finding.cause, finding.confirm,
                         *finding.remarks):
            assert sentence in shown


@pytest.mark.parametrize('make', [one_effect, ambiguous, unknown, everything])
def test_verdict_fall_and_next_step_fit_25_lines_of_80_columns(make: Any) -> None:
    diagnosis = replace(make(), sets=ranked_sets('coulomb_friction', 'hysteresis'))
    words = word_diagnosis(diagnosis)
    text = printed(diagnosis, 80, details=False)
    # The command adds a finding of a recording and the name of the page.
    assert len(text.splitlines()) <= 25 - 2
    for part in (words.headline, words.following, words.command,
                 'Runner-up hysteresis on lift_2 instead of coulomb_friction on lift_2: '
                 'costs 7.0 more: names + 7.0'):
        assert part in in_one_line(text)


def test_the_runner_up_stands_beside_the_best_set_with_its_cost() -> None:
    diagnosis = one_effect(sets=(
        *ranked_sets('coulomb_friction', 'hysteresis'),
        ranked_set((), 120.4), ranked_set((('unknown, position', ('lift_2',)),), 130.0)))
    assert set_rows(diagnosis) == [
        ('coulomb_friction on lift_2', 'the best', ''),
        ('hysteresis on lift_2', '+7.0', 'names + 7.0'),
        ('nothing missing', '+120.4', 'names + 120.4'),
        ('a pattern depending on position on lift_2', '+130.0', 'names + 130.0')]
    page = diagnosis_page(diagnosis, word_diagnosis(diagnosis), made_up_residuals(), ['a'])
    assert '>hysteresis on lift_2</th>' in page.html()


def test_one_pattern_on_all_drives_is_one_finding() -> None:
    line = tuple(statement(drive, 'frequency', 'line', (7.0, 7.1)) for drive in DRIVES)
    words = word_diagnosis(made_up_diagnosis('unknown', depends_on=line))
    assert [finding.title for finding in words.unexplained] == [
        'unknown on slide_1, slide_2, slide_3, lift_1, lift_2 and lift_3, at one frequency']
    assert 'place' not in words.headline


def test_a_rival_has_its_card_with_values_and_cost_and_a_picture() -> None:
    found = found_effect('external_wrench', None)
    rival = RivalEffect(found.effect, None, found.parameters, found.force, 'base_tilt', 0.0521,
                        0.0533, 3.24, made_up_residuals().error)
    words = word_diagnosis(ambiguous(), rivals=(rival,))
    said, = words.rivals
    assert 'external_wrench explains the data about as well as base_tilt' in said.what
    assert '0.600 ± 0.020 N' in said.what
    assert '0.0521 N' in said.why
    assert 'costs 3.2 more than the best one' in said.why
    assert said.confirm[1:-1] == CATALOGUE['external_wrench'].card.confirm[1:]
    html = diagnosis_page(ambiguous(), words, made_up_residuals(), ['a'], (), (rival,)).html()
    card = html[html.index('<h3>or external_wrench'):]
    assert 'class="plot"' in card[:card.index('</section>')]


def test_commands_hold_the_real_names_as_a_shell_takes_them() -> None:
    files = GivenFiles(('my run.mcap', 'b.csv'), ('held.csv',), 'robot.yaml')
    words = word_diagnosis(one_effect(), files)
    assert words.command == (
        "pprs adopt coulomb_friction 'my run.mcap' b.csv --validate held.csv --model robot.yaml "
        '--output with_coulomb_friction.yaml')
    assert word_diagnosis(ambiguous(), files).command == (
        "pprs next-experiment 'my run.mcap' b.csv --model robot.yaml --output next.csv")


@pytest.mark.parametrize(('given', 'written'), [
    ('robot.yaml', 'with_coulomb_friction.yaml'),
    ('with_coulomb_friction.yaml', 'with_coulomb_friction_2.yaml'),
    ('with_coulomb_friction_2.yaml', 'with_coulomb_friction_3.yaml'),
    ('elsewhere/with_coulomb_friction.yaml', 'with_coulomb_friction.yaml')])
def test_what_is_written_is_never_the_model_that_is_given(given: str, written: str) -> None:
    command = word_diagnosis(one_effect(), GivenFiles(('a.csv',), model=given)).command
    assert command == (f'pprs adopt coulomb_friction a.csv --model {given} --output {written}')


@pytest.mark.parametrize('verdict', ['effect', 'ambiguous', 'unknown', 'adequate'])
def test_every_command_keeps_model_and_topic_and_is_one(verdict: str) -> None:
    files = GivenFiles(('a.csv',), ('b.csv',), 'my robot.yaml', '/arm/joint_states')
    diagnosis = {'effect': one_effect, 'ambiguous': ambiguous}.get(verdict, one_effect)()
    if verdict in ('unknown', 'adequate'):
        diagnosis = replace(diagnosis, effects=(), indistinguishable=(), verdict=verdict)
    _, command = next_step(diagnosis, files)
    assert "--model 'my robot.yaml' --topic /arm/joint_states" in command
    words = shlex.split(command)[1:]
    assert _parser(words).parse_args(words).topic == '/arm/joint_states'


@pytest.mark.parametrize(('before', 'after', 'said'), [
    (0.25, 0.051, 'falls from 0.25 N to 0.051 N'),
    (0.86512, 0.86488, 'falls from 0.8651 N to 0.8649 N'),
    (0.865, 0.868, 'does not fall (0.865 N before, 0.868 N after)'),
    (1234.5, 12.3, 'falls from 1234 N to 12.3 N')])
def test_an_error_falls_by_digits_that_show_it_or_not_at_all(
    before: float, after: float, said: str,
) -> None:
    assert change(before, after) == said


@pytest.mark.parametrize(('share', 'text'), [
    (1.3, '130%'), (0.41, '41%'), (0.0123, '1.2%'), (0.0995, '10%'), (float('nan'), 'none')])
def test_shares_are_read_without_powers_of_ten(share: float, text: str) -> None:
    assert percent(share) == text


def test_the_steps_of_the_error_end_where_comparisons_do() -> None:
    diagnosis = everything()
    after = made_up_residuals()
    steps = error_steps(diagnosis, after)
    assert [step.label for step in steps] == [
        'model as given', 'stribeck_friction', 'asymmetric_friction', 'payload_offset']
    assert steps[0].overall == pytest.approx(np.sqrt(np.mean(diagnosis.residuals.error ** 2)))
    np.testing.assert_allclose(steps[-1].drives, np.sqrt(np.mean(after.error ** 2, axis=0)))
    # The second of them does not sit on lift_3.
    assert steps[2].drives[5] == pytest.approx(steps[1].drives[5])


def test_numbers_that_move_are_a_step_of_their_own() -> None:
    diagnosis = one_effect()
    shifted = replace(diagnosis.residuals, measured=diagnosis.residuals.measured + 0.2)
    steps = error_steps(replace(diagnosis, residuals=shifted), made_up_residuals())
    assert [step.label for step in steps] == ['model as given', 'its own numbers',
                                              'coulomb_friction']


def test_an_effect_is_drawn_along_what_it_depends_on_with_noise_as_uncertainty() -> None:
    part = partial_residual(one_effect(), one_effect().effects[0])
    assert DRIVES[part.drive] == 'lift_2'
    assert part.variable == 'velocity'
    assert part.profile is not None
    off = np.abs(part.profile.mean - part.fitted)
    assert np.all(off < 5 * part.profile.uncertainty)
    assert part.profile.uncertainty.max() < NOISE
    np.testing.assert_allclose(part.force, 0.6 * np.sign(
        made_up_residuals().variables['velocity'][:, 4]))


def test_the_shape_of_what_remains_is_the_one_that_was_planted() -> None:
    residuals = made_up_residuals()
    lead = residuals.variables['position'][:, 3]
    remaining = residuals.error.copy()
    remaining[:, 0] += 10 * lead
    found = statement(variable='position of lift_1', limits=None)
    before, planted = (unknown_picture(one, found) for one in (
        unknown(), replace(unknown(), remaining=remaining)))
    curve, shape = before.data[0], planted.data[0]
    # Positions are drawn in mm.
    np.testing.assert_allclose(shape.y - curve.y, 10 * shape.x / 1e3, atol=0.03)


def test_the_page_escapes_what_comes_from_files() -> None:
    words = word_diagnosis(everything())
    html = diagnosis_page(everything(), words, made_up_residuals(), ['<script>alert(1)</script>'],
                          ['<b>']).html()
    assert '<script>alert(1)' not in html
    assert '&lt;script&gt;alert(1)' in html
    assert 'Held out: &lt;b&gt;' in html
