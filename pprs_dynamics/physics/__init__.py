# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Drive forces: mechanism, rigid body, and a sum over effects. Neither ROS nor plotting."""
