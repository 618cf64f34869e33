# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The 3-PPRS in closed form: the paper's kinematics, rigid body and joint reactions."""
