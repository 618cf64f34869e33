# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The SROS2 policy names all that nodes have in the graph."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from fnmatch import fnmatch
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from node_bench import Bench, bench, overrides
from rclpy.node import Node

from pprs_dynamics import DriveModel
from pprs_dynamics.ros.feedforward import FeedforwardNode
from pprs_dynamics.ros.live_joint_states import LiveJointStates
from pprs_dynamics.ros.monitor import MonitorNode
from pprs_dynamics.ros.play_trajectory import PlayTrajectoryNode
from pprs_dynamics.ros.simulated_robot import SimulatedRobotNode

pytestmark = pytest.mark.nodes

CONFIG = Path(__file__).parents[2] / 'config'
POLICY = CONFIG / 'sros2' / 'pprs_dynamics.policy.xml'
ACTION = '/_action/'  # in what an action consists of
KINDS = {('topics', 'publish'): 'publisher', ('topics', 'subscribe'): 'subscriber',
         ('services', 'reply'): 'service', ('services', 'request'): 'client'}
Names = dict[str, set[str]]


def allowed(node: str) -> Names:
    """Return what the policy allows a node, by kind, with full names as SROS2 resolves them."""
    profile, = (candidate for candidate in ElementTree.parse(POLICY).iter('profile')
                if candidate.get('node') == node)
    found: Names = {kind: set() for kind in (*KINDS.values(), 'execute', 'call')}
    for group in profile:
        for right in group.attrib:
            kind = KINDS.get((group.tag, right), right)
            for entry in group:
                name = entry.text or ''
                found[kind].add(name if name.startswith('/') else f'/{node}{name[1:]}'
                                if name.startswith('~') else f'/{name}')
    return found


def present(running: Bench, node: Node) -> Names:
    """Return what a node has in the graph, the parts of actions apart."""
    found: Names = {}
    for kind in KINDS.values():
        asked = getattr(running.probe, f'get_{kind}_names_and_types_by_node')
        found[kind] = {name for name, _ in asked(node.get_name(), '/')}
    actions = {kind: {name.partition(ACTION)[0] for name in found[kind] if ACTION in name}
               for kind in ('service', 'client')}
    found = {kind: {name for name in names if ACTION not in name} for kind, names in found.items()}
    return {**found, 'execute': actions['service'], 'call': actions['client']}


def started(running: Bench) -> Iterator[Node]:
    """Start every node that can be started here, as it has most in the graph."""
    factories: list[tuple[Callable[..., Node], dict[str, Any]]] = [
        (FeedforwardNode, {'use_sim_time': True}), (MonitorNode, {'diagnose_every': 60.0}),
        (PlayTrajectoryNode, {}), (SimulatedRobotNode, {})]
    for factory, more in factories:
        yield running.add(factory, parameter_overrides=overrides(**more))
    workbench = LiveJointStates(DriveModel.load(), 'joint_states', 'monitor', 'feedforward',
                                context=running.context)
    running.executor.add_node(workbench)
    yield workbench


@pytest.mark.usefixtures('ros_domain')
def test_the_policy_allows_what_nodes_have() -> None:
    with bench() as running:
        nodes = list(started(running))
        running.spin_for(1.0)
        for node in nodes:
            rights, has = allowed(node.get_name()), present(running, node)
            for kind, names in has.items():
                beyond = {name for name in names
                          if not any(fnmatch(name, pattern) for pattern in rights[kind])}
                assert not beyond, (node.get_name(), kind, beyond)


def test_every_node_has_an_enclave_of_its_own() -> None:
    enclaves = [enclave.get('path') for enclave in ElementTree.parse(POLICY).iter('enclave')]
    nodes = [profile.get('node') for profile in ElementTree.parse(POLICY).iter('profile')]
    assert enclaves == [f'/pprs_dynamics/{node}' for node in nodes]
    assert set(nodes) == {'feedforward', 'monitor', 'play_trajectory', 'simulated_robot',
                          'trajectory_proxy', 'workbench'}
