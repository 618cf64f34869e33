# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Motion of the platform: poses, twists and classical accelerations, checked once.

Poses that come without velocities and accelerations get those of splines. Orientations are unit
quaternions, made continuous in sign, with a spline through each of their components. Between the
poses its length n is not 1; the orientation is s / n, and omega = 2 Im(s_dot s*) / n^2,
epsilon = 2 Im(s_ddot s*) / n^2 - 2 (s . s_dot) / n^2 omega. No Euler angle wraps, and the ends are
as good as those of the positions: a spline of rotation vectors
(scipy.spatial.transform.RotationSpline) has angular accelerations of its own choice there, and the
first point is the one that is executed.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import MotionError
from pprs_dynamics.physics.mechanism.evaluation import is_ready, run
from pprs_dynamics.physics.mechanism.vectors import rotation_matrix, sqrt

# A quaternion printed with three decimals is still accepted; a Euler triple with a 0 is not.
UNIT_LENGTH_TOLERANCE = 1e-3
FEWEST_POSES = 4
QUINTIC_FROM = 6  # points; below, the splines are cubic
QUANTITIES = ('position', 'orientation', 'linear_velocity', 'angular_velocity',
              'linear_acceleration', 'angular_acceleration')
WIDTHS = [3, 4, 3, 3, 3, 3]
ENDS = [3, 7, 10, 13, 16]  # where the columns of the next begin
FLOAT = np.dtype(np.float64)
MOST_SAMPLES = 10_000_000  # five hours at 500 Hz; more is a mistake in rate or times


def checked_matrix(name: str, value: ArrayLike, width: int, samples: int | None = None) -> Array:
    """Return a finite (N, width) array of floats, or raise MotionError naming the quantity."""
    try:
        array = np.array(value, dtype=float, ndmin=2)
    except (TypeError, ValueError):
        raise MotionError(name, f'{str(value)[:60]!r} was given',
                          f'be an (N, {width}) array of numbers', 'shape') from None
    if array.ndim != 2 or array.shape[1] != width or len(array) == 0:
        raise MotionError(name, f'its shape is {np.shape(value)}',
                          f'be (N, {width}) with N of at least 1', 'shape')
    if samples is not None and len(array) != samples:
        raise MotionError(name, f'it has {len(array)} samples', f'have {samples}, as position',
                          'shape')
    if not np.all(np.isfinite(array)):
        row = int(np.argmax(~np.isfinite(array).all(axis=1)))
        raise MotionError(name, f'sample {row} is {array[row].tolist()}', 'be finite',
                          'finite')
    return array


def normalised(quaternions: Array) -> Array:
    """Return (N, 4) quaternions with length 1, or raise MotionError for one far from it."""
    # hypot-like scaling is not needed: components are finite and a length near 1 is required.
    with np.errstate(over='ignore'):
        length = np.sqrt(np.sum(quaternions * quaternions, axis=1))
    off = np.abs(length - 1) > UNIT_LENGTH_TOLERANCE
    if np.any(off):
        row = int(np.argmax(off))
        raise MotionError('orientation', f'the quaternion of sample {row} has length '
                          f'{length[row]:.6g}', f'be 1 within {UNIT_LENGTH_TOLERANCE:g}',
                          'unit_length')
    unit: Array = quaternions / length[:, None]
    return unit


def checked_times(time: ArrayLike, samples: int) -> Array:
    """Return (N,) finite, strictly increasing times, or raise MotionError."""
    try:
        times = np.array(time, dtype=float, ndmin=1)
    except (TypeError, ValueError):
        raise MotionError('time', f'{str(time)[:60]!r} was given', f'be ({samples},) numbers',
                          'shape') from None
    if times.shape != (samples,):
        raise MotionError('time', f'its shape is {np.shape(time)}',
                          f'be ({samples},), as position', 'shape')
    if samples == 1 and isfinite(times[0]):
        return times  # of a stream's message, where the rest would take longer than the model
    if not np.all(np.isfinite(times)):
        raise MotionError('time', f'sample {int(np.argmax(~np.isfinite(times)))} is not finite',
                          'be finite', 'finite')
    if np.any(np.diff(times) <= 0):
        row = int(np.argmax(np.diff(times) <= 0))
        raise MotionError('time', f'sample {row + 1} at {times[row + 1]:.9g} s follows '
                          f'{times[row]:.9g} s', 'strictly increase', 'time')
    return times


