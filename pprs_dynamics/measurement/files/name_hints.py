# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Hints for the model file where a recording uses other names than those of the drives."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from pprs_dynamics.errors import meant

MOST = 12  # names of a file that are listed


def init_command(name: str) -> str:
    """Return the sentence that names the command which writes a model file."""
    return f'`pprs init ROBOT.urdf {name} --output robot.yaml` writes a model file that reads it'


def missing_names(drives: Sequence[str], known: Collection[str], name: str) -> str:
    """Return a hint for missing drives: the line to write in the model file, or `pprs init`.

    Parameters
    ----------
    drives : sequence of str
        Those looked for.
    known : collection of str
        Those that are there.
    name : str
        Of the file.
    """
    missing = [drive for drive in drives if drive not in known]
    prefix = common_prefix(missing, known)
    if prefix:
        return f'write joint_prefix: {prefix} in the model file'
    for drive in missing:
        close = meant(drive, [recorded for recorded in known if recorded not in drives])
        if close and len(missing) < len(drives):
            return f'write joint_map: {{{drive}: {close}}} in the model file'
    return init_command(name)


def common_prefix(drives: Sequence[str], known: Collection[str]) -> str:
    """Return the common prefix of all drives among the recorded names; '' for none."""
    first = [recorded.removesuffix(drives[0]) for recorded in known if recorded.endswith(drives[0])
             ] if drives else []
    return next((prefix for prefix in sorted(first, key=len) if prefix and all(
        f'{prefix}{drive}' in known for drive in drives)), '')
