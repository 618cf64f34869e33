# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Parameter files that would take forever, or a stack, to read: one sentence within a second."""

from __future__ import annotations

import math
import subprocess
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pprs_command import pprs
from ros_processes import executable

from pprs_dynamics import DriveModel
from pprs_dynamics.errors import PprsError, UnreadableFileError
from pprs_dynamics.system.bounded_yaml import LARGEST
from pprs_dynamics.system.numbers import parse_number, parse_whole

HEAD = '/**:\n  ros__parameters:\n'
PAPER = Path(__file__).parents[2] / 'config/paper.yaml'


def expanding() -> str:
    """Ten lines that stand for 10^10 values."""
    lines = ['    a: &a [x, x, x, x, x, x, x, x, x, x]']
    lines += [f'    {name}: &{name} [{", ".join([f"*{of}"] * 10)}]'
              for of, name in zip('abcdefghi', 'bcdefghij', strict=True)]
    return HEAD + '\n'.join(lines) + '\n'


FILES = {
    'expanding aliases': (expanding(), 'an alias'),
    'an alias of itself': ('/**: &a\n  ros__parameters: {b: *a}\n', 'an alias'),
    'merged mappings': (f'{HEAD}    a: &a {{b: 1}}\n    c: {{<<: *a}}\n', 'an alias'),
    'nested mappings': (f'{HEAD}    a: {"{a: " * 1000}1{"}" * 1000}\n', 'nest'),
    'an open list': (f'{HEAD}    a: {"[" * 100_000}\n', 'nest'),
    'size': (HEAD + '    a: 1.0\n' * (LARGEST // 5), 'larger than'),
    'a number of groups': (f'{HEAD}    gravity: [0.0, 1_0, 0.0]\n', '1_0'),
    'hours and minutes': (f'{HEAD}    gravity: [0.0, 1:30, -1:30.5]\n', '1:30'),
    'a number of any length': (f'{HEAD}    gravity: {"9" * 5000}\n', 'Exceeds the limit'),
    'a tagged time': (f'{HEAD}    gravity: !!timestamp soon\n', 'not valid YAML'),
    'a tagged truth': (f'{HEAD}    gravity: !!bool maybe\n', 'not valid YAML'),
    'an object': (f'{HEAD}    gravity: !!python/object:os.system x\n', 'constructor')}


@pytest.mark.parametrize('content', FILES.values(), ids=FILES.keys())
def test_files_out_of_bounds_are_one_sentence_within_a_second(
    tmp_path: Path, content: tuple[str, str],
) -> None:
    text, reason = content
    file = tmp_path / 'model.yaml'
    file.write_text(text)
    start = time.process_time()
    with pytest.raises(PprsError, match=reason) as caught:
        DriveModel.load(file)
    assert time.process_time() - start < 1.0
    assert len(str(caught.value)) < 300
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize('number', [
    ':'.join(['59'] * 300) + '.5', '\uff11.5', '1.\uff10e3', '0x' + 'f' * 900, '9' * 900])
def test_numbers_within_bounds_that_are_none_are_one_sentence(tmp_path: Path, number: str) -> None:
    file = tmp_path / 'model.yaml'
    file.write_text(PAPER.read_text().replace('base_radius: 0.15', f'base_radius: {number}'))
    done = pprs('history', file.name, cwd=tmp_path)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert len(done.stderr) < 400


def test_a_file_without_end_is_not_read_to_its_end(tmp_path: Path) -> None:
    with pytest.raises(UnreadableFileError, match='it is a device, must be a file'):
        DriveModel.load('/dev/zero')
    with (tmp_path / 'model.yaml').open('wb') as file:
        file.truncate(1 << 40)
    with pytest.raises(UnreadableFileError, match='larger than'):
        DriveModel.load(tmp_path / 'model.yaml')


def test_text_with_the_tag_of_a_string_is_what_ros_reads(tmp_path: Path) -> None:
    file = tmp_path / 'model.yaml'
    file.write_text(PAPER.read_text().replace('elbow: up', 'elbow: !!str up'))
    assert DriveModel.load(file).robot.geometry.elbow == 'up'


@pytest.mark.parametrize('kind', ['an open list', 'nested mappings', 'size'])
def test_nodes_refuse_such_files_before_ros_reads_them(tmp_path: Path, kind: str) -> None:
    text, reason = FILES[kind]
    (tmp_path / 'model.yaml').write_text(text)
    done = subprocess.run(
        [executable('feedforward'), '--ros-args', '--params-file', 'model.yaml'], cwd=tmp_path,
        capture_output=True, text=True, timeout=30)
    assert done.returncode == 2
    assert reason in done.stderr
    assert len(done.stderr.splitlines()) == 1


# Numbers in text are what people mean by them, and nothing else that Python would read.

@given(value=st.floats(allow_nan=False))
def test_every_number_that_python_writes_is_read(value: float) -> None:
    assert parse_number(f' {value!r}\t') == value
    assert parse_number(f'{value:+.17e}') == value


@pytest.mark.parametrize(('text', 'value'), [
    ('1.', 1.0), ('.5', 0.5), ('+2', 2.0), ('1E3', 1000.0), ('-inf', -math.inf), ('Infinity',
                                                                                  math.inf)])
def test_forms_of_numbers(text: str, value: float) -> None:
    assert parse_number(text) == value
    assert math.isnan(parse_number('NaN'))


@pytest.mark.parametrize('text', [
    '', '1_0', '\uff11\uff12', '\u0663', '1,5', '0x10', '1e', '.', '--', '1 0', '1:30', 'nano',
    '1' * 5000, '1\n2', '\x1b[0m1'])
def test_what_is_no_number_is_refused(text: str) -> None:
    for read in (parse_number, parse_whole):
        with pytest.raises(ValueError, match='is no'):
            read(text)


@pytest.mark.parametrize('text', ['-1', '1.0', '+1', ' 1', '²'])
def test_whole_numbers_are_digits_alone(text: str) -> None:
    assert parse_whole('007') == 7
    with pytest.raises(ValueError, match='whole'):
        parse_whole(text)