def load_splines() -> None:
    """Load what `spline_derivatives` needs: half a second, that nobody else should wait for."""
    import scipy.interpolate  # noqa: F401


def spline_derivatives(time: Array, place: Array, is_pose: bool) -> tuple[Array, Array]:
    """Return velocities and accelerations of splines through points, at the points.

    Parameters
    ----------
    time : (N,) array
        Strictly increasing times [s], at least four.
    place : (N, D) array
        Positions of drives, or poses: position [m] and unit quaternion x, y, z, w.
    is_pose : bool

    Returns
    -------
    velocity, acceleration : (N, D) arrays
        Of poses (N, 6), linear, then angular, in `base`; NaN throughout where points are so far
        apart that no spline can be computed.

    Raises
    ------
    MotionError
        For points or times that are none, or fewer than four poses.
    """
    if is_pose:
        knots, places, turns = checked_poses(time, place[:, :3], place[:, 3:])
        rows = spline_rows(knots, places, turns, knots)
        return rows[:, 7:13], rows[:, 13:]
    places = checked_matrix('position', place, place.shape[1])
    knots = checked_times(time, len(places))
    _, velocity, acceleration = spline_through(knots, places, knots)
    return velocity, acceleration


def checked_poses(
    time: ArrayLike, position: ArrayLike, orientation: ArrayLike,
) -> tuple[Array, Array, Array]:
    """Return times, positions and unit quaternions of poses that a spline can go through.

    Raises
    ------
    MotionError
        For poses or times that are none, or fewer than four.
    """
    places = checked_matrix('position', position, 3)
    turns = normalised(checked_matrix('orientation', orientation, 4, len(places)))
    knots = checked_times(time, len(places))
    if len(knots) < FEWEST_POSES:
        raise MotionError('poses', f'{len(knots)} were given', f'be at least {FEWEST_POSES} for '
                          'velocities and accelerations', 'shape')
    return knots, places, turns


def spline_rows(knots: Array, position: Array, orientation: Array, at: Array) -> Array:
    """Return poses, velocities and accelerations of splines at any times, (K, 19).

    Quintic from six poses on, below that cubic.

    Parameters
    ----------
    knots : (N,) array
        Strictly increasing times of the poses [s].
    position : (N, 3) array
        [m].
    orientation : (N, 4) array
        Unit quaternions x, y, z, w.
    at : (K,) array
        [s].

    Returns
    -------
    (K, 19) array
        Columns of `PlatformMotion.rows`.

    NaN throughout where poses or times are so far apart that no spline can be computed.
    """
    place, first, second = spline_through(
        knots, np.hstack((position, _continuous(orientation))), at)
    s = place[:, 3:]
    with np.errstate(all='ignore'):
        square = np.sum(s * s, axis=1, keepdims=True)
        omega = 2 * _vector_part(first[:, 3:], s) / square
        growth = 2 * np.sum(s * first[:, 3:], axis=1, keepdims=True) / square
        epsilon = 2 * _vector_part(second[:, 3:], s) / square - growth * omega
        return np.hstack((place[:, :3], s / np.sqrt(square), first[:, :3], omega,
                          second[:, :3], epsilon))


