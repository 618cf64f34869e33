# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Inference: regression, search, diagnosis, adoption, and the next experiment."""
