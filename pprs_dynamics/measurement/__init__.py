# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Measurement: files of recordings, and the smoothed motion of the drives."""
