# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Errors of a session."""

from pprs_dynamics.errors import PprsError


class SessionError(PprsError, ValueError):
    """A request that a session refuses."""


class StaleError(SessionError):
    """A change that counts on a state which is not that of the session any more."""
