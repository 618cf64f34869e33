# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Terms of the regression: an effect on a drive or in the structure, and what drives did."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.motion.treatment import Treatment
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveSamples
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.model.drive_model import DriveModel

Rows = Mapping[int, Array]
"""Columns by drive, (k, M) each; drives that are not in it feel nothing."""


@dataclass(frozen=True, eq=False)
class Term:
    """One way in which an effect may be there: on one drive, or in the structure; one shape.

    Parameters
    ----------
    effect : type of CatalogueEffect
    drive : int or None
        On which it sits.
    shape : mapping of str to float
    rows : dict of drive to (k, M) array
        One row per coefficient [N].
    course : (M,) array, optional
        By which the rows are multiplied already: which share of the effect is there when.
    """

    effect: type[CatalogueEffect]
    drive: int | None
    shape: Mapping[str, float]
    rows: Rows
    course: Array | None = None

    def following(self, course: Array) -> Term:
        """Return the term that is there as a course (M,) says."""
        return replace(
            self, rows={d: rows * course for d, rows in self.rows.items()}, course=course)

    def force(self, coefficients: Mapping[str, float]) -> dict[int, Array]:
        """Return the force of coefficients by name, (M,) by drive [N]."""
        weights = np.array([coefficients[name] for name in self.names] or [1.0])
        return {d: weights @ rows for d, rows in self.rows.items()}

    @property
    def names(self) -> tuple[str, ...]:
        """Coefficients of the rows; none where the only row has the coefficient 1."""
        return tuple(c.name for c in self.effect.coefficients)

    def variants(self) -> list[tuple[str, ...]]:
        """Return the effect's choices of coefficients that do something.

        Without those that do what a smaller one does: a coefficient per load is none on a drive
        that carries nothing.
        """
        felt = {name for rows in self.rows.values() for name, row in zip(
            self.names, rows, strict=False) if np.any(row)}
        chosen = {names: tuple(name for name in names if name in felt)
                  for names in self.effect.variants}
        return [names for names, does in chosen.items()
                if does == names or (does and does not in chosen)]


@dataclass(frozen=True)
class FullRate:
    """Motion of the drives at every sample of a recording, in segments; (N, D) arrays.

    `effort` is what the model's drives apply, before any sensor; `effort_measured` the
    recording's; `start` the time at which the recording began [s]; `channels` further
    measurements.
    """

    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    direction: Array
    friction_load: Array
    transmitted: Array
    effort: Array
    effort_measured: Array
    segments: tuple[slice, ...]
    treat: Treatment
    start: float
    channels: Mapping[str, Array]

    def samples(self, part: slice, drive: int, memory: object = None) -> DriveSamples:
        """Return one drive in one segment."""
        return DriveSamples(
            self.time[part], self.position[part, drive], self.velocity[part, drive],
            self.acceleration[part, drive], self.direction[part, drive],
            self.friction_load[part, drive], self.transmitted[part, drive], memory,
            {name: values[part, drive] for name, values in self.channels.items()})

    def columns(self, effect: type[DriveEffect], drive: int, shape: Mapping[str, float],
                direction: float | None = None) -> Array:
        """Return the columns of an effect, (k, N), as if the drive had one direction if given."""
        found = []
        for part in self.segments:
            samples = self.samples(part, drive, effect.drive_memory(self.start))
            if direction is not None:
                samples = replace(samples, direction=np.full_like(samples.velocity, direction))
            found.append(np.stack(effect.columns(samples, **shape)))
        return np.concatenate(found, axis=1)


@dataclass(frozen=True)
class PlacedEffect:
    """An effect on a drive or in the structure, with all its coefficients by name.

    Where the given model has it, they are what is changed of those that it has.
    """

    effect: type[CatalogueEffect]
    drive: int | None
    shape: Mapping[str, float]
    coefficients: Mapping[str, float]


@dataclass(frozen=True)
class OperatingPoint:
    """Point of linearisation: a model, and its differences from the input model.

    Parameters
    ----------
    model : DriveModel
    base : (P,) array
        Coefficients of the base columns; those of reversals are 0.
    effects : tuple of PlacedEffect
        That it has in addition to the given model, or with other values.
    """

    model: DriveModel
    base: Array
    effects: tuple[PlacedEffect, ...] = ()

    def has(self, effects: Iterable[PlacedEffect], scales: float = 1.0) -> bool:
        """Return whether it has some effects, their shapes the same to so many scales."""
        known = {(effect.effect, effect.drive): effect for effect in self.effects}
        return all((effect.effect, effect.drive) in known and all(
            abs(effect.shape[p.name] - known[effect.effect, effect.drive].shape[p.name])
            <= scales * p.scale for p in effect.effect.parameters if p.name in effect.shape)
            for effect in effects)

    def is_near(self, other: OperatingPoint) -> bool:
        """Return whether another point has the same effects in nearly the same shapes."""
        return len(self.effects) == len(other.effects) and self.has(other.effects)
