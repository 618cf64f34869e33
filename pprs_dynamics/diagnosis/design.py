"""Columns of the regression: the model's own numbers, and every catalogue effect that may lack.

Model and columns are computed at full rate from one motion and then averaged in blocks, as the
measured effort is; were one side treated otherwise, each reversal would look like friction.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.diagnosis.axis_sensitivities import AxisSensitivities
from pprs_dynamics.diagnosis.measuring import join_tables, treated_table
from pprs_dynamics.diagnosis.platform_sensitivities import PlatformSensitivities
from pprs_dynamics.diagnosis.residuals import Residuals
from pprs_dynamics.diagnosis.sensitivities import (
    HOMING,
    NUMBERS,
    OF_DRIVES,
    OF_JOINTS,
    PRESENT,
    Number,
    Sensitivities,
)
from pprs_dynamics.effects.drive_effect import (
    DriveEffect,
    DriveRange,
    DriveSamples,
    MeasurementEffect,
)
from pprs_dynamics.effects.effect import CatalogueEffect
from pprs_dynamics.effects.effort_gain import EffortGain
from pprs_dynamics.effects.homing_error import HomingError
from pprs_dynamics.effects.structure_effect import StructureEffect
from pprs_dynamics.effects.time_delay import TimeDelay, shifted
from pprs_dynamics.measurement.reconstruction import Reconstruction, reconstruct
from pprs_dynamics.measurement.recording import Recording
from pprs_dynamics.measurement.treatment import Treatment
from pprs_dynamics.model.axis_model import AxisModel
from pprs_dynamics.model.drive_model import DriveModel
from pprs_dynamics.model.force_model import ForceModel, Forces

SHAPE_STEP = 1e-3  # relative, for derivatives by shape parameters of effects in the model
COLUMN = 'column '
FREE = 1e-6  # prior precision of what is not known beforehand
# A drive hardly moves whose speed is seldom beyond the width in which the model's friction turns
# over, times the first: in less than the second of the time.
TURNED, LEAST_MOVING = 2.0, 0.05
Rows = dict[int, Array]
"""Columns by drive, (k, M) each; drives that are not in it feel nothing."""


@dataclass(frozen=True)
class Term:
    """One way in which an effect may be there: on one drive, or in the structure; one shape.

    Parameters
    ----------
    effect : type of CatalogueEffect
    drive : int or None
        On which it sits.
    shape : mapping of str to float
    rows : dict of drive to (k, M) array
        One row per coefficient.
    fixed : bool
        True where the only row has the coefficient 1: its shape says it all.
    """

    effect: type[CatalogueEffect]
    drive: int | None
    shape: Mapping[str, float]
    rows: Rows
    fixed: bool = False


@dataclass(frozen=True)
class BaseColumn:
    """A column of what the model has already, present in every fit.

    Parameters
    ----------
    kind : {'number', 'width', 'present'}
    label : str
        Number, or effect.drive.coefficient.
    rows : dict of drive to (M,) array
    precision : float
        Of the prior about zero, per unit of the coefficient squared.
    number : Number, optional
    """

    kind: str
    label: str
    rows: dict[int, Array]
    precision: float
    number: Number | None = None


@dataclass(frozen=True)
class FullRate:
    """What the drives did at every sample of a recording, in segments; (N, D) arrays.

    `effort` is the model's, `effort_measured` the recording's.
    """

    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    direction: Array
    guide_load: Array
    effort: Array
    effort_measured: Array
    segments: tuple[slice, ...]
    treat: Treatment

    def samples(self, part: slice, drive: int, memory: object = None) -> DriveSamples:
        """Return one drive in one segment."""
        return DriveSamples(
            self.time[part], self.position[part, drive], self.velocity[part, drive],
            self.acceleration[part, drive], self.direction[part, drive],
            self.guide_load[part, drive], memory)


@dataclass
class Design:
    """Measured efforts, the model's, and the columns that may explain the difference.

    Parameters
    ----------
    model : ForceModel
    residuals : Residuals
    recordings : tuple of FullRate
    base : list of BaseColumn
    structure : list of Term
        Effects that are not in single drives.
    homing : list of Term
    notes : tuple of str
    """

    model: ForceModel
    residuals: Residuals
    recordings: tuple[FullRate, ...]
    base: list[BaseColumn]
    structure: list[Term]
    homing: list[Term]
    notes: tuple[str, ...]
    covered: list[DriveRange] = field(default_factory=list)

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of the drives."""
        return self.residuals.drives

    @classmethod
    def of(
        cls, model: ForceModel, recordings: Sequence[Recording],
        progress: Callable[[float], None] | None = None,
    ) -> Design:
        """Evaluate a model and its sensitivities on recordings; errors as `measure_residuals`."""
        sensitivities = sensitivities_of(model)
        tables: list[dict[str, Array]] = []
        full: list[FullRate] = []
        notes: list[str] = []
        for k, recording in enumerate(recordings):
            reconstruction = reconstruct(model, recording)

            def report(done: int, total: int, k: int = k) -> None:
                if progress is not None:
                    progress((k + 0.3 + 0.7 * done / total) / len(recordings))

            collector = _Collector(sensitivities)
            tables.append(treated_table(model, reconstruction, report, collector))
            full.append(collector.full_rate(reconstruction))
            notes += reconstruction.notes
        return cls._assembled(sensitivities, tables, tuple(full), tuple(notes))

    @classmethod
    def _assembled(
        cls, sensitivities: Sensitivities, tables: list[dict[str, Array]],
        full: tuple[FullRate, ...], notes: tuple[str, ...],
    ) -> Design:
        model, numbers = sensitivities.model, sensitivities.numbers
        drives, count = model.drives, len(model.drives)
        stacked: dict[str, Array] = {}
        for name in [name for name in tables[0] if name.startswith(COLUMN)]:
            flat = np.concatenate([table.pop(name) for table in tables])
            # (M, k * D) -> (k, D, M)
            stacked[name.removeprefix(COLUMN)] = flat.reshape(len(flat), -1, count).transpose(
                1, 2, 0)
        residuals = join_tables(drives, tables)
        base = [BaseColumn('number', number.label, _rows(column), 1.0, number)
                for number, column in zip(numbers, stacked[NUMBERS], strict=True)]
        base += [BaseColumn('width', f'{drive} {factor}', {d: column[d]}, 1.0)
                 for factor, column in enumerate(stacked[OF_DRIVES])
                 for d, drive in enumerate(drives) if np.any(column[d])]
        base += [BaseColumn('width', f'passive {factor}', _rows(column), 1.0)
                 for factor, column in enumerate(stacked.get(OF_JOINTS, ())) if np.any(column)]
        structure = [Term(effect, None, {}, {d: stacked[effect.name][:, d]
                                             for d in range(count)})
                     for effect in sensitivities.absent]
        homing = [Term(HomingError, drive, {}, {d: column[None, d] for d in range(count)})
                  for drive, column in enumerate(stacked.get(HOMING, ()))]
        design = cls(model, residuals, full, base, structure, homing, notes)
        design.covered = [design._covered(drive) for drive in range(count)]
        for effect in model.effects:
            if isinstance(effect, DriveEffect):
                design.base += design._present_in_drives(effect)
            elif isinstance(effect, StructureEffect):
                rows = stacked[PRESENT + effect.name]
                design.base += [
                    BaseColumn('present', f'{effect.name}..{c.name}', _rows(column * c.scale),
                               FREE)
                    for c, column in zip(effect.coefficients, rows, strict=True)]
        return design

    def moving(self, drive: int) -> np.typing.NDArray[np.bool_]:
        """Return when a drive is in motion, (M,)."""
        width = np.broadcast_to(self.model.reversal.velocity, len(self.drives))[drive]
        return np.abs(self.residuals.variables['velocity'][:, drive]) > float(TURNED * width)

    def moves(self, drive: int) -> bool:
        """Return whether a drive is in motion for a noteworthy share of the time."""
        return bool(np.mean(self.moving(drive)) >= LEAST_MOVING)

    def _covered(self, drive: int) -> DriveRange:
        position = np.concatenate([one.position[:, drive] for one in self.recordings])
        velocity = np.concatenate([one.velocity[:, drive] for one in self.recordings])
        longest = max(self.recordings, key=lambda one: len(one.time))
        return DriveRange(float(longest.time[-1] - longest.time[0]),
                          float(np.median(np.diff(longest.time))),
                          float(np.ptp(position)), float(np.abs(velocity).max()))

    def drive_rows(self, effect: type[DriveEffect], drive: int,
                   shape: Mapping[str, float]) -> Array:
        """Return the treated columns of an effect on one drive, (k, M)."""
        if effect is EffortGain:
            return self.residuals.model[None, :, drive]
        parts = []
        for one in self.recordings:
            if effect is TimeDelay:
                columns = [np.concatenate([
                    shifted(one.time[part], one.effort[part, drive], shape['delay'])
                    - one.effort[part, drive] for part in one.segments])]
            else:
                pieces = []
                for part in one.segments:
                    memory = effect.drive_memory()
                    piece = np.stack(effect.columns(one.samples(part, drive, memory), **shape))
                    pieces.append(self._sensed(piece, one.time[part], drive))
                columns = list(np.concatenate(pieces, axis=1))
            parts.append(one.treat(np.stack(columns, axis=1)).T)
        return np.concatenate(parts, axis=1)

    def _sensed(self, rows: Array, time: Array, drive: int) -> Array:
        sensors = [e for e in self.model.effects if isinstance(e, MeasurementEffect)
                   and self.drives[drive] in e.drives]
        for effect in sensors:
            rows = np.stack([effect.sensed(np.repeat(row[:, None], len(self.drives), axis=1),
                                           time, self.drives)[:, drive] for row in rows])
        return rows

    def term(self, effect: type[DriveEffect], drive: int, shape: Mapping[str, float]) -> Term:
        """Return an effect on one drive, of one shape."""
        return Term(effect, drive, shape, {drive: self.drive_rows(effect, drive, shape)},
                    effect is TimeDelay)

    def trial_terms(self, effect: type[DriveEffect], drive: int,
                    shapes: Sequence[Mapping[str, float]]) -> list[Term]:
        """Return an effect on one drive in many shapes, with rows for `scanned` only."""
        variables = self.residuals.variables
        time = self.residuals.time
        means = DriveSamples(time, variables['position'][:, drive],
                             variables['velocity'][:, drive], np.zeros_like(time),
                             np.zeros_like(time), np.zeros_like(time))
        rows = effect.averaged(means, self.residuals.period, shapes)
        if rows is None:
            return [self.term(effect, drive, shape) for shape in shapes]
        return [Term(effect, drive, shape, {drive: block}) for shape, block
                in zip(shapes, rows, strict=True)]

    def _present_in_drives(self, effect: DriveEffect) -> list[BaseColumn]:
        """Return what an effect of the model may still change, drive by drive."""
        found = []
        for name, values in effect.drives.items():
            drive = self.drives.index(name)
            if isinstance(effect, HomingError):
                column = {d: row[0] * effect.linear[0].scale
                          for d, row in self.homing[drive].rows.items()}
                found.append(BaseColumn('present', f'{effect.name}.{name}.zero', column, FREE))
                continue
            shape = {p.name: values[p.name] for p in effect.shape}
            rows = self.drive_rows(type(effect), drive, shape)
            coefficients = effect.to_coefficients(values)
            if not isinstance(effect, TimeDelay):
                found += [BaseColumn('present', f'{effect.name}.{name}.{c.name}',
                                     {drive: row * c.scale}, FREE)
                          for c, row in zip(effect.coefficients, rows, strict=True)]
            weights = np.array([coefficients[c.name] for c in effect.coefficients] or [1.0])
            for p in effect.shape:
                step = (1e-4 if isinstance(effect, TimeDelay)
                        else SHAPE_STEP * abs(shape[p.name]))
                moved = {**shape, p.name: shape[p.name] + step}
                if isinstance(effect, TimeDelay):
                    # The model's effort is delayed already: a little more of it.
                    change = self.drive_rows(type(effect), drive, {'delay': step})
                else:
                    change = self.drive_rows(type(effect), drive, moved) - rows
                scale = step if isinstance(effect, TimeDelay) else SHAPE_STEP
                found.append(BaseColumn('present', f'{effect.name}.{name}.{p.name}',
                                        {drive: weights @ change / scale * (
                                            1e-3 if isinstance(effect, TimeDelay) else 0.1)},
                                        FREE))
        return found


