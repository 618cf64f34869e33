# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The workbench in the browser: a server for one session, and who may speak to it."""