def spline_through(knots: Array, values: Array, at: Array) -> tuple[Array, Array, Array]:
    """Return values, first and second derivatives of splines at any times, (K, D) each.

    Parameters
    ----------
    knots : (N,) array
        Strictly increasing times [s].
    values : (N, D) array
    at : (K,) array
        [s].

    NaN throughout where values or times are so far apart that no spline can be computed.
    """
    from scipy.interpolate import make_interp_spline

    try:
        with np.errstate(all='ignore'):
            spline = make_interp_spline(knots, values, k=5 if len(knots) >= QUINTIC_FROM else 3)
            return spline(at), spline.derivative(1)(at), spline.derivative(2)(at)
    except (ValueError, ArithmeticError, np.linalg.LinAlgError):
        unknown = np.full((len(at), values.shape[1]), np.nan)
        return unknown, unknown, unknown


def _continuous(quaternion: Array) -> Array:
    """Return quaternions with signs chosen such that neighbours are near each other."""
    turned = np.sum(quaternion[1:] * quaternion[:-1], axis=1) < 0
    signs = np.concatenate(([1.0], np.cumprod(np.where(turned, -1.0, 1.0))))
    return quaternion * signs[:, None]


def _vector_part(a: Array, b: Array) -> Array:
    """Return the vector part of quaternion a times the conjugate of b, (N, 3)."""
    return b[:, 3:] * a[:, :3] - a[:, 3:] * b[:, :3] - np.cross(a[:, :3], b[:, :3])


def _columns(first: int, end: int, description: str) -> cached_property[Array]:
    """Return a property of a motion that holds columns of its rows."""
    columns = cached_property(lambda motion: np.ascontiguousarray(motion.rows[:, first:end]))
    columns.__doc__ = description
    return columns


