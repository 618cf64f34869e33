# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The paper's simulation: the helical translation, and a check of the paper's claims.

Forces of both approaches, in both forms of the equations, on the paper's own path with the
paper's own numbers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import ModelError
from pprs_dynamics.physics.effects.laws.drive_friction import DriveFriction
from pprs_dynamics.physics.effects.laws.joint_friction import (
    IndependentChainsFriction,
    ModelJointFriction,
    PrintedFriction,
)
from pprs_dynamics.physics.mechanism.paths import HelicalPath
from pprs_dynamics.physics.mechanism.state import MechanismState
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.keys import APPROACHES
from pprs_dynamics.physics.three_pprs.robot import ThreePprs

# Of the paper's path; fine enough that rms figures no longer change in four digits.
SAMPLES = 9425
# The claims are about dry friction with a hard sign; this width is hard at any speed of the path.
HARD_REVERSAL = 1e-9


@dataclass(frozen=True)
class Claim:
    """A statement of the paper, and the result of this model.

    Parameters
    ----------
    claim, paper, found : str
        The subject, what the paper says about it, and what this model gives.
    reproduced : bool
        Whether both agree.
    """

    claim: str
    paper: str
    found: str
    reproduced: bool


@dataclass(frozen=True)
class Reproduction:
    """The paper's simulation.

    Parameters
    ----------
    time : (N,) array
        [s].
    rigid_body, active : (N, 6) arrays
        Q and Delta Q^m [N].
    passive : dict of (N, 6) arrays
        Delta Q^p [N] by approach; NaN where the approach is not defined.
    rod_angle : (N, 3) array
        u_i [rad].
    claims : tuple of Claim
    """

    time: Array
    rigid_body: Array
    active: Array
    passive: dict[str, Array]
    rod_angle: Array
    claims: tuple[Claim, ...]


def reproduce(model: DriveModel) -> Reproduction:
    """Run the paper's helical translation with a model of any numbers.

    Parameters
    ----------
    model : DriveModel
        Its `equations` decide between the corrected and the printed ones; both approaches are
        evaluated whatever its `friction.approach`.

    Raises
    ------
    ModelError
        For another robot than a 3-PPRS.
    WorkspaceError, SingularityError
        Where another 3-PPRS than the paper's cannot follow the path.
    """
    if not isinstance(model.robot, ThreePprs):
        raise ModelError('--model', model.source, 'be a 3-PPRS, as the paper is on one')
    path = HelicalPath(radius=model.robot.geometry.base_radius)
    time = np.linspace(0.0, path.duration, SAMPLES)
    mechanism = model.mechanism(path.motion(time))
    active = model.friction.force(mechanism)
    blocks = next(effect.blocks for effect in model.effects
                  if isinstance(effect, ModelJointFriction))
    whole = PrintedFriction if model.robot.printed else ModelJointFriction
    approaches = (whole(blocks),
                  IndependentChainsFriction(blocks, model.values['limits.rod_cosine']))
    passive = {approach: _where_defined(effect, mechanism)
               for approach, effect in zip(APPROACHES, approaches, strict=True)}
    hard_model = replace(model, reversal=replace(
        model.reversal, velocity=HARD_REVERSAL, rate=HARD_REVERSAL))
    hard = hard_model.mechanism(path.motion(time))
    return Reproduction(
        time, mechanism.rigid_force, active, passive, model.robot.rods(mechanism.links)[0],
        tuple(_claims(hard, model.friction, approaches)))


def _claims(
    state: MechanismState, active_friction: DriveFriction,
    approaches: tuple[ModelJointFriction, IndependentChainsFriction],
) -> list[Claim]:
    Q, active = state.rigid_force, active_friction.force(state)
    first, second = (_where_defined(effect, state) for effect in approaches)
    friction = active + first
    share = 100 * _rms(friction) / _rms(Q + friction)
    u, *_ = state.robot.rods(state.links)
    cos_u, u = np.cos(u), np.degrees(u)
    # A rod that leans down has a negative angle; upright is 90 degrees either way.
    crossed = bool(np.any(cos_u.min(axis=0) * cos_u.max(axis=0) < 0))
    near = float(np.nanmax(np.abs(_where_defined(
        IndependentChainsFriction(approaches[1].blocks, 1e-3), state))))
    a, p1, p2 = _rms(active), _rms(first), _rms(second)
    passive_share = float(np.max(p1 / _rms(Q + friction)))
    agree = bool(np.allclose(first[:, 0], second[:, 0], atol=0.01, equal_nan=True))
    return [
        Claim('friction is about 25 % of the drive force (rms over rms, hard sgn)', '25 %',
              f'motor 1: {share[0]:.1f} %; slides {share[:3].min():.1f} to '
              f'{share[:3].max():.1f} %; lifts, which carry the weight, '
              f'{share[3:].min():.1f} to {share[3:].max():.1f} %',
              bool(20 <= share[0] <= 30)),
        Claim('friction of the active joints dominates that of the passive joints',
              'it dominates',
              f'motor 1: {a[0]:.2f} N rms active, {p1[0]:.2f} N rms passive',
              bool(a[0] > 3 * p1[0])),
        Claim('both approaches give the same passive friction for motor 1 on this path',
              'the same values', f'{p1[0]:.3f} N rms by the first, {p2[0]:.3f} N rms by the '
              'second: without rotation its moment about the vertical is 0', agree),
        Claim('for a translation both approaches are alike or identical', 'alike or identical',
              'largest difference where the second is defined: '
              f'{np.nanmax(np.abs(first - second)):.2f} N',
              bool(np.nanmax(np.abs(first - second)) < 0.1 * np.abs(first).max())),
        Claim('the second approach errs where a rod angle is near 90 degrees',
              'significant errors',
              f'u runs from {u.min():.1f} to {u.max():.1f} degrees on this very path; its force '
              f'reaches {near:.0f} N at |cos u| = 0.001', crossed and bool(near > 10 * a.max())),
        Claim('friction of the passive joints does not matter much for the drive forces',
              'not significant', f'{100 * passive_share:.1f} % of the drive force at most '
              '(rms over rms)', passive_share < 0.05),
    ]


def _where_defined(effect: ModelJointFriction, state: MechanismState) -> Array:
    """Return the effect's force, NaN where it refuses."""
    if isinstance(effect, IndependentChainsFriction):
        # Evaluated with the bound lifted, so that refused samples can be blanked one by one.
        with np.errstate(divide='ignore', invalid='ignore'):
            force = IndependentChainsFriction(effect.blocks, 0.0).force(state)
        return np.where(effect.singular(state)[:, None], np.nan, force)
    return effect.force(state)


def _rms(force: Array) -> Array:
    rms: Array = np.sqrt(np.nanmean(force ** 2, axis=0))
    return rms
