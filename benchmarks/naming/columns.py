# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The columns that every entrant gets: what each effect of the library would add, as arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from benchmarks.naming.problems import Column, Problem
from benchmarks.naming.robots import OFFERED
from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.design import Design, searched_in_drives
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.model.drive_model import DriveModel

SHAPES = 24  # of an effect on a drive at the most, evenly among those that we try ourselves


def problem_of(model: DriveModel, recording: Recording) -> Problem:
    """Return a recording as a regression around a model."""
    design = Design.of(model, [recording])
    error = design.residuals.error
    columns: list[Column] = []
    rows: list[Array] = []
    for effect in searched_in_drives(design):
        if effect.name not in OFFERED:
            continue
        for d, drive in enumerate(design.drives):
            if not design.acts_on(effect, d):
                continue
            shapes = [{}] if effect.shifts_positions() else _thinned(
                effect.trials(design.covered[d]))
            for shape in shapes:
                _add(columns, rows, design, effect, d, drive, shape)
    for term in design.structure:
        if term.effect.name not in OFFERED:
            continue
        for k, coefficient in enumerate(term.names):
            rows.append(_stacked({d: of[k] for d, of in term.rows.items()}, error.shape))
            columns.append(Column(term.effect.name, coefficient, None))
    base = np.array([_stacked(column.rows, error.shape) / np.sqrt(max(column.precision, 1e-12))
                     for column in design.base]).reshape(-1, *error.shape)
    kept = [k for k, row in enumerate(rows) if np.any(row)]
    return Problem(design.drives, design.residuals.time, error, base,
                   tuple(columns[k] for k in kept),
                   np.array([rows[k] for k in kept], dtype=np.float32))


def _add(columns: list[Column], rows: list[Array], design: Design, effect: type[DriveEffect],
         d: int, drive: str, shape: Mapping[str, float]) -> None:
    term = design.term(effect, d, shape)
    # An effect that is all shape (a delay) has one column, and its coefficient is 1.
    size = design.residuals.error.shape
    for k, coefficient in enumerate(term.names or ('present',)):
        rows.append(_stacked({j: of[k] for j, of in term.rows.items()}, size))
        columns.append(Column(effect.name, coefficient, drive, tuple(sorted(shape.items()))))


def _thinned(shapes: Sequence[Mapping[str, float]]) -> list[Mapping[str, float]]:
    if len(shapes) <= SHAPES:
        return list(shapes)
    spread = np.linspace(0, len(shapes) - 1, SHAPES).round().astype(int)
    return [shapes[k] for k in np.unique(spread)]


def _stacked(rows: Mapping[int, Array], shape: tuple[int, int]) -> Array:
    found = np.zeros(shape, dtype=np.float32)
    for d, row in rows.items():
        found[:, d] = row
    return found
