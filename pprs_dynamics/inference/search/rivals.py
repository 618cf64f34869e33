# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Rivals: sets with other effects whose cost is so near the best that recordings cannot tell."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from pprs_dynamics.inference.search.candidates import CandidateSet
from pprs_dynamics.inference.search.expansion import Selection


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