def _rows(column: Array) -> dict[int, Array]:
    return {drive: row for drive, row in enumerate(column) if np.any(row)}


def sensitivities_of(model: ForceModel) -> Sensitivities:
    """Return the sensitivities of a model of either kind."""
    if isinstance(model, AxisModel):
        return AxisSensitivities(model)
    assert isinstance(model, DriveModel)
    return PlatformSensitivities(model)


class _Collector:
    """Called chunk by chunk: gives columns to be treated, and keeps what drives did."""

    def __init__(self, sensitivities: Sensitivities) -> None:
        self.sensitivities = sensitivities
        self.kept: list[tuple[Array, ...]] = []

    def __call__(self, forces: Forces) -> dict[str, Array]:
        s = forces.mechanism
        self.kept.append((s.velocity, s.acceleration, s.direction, s.guide_load, forces.total))
        return {COLUMN + name: column.transpose(1, 0, 2).reshape(len(s.velocity), -1)
                for name, column in self.sensitivities.columns(forces).items()}

    def full_rate(self, reconstruction: Reconstruction) -> FullRate:
        """Return what the drives did, with positions as the mechanism has them."""
        velocity, acceleration, direction, load, effort = (
            np.concatenate(arrays) for arrays in zip(*self.kept, strict=True))
        return FullRate(
            reconstruction.time, reconstruction.position, velocity, acceleration, direction, load,
            effort, reconstruction.effort, reconstruction.segments, reconstruction.treat)
