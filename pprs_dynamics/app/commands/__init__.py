# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The command-line tool `pprs`: arguments -> one call -> report. One file per subcommand."""
