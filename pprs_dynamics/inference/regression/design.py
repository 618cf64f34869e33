# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Design of the regression: columns of the model's numbers and of every effect of the catalogue.

Model and columns are computed at full rate from one motion and then averaged in blocks, as the
measured effort is; were one side treated otherwise, each reversal would look like friction.

Forces are linear around an operating point: the input model at first, and later one with the
reported effects. There the error is extrapolated back to the given model (Gauss-Newton), so that
coefficients, priors and costs always mean the same.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.base_columns import (
    SMALL_STEP,
    BaseColumn,
    CarriedOver,
    LoadOfFriction,
    ModelNumber,
    PresentParameter,
    ReferenceDirection,
    ReversalShape,
    force_of,
    present_columns,
    present_values,
)
from pprs_dynamics.inference.regression.drive_ranges import SecondEncoders, drive_range
from pprs_dynamics.inference.regression.sensitivities import (
    BY_FRICTION,
    DRIVE_WIDTHS,
    HOMING,
    INERTIA,
    NUMBERS,
    OF_DRIVES,
    OF_JOINTS,
    PRESENT,
    ColumnCollector,
    Sensitivities,
    stacked_columns,
)
from pprs_dynamics.inference.regression.terms import FullRate, OperatingPoint, Term
from pprs_dynamics.inference.residuals.measuring import join_tables, progress_of, treated_table
from pprs_dynamics.inference.residuals.reconstruction import (
    Reconstruction,
    misread,
    read_by,
    reconstruct,
    treated_forces,
)
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.motion.treatment import Treatment
from pprs_dynamics.physics.effects.catalogue import catalogue
from pprs_dynamics.physics.effects.drive_effect import (
    DriveEffect,
    DriveRange,
    DriveSamples,
    MeasurementEffect,
)
from pprs_dynamics.physics.effects.effect import CatalogueEffect, Parameter
from pprs_dynamics.physics.effects.structure_effect import AddedBody, StructureEffect
from pprs_dynamics.physics.mechanism.state import smooth_sign
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.forces import Forces
from pprs_dynamics.physics.model.parameter_values import effect_uncertainties

SHARE = 0.1  # of what a model has of an effect that shifts positions, for derivatives
SIZES = (0.1, 0.2, 0.4, 0.8, 1.6, 3.2)  # of what it usually is, that are tried where none is
SHAPE_STEP = 1e-3  # amount of movement, for derivatives by shape parameters
# A drive hardly moves whose speed is seldom beyond the width in which the model's friction turns
# over, times the first: in less than the second of the time.
TURNED, LEAST_MOVING = 2.0, 0.05


