# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings as files: rosbag2, CSV, stamps, units, and what is wrong with them."""
