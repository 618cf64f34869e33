# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The command-line tool: what it writes, and how it ends."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import pytest
from pprs_command import pprs


def png_size(file: Path) -> tuple[int, int]:
    header = file.read_bytes()[:24]
    assert header[:8] == b'\x89PNG\r\n\x1a\n'
    return struct.unpack('>II', header[16:24])


@pytest.fixture(scope='module')
def reproduced(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('reproduce')
    done = pprs('reproduce', '--output', str(folder / 'new' / 'output'), '--json',
                str(folder / 'result.json'), cwd=folder)
    assert done.returncode == 0, done.stderr
    assert 'reproduced' in done.stdout
    return folder


def test_reproduce_writes_figures_curves_and_claims(reproduced: Path) -> None:
    output = reproduced / 'new' / 'output'
    for name in ('figure_8.png', 'figure_9.png'):
        assert min(png_size(output / name)) > 400
    content = json.loads((reproduced / 'result.json').read_text())
    assert content == json.loads((output / 'claims.json').read_text())
    for claim in content['claims']:
        assert set(claim) == {'claim', 'paper', 'found', 'reproduced'}
        assert isinstance(claim['reproduced'], bool)


def test_reproduce_is_honest_about_what_does_not_come_out(reproduced: Path) -> None:
    claims = json.loads((reproduced / 'result.json').read_text())['claims']
    verdicts = [claim['reproduced'] for claim in claims]
    assert verdicts == [True, True, False, False, True, True]
    # The checked figures: 24 to 28 % printed, active 0.93 N, passive 0.13 N exact and 0.00 N.
    assert 'motor 1: 29.1 %' in claims[0]['found']
    assert '0.93 N rms active, 0.13 N rms passive' in claims[1]['found']
    assert '0.000 N rms by the second' in claims[2]['found']
    assert '48.2 to 109.5 degrees' in claims[4]['found']
