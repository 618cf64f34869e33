# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Limits of the robot, checked for motions and for forces."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import COUNT, DRIVES
from pprs_dynamics.errors import LimitError, WorkspaceError
from pprs_dynamics.physics.mechanism.evaluation import KernelParameters, evaluate


class DriveLimits(ABC):
    """What D drives can reach and give.

    Class attributes
    ----------------
    effort_source : str
        Where their efforts are limited, for a sentence.

    Attributes
    ----------
    drives : tuple of D str
    position_units, effort_units : tuple of D str
    """

    effort_source = 'limits.effort'

    drives: tuple[str, ...]
    position_units: tuple[str, ...]
    effort_units: tuple[str, ...]

    @property
    @abstractmethod
    def strokes(self) -> tuple[Array, Array]:
        """Lowest and highest position of each drive [m, rad], (D,) each."""

    @property
    @abstractmethod
    def efforts(self) -> Array:
        """Largest absolute effort of each drive [N, N m], (D,)."""

    @abstractmethod
    def with_efforts(self, effort: Sequence[float]) -> Self:
        """Return these limits with the smaller of two limits on every drive's effort."""

    @abstractmethod
    def stroke_source(self, drive: int) -> str:
        """Return where the positions of a drive are limited, for a sentence."""

    def clamped(self, forces: Array) -> Array:
        """Return efforts, (N, D), moved to the limit where they are over it."""
        return np.clip(forces, -self.efforts, self.efforts)

    def allow(self, forces: Array, drive_motion: tuple[Array, ...]) -> bool:
        """Return whether all is finite, and neither a stroke nor an effort is exceeded.

        Parameters
        ----------
        forces : (N, D) array
            [N, N m].
        drive_motion : three (N, D) arrays
            Position, velocity and acceleration.
        """
        lower, upper = self.strokes
        position = drive_motion[0]
        within = (np.abs(forces) <= self.efforts) & (position >= lower) & (position <= upper)
        return bool(within.all() and np.isfinite((forces, *drive_motion)).all())

    def check_strokes(self, positions: Array) -> None:
        """Raise WorkspaceError for the first drive position, (N, D), outside its stroke."""
        lower, upper = self.strokes
        outside = ~((positions >= lower) & (positions <= upper))
        if np.any(outside):
            sample, drive = (int(i) for i in np.argwhere(outside)[0])
            unit = self.position_units[drive]
            raise WorkspaceError(
                sample,
                f'{self.drives[drive]} would have to be at {positions[sample, drive]:.6g} {unit}',
                f'{self.stroke_source(drive)} is [{lower[drive]:g}, {upper[drive]:g}] {unit}')

    def check_efforts(self, forces: Array) -> None:
        """Raise LimitError for the first effort, (N, D), over its limit."""
        over = ~(np.abs(forces) <= self.efforts)
        if np.any(over):
            sample, drive = (int(i) for i in np.argwhere(over)[0])
            raise LimitError(sample, self.drives[drive], float(forces[sample, drive]),
                             float(self.efforts[drive]), self.effort_units[drive],
                             self.effort_source)


@dataclass(frozen=True, eq=False)
class JointLimits(DriveLimits):
    """Ranges and efforts of an arm's joints, as its URDF has them; infinite where it has none.

    Parameters
    ----------
    drives, position_units, effort_units
        See `DriveLimits`.
    lower, upper, effort : (n,) arrays
    """

    effort_source = 'the effort limit of URDF or node'

    drives: tuple[str, ...]
    position_units: tuple[str, ...]
    effort_units: tuple[str, ...]
    lower: Array
    upper: Array
    effort: Array

    @property
    def strokes(self) -> tuple[Array, Array]:
        """Lowest and highest position of each joint [rad, m], (n,) each."""
        return self.lower, self.upper

    @property
    def efforts(self) -> Array:
        """Largest absolute effort of each joint, (n,)."""
        return self.effort

    def with_efforts(self, effort: Sequence[float]) -> JointLimits:
        """Return these limits with the smaller of two limits on every joint's effort."""
        return replace(self, effort=np.minimum(self.effort, effort))

    def stroke_source(self, drive: int) -> str:
        """Return where the positions of a joint are limited, for a sentence."""
        return 'its range in the URDF'


