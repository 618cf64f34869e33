# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What a user starts: commands, pages, the workbench, fleets of recordings."""
