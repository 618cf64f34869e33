# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Model files written: read back exactly, by us and by ROS 2; whole or not at all."""

from __future__ import annotations

import difflib
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node

from pprs_dynamics import DriveModel
from pprs_dynamics.errors import ModelError
from pprs_dynamics.physics.model.model_writer import edit_model, write_model
from pprs_dynamics.physics.model.parameter_file import LEDGER, default_parameters, read_parameters

PAPER = Path(__file__).parents[2] / 'config' / 'paper.yaml'
# Numbers whose shortest text is a trap: whole, tiny, huge, not representable, negative zero.
AWKWARD = (1.0, 1e-05, 2.5e-300, 1e22, 123456789.123456789, 0.1, -0.0, 1e300)
ADDED = {
    'effects.active': ['stribeck_friction', 'payload_offset'],
    'effects.stribeck_friction.lift_1.force': 1e-05,
    'effects.stribeck_friction.lift_1.velocity': 0.012345678901234567,
    'effects.payload_offset.x': 0.004, 'effects.payload_offset.y': -0.0,
    'effects.payload_offset.z': 1e-3,
    'tolerances.masses.payload': 0.05,
    'history.step_01.effect': 'yes', 'history.step_01.forced': True,
    'history.step_01.recordings': ['a: b #c.csv', '1e3', 'null', 'ü"\\', ''],
    'history.step_01.values': list(AWKWARD),
}


def values_of(**changes: Any) -> dict[str, Any]:
    return dict(DriveModel.from_parameters({**default_parameters(), **ADDED, **changes}).values)


def plain(values: dict[str, Any]) -> dict[str, Any]:
    return {key: list(value) if isinstance(value, tuple) else value
            for key, value in values.items()}


def ros_parameters(file: Path, name: str = 'any', namespace: str = '') -> dict[str, Any]:
    """Return what ROS 2's own parser makes of a file for a node."""
    context = Context()
    rclpy.init(context=context, args=['--ros-args', '--params-file', str(file)])
    try:
        node = Node(name, namespace=namespace, context=context, allow_undeclared_parameters=True,
                    automatically_declare_parameters_from_overrides=True)
        found = {name: parameter.value for name, parameter
                 in node.get_parameters_by_prefix('').items()}
        node.destroy_node()
    finally:
        context.try_shutdown()
    return {name: list(value) if hasattr(value, 'tolist') or isinstance(value, tuple) else value
            for name, value in found.items()}


def test_what_is_written_is_read_back_exactly(tmp_path: Path) -> None:
    values = values_of()
    write_model(tmp_path / 'model.yaml', values)
    assert read_parameters(tmp_path / 'model.yaml') == plain(values)
    assert DriveModel.load(tmp_path / 'model.yaml').values == values


def test_ros_reads_the_same_numbers_and_words(tmp_path: Path) -> None:
    file = tmp_path / 'model.yaml'
    values = values_of()
    write_model(file, values)
    found = ros_parameters(file)
    of_model = {key: value for key, value in values.items() if not key.startswith('history.')}
    assert {key: found[key] for key in of_model} == plain(of_model)
    # The ledger is no node's, but ROS 2 reads its numbers and words alike.
    assert not [key for key in found if key.startswith('history.')]
    namespace, _, name = LEDGER.rpartition('/')
    ledger = ros_parameters(file, name, namespace)
    values = plain(values)
    for key in values.keys() - of_model.keys():
        assert ledger[key] == values[key], key
    assert all(type(found[key]) is float for key, value in values.items()
               if isinstance(value, float) and key in of_model)


def test_an_edited_file_differs_in_what_changed_and_nothing_else() -> None:
    text = PAPER.read_text()
    values = values_of(**{'masses.payload': 1.23456, 'masses.slides': [0.5, 0.51, 0.5]})
    edited = edit_model(text, values)
    taken = [line[1:] for line in difflib.ndiff(text.splitlines(), edited.splitlines())
             if line.startswith('- ')]
    assert [line.split(':')[0].strip() for line in taken] == ['payload', 'slides']
    assert '# m, the manipulated object' in edited
    assert '# F_s, breakaway force beyond Coulomb friction [N]' in edited
    # What is taken back leaves not a byte behind.
    assert edit_model(edited.replace('    tolerances.masses.payload: 0.05\n', ''),
                      default_parameters()) == text


def test_keys_of_nodes_and_other_nodes_blocks_stay(tmp_path: Path) -> None:
    base = tmp_path / 'base.yaml'
    base.write_text(PAPER.read_text() + '    max_age: 0.5  # of the node\n'
                    'monitor:\n  ros__parameters:\n    window: 0.2\n')
    write_model(tmp_path / 'new.yaml', values_of(), base)
    text = (tmp_path / 'new.yaml').read_text()
    assert 'max_age: 0.5  # of the node\n' in text
    assert 'monitor:\n  ros__parameters:\n    window: 0.2\n' in text
    assert DriveModel.load(tmp_path / 'new.yaml').values == values_of()


@pytest.mark.parametrize('link', ['same', 'symbolic', 'hard'])
def test_the_model_itself_is_never_the_output(tmp_path: Path, link: str) -> None:
    base, output = tmp_path / 'base.yaml', tmp_path / 'output.yaml'
    base.write_text(PAPER.read_text())
    if link == 'same':
        output = base
    elif link == 'symbolic':
        output.symlink_to(base)
    else:
        os.link(base, output)
    with pytest.raises(ModelError, match='another file than the model'):
        write_model(output, default_parameters(), base)
    assert base.read_text() == PAPER.read_text()


def write_in_process(file: Path, before: str, setup: Any = None) -> int:
    """Write a file in a process of its own in which something goes wrong."""
    code = (f'{before}\nfrom pprs_dynamics.system.files import write_text\n'
            f'write_text({str(file)!r}, "new " * 100_000)')
    return subprocess.run([sys.executable, '-c', code], capture_output=True,
                          preexec_fn=setup).returncode


@pytest.mark.parametrize('moment', ['fsync', 'replace'])
def test_a_kill_in_mid_write_leaves_the_old_file_whole(tmp_path: Path, moment: str) -> None:
    old = tmp_path / 'model.yaml'
    old.write_text('old')
    before = (f'import os, signal\nos.{moment} = lambda *a, **k: '
              'os.kill(os.getpid(), signal.SIGKILL)')
    assert write_in_process(old, before) == -signal.SIGKILL
    assert old.read_text() == 'old'
