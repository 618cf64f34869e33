# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What `from pprs_dynamics import …` gives: one call for each step of the loop; commands use it."""
