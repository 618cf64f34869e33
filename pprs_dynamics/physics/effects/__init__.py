# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Physical effects: what each adds to the drive forces, and the catalogue of all of them."""
