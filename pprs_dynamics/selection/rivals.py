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

"""Rivals: sets with other effects whose cost is so near the best that recordings cannot tell."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from pprs_dynamics.selection.candidates import CandidateSet
from pprs_dynamics.selection.expansion import Selection


@dataclass(frozen=True)
class Rival:
    """A set that stands beside the one that was adopted.

    Parameters
    ----------
    found : CandidateSet
    missing, instead : tuple of str
        Adopted effects that it lacks, and what it has instead; neither is empty.
    """

    found: CandidateSet
    missing: tuple[str, ...]
    instead: tuple[str, ...]


def find_rivals(selection: Selection, adopted: CandidateSet, margin: float,
                ignored: Collection[str] = ()) -> list[Rival]:
    """Return the rivals of a set, the best first.

    Parameters
    ----------
    selection : Selection
    adopted : CandidateSet
    margin : float
        How near the best the cost of a rival comes.
    ignored : collection of str
        Effects that are within the model error of others: to have them makes no rival.
    """
    mine = {candidate.name for candidate in adopted.effects}
    rivals = []
    for other in selection.ranked:
        if other.cost > selection.best.cost + margin:
            break
        theirs = {candidate.name for candidate in other.effects} - set(ignored)
        missing, instead = sorted(mine - theirs), sorted(theirs - mine)
        if missing and instead:
            rivals.append(Rival(other, tuple(missing), tuple(instead)))
    return rivals
