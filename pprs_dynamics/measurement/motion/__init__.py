# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Smoothed motion of the drives: differentiation, blocks, and the treatment of efforts."""
