# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Share of the drives' efforts that a model explains.

Whatever a search for effects says: a model that explains less than half of what a drive does is
not yet a model of that drive, and no noise accounts for the rest.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.design import LEAST_MOVING, TURNED
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.inference.search.decisions import DECISIONS, Decisions, outside_cost
from pprs_dynamics.physics.model.drive_model import DriveModel

CONSTANT = 1e-9  # of an effort's size, below which a change of it is rounding
# Third differences of white noise have this many times its variance (1 + 9 + 9 + 1).
THIRD_DIFFERENCES = 20.0
# Of the variance of an effort that is not noise, below which nothing can be said of a model: the
# variance of a noise is known to 10 % from 200 independent samples.
LEAST_BEYOND_NOISE = 0.1


def explained_shares(residuals: Residuals, left: Array | None = None) -> dict[str, float]:
    """Return the share of the variance of each measured effort that a model explains.

    Parameters
    ----------
    residuals : Residuals
    left : (M, D) array, optional
        Measured minus model [N]; by default the error of the residuals.

    Returns
    -------
    dict of str to float
        1 - var(left) / var(effort) of the drives that were measured; below 0 where the error is
        larger than the effort, NaN where that is constant.
    """
    error = residuals.error if left is None else left
    shares = {}
    for d, name in enumerate(residuals.drives):
        known = np.isfinite(residuals.measured[:, d])
        if not known.any():
            continue
        effort = residuals.measured[known, d]
        swing = float(np.std(effort))
        constant = swing <= CONSTANT * max(float(np.abs(effort).max()), CONSTANT)
        shares[name] = float('nan') if constant else 1 - float(
            np.var(error[known, d])) / swing ** 2
    return shares


@outside_cost('the model explains less than half of the effort of a drive: `unknown`')
def little_explained(model: DriveModel, residuals: Residuals, left: Array | None = None,
                     decisions: Decisions = DECISIONS,
                     noise: Mapping[str, float] = MappingProxyType({}),
                     ) -> dict[str, float]:
    """Return the drives of whose effort a model explains little, with the shares; least first.

    Of drives that move: where a drive stands, static friction holds whatever it is loaded with.
    White noise is for no model to explain, but a model whose force varies more contradicts it.

    Parameters
    ----------
    model : DriveModel
        Its width of reversal separates motion from rest.
    residuals : Residuals
    left : (M, D) array, optional
        See `explained_shares`.
    decisions : Decisions, optional
    noise : mapping of str to float, optional
        Rms of the noise of the drives, where it is known [N]: no model explains it.
    """
    little = {}
    for name, share in explained_shares(residuals, left).items():
        d = residuals.drives.index(name)
        if not _moves(model, residuals, d):
            continue
        effort = residuals.measured[:, d]
        if _is_white_noise(residuals, d, decisions):
            is_little = np.nanvar(residuals.model[np.isfinite(effort), d]) > np.nanvar(effort)
        else:
            of_noise = noise.get(name, 0.0) ** 2 / max(float(np.nanvar(effort)), 1e-300)
            is_little = (1 - of_noise > LEAST_BEYOND_NOISE
                         and share < decisions.explained * (1 - of_noise))
        if is_little:
            little[name] = float(np.nan_to_num(share))  # of a constant nothing is explained
    return dict(sorted(little.items(), key=lambda item: item[1]))


def _moves(model: DriveModel, residuals: Residuals, d: int) -> bool:
    """Return whether a drive moves, as far as its velocity is known."""
    velocity = residuals.variable('velocity', d)
    width = float(model.reversal.widths(len(residuals.drives))[d])
    return velocity is None or bool(np.mean(np.abs(velocity) > TURNED * width) >= LEAST_MOVING)


def _is_white_noise(residuals: Residuals, d: int, decisions: Decisions) -> bool:
    """Return whether the variance of a drive's effort is mostly white noise."""
    squares = [np.diff(residuals.measured[part, d], 3) ** 2 for part in residuals.stretches(d)]
    every = np.concatenate(squares)
    every = every[np.isfinite(every)]
    if not len(every):
        return False
    white = float(every.mean()) / THIRD_DIFFERENCES
    return white >= decisions.explained * float(np.nanvar(residuals.measured[:, d]))
