# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Residuals of a model on recordings: model and measured effort filtered alike."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.residuals.reconstruction import (
    MOTION,
    Reconstruction,
    reconstruct,
    treated_forces,
)
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.files.samples import Progress
from pprs_dynamics.measurement.motion.treatment import Treatment
from pprs_dynamics.physics.model.drive_model import DriveModel

# Between recordings [s], so that times of all together increase.
PAUSE = 1.0


@dataclass(frozen=True)
class Variable:
    """Key of a variable in a table: no other key is equal to it, whatever name it has."""

    name: str


def progress_of(report: Callable[[float], None], part: int, parts: int) -> Progress:
    """Return a function that reports (done, all) of one of several parts as a share of all."""
    return lambda done, total: report((part + done / max(total, 1)) / parts)


def measure_residuals(
    model: DriveModel, recordings: Sequence[Recording],
    progress: Callable[[float], None] = lambda share: None,
) -> tuple[Residuals, tuple[str, ...]]:
    """Return measured and modelled efforts of recordings side by side, and how, in words.

    Parameters
    ----------
    model : DriveModel
    recordings : sequence of Recording
        One after the other, with a pause between; each segment stays one of its own.
    progress : callable, optional
        Called with the share that is done.

    Raises
    ------
    MotionError
        Where a recording is too short.
    WorkspaceError, SingularityError
        Where the model cannot follow a recording.
    ResidualsError
        Where no effort was measured.
    """
    tables: list[dict[Any, Array]] = []
    notes: list[str] = []
    for k, recording in enumerate(recordings):
        reconstruction = reconstruct(model, recording)
        tables.append(treated_table(model, reconstruction,
                                    progress_of(progress, k, len(recordings))))
        notes += reconstruction.notes
        # Motion at full rate takes several times the room of all that follows.
        del reconstruction
    return join_tables(model, tables), tuple(notes)


def treated_table(
    model: DriveModel, reconstruction: Reconstruction,
    progress: Progress | None = None,
    more: Callable[[Any, Treatment], Mapping[Any, Array]] = lambda forces, treat: {},
) -> dict[Any, Array]:
    """Return the filtered signals of one recording that a comparison needs, by name.

    Parameters
    ----------
    model : DriveModel
    reconstruction : Reconstruction
    progress : callable, optional
    more : callable, optional
        Returns further quantities, see `treated_forces`.
    """
    def with_variables(forces: Any, treat: Treatment) -> dict[Any, Array]:
        return {**{Variable(name): treat(values) for name, values
                   in model.robot.variables(forces.mechanism).items()}, **more(forces, treat)}

    treat = reconstruction.treat
    table = treated_forces(model, reconstruction, progress, with_variables)
    table['measured'] = treat(reconstruction.effort)
    table['time'] = treat(reconstruction.time)
    for name in MOTION:
        table[Variable(name)] = treat(getattr(reconstruction, name))
    edges = [segment.start for segment in reconstruction.segments]
    table['segment'] = np.searchsorted(edges, treat.starts, side='right').astype(float) - 1
    return table


def join_tables(model: DriveModel, tables: list[dict[Any, Array]]) -> Residuals:
    """Return the residuals of a model on recordings one after the other, from their tables."""
    segments = 0.0
    for number, table in enumerate(tables):
        table['record'] = np.full(len(table['time']), float(number))
        table['segment'] = table['segment'] + segments
        segments = table['segment'][-1] + 1
    joined = (tables[0] if len(tables) == 1 else
              {name: np.concatenate([table[name] for table in tables]) for name in tables[0]})
    names = [*MOTION, *(key.name for key in joined if isinstance(key, Variable))]
    variables = {name: joined.pop(Variable(name)) for name in dict.fromkeys(names)}
    time = joined.pop('time')
    segment, record = (joined.pop(name).astype(int) for name in ('segment', 'record'))
    steps = np.diff(time, prepend=time[0])
    is_break = (steps < 0) | (np.diff(record, prepend=record[0]) > 0)  # or a clock was set back
    time = time + np.cumsum(np.where(is_break, PAUSE - steps, 0.0))
    measured, total = joined.pop('measured'), joined.pop('total')
    steps = np.diff(time)[np.diff(segment) == 0]  # none between poses that are held
    return Residuals(model.drives, time, segment, measured, total, joined, variables,
                     float(np.median(steps)) if len(steps) else Residuals.period,
                     model.units, record)
