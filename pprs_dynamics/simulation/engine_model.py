# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""MuJoCo's model of the robot: four trees, to be closed at the spherical joints."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from pprs_dynamics.errors import MissingLibraryError


def load_engine(purpose: str = 'the simulated robot') -> Any:
    """Return the module mujoco.

    Parameters
    ----------
    purpose : str
        What needs it, where it is missing.

    Raises
    ------
    MissingLibraryError
        Where it is not installed.
    """
    try:
        import mujoco
    except ImportError:
        raise MissingLibraryError('mujoco', purpose, 'sim') from None
    if mujoco.get_mju_user_warning() is None:
        # Its own way writes MUJOCO_LOG.TXT into the user's folder; warnings are counted anyway.
        mujoco.set_mju_user_warning(lambda message: None)
    return mujoco


def describe_trees(values: Mapping[str, Any]) -> str:
    """Return the mechanism in MuJoCo's format (MJCF), with masses still to be set.

    Bodies 1 to 9 are slide, lift and rod of each chain, 10 is the platform. Sensors are the
    accelerations of the rods' tips, then of the platform's ends of the spherical joints. The
    hinge's angle is u_i: at 0 the rod points inwards from C_i.
    """
    R, r, l = (values[f'geometry.{name}'] for name in  # noqa: E741
               ('base_radius', 'platform_radius', 'rod_length'))
    # Off centre, so that the engine prepares for any mass matrix and not for a diagonal one.
    body = '<inertial pos="0.1 0.2 0.3" quat="1 0.1 0.2 0.3" mass="1" diaginertia="3 4 5"/>'
    chains, ends, closures, sensors = [], [], [], []
    for i in range(3):
        delta = values['geometry.chain_angles'][i]
        beta = values['geometry.platform_angles'][i]
        chains.append(
            f'<body name="slide_{i + 1}" pos="{R * math.cos(delta)!r} {R * math.sin(delta)!r} 0"'
            f' quat="{math.cos(delta / 2)!r} 0 0 {math.sin(delta / 2)!r}">{body}'
            '<joint type="slide" axis="0 1 0"/>'
            f'<body name="lift_{i + 1}">{body}<joint type="slide" axis="0 0 1"/>'
            f'<body name="rod_{i + 1}">{body}<joint type="hinge" axis="0 1 0"/>'
            f'<site name="tip_{i + 1}" pos="{-l!r} 0 0"/></body></body></body>')
        ends.append(f'<site name="end_{i + 1}" '
                    f'pos="{r * math.cos(beta)!r} {r * math.sin(beta)!r} 0"/>')
        closures.append(f'<connect site1="tip_{i + 1}" site2="end_{i + 1}"/>')
    for site in ('tip', 'end'):
        sensors += [f'<framelinacc objtype="site" objname="{site}_{i}"/>' for i in (1, 2, 3)]
    return (
        '<mujoco><compiler angle="radian"/><option jacobian="dense">'
        '<flag contact="disable" island="disable" energy="enable"/></option><worldbody>'
        f'{"".join(chains)}<body name="platform">{body}<freejoint/>{"".join(ends)}</body>'
        f'</worldbody><equality>{"".join(closures)}</equality>'
        f'<sensor>{"".join(sensors)}</sensor></mujoco>')
