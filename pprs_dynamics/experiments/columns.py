"""Columns of the regression on a motion that nobody has made yet.

They are those of `diagnosis.design`, in the same order and scale, so that what a new motion
would tell adds to what the recordings have told.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.diagnosis.joint_fit import Active
from pprs_dynamics.effects.drive_effect import DriveEffect
from pprs_dynamics.effects.effect import CatalogueEffect
from pprs_dynamics.effects.homing_error import HomingError
from pprs_dynamics.effects.structure_effect import StructureEffect
from pprs_dynamics.effects.time_delay import TimeDelay
from pprs_dynamics.measurement.treatment import Treatment
from pprs_dynamics.mechanism.robot import DRIVES
from pprs_dynamics.model.drive_model import DriveForces, DriveModel
from pprs_dynamics.regression.design import SHAPE_STEP, Design, FullRate
from pprs_dynamics.regression.platform_sensitivities import ChunkSensitivities
from pprs_dynamics.regression.sensitivities import Number
from pprs_dynamics.residuals.residuals import Residuals

DELAY_STEP = 1e-4  # [s]
PER_MILLISECOND = 1e-3
PRESENT_SHAPE = 0.1  # relative change per unit of a present shape parameter's column
HOMING_SAMPLES = 100  # of a motion, at which its columns are computed; they change slowly
Rows = dict[int, Array]


class Source(Protocol):
    """A recording or a motion that gives columns, (k, M) by drive."""

    def drive_rows(self, effect: type[DriveEffect], drive: int,
                   shape: Mapping[str, float]) -> Array:
        """Return the columns of an effect on one drive."""

    def common_rows(self, effect: type[CatalogueEffect], drive: int | None) -> Rows:
        """Return the columns of an effect that all drives feel."""


@dataclass(frozen=True)
class Block:
    """An effect's term with values: its columns, and those of its shape parameters.

    Parameters
    ----------
    effect : type of CatalogueEffect
    drive : int or None
    shape : mapping of str to float
    chosen : tuple of int
        Coefficients that are fitted.
    values : (k,) array
        Theirs; 1 for an effect whose shape says it all.
    """

    effect: type[CatalogueEffect]
    drive: int | None
    shape: Mapping[str, float]
    chosen: tuple[int, ...]
    values: Array

    @classmethod
    def of(cls, active: Active, coefficients: Array) -> Block:
        """Return the block of an active term, at fitted coefficients."""
        term = active.term
        chosen, values = (((0,), np.ones(1)) if term.fixed
                          else (tuple(active.chosen), np.asarray(coefficients)))
        return cls(term.effect, term.drive, dict(term.shape), chosen, values)

    @property
    def size(self) -> int:
        """Number of columns."""
        return len(self.chosen) + len(self.shape)

    @property
    def truth(self) -> Array:
        """Coefficients of its columns where the effect is there as fitted, (size,)."""
        return np.concatenate((self.values, np.zeros(len(self.shape))))

    @property
    def is_homing(self) -> bool:
        """True where positions are wrong: felt by all drives."""
        return self.effect is HomingError

    def rows(self, source: Source) -> Rows:
        """Return its columns and their derivatives by the shape parameters."""
        if self.drive is None or self.is_homing:
            found = source.common_rows(self.effect, self.drive)
            return {d: rows[list(self.chosen)] for d, rows in found.items()}
        assert issubclass(self.effect, DriveEffect)

        def at(shape: Mapping[str, float]) -> Array:
            assert issubclass(self.effect, DriveEffect)
            assert self.drive is not None
            return source.drive_rows(self.effect, self.drive, shape)[list(self.chosen)]

        own = at(self.shape)
        slopes = []
        for name, value in self.shape.items():
            step = DELAY_STEP if self.effect is TimeDelay else SHAPE_STEP * abs(value)
            unit = PER_MILLISECOND / DELAY_STEP if self.effect is TimeDelay else 1 / SHAPE_STEP
            slopes.append(self.values @ (at({**self.shape, name: value + step}) - own) * unit)
        return {self.drive: np.concatenate((own, np.stack(slopes))) if slopes else own}


class RecordedColumns:
    """Columns on recordings."""

    def __init__(self, design: Design) -> None:
        self.design = design
        self.drive_rows = design.drive_rows

    def common_rows(self, effect: type[CatalogueEffect], drive: int | None) -> Rows:
        """Return the columns of an effect that all drives feel."""
        terms = self.design.homing if effect is HomingError else self.design.structure
        return next(one.rows for one in terms if one.effect is effect and one.drive == drive)


@dataclass(frozen=True)
class MotionColumns:
    """Columns on one hypothetical motion.

    Parameters
    ----------
    base : list of dict of drive to (M,) array
        As the design's base columns.
    common : dict of (name, drive) to Rows
    design : Design
        Of this motion, for columns of effects on drives.
    """

    base: list[dict[int, Array]]
    common: Mapping[tuple[str, int | None], Rows]
    design: Design

    def drive_rows(self, effect: type[DriveEffect], drive: int,
                   shape: Mapping[str, float]) -> Array:
        """Return the columns of an effect on one drive."""
        return self.design.drive_rows(effect, drive, shape)

    def common_rows(self, effect: type[CatalogueEffect], drive: int | None) -> Rows:
        """Return the columns of an effect that all drives feel."""
        return self.common[effect.name, drive]


@dataclass(frozen=True)
class ColumnPlan:
    """Which columns are wanted, and how they are computed.

    Parameters
    ----------
    model : DriveModel
    labels : tuple of (kind, label)
        Of the base columns, as the design has them.
    numbers : tuple of Number
    blocks : tuple of Block
    """

    model: DriveModel
    labels: tuple[tuple[str, str], ...]
    numbers: tuple[Number, ...]
    blocks: tuple[Block, ...]

    @property
    def size(self) -> int:
        """Number of all columns, base columns first."""
        return len(self.labels) + sum(block.size for block in self.blocks)

    def places(self) -> list[slice]:
        """Return where each block's columns stand."""
        ends = len(self.labels) + np.cumsum([block.size for block in self.blocks])
        return [slice(int(end) - block.size, int(end))
                for end, block in zip(ends, self.blocks, strict=True)]

    def on_motions(self, forces: DriveForces, time: Array, block: int = 1,
                   ) -> list[MotionColumns]:
        """Return the columns of motions one after the other, each at the same times.

        Parameters
        ----------
        forces : DriveForces
            Of the model with its sensors; M motions of N samples.
        time : (N,) array
        block : int
            Samples that are averaged.
        """
        samples = len(time)
        found = ChunkSensitivities(self.model, forces)
        every = {**dict(zip((('number', n.label) for n in self.numbers),
                            found.of_numbers(self.numbers), strict=True)),
                 **{('width', f'drives {k}'): column
                    for k, column in enumerate(found.of_drive_widths())},
                 **{('width', f'passive {k}'): column
                    for k, column in enumerate(found.of_passive_widths())},
                 **{('present', f'{effect.name}..{name}'): column * _scale(effect, name)
                    for effect in self.model.effects if isinstance(effect, StructureEffect)
                    for _, name, column in found.of_present(effect)}}
        common: dict[tuple[str, int | None], Array] = {
            (one.effect.name, None): np.stack(list(found.of_structure(one.effect)))
            for one in self.blocks if issubclass(one.effect, StructureEffect)}
        common |= {(HomingError.name, drive): column[None]
                   for drive, column in self._homing(found, samples).items()}
        treat = Treatment(np.arange(0, samples - samples % block or samples, block), samples)
        result = []
        for start in range(0, len(forces.total), samples):
            part = slice(start, start + samples)
            columns = MotionColumns(
                [], {key: {d: treat(rows[:, part, d].T).T for d in range(len(DRIVES))}
                     for key, rows in common.items()},
                self._design(forces, part, time, treat, block))
            treated = {key: treat(column[part]).T for key, column in every.items()}
            columns.base.extend(self._base(kind, label, columns, treated)
                                for kind, label in self.labels)
            result.append(columns)
        return result

    def _base(self, kind: str, label: str, columns: MotionColumns,
              treated: Mapping[tuple[str, str], Array]) -> dict[int, Array]:
        """Return a base column of one motion by its label."""
        if (kind, label) in treated:
            return dict(enumerate(treated[kind, label]))
        if kind == 'width':
            drive, factor = label.rsplit(' ', 1)
            d = DRIVES.index(drive)
            return {d: treated[kind, f'drives {factor}'][d]}
        name, drive, parameter = label.split('.')
        d = DRIVES.index(drive)
        effect = next(e for e in self.model.effects if e.name == name)
        assert isinstance(effect, DriveEffect)
        kind_of = type(effect)
        if isinstance(effect, HomingError):
            return {k: rows[0] * effect.linear[0].scale
                    for k, rows in columns.common_rows(kind_of, d).items()}
        values = effect.drives[drive]
        shape = {p.name: values[p.name] for p in effect.shape}
        names = [c.name for c in effect.coefficients]
        if parameter in names:
            row = columns.drive_rows(kind_of, d, shape)[names.index(parameter)]
            return {d: row * _scale(effect, parameter)}
        if isinstance(effect, TimeDelay):
            # The model's effort is delayed already: a little more of it.
            later = columns.drive_rows(kind_of, d, {'delay': DELAY_STEP})[0]
            return {d: later / DELAY_STEP * PER_MILLISECOND}
        coefficients = effect.to_coefficients(values)
        weights = np.array([coefficients[name] for name in names])
        moved = {**shape, parameter: shape[parameter] * (1 + SHAPE_STEP)}
        change = (columns.drive_rows(kind_of, d, moved)
                  - columns.drive_rows(kind_of, d, shape))
        return {d: weights @ change / SHAPE_STEP * PRESENT_SHAPE}

    def _homing(self, found: ChunkSensitivities, samples: int) -> dict[int, Array]:
        """Return the columns of wrong zeros by drive, (N, 6), where any is wanted."""
        wanted = any(block.is_homing for block in self.blocks) or any(
            isinstance(effect, HomingError) for effect in self.model.effects)
        if not wanted:
            return {}
        every = np.arange(len(found.state.velocity))
        kept = every[::max(1, samples // HOMING_SAMPLES)]
        return {drive: np.stack([np.interp(every, kept, column) for column in rows.T], axis=1)
                for drive, rows in enumerate(found.of_homing(kept))}

    def _design(self, forces: DriveForces, part: slice, time: Array, treat: Treatment,
                block: int) -> Design:
        s, total = forces.mechanism, forces.total[part]
        full = FullRate(time, s.position[part], s.velocity[part], s.acceleration[part],
                        s.direction[part], s.guide_load[part], total, total,
                        (slice(0, len(time)),), treat)
        means = treat(total)
        residuals = Residuals(DRIVES, treat(time), np.zeros(len(means), dtype=int), means, means,
                              period=float(time[1] - time[0]) * block)
        return Design(self.model, residuals, (full,), [], [], [], ())


def _scale(effect: CatalogueEffect, name: str) -> float:
    return next(c.scale for c in effect.coefficients if c.name == name)


def plan_for(design: Design, blocks: Sequence[Block]) -> ColumnPlan:
    """Return the plan of a design's base columns and more."""
    assert isinstance(design.model, DriveModel)
    return ColumnPlan(
        design.model, tuple((one.kind, one.label) for one in design.base),
        tuple(one.number for one in design.base if one.number is not None), tuple(blocks))