@dataclass(frozen=True)
class Limits(DriveLimits):
    """Strokes, efforts and distances from singularities.

    Parameters
    ----------
    slide_stroke, lift_stroke : (lower, upper)
        Positions that the drives can take [m].
    effort : 6 floats
        Largest absolute force of each drive [N].
    condition_number : float
        Largest condition number of the drive Jacobian, rotations times r.
    rod_sine : float
        Smallest abs(sin u_i); 0 is a horizontal rod, where the inverse kinematics is singular.
    rod_cosine : float
        Smallest abs(cos u_i), for the approach of independent chains only.
    """

    drives = DRIVES
    position_units = ('m',) * COUNT
    effort_units = ('N',) * COUNT

    slide_stroke: tuple[float, float]
    lift_stroke: tuple[float, float]
    effort: tuple[float, float, float, float, float, float]
    condition_number: float
    rod_sine: float
    rod_cosine: float

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Limits:
        """Return the limits in the values of a model, by flat keys."""
        return cls(**{one.name: values[f'limits.{one.name}'] for one in fields(cls)})

    @cached_property
    def strokes(self) -> tuple[Array, Array]:
        """Lowest and highest position of each drive [m], (6,) each."""
        return (np.repeat((self.slide_stroke[0], self.lift_stroke[0]), 3),
                np.repeat((self.slide_stroke[1], self.lift_stroke[1]), 3))

    @cached_property
    def efforts(self) -> Array:
        """Largest absolute force of each drive [N], (6,)."""
        return np.asarray(self.effort, dtype=float)

    def with_efforts(self, effort: Sequence[float]) -> Limits:
        """Return these limits with the smaller of two limits on every drive's force [N]."""
        first, second, third, fourth, fifth, sixth = np.minimum(self.efforts, effort).tolist()
        return replace(self, effort=(first, second, third, fourth, fifth, sixth))

    def stroke_source(self, drive: int) -> str:
        """Return the key that limits the positions of a drive."""
        return f'limits.{"slide_stroke" if drive < 3 else "lift_stroke"}'

    @cached_property
    def _kernel_parameters(self) -> KernelParameters[LimitParameters]:
        lower, upper = (tuple(end.tolist()) for end in self.strokes)
        return KernelParameters(LimitParameters(lower, upper, tuple(self.effort)))

    def allow(self, forces: Array, drive_motion: tuple[Array, ...]) -> bool:
        """Return whether all is finite, and neither a stroke nor an effort is exceeded.

        In a tenth of the time of `check_strokes` and `check_efforts`, which name what is exceeded.

        Parameters
        ----------
        forces : (N, 6) array
            [N].
        drive_motion : three (N, 6) arrays
            Position, velocity and acceleration [m, m/s, m/s^2]; all of it C-contiguous.
        """
        return evaluate(allowed_kernel, self._kernel_parameters, forces, *drive_motion) < 0


class LimitParameters(NamedTuple):
    """Parameters of `allowed_kernel`: ends of the strokes [m] and efforts [N] of all drives."""

    lower: tuple[Any, ...]
    upper: tuple[Any, ...]
    effort: tuple[Any, ...]


def allowed_kernel(
    p: LimitParameters, s: Any, forces: Any, position: Any, velocity: Any, acceleration: Any,
) -> Any:
    """Return whether a sample is allowed."""
    # 0 times infinity or NaN is NaN.
    allowed = 0.0 * forces[s, 0] == 0.0
    for i in range(COUNT):
        force, q = forces[s, i], position[s, i]
        finite = 0.0 * force + 0.0 * velocity[s, i] + 0.0 * acceleration[s, i] == 0.0
        within = (q >= p.lower[i]) & (q <= p.upper[i]) & (abs(force) <= p.effort[i])
        allowed = allowed & finite & within
    return allowed
