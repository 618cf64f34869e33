# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The drives' electronics: PD loop, feedforward, limits, and the timeout of commands."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import WorkspaceError
from pprs_dynamics.physics.mechanism.joint_motion import DrivePath
from pprs_dynamics.physics.model.forces import DriveLimits

# [m, m/s, N, ...]: no drive's; with more, products with gains would overflow, and differences of
# what overflowed are no numbers.
LARGEST = 1e9

# What was due longer ago [s] tells nothing of the present by its velocity.
LONGEST_LATE = 0.1

NoteCode = Literal['HOLD', 'REFUSED', 'SATURATED', 'STOPPED']


@dataclass(frozen=True)
class ControlSettings:
    """Gains and behaviour of the drives' control.

    Parameters
    ----------
    stiffness, damping : float or (D,) array
        Gains of position [N/m] and velocity [N s/m]. The defaults give about 7 Hz and a damping
        ratio of 0.9 for the 1.5 to 2 kg that a drive of the paper's robot moves. An unknown
        force of 1 N then costs a quarter of a millimetre, as on a real machine of this size.
    gravity_compensation : bool
        Add the efforts that hold the model's weight at the setpoint.
    command_timeout : float
        Without a command for this long, the drives hold where they are [s].
    actuation_delay : float
        From the electronics' effort to the drive's [s].
    """

    stiffness: float | Array = 4000.0
    damping: float | Array = 150.0
    gravity_compensation: bool = False
    command_timeout: float = 0.1
    actuation_delay: float = 0.0


@dataclass(frozen=True, eq=False)
class Setpoint:
    """Setpoint of one command; arrays (D,) in drive order.

    Parameters
    ----------
    position, velocity : arrays, optional
        Of the PD loop [m, m/s]; both None for efforts alone.
    effort : array, optional
        Feedforward, or the effort itself [N, N m]; None for none.
    """

    position: Array | None = None
    velocity: Array | None = None
    effort: Array | None = None


@dataclass(frozen=True)
class Note:
    """A message of the robot."""

    time: float
    code: NoteCode
    message: str


