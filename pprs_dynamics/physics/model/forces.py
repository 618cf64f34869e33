# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Forces of a model by parts, limits of the drives, and what effects remember between calls."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DriveUnits
from pprs_dynamics.errors import EffectError, LimitError, WorkspaceError
from pprs_dynamics.physics.mechanism.state import MechanismState

RIGID_BODY = 'rigid_body'


class Forces:
    """Forces of N samples of D drives.

    Parameters
    ----------
    total : (N, D) array
        What the drives must apply [N, N m], in drive order.
    parts : dict of (N, D) arrays, or function that returns it
        `rigid_body`, the model's own friction, and one per added effect; they sum to `total`.
    mechanism : state, or function that returns it
        What the forces were computed from.
    drive_motion : three (N, D) arrays, optional
        Position, velocity and acceleration of the drives; without it those of the state.
    """

    __slots__ = ('_drive_motion', '_mechanism', '_parts', 'total')

    # Functions, because of most samples only the total is read: building the rest takes longer
    # than the equations.
    def __init__(self, total: Array, parts: dict[str, Array] | Callable[[], dict[str, Array]],
                 mechanism: MechanismState | Callable[[], MechanismState],
                 drive_motion: Sequence[Array] | None = None) -> None:
        self.total, self._parts, self._mechanism = total, parts, mechanism
        self._drive_motion = drive_motion

    def __reduce__(self) -> tuple[Any, ...]:
        return Forces, (self.total, self.parts, self.mechanism)

    @property
    def parts(self) -> dict[str, Array]:
        """Parts of the total, by name."""
        if callable(self._parts):
            self._parts = self._parts()
        return self._parts

    @property
    def mechanism(self) -> MechanismState:
        """The state of the mechanism."""
        if callable(self._mechanism):
            self._mechanism = self._mechanism()
        return self._mechanism

    @property
    def drive_motion(self) -> tuple[Array, ...]:
        """Position, velocity and acceleration of the drives, (N, D) each."""
        if self._drive_motion is not None:
            return tuple(self._drive_motion)
        state = self.mechanism
        return state.position, state.velocity, state.acceleration


@dataclass(eq=False)
class ModelState:
    """Memory of effects between calls; made by `initial_state` of a model.

    Parameters
    ----------
    memories : dict of str to object
        By effect.
    start : float, optional
        When the motion began [s]; None before its first sample.
    end : float, optional
        Time of the last sample [s].
    closed : dict of Structure to (C,) array
        Coordinates of a mechanism at the last sample, from which its loops close in fewer steps
        where the next one is near. No result depends on them.
    """

    memories: dict[str, Any]
    start: float | None = None
    end: float | None = None
    closed: dict[Any, Array] = field(default_factory=dict)

    def advance(self, time: Array | None, fresh: Callable[[], ModelState]) -> None:
        """Take note of the times (N,) of the next samples, the first of which is the start.

        Times that go back are of another stream: everything begins anew, from a fresh state.
        """
        if time is None or not len(time):
            return
        if self.end is not None and time[0] < self.end:
            self.memories, self.start = fresh().memories, None
        if self.start is None:
            self.start = float(time[0])
        self.end = float(time[-1])

    @property
    def has_memory(self) -> bool:
        """Whether any effect keeps anything."""
        return any(memory is not None for memory in self.memories.values())

    def copy(self) -> ModelState:
        """Return an independent copy, to look ahead without advancing this one.

        Raises
        ------
        EffectError
            Where an effect keeps what cannot be copied.
        """
        copied = {}
        for name, memory in self.memories.items():
            try:
                copied[name] = copy.deepcopy(memory)
            except Exception as error:  # another package's effect may keep anything
                raise EffectError(name, 'its memory cannot be copied '
                                  f'({type(error).__name__}: {error})') from error
        return replace(self, memories=copied, closed=dict(self.closed))


@dataclass(frozen=True, eq=False)
class DriveLimits:
    """Strokes and efforts of D drives; infinite where there are none.

    Parameters
    ----------
    drives : tuple of D str
    units : tuple of D DriveUnits
    lower, upper : (D,) arrays
        Lowest and highest position of each drive [m, rad].
    efforts : (D,) array
        Largest absolute effort of each drive [N, N m].
    sources : tuple of D str
        Where the positions of each drive are limited, for a sentence.
    effort_source : str
        Where efforts are limited, for a sentence.
    """

    drives: tuple[str, ...]
    units: tuple[DriveUnits, ...]
    lower: Array
    upper: Array
    efforts: Array
    sources: tuple[str, ...]
    effort_source: str

    def with_efforts(self, effort: Sequence[float]) -> DriveLimits:
        """Return these limits with the smaller of two limits on every drive's effort."""
        return replace(self, efforts=np.minimum(self.efforts, effort))

    def clamped(self, forces: Array) -> Array:
        """Return efforts, (N, D), moved to the limit where they are over it."""
        return np.clip(forces, -self.efforts, self.efforts)

    def check_strokes(self, positions: Array) -> None:
        """Raise WorkspaceError for the first drive position, (N, D), outside its stroke."""
        lower, upper = self.lower, self.upper
        outside = ~((positions >= lower) & (positions <= upper))
        if np.any(outside):
            sample, drive = (int(i) for i in np.argwhere(outside)[0])
            unit = self.units[drive].position
            raise WorkspaceError(
                sample,
                f'{self.drives[drive]} would have to be at {positions[sample, drive]:.6g} {unit}',
                f'{self.sources[drive]} is [{lower[drive]:g}, {upper[drive]:g}] {unit}')

    def check_efforts(self, forces: Array) -> None:
        """Raise LimitError for the first effort, (N, D), over its limit."""
        over = ~(np.abs(forces) <= self.efforts)
        if np.any(over):
            sample, drive = (int(i) for i in np.argwhere(over)[0])
            raise LimitError(sample, self.drives[drive], float(forces[sample, drive]),
                             float(self.efforts[drive]), self.units[drive].effort,
                             self.effort_source)
