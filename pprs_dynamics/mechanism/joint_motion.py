# Copyright 2026 The pprs_dynamics founders
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Motion of drives that move what they move by themselves: a single axis, joints of an arm."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

from pprs_dynamics.arrays import Array


@dataclass(frozen=True)
class JointMotion:
    """N samples of the motion of D drives.

    Parameters
    ----------
    position, velocity, acceleration : (N, D) arrays
        [m, m/s, m/s^2], and of revolute joints [rad, rad/s, rad/s^2].
    time : (N,) array, optional
        [s]
    """

    position: Array
    velocity: Array
    acceleration: Array
    time: Array | None = None

    def __len__(self) -> int:
        return len(self.position)

    def __getitem__(self, samples: slice) -> Self:
        return replace(self, position=self.position[samples], velocity=self.velocity[samples],
                       acceleration=self.acceleration[samples],
                       time=None if self.time is None else self.time[samples])

    def with_time(self, time: Array) -> Self:
        """Return the motion at given times."""
        return replace(self, time=time)
