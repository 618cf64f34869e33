# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Model against measurement: how large the error is, where it sits, and what noise explains."""
