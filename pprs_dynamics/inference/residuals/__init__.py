# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Model against recording: motion of the mechanism, measured minus modelled effort, its noise."""
