# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What a node needs whatever it does: execution, parameters, QoS, clocks, status, lifecycle."""
