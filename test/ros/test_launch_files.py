# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What the launch files start, with which parameters and arguments."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import pytest
from launch_stand_in import install

from pprs_dynamics.errors import PprsError
from pprs_dynamics.physics.model.keys import NODE_KEYS
from pprs_dynamics.ros import executables

PROJECT = Path(__file__).parents[2]
MODEL = str(PROJECT / 'config' / 'hexapod.yaml')
STARTED = {  # each node, and whether a supervisor can lead it through its states
    'demo': {'simulated_robot': False, 'feedforward': True, 'monitor': True,
             'play_trajectory': False},
    'display': {'monitor': True}, 'feedforward': {'feedforward': True, 'monitor': True},
    'monitor': {'monitor': True}, 'workbench': {}}


def described(name: str, monkeypatch: pytest.MonkeyPatch, **given: str,
              ) -> tuple[dict[str, Any], list[Any]]:
    """Return the arguments of a launch file, and its actions with some of them given."""
    install(monkeypatch)
    found = runpy.run_path(str(PROJECT / 'launch' / f'{name}.launch.py'))
    actions = found['generate_launch_description']().arguments[0]
    declared = {action.arguments[0]: action.options for action in actions
                if type(action).__name__ == 'DeclareLaunchArgument'}
    values = {key: options.get('default_value') for key, options in declared.items()}
    opaque, = (action for action in actions if type(action).__name__ == 'OpaqueFunction')
    return declared, opaque.options['function']({**values, **given})


@pytest.mark.parametrize('name', STARTED)
def test_a_launch_file_starts_its_nodes_with_parameters_that_they_have(
    name: str, monkeypatch: pytest.MonkeyPatch,
) -> None:
    declared, actions = described(name, monkeypatch, model=MODEL)
    assert {'model', 'namespace', 'use_sim_time', 'parameters'} <= declared.keys()
    assert all(options['description'] for options in declared.values())
    if name == 'workbench':
        command = [str(word) for word in actions[0].options['cmd'] if isinstance(word, str)]
        assert command[:2] == ['workbench', '--live']
        assert MODEL in command
        assert '__ns:=/' in command
        # As of launch's own nodes, a namespace needs no slash.
        _, actions = described(name, monkeypatch, model=MODEL, namespace='cell')
        assert '__ns:=/cell' in actions[0].options['cmd']
        return
    nodes = {action.options['executable']: action for action in actions}
    assert {key: type(node).__name__ == 'LifecycleNode' for key, node in nodes.items()} == (
        STARTED[name])
    for key, node in nodes.items():
        assert callable(getattr(executables, key))
        assert node.options['package'] == 'pprs_dynamics'
        assert node.options['namespace'].arguments == ('namespace',)
        file, *given = node.options['parameters']
        assert file == MODEL
        names = {parameter for values in given for parameter in values}
        assert 'use_sim_time' in names
        assert names <= NODE_KEYS


@pytest.mark.parametrize('name', STARTED)
def test_a_file_that_is_not_there_is_a_sentence(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(PprsError, match=r'nowhere\.yaml'):
        described(name, monkeypatch, model='nowhere.yaml')


def test_every_launch_file_is_tried() -> None:
    assert {file.name.partition('.')[0] for file in (PROJECT / 'launch').iterdir()
            if file.name.endswith('.launch.py')} == STARTED.keys()
