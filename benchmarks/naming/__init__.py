# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The naming benchmark: which physical effect is missing, asked of every method alike.

README.md in this folder is the protocol.
"""
