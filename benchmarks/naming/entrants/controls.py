# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Entrants whose score is known beforehand: they check the scoring, and say what chance gets."""

from __future__ import annotations

import zlib

import numpy as np

from benchmarks.naming.problems import Answer, Named, Problem, Truth


def silent(problem: Problem) -> Answer:
    """Say that nothing is missing."""
    return Answer('none')


def random(problem: Problem) -> Answer:
    """Name one effect of the columns at random, on a drive at random where it sits on drives."""
    text = problem.folder.name if problem.folder else str(problem.time[-1])
    rng = np.random.default_rng(zlib.crc32(text.encode()))
    names = sorted({column.effect for column in problem.columns})
    name = names[int(rng.integers(len(names)))]
    drives = sorted({column.drive for column in problem.columns
                     if column.effect == name and column.drive})
    return Answer.of([Named(name, (drives[int(rng.integers(len(drives)))],) if drives else None)])


def perfect(truth: Truth) -> Answer:
    """Say what is true; no entrant can."""
    if truth.kind == 'unknown':
        return Answer('unknown')
    return Answer.of(truth.effects)
