# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The machine underneath: files, threads, text of terminals. No mathematics."""
