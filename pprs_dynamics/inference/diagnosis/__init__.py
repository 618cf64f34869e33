# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Comparison and diagnosis: size and place of the error, and the effects that explain it."""
