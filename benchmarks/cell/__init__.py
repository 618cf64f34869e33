# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The nodes beside the controllers of ros2_control themselves, where these are installed."""
