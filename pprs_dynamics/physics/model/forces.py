# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Forces of a model by parts, and what its effects remember between calls."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import EffectError

RIGID_BODY = 'rigid_body'
# The model's own friction, in its drives and in its passive joints.
ACTIVE_FRICTION, PASSIVE_FRICTION = 'active_friction', 'passive_friction'


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
                 mechanism: Any,
                 drive_motion: Any = None) -> None:
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
    def mechanism(self) -> Any:
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


class ModelState:
    """Memory of effects between calls; made by `initial_state` of a model.

    Parameters
    ----------
    memories : dict of str to object
        By effect.
    start : float, optional
        When the motion began [s]; None before its first sample.

    Attributes
    ----------
    end : float, optional
        Time of the last sample [s].
    closed : dict of Structure to (C,) array
        Coordinates of a mechanism at the last sample, from which its loops close in fewer steps
        where the next one is near. No result depends on them.
    """

    def __init__(self, memories: dict[str, Any], start: float | None = None) -> None:
        self.memories, self.start = memories, start
        self.end: float | None = None
        self.closed: dict[Any, Array] = {}

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
        state = ModelState(copied, self.start)
        state.end = self.end
        state.closed = dict(self.closed)
        return state
