# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Model files: what is accepted, and what each mistake is told as."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from pprs_dynamics import DriveModel, PlatformMotion
from pprs_dynamics.errors import ModelError, PprsError, UnreadableFileError
from pprs_dynamics.physics.model.keys import KEYS
from pprs_dynamics.physics.model.parameter_file import default_parameters, read_parameters

PAPER = Path(__file__).parents[2] / 'config' / 'paper.yaml'


def written(folder: Path, changes: dict[str, Any], removed: tuple[str, ...] = ()) -> Path:
    """Write the paper's model with changes, flat keys side by side, as ROS 2 also reads them."""
    flat = {**default_parameters(), **changes}
    for name in removed:
        del flat[name]
    file = folder / 'model.yaml'
    file.write_text(yaml.safe_dump({'/**': {'ros__parameters': flat}}))
    return file


def test_the_default_model_is_the_papers_robot() -> None:
    robot = DriveModel.load().robot
    assert (robot.geometry.base_radius, robot.geometry.platform_radius,
            robot.geometry.rod_length) == (0.15, 0.10, 0.30)
    assert robot.moved_mass == 2.0
    friction = DriveModel.load().values
    mu_p, s, d_r = 0.1, 0.00005, 0.01
    assert friction['friction.revolute.coulomb'] == pytest.approx(
        mu_p + 2 * s / d_r / np.sqrt(1 + mu_p ** 2), abs=1e-5)
    assert friction['friction.spherical.coulomb'] == pytest.approx(mu_p / 3, abs=1e-6)


def test_every_key_of_the_file_is_declared_and_every_declared_key_stands_in_the_file() -> None:
    assert set(read_parameters(PAPER)) == set(KEYS)


def test_limits_tolerances_effects_and_node_keys_are_optional(tmp_path: Path) -> None:
    limits = tuple(name for name in KEYS if name.startswith('limits.'))
    file = written(tmp_path, {'max_age': 0.2, 'tolerances.masses.payload': 0.05,
                              'effects.active': []}, limits)
    model = DriveModel.load(file)
    assert model.limits.efforts.tolist() == [100.0] * 6
    assert [effect.name for effect in model.effects] == ['active_friction', 'passive_friction']


WRONG = [
    ('geometry.rod_length', -0.3, 'greater than 0'),
    ('geometry.rod_length', True, 'be a finite number'),
    ('geometry.elbow', 'sideways', 'one of up, down'),
    ('geometry.chain_angles', [0.0, 0.0, 1.0], 'three different directions'),
    ('masses.inertia', [0.005, 0.005, 0.02, 0.0, 0.0, 0.0], 'sum to at least the third'),
    ('masses.inertia', [0.005, 0.005, 0.01, 0.009, 0.0, 0.0], 'positive semi-definite'),
    ('limits.slide_stroke', [0.3, -0.3], 'a lower and a higher position'),
    ('masses.paylod', 1.0, r'unknown key masses\.paylod \(did you mean masses\.payload\?\)'),
    ('tolerances.masses.paylod', 0.1, r'unknown key tolerances\.masses\.paylod \(did you mean '
     r'tolerances\.masses\.payload\?\)'),
    ('tolerances.masses.payload', 5.0, 'between 0 and 1'),
    ('effects.active', ['stribeck'], r'unknown effect stribeck \(did you mean stribeck_friction\?'),
    ('effects.active', ['stribeck_friction'], 'be given'),
    ('effects.active', True, 'list of names'),
    ('geometry.rod_length', 0.01, 'greater than 0.05 m, for the platform to stand'),
    ('limits', 5, 'must be a mapping, of names to their content'),
    ('bogus', None, 'unknown key bogus'),
    ('effects.effort_offset.lift_9.force', 1.0, r'unknown drive lift_9 \(known: slide_1, '
     r'slide_2, slide_3, lift_1'),
    ('effects.effort_offset.lift_1.strength', 1.0, r'unknown key effects\.effort_offset\.lift_1\.'
     r'strength \(known: effects\.effort_offset\.lift_1\.force\)'),
    ('effects.stribeck_friction.lift_1.velocity', -0.01, r'between 1e-06 and 10 \('),
]


