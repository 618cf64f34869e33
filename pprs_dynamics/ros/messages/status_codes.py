# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Levels and codes of `~/status`: mypy holds calls to them, a test the schema and docs."""

from __future__ import annotations

from typing import Literal, get_args

Level = Literal['OK', 'WARN', 'ERROR', 'STALE']  # in the order of diagnostic_msgs
# Why a message is rejected.
RejectionCode = Literal['EMPTY', 'NAMES', 'FRAME', 'SIZE', 'NON_FINITE', 'QUATERNION', 'TIME',
                        'WORKSPACE', 'SINGULAR', 'LIMIT', 'OUTPUT', 'EFFECT']
# Conditions: of all nodes; of forces; of the managed node; of the simulated robot; of the monitor;
# of the trajectory proxy.
Condition = Literal['OK', 'WAITING', 'CLOCK',
                    'DONE', 'STALE', 'CLAMPED', 'LAG', 'NEAR_SINGULAR', 'NEAR_WORKSPACE',
                    'CURVE',
                    'UNCONFIGURED', 'INACTIVE', 'FINALIZED',
                    'HOLD', 'LATE', 'REFUSED', 'SATURATED', 'STOPPED',
                    'CHANGED',
                    'CONTROLLER']
Code = RejectionCode | Condition

LEVELS: tuple[str, ...] = get_args(Level)
REJECTIONS: tuple[str, ...] = get_args(RejectionCode)
CODES: tuple[str, ...] = (*REJECTIONS, *get_args(Condition))