class DriveControl:
    """From commands and measurements to the efforts of the drives.

    Parameters
    ----------
    limits : DriveLimits
    weight : callable
        Drive positions (D,) -> efforts that hold the robot still there.
    settings : ControlSettings
    step : float
        Time between two calls of `effort` [s].
    position : (D,) array
        As measured, where the drives hold at first [m, rad].
    smoothing : float
        Share of a change that measured velocities show after one step: 1 for tachometers, less
        for differentiated positions behind a first-order low-pass.

    Attributes
    ----------
    holding : bool
        True where no command is followed.
    notes : list of Note
        One for every change for the worse, not one for every step.
    """

    def __init__(self, limits: DriveLimits, weight: Callable[[Array], Array],
                 settings: ControlSettings, step: float, position: Array,
                 smoothing: float = 1.0) -> None:
        self.settings, self._limits, self._weight = settings, limits, weight
        self._smoothing = smoothing
        self._delay_line: deque[Array] = deque(maxlen=1 + round(settings.actuation_delay / step))
        self.notes: list[Note] = []
        self._at_limit = np.zeros(len(position), dtype=bool)
        self._nothing = np.zeros_like(position)
        self._wanted_speed: tuple[Array, Array] | None = None
        self._hold(position)

    def command(self, now: float, setpoint: Setpoint, following: Setpoint | None = None,
                after: float = 0.0, taken: float | None = None) -> bool:
        """Take a command; return False where it is refused.

        Parameters
        ----------
        now : float
            When it holds [s].
        setpoint : Setpoint
        following : Setpoint, optional
            The next one where it is known already: the drives then interpolate (positions by a
            cubic, efforts by a straight line). Else, and beyond it, they go on with the velocity,
            and keep the effort.
        after : float
            How long until then [s].
        taken : float, optional
            The present where that is later, of a command that comes late [s]: the timeout counts
            from then, and the drives go on from where it would have led by then, or within
            `LONGEST_LATE` of its time.
        """
        reason = self._fault(setpoint)
        if reason:
            self._note(now, 'REFUSED', f'a command was refused: {reason}')
            return False
        self._taken = now if taken is None else taken
        self._since = max(now, self._taken - LONGEST_LATE)
        self._setpoint, self.holding = setpoint, False
        if following is not None and self._fault(following):
            following = None  # refused when its time comes
        self._following, self._after = following, after
        if self.settings.gravity_compensation and setpoint.position is not None:
            self._compensation = self._weight(setpoint.position)
        else:
            self._compensation = self._nothing
        return True

    def effort(self, now: float, position: Array, velocity: Array) -> Array:
        """Return the efforts that the drives apply until the next call [N, N m], (D,).

        Parameters
        ----------
        now : float
        position, velocity : (D,) arrays
            As measured.
        """
        silence = now - self._taken
        if not self.holding and silence > self.settings.command_timeout + 1e-9:
            self._note(now, 'HOLD', f'no command for {silence:.3g} s: the drives hold')
            self._hold(position)
        age = now - self._since
        setpoint = self._setpoint
        wanted = self._nothing if setpoint.effort is None else setpoint.effort
        if self._following is not None and self._after > 0 and self._following.effort is not None:
            share = min(age / self._after, 1.0)
            wanted = wanted + share * (self._following.effort - wanted)
        if setpoint.position is not None and setpoint.velocity is not None:
            goal, speed = self._interpolated(setpoint.position, setpoint.velocity, age)
            speed = self._as_late(speed, velocity)
            wanted = (wanted + self._compensation + self.settings.stiffness * (goal - position)
                      + self.settings.damping * (speed - velocity))
        else:
            self._wanted_speed = None
        self._delay_line.append(self._limited(now, wanted))
        return self._delay_line[0]

    def _interpolated(self, position: Array, velocity: Array, age: float) -> tuple[Array, Array]:
        following, T = self._following, self._after
        if following is None or following.position is None or following.velocity is None or T <= 0:
            return position + age * velocity, velocity
        # The next one is taken at the next tick: until then the goal must not stand still.
        path = DrivePath(np.array([0.0, T]), np.array([position, following.position]),
                         np.array([velocity, following.velocity])).at(np.array([age]))
        return path.position[0], path.velocity[0]

    def _as_late(self, speed: Array, measured: Array) -> Array:
        """Return the wanted velocity, delayed like the measured one.

        Otherwise the lag of differentiation would count as an error: at 80 Hz and 150 N s/m 0.3 N
        per m/s^2, more than the residual of a feedforward.
        """
        if self._smoothing == 1.0:
            return speed
        last, smooth = self._wanted_speed or (speed, measured)
        smooth = smooth + self._smoothing * ((speed + last) / 2 - smooth)
        self._wanted_speed = speed, smooth
        return smooth

    def _hold(self, position: Array) -> None:
        self._since = self._taken = 0.0
        self.holding = True
        self._following, self._after = None, 0.0
        self._setpoint = Setpoint(np.array(position), self._nothing)
        # Holding against gravity without it would sag by millimetres.
        self._compensation = self._weight(position)

    def _limited(self, now: float, wanted: Array) -> Array:
        limits = self._limits
        effort = limits.clamped(wanted)
        over = effort != wanted
        if over.any():
            for i in np.flatnonzero(over & ~self._at_limit):
                unit = limits.units[i].effort
                self._note(now, 'SATURATED', f'{limits.drives[i]} would need {wanted[i]:.4g} '
                           f'{unit}, {limits.effort_source} allows {limits.efforts[i]:g} {unit}')
        self._at_limit = over
        return effort

    def _fault(self, setpoint: Setpoint) -> str:
        for name in ('position', 'velocity', 'effort'):
            value = getattr(setpoint, name)
            if value is not None and (np.shape(value) != self._nothing.shape
                                      or not np.all(np.abs(value) <= LARGEST)):
                return (f'its {name} must be {len(self._nothing)} numbers between {-LARGEST:g} and '
                        f'{LARGEST:g}')
        if (setpoint.position is None) != (setpoint.velocity is None):
            return 'it must have both position and velocity, or neither'
        if setpoint.position is not None:
            try:
                self._limits.check_strokes(setpoint.position[None])
            except WorkspaceError as error:
                return f'{error.found}, but {error.rule}'
        return ''

    def _note(self, now: float, code: NoteCode, message: str) -> None:
        # A message that repeats the last one is not given again.
        if not self.notes or (self.notes[-1].code, self.notes[-1].message) != (code, message):
            self.notes.append(Note(now, code, message))