@pytest.mark.parametrize(('key', 'value', 'rule'), WRONG)
def test_a_wrong_value_is_told_with_file_key_value_and_rule(
    tmp_path: Path, key: str, value: object, rule: str,
) -> None:
    file = written(tmp_path, {key: value})
    with pytest.raises(ModelError, match=rule) as caught:
        DriveModel.load(file)
    message = str(caught.value)
    assert message.startswith(f'{file}: ')
    assert '\n' not in message
    if value == ['stribeck_friction']:
        # The list is right; what it needs is missing.
        assert 'effects.stribeck_friction is missing' in message
    elif 'unknown' not in message:
        # A whole block is named where its drive is wrong: effects.effort_offset.lift_9.
        assert '.'.join(key.split('.')[:3]) in message
        assert str(value)[:100] in message


def test_a_missing_key_is_told(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r'masses\.payload is missing, must'):
        DriveModel.load(written(tmp_path, {}, ('masses.payload',)))


FOREIGN = {
    'empty': b'', 'no mapping': b'- 1\n- 2\n', 'binary': bytes(range(256)),
    'not yaml': b'a: [1, 2\nb: }', 'no ros__parameters': b'/**:\n  geometry: {}\n',
    'key twice': b'/**:\n  ros__parameters:\n    equations: corrected\n    equations: printed\n',
    'a list as key': b'/**:\n  ros__parameters:\n    ? [a, b]\n    : 1\n',
    'braces': b'/**:\n  ros__parameters:\n    rod_length: {{ l }}\n',
    'itself': b'/**: &a\n  ros__parameters: {b: *a}\n',
    'model of one node': (b'/**: {ros__parameters: {equations: corrected}}\n'
                          b'feedforward: {ros__parameters: {masses: {payload: 9.0}}}\n'),
    'two nodes': b'a: {ros__parameters: {}}\nb: {ros__parameters: {}}\n'}


@pytest.mark.parametrize('content', FOREIGN.values(), ids=FOREIGN.keys())
def test_a_foreign_file_is_one_clear_sentence(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / 'model.yaml'
    file.write_bytes(content)
    with pytest.raises(UnreadableFileError) as caught:
        DriveModel.load(file)
    assert str(caught.value).startswith(f'{file}: ')
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize('number', ['1e-3', '.1E-2'])
def test_numbers_are_those_that_ros_reads(tmp_path: Path, number: str) -> None:
    text = PAPER.read_text().replace('reversal_velocity: 0.001', f'reversal_velocity: {number}')
    file = tmp_path / 'model.yaml'
    file.write_text(text)
    assert DriveModel.load(file).reversal.velocity == (1e-3,) * 6


def test_a_key_given_nested_and_with_dots_is_refused(tmp_path: Path) -> None:
    file = tmp_path / 'model.yaml'
    file.write_text(PAPER.read_text() + '    masses.payload: 3.0\n')
    with pytest.raises(ModelError, match=r'masses\.payload is 3\.0, must occur once'):
        DriveModel.load(file)


def test_an_effect_cannot_be_a_value_and_a_block_at_once() -> None:
    values = {**DriveModel.load().values, 'effects.effort_offset.lift_1.force': 1.0}
    for key in ('effects.effort_offset', 'effects.effort_offset.'):
        with pytest.raises(ModelError, match='be a mapping of its parameters'):
            DriveModel.from_parameters({**values, key: 3})


JUNK = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5),
    st.lists(st.one_of(st.floats(), st.integers(), st.text(max_size=3)), max_size=6))
NAMES = st.one_of(
    st.sampled_from([*KEYS, 'effects.active', 'effects.effort_offset.lift_1.force',
                     'effects.hysteresis.slide_1', 'effects', 'history.step_01.effect']),
    st.from_regex(r'(effects|tolerances|history|masses)(\.[a-z_1]{0,8}){0,3}', fullmatch=True))


@settings(max_examples=400)
@given(st.dictionaries(NAMES, JUNK, min_size=1, max_size=4))
def test_whatever_a_parameter_is_set_to_gives_a_model_or_one_of_our_errors(
    changes: dict[str, object],
) -> None:
    # In a node every other exception would end the feedforward of a moving robot.
    try:
        model = DriveModel.from_parameters({**DriveModel.load().values, **changes})
        # A platform of 1e-166 m is a model, and singular everywhere.
        forces = model.drive_forces(PlatformMotion.at_rest((0.0, 0.0, 0.5)))
    except PprsError:
        pass
    else:
        assert forces.total.shape == (1, 6)
