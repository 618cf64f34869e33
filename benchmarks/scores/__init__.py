# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How often the package is right: cases on a cluster, outcomes in a file, a table from the file."""
