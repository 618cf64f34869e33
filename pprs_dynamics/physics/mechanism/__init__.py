# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What every mechanism has: motions, paths, units, descriptions in URDF, compiled kernels."""
