# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Mechanisms: motions, paths, units, descriptions in URDF, compiled kernels."""
