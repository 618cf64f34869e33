# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""QoS profiles of topics, and their overrides by parameters."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import InvalidQosOverridesError, QoSOverridingOptions

from pprs_dynamics.errors import ModelError
from pprs_dynamics.ros.node.parameters import overrides

# Reliable, and deep enough that a listener that stalls for a tenth of a second at 1 kHz gets
# every message.
EVERY_MESSAGE = QoSProfile(depth=100)
# The same for measurements that wait for a node that has work to do on them: a machine that is
# busy with other things for a second loses no sample at 1 kHz. Best effort hears every publisher:
# drivers over a network offer no more.
MEASURED = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
# Of setpoints the latest count: after a standstill those that waited would be executed in one
# burst, seconds late. A hiccup of 20 ms at 500 Hz loses none.
SETPOINTS = QoSProfile(depth=10)
# Reliable; a subscriber that joins later gets the last message.
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)

POLICIES = (QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, QoSPolicyKind.RELIABILITY,
            QoSPolicyKind.DURABILITY)


def publisher(node: Node, kind: type, topic: str, profile: QoSProfile = EVERY_MESSAGE) -> Any:
    """Create a publisher whose QoS the parameters qos_overrides.<topic>.publisher.* change.

    rclpy warns of listeners that ask for another QoS, with the name of the topic as given here.

    Raises
    ------
    ModelError
        For an override that is none.
    """
    return _overridable(node, topic, lambda options: node.create_publisher(
        # rclpy writes the overrides into the profile.
        kind, node.resolve_topic_name(topic), copy.copy(profile), qos_overriding_options=options))


def subscription(
    node: Node, kind: type, topic: str, callback: Callable[..., None],
    profile: QoSProfile = EVERY_MESSAGE,
) -> Any:
    """Create a subscription to bytes, whose QoS qos_overrides.<topic>.subscription.* change."""
    return _overridable(node, topic, lambda options: node.create_subscription(
        kind, node.resolve_topic_name(topic), callback, copy.copy(profile),
        qos_overriding_options=options, raw=True))


def _overridable(node: Node, topic: str, create: Callable[[QoSOverridingOptions], Any]) -> Any:
    try:
        return create(QoSOverridingOptions(POLICIES))
    except (ParameterException, InvalidQosOverridesError, RuntimeError, ValueError,
            AssertionError) as error:
        name = f'qos_overrides.{node.resolve_topic_name(topic)}'
        prefix = f'{name}.'
        given = {key.removeprefix(prefix): value
                 for key, value in overrides(node).items() if key.startswith(prefix)}
        raise ModelError(name, given, 'hold history: keep_last or keep_all, a depth from 0 on, '
                         'reliability: reliable or best_effort, and durability: volatile or '
                         f'transient_local ({error})') from None
