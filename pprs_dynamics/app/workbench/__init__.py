# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Trying effects out on recordings: tick, fit, look, brush, adopt, take back."""

from pprs_dynamics.app.workbench.session import Session

__all__ = ['Session']