class PlatformMotion:
    """N samples of the motion of the platform's origin o, everything in `base`. Not changeable.

    Parameters
    ----------
    position : (N, 3) array_like
        P [m].
    orientation : (N, 4) array_like
        Unit quaternions x, y, z, w; normalised when their length is within 1e-3 of 1.
    linear_velocity, angular_velocity : (N, 3) array_like
        v of o [m/s] and omega [rad/s].
    linear_acceleration, angular_acceleration : (N, 3) array_like
        Classical acceleration a_o of o [m/s^2] and epsilon [rad/s^2].
    time : (N,) array_like, optional
        Strictly increasing times [s]; needed by effects with memory.

    Attributes
    ----------
    rows : (N, 19) array
        All of it but the times, in the order of the parameters: what kernels take.

    Raises
    ------
    MotionError
        For a wrong shape, a non-finite number, a quaternion off unit length, or times that do
        not strictly increase.
    """

    rows: Array
    time: Array | None = None

    def __init__(
        self, position: ArrayLike, orientation: ArrayLike, linear_velocity: ArrayLike,
        angular_velocity: ArrayLike, linear_acceleration: ArrayLike,
        angular_acceleration: ArrayLike, time: ArrayLike | None = None,
    ) -> None:
        columns = (position, orientation, linear_velocity, angular_velocity, linear_acceleration,
                   angular_acceleration)
        rows = _joined(columns)
        if rows is None or not _is_finite_and_unit(rows):
            rows = _checked(columns)
        self.__dict__['rows'] = rows
        if time is not None:
            self.__dict__['time'] = checked_times(time, len(rows))

    @classmethod
    def _of(cls, rows: Array, time: ArrayLike | None) -> PlatformMotion:
        """Return the motion of rows that are known to be right."""
        motion = object.__new__(cls)
        motion.__dict__['rows'] = rows
        motion.__dict__['time'] = None if time is None else checked_times(time, len(rows))
        return motion

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f'a PlatformMotion cannot be changed: {name} was to be set')

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, index: Any) -> PlatformMotion:
        """Return the samples that `index` (slice, mask or indices) selects."""
        if isinstance(index, (int, np.integer)):
            index = range(len(self))[index]  # raises IndexError, and ends a loop
            index = slice(index, index + 1)
        rows = np.array(self.rows[index])
        if not len(rows):
            raise MotionError('position', f'its shape is {(0, 3)}',
                              'be (N, 3) with N of at least 1', 'shape')
        return PlatformMotion._of(rows, None if self.time is None else self.time[index])

    position = _columns(0, 3, 'P [m], (N, 3).')
    orientation = _columns(3, 7, 'Unit quaternions x, y, z, w, (N, 4).')
    linear_velocity = _columns(7, 10, 'Velocity v of o [m/s], (N, 3).')
    angular_velocity = _columns(10, 13, 'Angular velocity omega [rad/s], (N, 3).')
    linear_acceleration = _columns(13, 16, 'Acceleration a_o of o [m/s^2], (N, 3).')
    angular_acceleration = _columns(16, 19, 'Angular acceleration epsilon [rad/s^2], (N, 3).')

    def is_closed(self) -> bool:
        """Return whether it ends within 1 mm and 1 mrad of where it starts."""
        ends = self.orientation[[0, -1]]
        moved = np.linalg.norm(self.position[-1] - self.position[0])
        turned = 2 * np.arccos(min(abs(float(ends[0] @ ends[1])), 1.0))
        return bool(moved < 1e-3 and turned < 1e-3)

    def with_time(self, time: ArrayLike) -> PlatformMotion:
        """Return the motion with other times [s]."""
        return PlatformMotion._of(self.rows, time)

    def resampled(self, rate: float) -> PlatformMotion:
        """Return the motion at a constant rate.

        Where the samples already have that rate they stay as they are, twists included; else a
        spline through the poses is evaluated, see `from_poses`.

        Parameters
        ----------
        rate : float
            [Hz].
        """
        if self.time is None:
            raise MotionError('time', 'it is absent', 'be known to resample', 'time')
        if not 0 < rate * (self.time[-1] - self.time[0]) < MOST_SAMPLES:
            raise MotionError('rate', f'{rate:g} Hz over {self.time[-1] - self.time[0]:g} s',
                              f'give between 1 and {MOST_SAMPLES:g} samples', 'shape')
        if len(self) > 1 and np.allclose(np.diff(self.time) * rate, 1.0, rtol=0, atol=1e-6):
            return self
        # The last pose belongs to the motion even where rounding puts it just past the grid.
        count = int((self.time[-1] - self.time[0]) * rate + 1e-9) + 1
        grid = self.time[0] + np.arange(count) / rate
        return PlatformMotion.from_poses(
            self.time, self.position, self.orientation, at=grid).with_time(grid)

    @cached_property
    def rotation(self) -> Array:
        """Rotation matrices from `platform` to `base`, (N, 3, 3)."""
        return rotation_matrix(*self.orientation.T)

    @property
    def tilt(self) -> Array:
        """Angle between the platform's normal and the vertical [rad], (N,)."""
        x, y, z, w = self.orientation.T
        tilt: Array = 2 * np.arctan2(np.hypot(x, y), np.hypot(z, w))
        return tilt

    @property
    def turn(self) -> Array:
        """Rotation about the vertical that remains without the tilt [rad], (N,)."""
        _, _, z, w = self.orientation.T
        turn: Array = 2 * np.arctan2(z * np.where(w < 0, -1.0, 1.0), np.abs(w))
        return turn

    @classmethod
    def from_rows(cls, rows: Array, time: ArrayLike | None = None) -> PlatformMotion:
        """Return the motion in a table such as `rows`, an (N, 19) array of floats."""
        checked = np.array(rows)
        if not len(rows) or not _is_finite_and_unit(checked):
            # The constructor raises the specific error.
            P, q, v, omega, a, epsilon = np.split(rows, ENDS, axis=1)
            return cls(P, q, v, omega, a, epsilon, time)
        return cls._of(checked, time)

    @classmethod
    def at_rest(cls, position: ArrayLike, orientation: ArrayLike | None = None) -> PlatformMotion:
        """Return poses held still.

        Parameters
        ----------
        position : (N, 3) or (3,) array_like
            P [m].
        orientation : (N, 4) array_like, optional
            Unit quaternions x, y, z, w; unturned by default.
        """
        position = checked_matrix('position', position, 3)
        zero = np.zeros_like(position)
        if orientation is None:
            orientation = np.broadcast_to((0.0, 0.0, 0.0, 1.0), (len(position), 4))
        return cls(position, orientation, zero, zero, zero, zero)

    def held(self) -> PlatformMotion:
        """Return the last pose, at rest, at time 0."""
        return PlatformMotion.at_rest(self.position[-1:], self.orientation[-1:]).with_time([0.0])

    @classmethod
    def from_poses(
        cls, time: ArrayLike, position: ArrayLike, orientation: ArrayLike,
        at: ArrayLike | None = None,
    ) -> PlatformMotion:
        """Return the motion of a spline through poses, differentiated analytically.

        See the head of this module: angular velocity and acceleration are continuous, no Euler
        angle wraps, and the ends are as good as the middle.

        Parameters
        ----------
        time : (N,) array_like
            Strictly increasing times [s], at least four.
        position : (N, 3) array_like
        orientation : (N, 4) array_like
        at : (K,) array_like, optional
            Times at which to evaluate [s], in any order; the poses' own by default. The result
            carries times only without it.
        """
        knots, places, turns = checked_poses(time, position, orientation)
        moments = knots if at is None else np.asarray(at, dtype=float)
        if not np.all(np.isfinite(moments)):
            raise MotionError('at', 'a time is not finite', 'be finite', 'finite')
        rows = spline_rows(knots, places, turns, moments)
        return cls.from_rows(rows, knots if at is None else None)


