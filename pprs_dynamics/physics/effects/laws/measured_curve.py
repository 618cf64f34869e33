# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A measured curve: a drive's force over one variable that no law of the catalogue explains.

It is a correction table, as cogging maps and cable forces are compensated in practice: no cause,
and nothing outside the range in which it was measured. The curve is a cubic B-spline with uniform
knots (de Boor, A Practical Guide to Splines, 1978), periodic where the joint turns; beyond its
range it goes on with its last value.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import MISSING, ModelError, UnknownNameError
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveSamples
from pprs_dynamics.physics.mechanism.state import MechanismState

OWN = ('position', 'velocity', 'acceleration', 'load')  # of the drive itself
OF = ('position', 'velocity')  # of another drive: 'position of lift_1'
DEGREE = 3
LEAST, MOST = 1 + DEGREE, 400 + DEGREE  # coefficients of B-splines


class Curve(NamedTuple):
    """One drive's curve.

    Parameters
    ----------
    variable : str
        One of `OWN`, or 'position of DRIVE', 'velocity of DRIVE'.
    start, end : float
        Range in which it was measured, in the variable's unit.
    values : tuple of float
        Coefficients of the B-splines [N, N m]: one per interval where it is periodic, else three
        more.
    periodic : bool
        Whether the end joins the start.
    """

    variable: str
    start: float
    end: float
    values: tuple[float, ...]
    periodic: bool = False

    def basis(self, x: Array) -> Any:
        """Return the B-splines at values of the variable, (N, len(values)), sparse."""
        intervals = len(self.values) - (0 if self.periodic else DEGREE)
        return spline_basis(x, self.start, self.end, intervals, self.periodic)

    def force(self, x: Array) -> Array:
        """Return the force at values of the variable, (N,) [N, N m]."""
        force: Array = self.basis(x) @ np.asarray(self.values)
        return force


def spline_basis(x: Array, start: float, end: float, intervals: int, periodic: bool) -> Any:
    """Return cubic B-splines at x, a sparse matrix (N, intervals + 3), or (N, intervals).

    Parameters
    ----------
    x : (N,) array
    start, end : float
        Outermost knots; x beyond them counts as on them, or joins on the other side.
    intervals : int
        Between the knots.
    periodic : bool
    """
    # Imported here: few models have a curve, and the import takes 0.3 s.
    from scipy.interpolate import BSpline
    from scipy.sparse import eye_array

    u = (x - start) / (end - start) * intervals
    u = np.mod(u, intervals) if periodic else np.clip(u, 0.0, intervals)
    count = intervals + DEGREE
    basis = BSpline.design_matrix(u, np.arange(-DEGREE, count + 1.0), DEGREE)
    return basis @ eye_array(intervals).tocsr()[np.arange(count) % intervals] if periodic else basis


class MeasuredCurve(DriveEffect):
    """A drive's force over one variable, as it was measured: a table, not a cause.

    Equation
    --------
    f(x), a cubic B-spline over position, velocity, acceleration, load, or position or velocity
    of another drive

    Symptom
    -------
    Whatever no other effect explains, as long as it depends on one variable.

    Causes
    ------
    Unknown: a cogging map, a cable that pulls, a bent screw and a belt stage look like this.

    Confirmation
    ------------
    A second recording along another motion must fall by it as well.

    References
    ----------
    De Boor, A Practical Guide to Splines, Springer, 1978.
    """

    name = 'measured_curve'
    linear = ()
    variants = ((),)

    def __init__(self, drives: Mapping[str, Mapping[str, Any]]) -> None:
        super().__init__(drives)
        self.curves = {drive: Curve(*(values[key] for key in RULES))
                       for drive, values in drives.items()}

    @classmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return none: a curve is adopted as a whole, not scaled."""
        return ()

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return the curves' forces [N, N m], (N, D)."""
        force = np.zeros_like(state.velocity)
        for drive, curve in self.curves.items():
            force[:, state.drives.index(drive)] = curve.force(
                variable_of(state, drive, curve.variable))
        return force

    def left(self, state: MechanismState) -> str | None:
        """Return the sentence that a state is outside the measured range, or None."""
        for drive, curve in self.curves.items():
            x = variable_of(state, drive, curve.variable)
            outside = (x < curve.start) | (x > curve.end)
            if np.any(outside) and not curve.periodic:
                value = float(x[int(np.argmax(outside))])
                return (f'{drive}: {curve.variable} {value:.4g} is outside of '
                        f'{curve.start:.4g} to {curve.end:.4g}, where its curve was measured: '
                        'the curve goes on with its last value')
        return None

    @classmethod
    def _checked(cls, prefix: str, values: Mapping[str, Any], complete: bool,
                 turns: bool = False) -> dict[str, Any]:
        for key, value in values.items():
            if key not in RULES:
                raise UnknownNameError('key', f'{prefix}.{key}',
                                       [f'{prefix}.{known}' for known in RULES])
            is_right, rule = RULES[key]
            if not is_right(value):
                raise ModelError(f'{prefix}.{key}', value, rule)
        found = {'periodic': False, **values}
        missing = [key for key in RULES if key not in found]
        if missing and complete:
            raise ModelError(f'{prefix}.{missing[0]}', MISSING, 'be given')
        if not found.get('from', -math.inf) < found.get('to', math.inf):
            raise ModelError(f'{prefix}.to', found['to'],
                             f'be greater than from, {found["from"]:g}')
        return found


def variable_of(state: MechanismState, drive: str, variable: str) -> Array:
    """Return the variable of a drive's curve at all samples, (N,)."""
    name, _, other = variable.partition(' of ')
    column = state.drives.index(other or drive)
    values: Array = getattr(state, 'friction_load' if name == 'load' else name)[:, column]
    return values


def check_variable(key: str, variable: Any, drives: Sequence[str]) -> str:
    """Return a variable that a curve may have, or raise ModelError."""
    is_right, rule = RULES['variable']
    if not is_right(variable):
        raise ModelError(key, variable, rule)
    if (other := variable.partition(' of ')[2]) and other not in drives:
        raise UnknownNameError('drive', other, drives, key)
    return str(variable)


def _is_variable(value: Any) -> bool:
    name, of, drive = value.partition(' of ') if isinstance(value, str) else ('', '', '')
    return bool(name in OF and drive) if of else name in OWN


def _is_number(value: Any) -> bool:
    return (isinstance(value, (int, float)) and not isinstance(value, bool)
            and math.isfinite(value))


def _are_values(value: Any) -> bool:
    return (isinstance(value, (list, tuple)) and LEAST <= len(value) <= MOST
            and all(map(_is_number, value)))


# Whether a value of a key is right, and what it must be, in the order of `Curve`.
RULES: dict[str, tuple[Callable[[Any], bool], str]] = {
    'variable': (_is_variable, f'be one of {", ".join(OWN)}, or '
                 + ' or '.join(f'{name} of DRIVE' for name in OF)),
    'from': (_is_number, 'be a finite number'),
    'to': (_is_number, 'be a finite number'),
    'values': (_are_values, f'be a list of {LEAST} to {MOST} finite numbers, coefficients of '
               'B-splines'),
    'periodic': (lambda value: isinstance(value, bool), 'be true or false')}
