# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Fleets of the physics engine, surveyed; clusters whose processes are killed."""
