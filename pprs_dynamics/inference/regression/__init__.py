# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Columns of the regression, and the joint fit of all drives under coloured noise."""
