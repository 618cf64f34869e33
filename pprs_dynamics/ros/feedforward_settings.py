# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The feedforward node's own parameters."""

from __future__ import annotations

from dataclasses import replace

from pprs_dynamics.ros.messages.trajectory_request import REJECT, SPLINE
from pprs_dynamics.ros.node.parameters import NodeParameter

CLAMP = 'clamp'
HOLD_GRAVITY, ZERO, SILENT = 'hold_gravity', 'zero', 'silent'

FRAME = NodeParameter('frame_id', '', 'frame of poses and forces; empty: base, for a platform',
                      stays=True)

_PARAMETERS = (
    NodeParameter('autostart', True, 'true: active at once; false: a supervisor configures and '
                  'activates the node', stays=True),
    FRAME,
    NodeParameter('max_age', 0.0, 'oldest header stamp that is accepted [s]; 0: any', lower=0),
    NodeParameter('missing_derivatives', REJECT, 'points without velocities or accelerations: '
                  'reject the message, or take them from a spline through the points',
                  choices=(REJECT, SPLINE)),
    NodeParameter('feedforward_scale', 1.0, 'multiplies every effort that goes out [1]: less '
                  'than 1 while a robot is commissioned', lower=0, upper=1),
    NodeParameter('effort_limits', (), 'largest absolute effort that goes out, per drive [N, '
                  'N m]; the smaller one of this and the model\'s counts', size=6),
    NodeParameter('limit_policy', REJECT, 'an effort over its limit: reject the message, or clamp '
                  'the effort to the limit', choices=(REJECT, CLAMP)),
    NodeParameter('command_timeout', 0.1, 'how long after the end of the last accepted '
                  'trajectory its command goes stale [s]; 0: never', lower=0, upper=3600),
    NodeParameter('timeout_action', HOLD_GRAVITY, 'what goes out once when the command is '
                  'stale: the efforts that hold the last pose at rest, zeros, or nothing',
                  choices=(HOLD_GRAVITY, ZERO, SILENT)),
    NodeParameter('warning_margin', 0.1, 'share of the way to a limit of workspace or '
                  'conditioning that is left when warnings begin [1]', lower=0, upper=1),
    NodeParameter('lag_warning', 0.02, 'time that messages wait for the node, at the median, '
                  'when warnings begin [s]; 0: never', lower=0, upper=3600),
)


def parameters_for(drives: int) -> tuple[NodeParameter, ...]:
    """Return the parameters of a node with so many drives."""
    return tuple(replace(one, size=drives) if one.size else one for one in _PARAMETERS)
