# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Why a message was rejected, as a code of the interface and a sentence."""

from __future__ import annotations

from pprs_dynamics.errors import (
    ConvergenceError,
    EffectError,
    LimitError,
    MotionError,
    PprsError,
    SingularityError,
    WorkspaceError,
)
from pprs_dynamics.ros.messages.status_codes import RejectionCode

_KINDS: dict[str, RejectionCode] = {
    'shape': 'SIZE', 'finite': 'NON_FINITE', 'unit_length': 'QUATERNION', 'time': 'TIME'}


class Rejection(PprsError):
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
    def of(cls, error: PprsError) -> Rejection:
        """Return the rejection that an error of the model amounts to."""
        if isinstance(error, Rejection):
            return error
        if isinstance(error, MotionError):
            return cls(_KINDS[error.kind], str(error))
        if isinstance(error, SingularityError):
            return cls('SINGULAR', str(error))
        if isinstance(error, (WorkspaceError, ConvergenceError)):
            return cls('WORKSPACE', str(error))
        if isinstance(error, LimitError):
            return cls('LIMIT', str(error))
        if isinstance(error, EffectError):
            return cls('EFFECT', str(error))
        raise error
