# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Numbers in text are what people mean by them, and nothing else that Python would read."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pprs_dynamics.system.numbers import parse_number, parse_whole


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
