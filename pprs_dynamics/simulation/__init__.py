# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The physics-engine robot and its hidden effects; shares only numbers with the model."""
