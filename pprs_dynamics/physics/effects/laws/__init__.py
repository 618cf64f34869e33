# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""One law a file: the friction of the paper and every effect of the catalogue."""