@dataclass
class Design:
    """Measured efforts, the model's, and the columns that may explain the difference.

    Parameters
    ----------
    given, model : DriveModel
        As the user has it; and around which forces are linear.
    residuals : Residuals
        Whose error is that of the given model, extrapolated linearly from `model`.
    recordings : tuple of FullRate
    base : tuple of BaseColumn
    structure : tuple of Term
        Effects that are not in single drives, those of the given model among them.
    homing : (D, D, M) array
        Change of all forces per metre that a drive is measured too far [N/m].
    reconstructions : tuple of Reconstruction
    forces : (M, D) array
        Of `model`, exactly [N].
    point : OperatingPoint, optional
        None: the given model.
    carried : CarriedOver, optional
        Its mean is taken from what was measured, its directions are columns of every fit.
    columns : mapping of str to (k, D, M) array
        All by name, see `Sensitivities.columns`.
    """

    given: DriveModel
    model: DriveModel
    residuals: Residuals
    recordings: tuple[FullRate, ...]
    base: tuple[BaseColumn, ...]
    structure: tuple[Term, ...]
    homing: Array
    reconstructions: tuple[Reconstruction, ...] = field(repr=False)
    forces: Array = field(repr=False)
    point: OperatingPoint | None = None
    carried: CarriedOver | None = None
    columns: Mapping[str, Array] = field(default_factory=dict, repr=False)
    _moved: dict[tuple[Any, ...], tuple[Reconstruction, ...]] = field(
        default_factory=dict, repr=False, compare=False)
    _own_rows: dict[tuple[type[CatalogueEffect], int], Mapping[int, Array]] = field(
        default_factory=dict, repr=False, compare=False)
    _exact: tuple[Mapping[str, Any], Array] | None = field(default=None, repr=False, compare=False)

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of the drives."""
        return self.residuals.drives

    @property
    def notes(self) -> tuple[str, ...]:
        """How the motion of the recordings was found, in words."""
        return tuple(note for found in self.reconstructions for note in found.notes)

    def named(self, drives: Iterable[int] | None) -> tuple[str, ...] | None:
        """Return the names of some drives; None of the structure, which is no drive's."""
        return None if drives is None else tuple(self.drives[d] for d in drives)

    @classmethod
    def of(
        cls, model: DriveModel, recordings: Sequence[Recording],
        progress: Callable[[float], None] | None = None,
    ) -> Design:
        """Evaluate a model and its sensitivities on recordings; errors as `measure_residuals`.

        Parameters
        ----------
        model : DriveModel
        recordings : sequence of Recording
        progress : callable, optional
            Called with the share that is done.
        """
        report = progress or (lambda share: None)
        design = cls._evaluated(model, model, tuple(
            replace(reconstruct(model, recording), keeps=True) for recording in recordings), report)
        design._drop_unknown_past()
        return design

    def _drop_unknown_past(self) -> None:
        """Drop efforts that a delay moves into a segment from motion outside of it.

        If the efforts are late, those at the start of a segment are of a motion that is not known.
        """
        # In place: the delays are in `covered`, which a copy would compute again.
        delays = np.array([covered.delay for covered in self.covered])
        if np.any(delays):
            self.reconstructions = tuple(
                found.with_known_past(delays) for found in self.reconstructions)
            self.residuals = replace(self.residuals, measured=np.concatenate(
                [found.treat(found.effort) for found in self.reconstructions]))

    def around(self, point: OperatingPoint,
               effects: Container[type[CatalogueEffect]] | None = None) -> Design:
        """Return the design of the same recordings around another operating point.

        Parameters
        ----------
        point : OperatingPoint
        effects : container of type of CatalogueEffect, optional
            The only ones outside the drives that get columns; by default all.
        """
        design = self._evaluated(
            point.model, self.given, self.reconstructed(point.model),
            effects=effects,
            reversals={(column.drive, column.number) for column in self.base
                       if isinstance(column, ReversalShape)},
            known=self._unmoved(point)).beside(self.carried)
        shift = force_of(design.base, point.base, design.residuals.model.shape,
                         lambda column: column.in_model)
        for effect in point.effects:
            term = design.find_term(effect.effect, effect.drive, effect.shape)
            if issubclass(effect.effect, AddedBody) and self.present(effect.effect, None) is None:
                term = replace(term, rows=effect.effect.around(term.rows, effect.coefficients))
            for d, force in term.force(effect.coefficients).items():
                shift[:, d] += force
            for d, row in design.known_change(term).items():
                shift[:, d] += row
        residuals = replace(design.residuals, model=design.residuals.model - shift)
        return replace(design, residuals=residuals, point=point)

    def _unmoved(self, point: OperatingPoint) -> dict[str, Array]:
        """Return the columns that are not computed again around another operating point.

        Exact forces are known there, so that columns only say how forces change from there on.
        All stay from a point with the same effects in nearly the same shapes; those of numbers,
        which move within tolerances, and of positions from any (a chord method).
        Effects in drives add no load: they change no other column, but for errors of positions,
        with which friction turns over at other times. A sensor of efforts shows all but the columns
        of positions otherwise.
        """
        if self.point is not None and self.point.is_near(point):
            return dict(self.columns)
        effects = {e.effect for at in (point, self.point) if at is not None for e in at.effects}
        turning = any(effect.shifts_positions() for effect in effects)
        kept = {HOMING, INERTIA}
        if not any(issubclass(effect, MeasurementEffect) and not effect.shifts_positions()
                   for effect in effects):
            kept.add(NUMBERS)
            if all(issubclass(effect, DriveEffect) for effect in effects):
                kept |= self.columns.keys() - (
                    {OF_DRIVES, OF_JOINTS, BY_FRICTION} if turning else set())
        return {name: column for name, column in self.columns.items() if name in kept}

    def beside(self, carried: CarriedOver | None) -> Design:
        """Return this with what a reference says of the recordings, or unchanged for None."""
        if carried is None:
            return self
        forces = carried.shown(self.residuals)
        homing = self.homing
        if len(homing):
            homing = homing - carried.per_position(self.residuals).swapaxes(1, 2)
        alone = carried.at_full_rate(self.recordings, self.residuals.time)
        recordings = tuple(replace(recording, effort=recording.effort + more)
                           for recording, more in zip(self.recordings, alone, strict=True))
        late = replace(self, recordings=tuple(
            replace(recording, effort=more)
            for recording, more in zip(self.recordings, alone, strict=True)))._shown_late()
        residuals = replace(self.residuals, measured=self.residuals.measured - forces - late)
        return replace(self, residuals=residuals, recordings=recordings, homing=homing,
                       base=(*self.base, *carried.directions), carried=carried)

    def _shown_late(self) -> Array:
        """Return by how much sensors show efforts otherwise than those of the given model do."""
        late = np.zeros_like(self.residuals.model)
        sensors, given = ([(effect.name, repr(effect.drives)) for effect in model.effects
                           if isinstance(effect, MeasurementEffect)]
                          for model in (self.model, self.given))
        if sensors != given:
            before = replace(self, model=self.given)
            for d in range(len(self.drives)):
                def efforts(recording: FullRate, d: int = d) -> Array:
                    return recording.effort[None, :, d]

                late[:, d] = (self.shown(d, efforts) - before.shown(d, efforts))[0]
        return late

    def exact_forces(self, model: DriveModel) -> Array:
        """Return the treated forces of a model on the recordings, (M, D) [N].

        Raises
        ------
        PprsError
            Where the model cannot follow them.
        """
        if self._exact is None or self._exact[0] != model.values:
            self._exact = model.values, np.concatenate([
                treated_forces(model, table)['total'] for table in self.reconstructed(model)])
        return self._exact[1]

    def carried_forces(self, coefficients: Array) -> Array:
        """Return the force of a reference's directions with coefficients, (M, D) [N].

        Parameters
        ----------
        coefficients : (P,) array
            Of the base columns first.
        """
        return force_of(self.base, coefficients, self.residuals.model.shape,
                        lambda column: isinstance(column, ReferenceDirection))

    def reconstructed(self, model: DriveModel) -> tuple[Reconstruction, ...]:
        """Return the motion of the recordings by a model's encoders."""
        if model.position_effects == self.model.position_effects:
            return self.reconstructions
        key = tuple((effect.name, repr(effect.drives)) for effect in model.position_effects)
        if key not in self._moved:
            self._moved.clear()
            self._moved[key] = tuple(read_by(reconstruction, model)
                                     for reconstruction in self.reconstructions)
        return self._moved[key]

    @classmethod
    def _evaluated(cls, model: DriveModel, given: DriveModel,
                   reconstructions: tuple[Reconstruction, ...],
                   report: Callable[[float], None] = lambda share: None,
                   effects: Container[type[CatalogueEffect]] | None = None,
                   reversals: Container[tuple[int | None, int]] | None = None,
                   known: Mapping[str, Array] = MappingProxyType({}),
                   ) -> Design:
        """Return the design around a model.

        Parameters
        ----------
        model, given : DriveModel
        reconstructions : tuple of Reconstruction
        report : callable, optional
            Called with the share that is done; half of it is before.
        effects : container of type of CatalogueEffect, optional
            The only ones outside the drives that get columns; by default all.
        reversals : container of (int or None, int), optional
            Widths that are left open. They are those of the given model around every other one: a
            sensor that says nothing of small efforts, say, would leave some without a column.
        known : mapping of str to (k, D, M) array, optional
            Columns that are not computed again.
        """
        sensitivities = Sensitivities(model, given, effects, known)
        tables: list[dict[Any, Array]] = []
        full: list[FullRate] = []
        for k, reconstruction in enumerate(reconstructions):
            collector = ColumnCollector(sensitivities, reconstruction)
            tables.append(treated_table(model, reconstruction, progress_of(
                report, k, len(reconstructions)), collector))
            full.append(collector.full_rate(reconstruction))
        stacked = {**known, **stacked_columns(tables)}
        return cls._assembled(sensitivities, stacked, join_tables(model, tables), tuple(full),
                              reconstructions, reversals)

    @classmethod
    def planned(cls, sensitivities: Sensitivities, forces: Forces, time: Array,
                block: int) -> Design:
        """Return the design of a planned motion, without measurements.

        All widths of reversal are open, since a drive that stood in a recording may move here.

        Parameters
        ----------
        sensitivities : Sensitivities
            Of the model.
        forces : Forces
            Of the model on the motion, before its sensors.
        time : (N,) array
            [s]
        block : int
            Samples that are averaged.
        """
        s, samples = forces.mechanism, len(time)
        treat = Treatment(np.arange(0, samples - samples % block or samples, block), samples)
        stacked = {name: column.transpose(1, 2, 0)
                   for name, column in sensitivities.columns(forces, treat).items()}
        full = FullRate(time, s.position, s.velocity, s.acceleration, s.direction, s.friction_load,
                        s.transmitted, forces.total, forces.total, (slice(0, samples),), treat,
                        float(time[0]), {})
        means = treat(forces.total)
        residuals = Residuals(sensitivities.model.drives, treat(time),
                              np.zeros(len(means), dtype=int), means, means,
                              period=float(time[1] - time[0]) * block)
        widths = {(drive, number) for number in range(len(DRIVE_WIDTHS) + 1)
                  for drive in (None, *range(len(sensitivities.model.drives)))}
        return cls._assembled(sensitivities, stacked, residuals, (full,), (), widths)

    @classmethod
    def _assembled(
        cls, sensitivities: Sensitivities, stacked: Mapping[str, Array], residuals: Residuals,
        full: tuple[FullRate, ...], reconstructions: tuple[Reconstruction, ...],
        reversals: Container[tuple[int | None, int]] | None,
    ) -> Design:
        """Return the design of treated columns, (k, D, M) by name as `Sensitivities.columns`."""
        model, given = sensitivities.model, sensitivities.given
        count = len(model.drives)
        there = [(PRESENT + effect.name, type(effect)) for effect in given.effects
                 if isinstance(effect, StructureEffect)]
        structure = tuple(
            Term(effect, None, {}, {d: stacked[name][:, d] for d in range(count)})
            for name, effect in (
                *((effect.name, effect) for effect in sensitivities.searched), *there))
        design = cls(given, model, residuals, full, (), structure,
                     stacked.get(HOMING, np.zeros(0)), reconstructions, residuals.model,
                     columns=stacked)
        base: list[BaseColumn] = [
            ModelNumber(_rows(column), 1.0, number)
            for number, column in zip(sensitivities.numbers, stacked[NUMBERS], strict=True)]

        # Where a drive stands, friction that turns over otherwise is any constant force.
        def is_open(drive: int | None, number: int, column: Array) -> bool:
            if reversals is not None:
                return (drive, number) in reversals
            return bool(np.any(column)) and (drive is None or design.moves(drive))

        base += [ReversalShape({d: column[d]}, 1.0, d, number)
                 for number, column in enumerate(stacked[OF_DRIVES])
                 for d in range(count) if is_open(d, number, column[d])]
        base += [ReversalShape(_rows(column), 1.0, None, number)
                 for number, column in enumerate(stacked.get(OF_JOINTS, ()))
                 if is_open(None, number, column)]
        base += [LoadOfFriction(_rows(column), 1.0) for column in stacked.get(BY_FRICTION, ())]
        for effect in given.effects:
            if isinstance(effect, (DriveEffect, StructureEffect)):
                base += [replace(column, rows=design.present_rows(column))
                         for column in present_columns(effect, effect_uncertainties(
                             given.values, effect.name))]
        return replace(design, base=tuple(base))

    @cached_property
    def second_encoders(self) -> SecondEncoders:
        """Wind-up and clearance of the drives with an encoder behind the gear."""
        return SecondEncoders.of(self.recordings, self.reconstructions)

    def moving(self, drive: int) -> np.typing.NDArray[np.bool_]:
        """Return when a drive is in motion, (M,)."""
        width = self.given.reversal.widths(len(self.drives))[drive]
        return np.abs(self.residuals.variables['velocity'][:, drive]) > float(TURNED * width)

    def moves(self, drive: int) -> bool:
        """Return whether a drive is in motion for a noteworthy share of the time."""
        return bool(np.mean(self.moving(drive)) >= LEAST_MOVING)

    @cached_property
    def covered(self) -> tuple[DriveRange, ...]:
        """Ranges of motion of each drive."""
        return tuple(drive_range(self.given, self.recordings, drive)
                     for drive in range(len(self.drives)))

    def acts_on(self, effect: type[CatalogueEffect], drive: int) -> bool:
        """Return whether an effect may be looked for on a drive, there already or not."""
        return (issubclass(effect, DriveEffect) and self.given.offers(effect)
                and (not effect.is_friction or self.moves(drive))
                and effect.may_show(self.covered[drive]))

    def present(self, effect: type[CatalogueEffect], drive: int | None,
                ) -> Mapping[str, float] | None:
        """Return the parameters that the given model has of an effect; None where it lacks it."""
        there = next((e for e in self.given.effects if e.name == effect.name), None)
        name = None if drive is None else self.drives[drive]
        if there is None or (isinstance(there, DriveEffect) and name not in there.drives):
            return None
        assert isinstance(there, CatalogueEffect)
        return present_values(there, name)

    def known_change(self, term: Term) -> dict[int, Array]:
        """Return the change by a term that does not depend on its coefficients, (M,) by drive.

        Of an effect that the given model has in another shape, what the other shape does to the
        coefficients that are there; nothing for all others.
        """
        if term.drive is None or (values := self.present(term.effect, term.drive)) is None:
            return {}
        effect = term.effect
        assert issubclass(effect, DriveEffect)
        shape = {p.name: values[p.name] for p in effect.shape}
        if (effect, term.drive) not in self._own_rows:
            self._own_rows[effect, term.drive] = self.term(effect, term.drive, shape).rows
        before = self._own_rows[effect, term.drive]
        if not term.names:  # what it does is all in its shape, and that is no change
            return {d: -rows[0] for d, rows in before.items()}
        if shape == dict(term.shape):
            return {}
        known = effect.to_coefficients(values)
        c = np.array([known[name] for name in term.names])
        # Rows are of all coefficients, or of the first, which scans have.
        return {d: c[:len(rows)] @ (rows - before[d][:len(rows)]) for d, rows in term.rows.items()}

    def drive_rows(self, effect: type[DriveEffect], drive: int,
                   shape: Mapping[str, float]) -> Array:
        """Return the treated columns of an effect on one drive, (k, M)."""
        if issubclass(effect, MeasurementEffect):
            def sensor_columns(recording: FullRate, part: slice) -> Array:
                effort = self.measured(recording.effort[None, part, drive], recording, part, drive,
                                       effect)[0]
                samples = recording.samples(part, drive)
                return np.stack(effect.sensor_columns(effort, samples, **shape))

            return self.treated(lambda recording: np.concatenate(
                [sensor_columns(recording, part) for part in recording.segments], axis=1))

        return self.shown(drive, lambda recording: recording.columns(effect, drive, shape))

    def shown(self, drive: int, rows: Callable[[FullRate], Array]) -> Array:
        """Return forces on a drive, (k, N) of a recording, as its sensor shows them, (k, M)."""
        def behind_sensor(recording: FullRate) -> Array:
            whole = rows(recording)
            return np.concatenate([self.measured(whole[:, part], recording, part, drive)
                                   for part in recording.segments], axis=1)
        return self.treated(behind_sensor)

    def treated(self, rows: Callable[[FullRate], Array]) -> Array:
        """Return rows (k, N) of every recording, treated, one after the other, (k, M)."""
        return np.concatenate([recording.treat(rows(recording).T).T
                               for recording in self.recordings], axis=1)

    def measured(self, rows: Array, recording: FullRate, part: slice, drive: int,
                 without: type[CatalogueEffect] | None = None) -> Array:
        """Return forces (k, N) on a drive in a segment as the model's sensors show them.

        All but those of one kind.
        """
        name = self.drives[drive]
        for effect in self.model.effects:
            if (isinstance(effect, MeasurementEffect) and name in effect.drives
                    and (without is None or effect.name != without.name)):
                samples = recording.samples(part, drive)
                rows = np.reshape([effect.sense(row, samples, **effect.drives[name])
                                   for row in rows], rows.shape)
        return rows

    def term(self, effect: type[DriveEffect], drive: int, shape: Mapping[str, float]) -> Term:
        """Return an effect on one drive, of one shape."""
        if effect.shifts_positions():
            assert issubclass(effect, MeasurementEffect)
            return Term(effect, drive, dict(shape), self._misread_rows(effect, drive, shape))
        return Term(effect, drive, dict(shape), {drive: self.drive_rows(effect, drive, shape)})

    def _misread_rows(self, effect: type[MeasurementEffect], drive: int,
                      shape: Mapping[str, float]) -> dict[int, Array]:
        """Return changes of all efforts by a position error of one drive, (k, M) by drive.

        The force is not in proportion to a play. Around a model that has the effect it is taken
        at steps of `SHARE` of its size. Else, for coefficients in `not_linear_in`, it is taken at
        the one of `SIZES` that alone explains most of the drive's error.
        """
        name = self.drives[drive]
        there = next((present for present in self.model.effects
                      if isinstance(present, effect) and name in present.drives), None)
        before = {c.name: 0.0 for c in effect.coefficients} if there is None else (
            effect.to_coefficients(there.drives[name]))

        def read(coefficients: Mapping[str, float]) -> list[Array]:
            tried = effect({name: {**effect.from_coefficients(coefficients), **shape}})
            return [self._misread(tried, recording, reconstruction, drive)
                    for recording, reconstruction in zip(
                        self.recordings, self.reconstructions or [None], strict=True)]

        old = read(before)

        def changed(c: Parameter, step: float) -> Array | None:
            moved = read({**before, c.name: before[c.name] + step})
            if all(map(np.array_equal, old, moved)):
                return None
            q, q_ddot, rubbing = np.concatenate([
                recording.treat(self._misreading_rows(recording, drive, new - as_read).T).T
                for recording, as_read, new in zip(self.recordings, old, moved, strict=True)],
                axis=1)
            forces: Array = self.homing[drive] * q + self.columns[INERTIA][drive] * q_ddot
            forces[drive] += rubbing
            return forces

        error = np.nan_to_num(self.residuals.error[:, drive])
        none = np.zeros((len(self.drives), len(error)))
        rows = []
        for c in effect.coefficients:
            usual = c.scale if c.expected is None else c.expected[self.given.units[drive].turns]
            steps = ([SHARE * max(abs(before[c.name]), usual)] if there is not None
                     else [size * usual for size in SIZES] if c.name in effect.not_linear_in
                     else [usual])
            found = []
            for step in steps:
                if (rows_there := changed(c, step)) is None:
                    break  # no reversal comes back by as much
                found.append((step, rows_there))
            step, best = max(found, default=(1.0, none), key=lambda scored: float(
                (2 * error - scored[1][drive]) @ scored[1][drive]))
            rows.append(best / step)
        return dict(enumerate(np.stack(rows, axis=1)))

    def _misreading_rows(self, recording: FullRate, drive: int, change: Array) -> Array:
        """Return errors of position and acceleration, and what the drive's own friction makes.

        Of errors of position and its rates, (3, N) each.
        """
        q, q_dot, q_ddot = change
        friction, v = self.model.friction, recording.velocity[:, drive]
        rubbing = np.zeros_like(q)
        if np.any(q_dot):
            width = float(self.model.reversal.widths(len(self.drives))[drive])
            turned = smooth_sign(v - q_dot, width) - recording.direction[:, drive]
            rubbing = (friction.dry(recording.friction_load)[:, drive] * turned
                       - friction.viscous[drive] * q_dot)
        return np.stack((q, q_ddot, rubbing))

    def _misread(self, effect: MeasurementEffect, recording: FullRate,
                 read: Reconstruction | None, drive: int) -> Array:
        """Return the errors of a drive's position and its rates, (3, N); `read` None: planned."""
        name = (self.drives[drive],)
        if read is None:
            planned = effect.position_error(name, recording.position[:, [drive]])[:, 0]
            rate = np.gradient(planned, recording.time)
            found = np.stack((planned, rate, np.gradient(rate, recording.time)))
        else:
            found = np.concatenate(misread([effect], name, read.recorded, read.read, drive,
                                           read.smoothing), axis=1).T
        load = recording.transmitted[:, [drive]]
        found[0] += effect.loaded_position_error(name, load)[:, 0]
        if read is not None and read.windup is not None:
            found += effect.windup_error(name, load, read.windup[:, :, [drive]])[:, :, 0]
        return found

    def find_term(self, effect: type[CatalogueEffect], drive: int | None,
                  shape: Mapping[str, float]) -> Term:
        """Return an effect on a drive or in the structure."""
        if drive is None:
            return next(term for term in self.structure if term.effect is effect)
        assert issubclass(effect, DriveEffect)
        return self.term(effect, drive, shape)

    def trial_terms(self, effect: type[DriveEffect], drive: int,
                    shapes: Sequence[Mapping[str, float]]) -> list[Term]:
        """Return an effect on one drive in many shapes, with rows for `scanned` only."""
        variables = self.residuals.variables
        time = self.residuals.time
        means = DriveSamples(time, variables['position'][:, drive],
                             variables['velocity'][:, drive], *np.zeros((4, len(time))))
        rows = effect.averaged(means, self.residuals.period, shapes)
        if rows is None:
            return [self.term(effect, drive, shape) for shape in shapes]
        return [Term(effect, drive, shape, {drive: block}) for shape, block
                in zip(shapes, rows, strict=True)]

    def slope_rows(self, term: Term, coefficients: Array) -> dict[int, Array]:
        """Return the derivatives of a term's forces by its shape parameters, (s, M) by drive [N].

        Parameters
        ----------
        term : Term
        coefficients : (k,) array
            By which its rows are multiplied.
        """
        assert term.drive is not None
        assert issubclass(term.effect, DriveEffect)
        slopes: dict[int, list[Array]] = {d: [] for d in term.rows}
        for parameter in term.effect.shape:
            value = term.shape[parameter.name]
            moved = {**term.shape, parameter.name: parameter.moved(value, SHAPE_STEP)}
            after = self.term(term.effect, term.drive, moved)
            for d, rows in term.rows.items():
                change = coefficients @ after.rows[d] * (
                    1.0 if term.course is None else term.course) - coefficients @ rows
                slopes[d].append(change / SHAPE_STEP)
        return {d: np.stack(rows) for d, rows in slopes.items()}

    def present_rows(self, column: PresentParameter) -> dict[int, Array]:
        """Return the rows, (M,) by drive, of what the model's effects may be otherwise."""
        there = next(e for e in self.model.effects if e.name == column.effect.name)
        assert isinstance(there, CatalogueEffect)
        drive = None if column.drive is None else self.drives.index(column.drive)
        values = present_values(there, column.drive)
        moved = column.moved(values, SMALL_STEP)
        before, after = (self.find_term(column.effect, drive, {
            p.name: at[p.name] for p in column.effect.shape}).force(
                there.to_coefficients(at)) for at in (values, moved))
        rows = {d: (after[d] - force) / SMALL_STEP for d, force in before.items()}
        return {d: row for d, row in rows.items() if np.any(row)}


def searched_in_drives(design: Design) -> list[type[DriveEffect]]:
    """Return the effects on drives that the given model may lack."""
    return [effect for effect in catalogue().values() if issubclass(effect, DriveEffect)
            and any(design.acts_on(effect, d) for d in range(len(design.drives)))]


def _rows(column: Array) -> dict[int, Array]:
    return {drive: row for drive, row in enumerate(column) if np.any(row)}
