# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Where effects may be in a robot, of whatever kernel: its passive joints, links and tool."""

from __future__ import annotations

from typing import NamedTuple

# Kinds of robots: the closed form of the 3-PPRS, one slide alone, and every other one.
PLATFORM, SLIDE, MECHANISM = 'platform', 'slide', 'mechanism'


class PassiveJoint(NamedTuple):
    """A joint without a drive, or several joints that share their friction.

    Parameters
    ----------
    name : str
    radius : float
        At which its load rubs [m]; 0 where the model does not say.
    turns : bool
        False for a slide.
    has_position : bool
        Whether one number says where it is, as of a hinge and not of a ball.
    """

    name: str
    radius: float
    turns: bool = True
    has_position: bool = True


class BodyPlace(NamedTuple):
    """A link, or several that are alike, that may be heavier than the model says.

    Parameters
    ----------
    link : str
    centre : 3 floats
        Where a body is unless its parameters say otherwise, in the link's frame [m].
    mass : float
        What the link weighs, which nothing can take off it [kg]; inf where that is left open.
    is_spread : bool
        Whether what is added is spread as the link's own mass is, so that its mass alone counts.
    """

    link: str
    centre: tuple[float, float, float]
    mass: float
    is_spread: bool = False
