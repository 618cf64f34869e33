# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Measured minus modelled effort, in time and in frequency, and its noise."""
