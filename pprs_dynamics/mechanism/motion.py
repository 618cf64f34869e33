"""Motion of the platform: poses, twists and classical accelerations, checked once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from pprs_dynamics.errors import MotionError
from pprs_dynamics.mechanism.robot import Array

if TYPE_CHECKING:
    from typing import Any

# A quaternion printed with three decimals is still accepted; a Euler triple with a 0 is not.
UNIT_LENGTH_TOLERANCE = 1e-3
MOST_SAMPLES = 10_000_000  # five hours at 500 Hz; more is a mistake in rate or times


@dataclass(frozen=True, init=False, eq=False)
class PlatformMotion:
    """N samples of the motion of the platform's origin o, everything in `base`.

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

    Raises
    ------
    MotionError
        For a wrong shape, a non-finite number, a quaternion off unit length, or times that do
        not strictly increase.
    """

    position: Array
    orientation: Array
    linear_velocity: Array
    angular_velocity: Array
    linear_acceleration: Array
    angular_acceleration: Array
    time: Array | None = None

    def __init__(
        self, position: ArrayLike, orientation: ArrayLike, linear_velocity: ArrayLike,
        angular_velocity: ArrayLike, linear_acceleration: ArrayLike,
        angular_acceleration: ArrayLike, time: ArrayLike | None = None,
    ) -> None:
        columns = {
            'position': (position, 3), 'orientation': (orientation, 4),
            'linear_velocity': (linear_velocity, 3), 'angular_velocity': (angular_velocity, 3),
            'linear_acceleration': (linear_acceleration, 3),
            'angular_acceleration': (angular_acceleration, 3)}
        samples: int | None = None
        for name, (value, width) in columns.items():
            array = checked_matrix(name, value, width, samples)
            samples = len(array)
            object.__setattr__(self, name, array)
        object.__setattr__(self, 'orientation', _normalised(self.orientation))
        object.__setattr__(self, 'time', None if time is None else _times(time, len(self)))

    def __len__(self) -> int:
        return len(self.position)

    def __getitem__(self, index: Any) -> PlatformMotion:
        """Return the samples that `index` (slice, mask or indices) selects."""
        if isinstance(index, (int, np.integer)):
            index = range(len(self))[index]  # raises IndexError, and ends a loop
            index = slice(index, index + 1)
        return PlatformMotion(
            self.position[index], self.orientation[index], self.linear_velocity[index],
            self.angular_velocity[index], self.linear_acceleration[index],
            self.angular_acceleration[index], None if self.time is None else self.time[index])

    def is_closed(self) -> bool:
        """Return whether it ends within 1 mm and 1 mrad of where it starts."""
        ends = self.orientation[[0, -1]]
        moved = np.linalg.norm(self.position[-1] - self.position[0])
        turned = 2 * np.arccos(min(abs(float(ends[0] @ ends[1])), 1.0))
        return bool(moved < 1e-3 and turned < 1e-3)

    def with_time(self, time: ArrayLike) -> PlatformMotion:
        """Return the same motion with other times [s]."""
        return PlatformMotion(
            self.position, self.orientation, self.linear_velocity, self.angular_velocity,
            self.linear_acceleration, self.angular_acceleration, time)

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
        x, y, z, w = self.orientation.T
        return np.stack((
            1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w),
            2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
            2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y),
        ), axis=-1).reshape(-1, 3, 3)

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

    @classmethod
    def from_poses(
        cls, time: ArrayLike, position: ArrayLike, orientation: ArrayLike,
        at: ArrayLike | None = None,
    ) -> PlatformMotion:
        """Return the motion of a spline through poses, differentiated analytically.

        Positions by a quintic spline (cubic below six poses), orientations by a cubic spline of
        rotation vectors on SO(3), so that angular velocity and acceleration are continuous and
        no Euler angle wraps.

        Parameters
        ----------
        time : (N,) array_like
            Strictly increasing times [s], at least four.
        position : (N, 3) array_like
        orientation : (N, 4) array_like
        at : (K,) array_like, optional
            Times at which to evaluate [s], in any order; the poses' own by default. The result
            carries times only without it.

        References
        ----------
        scipy.interpolate.make_interp_spline, scipy.spatial.transform.RotationSpline.
        """
        from scipy.interpolate import make_interp_spline
        from scipy.spatial.transform import Rotation, RotationSpline

        position = checked_matrix('position', position, 3)
        orientation = _normalised(checked_matrix('orientation', orientation, 4, len(position)))
        knots = _times(time, len(position))
        if len(knots) < 4:
            raise MotionError('poses', f'{len(knots)} were given',
                              'be at least four for velocities and accelerations', 'shape')
        moments = knots if at is None else np.asarray(at, dtype=float)
        if not np.all(np.isfinite(moments)):
            raise MotionError('at', 'a time is not finite', 'be finite', 'finite')
        path = make_interp_spline(knots, position, k=5 if len(knots) >= 6 else 3)
        turn = RotationSpline(knots, Rotation.from_quat(orientation))
        rotation = turn(moments)
        # The spline's rates are in the turning frame; omega and its derivative turn alike.
        return cls(
            path(moments), rotation.as_quat(), path.derivative(1)(moments),
            rotation.apply(turn(moments, 1)), path.derivative(2)(moments),
            rotation.apply(turn(moments, 2)), knots if at is None else None)


def checked_matrix(
    name: str, value: ArrayLike, width: int, samples: int | None = None,
) -> Array:
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


def _normalised(quaternions: Array) -> Array:
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


def _times(time: ArrayLike, samples: int) -> Array:
    try:
        times = np.array(time, dtype=float, ndmin=1)
    except (TypeError, ValueError):
        raise MotionError('time', f'{str(time)[:60]!r} was given', f'be ({samples},) numbers',
                          'shape') from None
    if times.shape != (samples,):
        raise MotionError('time', f'its shape is {np.shape(time)}', f'be ({samples},), as position',
                          'shape')
    if not np.all(np.isfinite(times)):
        raise MotionError('time', f'sample {int(np.argmax(~np.isfinite(times)))} is not finite',
                          'be finite', 'finite')
    if np.any(np.diff(times) <= 0):
        row = int(np.argmax(np.diff(times) <= 0))
        raise MotionError('time', f'sample {row + 1} at {times[row + 1]:.9g} s follows '
                          f'{times[row]:.9g} s', 'strictly increase', 'time')
    return times
