# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Messages to motions and forces to messages: bytes, objects, and the rules they must obey."""
