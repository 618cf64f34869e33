# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Common parts of nodes: execution, parameters, QoS, clocks, status, lifecycle."""
