# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Names that effects had as long as only a 3-PPRS had them, and those that they have now."""

from __future__ import annotations

import warnings
from typing import NamedTuple


class Former(NamedTuple):
    """What an effect is today that had another name.

    Parameters
    ----------
    effect : str
    place : str
        Where it is; '' for an effect that is at one place alone.
    renamed : tuple of (str, str)
        Parameters that have another name, too.
    """

    effect: str
    place: str = ''
    renamed: tuple[tuple[str, str], ...] = ()

    def parameter(self, name: str) -> str:
        """Return the name of a parameter today."""
        own = dict(self.renamed).get(name, name)
        return f'{self.place}.{own}' if self.place else own


# Names from when only a 3-PPRS had these effects; files, ledgers and requests may have them.
FORMER = {
    'platform_drag': Former('tool_drag'),
    'revolute_friction': Former('joint_friction', 'revolute'),
    'revolute_stiffness': Former('joint_spring', 'revolute', (('angle', 'position'),)),
    'rod_mass': Former('link_mass', 'rods'),
    'spherical_friction': Former('joint_friction', 'spherical')}


def general_name(name: str) -> str:
    """Return the name that an effect has today; of what never had another, that."""
    return FORMER[name].effect if isinstance(name, str) and name in FORMER else name


def told_general_name(name: str) -> str:
    """Return the same, and tell a name of old in a warning what it is today."""
    if name in FORMER:
        found = FORMER[name]
        place = f', of {found.place}' if found.place else ''
        warnings.warn(f'{name} is called {found.effect} now{place}', FutureWarning, stacklevel=3)
    return general_name(name)
