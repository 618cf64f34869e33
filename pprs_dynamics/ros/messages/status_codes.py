# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Levels and codes of `~/status`, and the error that carries one: why a message is rejected."""

from __future__ import annotations

from typing import Literal, get_args

from pprs_dynamics import errors

Level = Literal['OK', 'WARN', 'ERROR', 'STALE']  # in the order of diagnostic_msgs
# Why a message is rejected.
RejectionCode = Literal['EMPTY', 'NAMES', 'FRAME', 'SIZE', 'NON_FINITE', 'QUATERNION', 'TIME',
                        'WORKSPACE', 'SINGULAR', 'LIMIT', 'OUTPUT', 'EFFECT']
# Conditions: of all nodes; of forces; of the managed node; of the simulated robot; of the monitor;
# of the trajectory proxy.
Condition = Literal['OK', 'WAITING', 'CLOCK', 'CONFLICT',
                    'DONE', 'STALE', 'CLAMPED', 'LAG', 'NEAR_SINGULAR', 'NEAR_WORKSPACE',
                    'CURVE',
                    'UNCONFIGURED', 'INACTIVE', 'FINALIZED',
                    'HOLD', 'LATE', 'REFUSED', 'SATURATED', 'STOPPED',
                    'CHANGED', 'UNEXPLAINED', 'GAPS', 'MODEL',
                    'CONTROLLER']
Code = RejectionCode | Condition

LEVELS: tuple[str, ...] = get_args(Level)
REJECTIONS: tuple[str, ...] = get_args(RejectionCode)
CODES: tuple[str, ...] = (*REJECTIONS, *get_args(Condition))


_KINDS: dict[str, RejectionCode] = {
    'shape': 'SIZE', 'finite': 'NON_FINITE', 'unit_length': 'QUATERNION', 'time': 'TIME'}
_CODES: dict[type[errors.PprsError], RejectionCode] = {
    errors.SingularityError: 'SINGULAR', errors.WorkspaceError: 'WORKSPACE',
    errors.LimitError: 'LIMIT', errors.EffectError: 'EFFECT'}


class Rejection(errors.PprsError):
    """A message that breaks a rule.

    Parameters
    ----------
    code : RejectionCode
    text : str
        What, which value, which rule.
    """

    def __init__(self, code: RejectionCode, text: str) -> None:
        self.code, self.text = code, text
        super().__init__(f'{code}: {text}')

    @classmethod
    def of(cls, error: errors.PprsError) -> Rejection:
        """Return the rejection that an error of the model amounts to."""
        if isinstance(error, Rejection):
            return error
        if isinstance(error, errors.MotionError):
            return cls(_KINDS[error.kind], str(error))
        for kind, code in _CODES.items():
            if isinstance(error, kind):
                return cls(code, str(error))
        raise error
