# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Nuisance columns: the uncertainty of the form of an effect, in proportion to its force.

Friction turns over at reversals in a width that nobody knows. Real effects depart from the
catalogue's forms in ways that the effect declares (`DriveEffect.deviations`). Friction may also be
off by waves over position and velocity. Each gives a column whose coefficient has unit prior. They
are as the drive feels them: behind its sensor they would follow a delay that is none, and make good
what it does to the forces.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.sensitivities import (
    DRIVE_WIDTHS,
    passive_reversal_columns,
    reversal_columns,
)
from pprs_dynamics.inference.regression.terms import FullRate, Term
from pprs_dynamics.inference.residuals.reconstruction import treated_forces
from pprs_dynamics.measurement.motion.treatment import Treatment
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, MeasurementEffect
from pprs_dynamics.physics.effects.structure_effect import PassiveJointEffect

# Share of the top speed within which added dry friction may turn over, whatever the model's width:
# presliding takes micrometres, which at usual accelerations are some mm/s.
TURNS_OVER = 0.002
# Half waves, from one on, of a form error over the stroke and over the velocities. With 8 and 4 as
# many of 24 hidden forms that are 5 to 15 % off were found, in twice the time.
POSITION_WAVES, VELOCITY_WAVES = 6, 3
TINY = 1e-12  # [m, rad], [m/s, rad/s]: of a drive that does not move


def reversal_rows(design: Design, term: Term, units: Array) -> Array:
    """Return changes of a term's friction by other widths of reversal, (u, w, M) [N].

    None, (u, 0, M), for an effect that is no friction.

    Parameters
    ----------
    design : Design
    term : Term
    units : (u, k) array
        Sets of coefficients by which its rows are multiplied.
    """
    if (friction := _friction_of_drive(term)) is None:
        return np.zeros((len(units), 0, len(design.residuals)))
    effect, d = friction
    width = design.model.reversal.widths(len(design.drives))[d]
    slowest = max(width, TURNS_OVER * design.covered[d].top_speed)
    widths = np.array([factor * (width if factor < 1 else slowest) for factor in DRIVE_WIDTHS])

    def rows(recording: FullRate) -> list[Array]:
        samples = recording.samples(slice(None), d)
        forward, backward, still = (units @ recording.columns(effect, d, term.shape, sign)
                                    for sign in (1.0, -1.0, 0.0))
        return reversal_columns(
            (forward - backward) / 2, samples.velocity, samples.direction, widths,
            (forward + backward) / 2 - still)

    return _treated(design, len(units), rows)


def deviation_rows(design: Design, term: Term, units: Array) -> Array:
    """Return departures of real forms from a term's law, (u, w, M) [N].

    See `reversal_rows`.
    """
    effect = term.effect
    if term.drive is None or not issubclass(effect, DriveEffect):
        return np.zeros((len(units), 0, len(design.residuals)))
    d = term.drive
    if issubclass(effect, MeasurementEffect):
        def read(recording: FullRate) -> list[Array]:
            parts = [np.stack(effect.sensor_deviations(design.measured(
                recording.effort[None, part, d], recording, part, d, effect)[0],
                recording.samples(part, d), **term.shape)) for part in recording.segments]
            return [np.tile(row, (len(units), 1)) for row in np.concatenate(parts, axis=1)]

        two = design.recordings[0].samples(slice(2), d)
        has_any = effect.sensor_deviations(two.velocity, two, **term.shape)
        return (_treated(design, len(units), read) if has_any
                else np.zeros((len(units), 0, len(design.residuals))))

    return _treated(design, len(units), lambda recording: [
        units @ np.stack(deviation)
        for deviation in effect.deviations(recording.samples(slice(None), d), **term.shape)])


def form_rows(design: Design, term: Term, units: Array, share: float) -> Array:
    """Return a friction's force times waves over position and velocity, (u, w, M) [N].

    None for what is no friction: springs and counterbalances with waves over the position are any
    force over it, and explained weights.

    Parameters
    ----------
    design : Design
    term : Term
    units : (u, k) array
        See `reversal_rows`.
    share : float
        All waves together over the force, both rms.
    """
    if (friction := _friction_of_drive(term)) is None:
        return np.zeros((len(units), 0, len(design.residuals)))
    effect, d = friction

    def rows(recording: FullRate) -> list[Array]:
        force = share * units @ recording.columns(effect, d, term.shape)
        return [force * wave for wave in _form_waves(design, recording, d)]

    return _treated(design, len(units), rows)


def _friction_of_drive(term: Term) -> tuple[type[DriveEffect], int] | None:
    """Return a friction in a drive, and which drive; None for any other effect."""
    if term.drive is None or not (
            term.effect.is_friction and issubclass(term.effect, DriveEffect)):
        return None
    return term.effect, term.drive


def _form_waves(design: Design, recording: FullRate, d: int) -> list[Array]:
    """Return waves over position and velocity of a drive, (N,) each, together of rms 1."""
    covered = design.covered[d]
    along = (recording.position[:, d] - covered.middle) / max(covered.stroke, TINY) + 0.5
    speed = (recording.velocity[:, d] / max(covered.top_speed, TINY) + 1) / 2
    size = np.sqrt(2 / (POSITION_WAVES + VELOCITY_WAVES))
    return [size * np.cos(np.pi * number * values) for values, count in (
        (along, POSITION_WAVES), (speed, VELOCITY_WAVES)) for number in range(1, count + 1)]


def _treated(design: Design, count: int, rows: Callable[[FullRate], Sequence[Array]]) -> Array:
    """Return w rows for each of `count` units, (u, N) of a recording, treated, (u, w, M)."""
    def flat(recording: FullRate) -> Array:
        found = rows(recording)
        return np.reshape(found, (len(found) * count, len(recording.time)))

    treated = design.treated(flat)
    return treated.reshape(len(treated) // count, count, treated.shape[1]).swapaxes(0, 1)


def joint_reversal_rows(design: Design, term: Term, names: Sequence[str]) -> dict[int, Array]:
    """Return changes of passive friction by other widths of reversal, by drive.

    By units of coefficients k and widths w, (k, w, M) [N] each; {} for what is no such friction.
    """
    effect, model = term.effect, design.model
    if not (effect.is_friction and issubclass(effect, PassiveJointEffect)):
        return {}
    units = [effect.at({name: 1.0}) for name in names]
    sensors = [effect for effect in model.effects if isinstance(effect, MeasurementEffect)]

    def rows(forces: Any, treat: Treatment) -> dict[str, Array]:
        state = forces.mechanism
        columns = np.stack([passive_reversal_columns(unit, state) for unit in units])
        for sensor in sensors:
            columns = np.stack([[sensor.measured(column, state) for column in columns_of]
                                for columns_of in columns])
        return {'rows': treat(columns.transpose(2, 0, 1, 3))}

    stacked = np.concatenate([
        treated_forces(model, reconstruction, more=rows)['rows']
        * reconstruction.recorded_share(model)
        for reconstruction in design.reconstructed(model)]).transpose(3, 1, 2, 0)
    return {d: rows for d, rows in enumerate(stacked) if np.any(rows)}
