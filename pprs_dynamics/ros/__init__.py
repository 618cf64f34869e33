# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""ROS 2 nodes: message -> conversion -> one call -> conversion -> publish. No mathematics here."""
