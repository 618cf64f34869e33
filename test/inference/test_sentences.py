# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What a diagnosis is put into: sentences, the terminal, and what is drawn of it."""

from __future__ import annotations

import re
import shlex
from dataclasses import replace
from html import unescape
from typing import Any

import made_up_diagnosis as made
import pytest
from made_up_recordings import judged, measured

from pprs_dynamics.app.api.adopt import AdoptionRunResult
from pprs_dynamics.app.api.diagnose import diagnosis_page, diagnosis_view
from pprs_dynamics.app.api.inputs import Inputs
from pprs_dynamics.app.commands.pprs import _parser
from pprs_dynamics.app.report.terminal import as_text
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.inference.adoption.adopt import AdoptionRun
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.diagnosis.next_step import GivenFiles, next_step
from pprs_dynamics.inference.diagnosis.quantities import change, fall, with_uncertainty
from pprs_dynamics.inference.diagnosis.sentences import Sentences
from pprs_dynamics.physics.model.drive_model import DriveModel


def one_effect(**changes: Any) -> Diagnosis:
    return made.made_up_diagnosis(effects=(made.found_effect('coulomb_friction'),), **changes)


def ambiguous() -> Diagnosis:
    return made.made_up_diagnosis(
        'ambiguous', effects=(made.found_effect('base_tilt', None),),
        indistinguishable=(('base_tilt', 'external_wrench'),))


def everything() -> Diagnosis:
    """Return a diagnosis with something in every place, on many drives."""
    return made.made_up_diagnosis(
        'unknown', effects=(made.found_effect('stribeck_friction', DRIVES),
                            made.found_effect('asymmetric_friction', DRIVES[:5]),
                            made.found_effect('payload_offset', None)),
        indistinguishable=(('payload_offset', 'external_wrench'),), depends_on=(made.statement(),),
        suspects=(made.SUSPECT,),
        calibrated=(made.calibration(),), warnings=('effort of slide_1 looks filtered',))


def test_a_held_out_error_that_rises_stands_in_the_headline_and_forbids_adoption() -> None:
    worse = made.made_up_diagnosis('adequate', unconfirmed=(
        made.found_effect('hysteresis', held_out_after=0.3,
                     objection='held-out data are predicted worse with it'),))
    words = Sentences(worse)
    assert 'lacks' not in words.headline
    assert words.headline == 'No effect is supported by held-out data.'
    assert not words.effects
    assert words.following.startswith('Do not add hysteresis')
    assert 'adopt' not in words.command


@pytest.mark.parametrize(('value', 'std', 'unit', 'text'), [
    (0.0102, 0.0002, 'm/s', '10.20 ± 0.40 mm/s'), (0.5, 0.01, 'rad', '28.6 ± 1.1°'),
    (1234.0, 60.0, 'N/m', '1230 ± 120 N/m'), (1.0, float('inf'), 'N', '1 N (not determined)')])
def test_values_are_read_with_the_digits_that_are_known(
    value: float, std: float, unit: str, text: str,
) -> None:
    assert with_uncertainty(value, std, unit) == text


def in_one_line(text: str) -> str:
    return re.sub(r'[\s│]+', ' ', text)


def test_a_row_shows_a_fall_of_the_error_that_three_digits_hide() -> None:
    assert fall(0.080844, 0.080791) == '0.08084 → 0.08079'
    assert fall(9.73, 7.41) == '9.73 → 7.41'
    assert change(0.1101712, 0.1101711) == 'falls from 0.110 N by less than 0.001%'


@pytest.mark.parametrize('make', [ambiguous, everything])
def test_the_terminal_keeps_its_width_and_the_page_shows_everything(make: Any) -> None:
    diagnosis = make()
    words = Sentences(diagnosis)
    assert len(re.findall(r'[.;](?: |$)', words.headline)) <= 2
    text = as_text(diagnosis_view(diagnosis, words, next_step=False), 80)
    assert max(map(len, text.splitlines())) <= 80
    assert words.headline in in_one_line(text)
    shown = unescape(diagnosis_page(diagnosis, words, ['a.csv']).html())
    for sentence in (words.headline, words.following, *words.suspects, *words.calibrated,
                     *words.refuted, *diagnosis.warnings):
        assert sentence in shown
    for finding in (*words.effects, *words.unexplained):
        for sentence in (finding.what, finding.why, finding.cause, finding.confirm,
                         *finding.remarks):
            assert sentence in shown


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


def test_an_effect_that_is_not_confirmed_is_named_beside_those_that_are() -> None:
    refuted = made.found_effect('hysteresis', objection='held-out data are predicted worse with it')
    found = made.made_up_diagnosis('effect', effects=(made.found_effect('coulomb_friction'),),
                                   unconfirmed=(refuted,))
    words = Sentences(found)
    assert words.headline.startswith('The model lacks coulomb_friction on lift_2. With it the ')
    assert words.refuted == (
        'hysteresis on lift_2: not reported, because held-out data are predicted worse with it',)
    assert words.command.startswith('pprs adopt coulomb_friction')


@pytest.mark.parametrize('count', [0, 1, 2])
def test_an_unexplained_error_is_recorded_again_before_anything_is_adopted(count: int) -> None:
    effects = (made.found_effect('coulomb_friction'), made.found_effect('time_delay'))[:count]
    open_ = made.made_up_diagnosis('unknown', effects=effects, above_noise={'lift_2': 3.0})
    following, command = next_step(open_, GivenFiles(('a.csv',)))
    assert following.startswith('Repeat the motion')
    assert command.startswith('pprs diagnose a.csv SECOND_RECORDING')


def test_a_run_that_ends_ambiguous_names_the_files_of_the_next_command() -> None:
    run = AdoptionRun((), 'ambiguous', 'base_tilt explains them as well', DriveModel.load())
    command = GivenFiles(('a.csv',)).command('next-experiment', '--output', 'next.csv')
    result = AdoptionRunResult(Inputs(DriveModel.load(), {'a.csv': measured()}, {},
                                      frozenset({'a.csv'}), model_path='MODEL.yaml'), run)
    assert command in in_one_line(as_text(result.view(), 200))


def test_commands_say_whose_robot_the_model_is() -> None:
    assert GivenFiles(('a.csv',), model='config/paper.yaml').command('info') == (
        'pprs info a.csv --demo')
    model = DriveModel.load()
    recording = judged(measured())
    changed = DriveModel.from_parameters({**model.values, 'masses.payload': 1.1})
    for given, words in (('config/paper.yaml', '--demo'), (model, '--demo'),
                         (changed, '--model MODEL.yaml')):
        assert Inputs.of(given, recording).files.command('diagnose') == (
            f'pprs diagnose RECORDING {words}')
