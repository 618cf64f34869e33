# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Applications: commands, pages, the workbench, surveys of many recordings."""
