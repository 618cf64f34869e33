# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Python interface `from pprs_dynamics import …`: one call for each step of the loop."""
