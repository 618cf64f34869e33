# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Many recordings of many robots: surveys into a store, and trends out of it."""