def _joined(columns: Sequence[Any]) -> Array | None:
    """Return columns as one table where they are floats of the right shapes, else None."""
    P, q, v, omega, a, epsilon = columns
    try:
        # Written out: a comparison of lists takes twice as long.
        right = (P.shape[1] == v.shape[1] == omega.shape[1] == a.shape[1] == epsilon.shape[1] == 3
                 and q.shape[1] == 4)
        rows = np.concatenate(columns, 1)
    except (AttributeError, IndexError, ValueError):
        return None
    right = right and type(rows) is np.ndarray and rows.dtype is FLOAT and len(rows) > 0
    return rows if right else None


def _is_finite_and_unit(rows: Array) -> bool:
    """Normalise quaternions in place; return False where `_checked` is to look at the rows.

    Nothing is compiled or loaded for that alone.
    """
    return is_ready(_normalise) and bool(run(_normalise, rows))


def _normalise(rows: Any) -> bool:
    for s in range(len(rows)):
        x, y, z, w = rows[s, 3], rows[s, 4], rows[s, 5], rows[s, 6]
        length = sqrt(x * x + y * y + z * z + w * w)
        rows[s, 3], rows[s, 4] = x / length, y / length
        rows[s, 5], rows[s, 6] = z / length, w / length
        everything = length
        for c in range(3):
            everything = everything + rows[s, c]
        for c in range(7, rows.shape[1]):
            everything = everything + rows[s, c]
        # 0 times infinity or NaN is NaN.
        if not (abs(length - 1.0) <= UNIT_LENGTH_TOLERANCE and everything * 0.0 == 0.0):
            return False
    return True


def _checked(columns: Sequence[ArrayLike]) -> Array:
    """Return columns as one table, or raise MotionError."""
    samples: int | None = None
    arrays = []
    for name, value, width in zip(QUANTITIES, columns, WIDTHS, strict=True):
        arrays.append(checked_matrix(name, value, width, samples))
        samples = len(arrays[0])
    arrays[1] = normalised(arrays[1])
    return np.concatenate(arrays, axis=1)
