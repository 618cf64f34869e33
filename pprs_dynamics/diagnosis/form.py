"""What an adopted effect leaves may be its form, where that is an idealisation.

What a strong effect leaves is no further effect and nothing unknown: a little of any, since columns
are linear, and more of friction, springs and cords, which are only nearly of the catalogue's form.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.diagnosis.joint_fit import Active, Regression
from pprs_dynamics.diagnosis.judging import Judged
from pprs_dynamics.diagnosis.library import Candidate
from pprs_dynamics.diagnosis.noise import NoiseModel
from pprs_dynamics.effects.effect import CatalogueEffect

# A further effect on the same drives has to gain this share of what the first one gained.
FORM_SHARE = 0.08
# And have this share of its force, both weighed under the same noise.
FORM_AMPLITUDE = 0.1
# Of the mean square that an effect explains on a drive beside its mean: less is its form.
REMAINDER_SHARE = 0.06
# The model's own friction: laws of friction seldom hold to this share of the force.
FRICTION_SHARE = 0.02


def is_form(one: Judged, other: Judged, active: Sequence[Active], regression: Regression) -> bool:
    """Return whether an effect is no more than another's form may be off by on its drives.

    Parameters
    ----------
    one, other : Judged
        The other is adopted.
    active : sequence of Active
        All that is adopted.
    regression : Regression
    """
    if one.evidence < FORM_SHARE * other.evidence:
        return True
    if not all(any(mine is known for known in active) for mine in other.candidate.active):
        return False  # adopted earlier and in the model
    felt = {d for mine in one.candidate.active for d in mine.term.rows}
    noises = {d: noise for d, noise in one.fit.noises.items() if d in felt}
    squares = squared_size(one.candidate, [*active, *one.candidate.active], noises, regression)
    return within_form(squares, other.candidate, active, noises, regression)


def within_form(squares: float, candidate: Candidate, active: Sequence[Active],
                noises: dict[int, NoiseModel], regression: Regression) -> bool:
    """Return whether squares, whitened, may be what the form of an adopted effect leaves."""
    return candidate.effect.idealised and squares < FORM_AMPLITUDE ** 2 * squared_size(
        candidate, active, noises, regression)


def squared_size(candidate: Candidate, active: Sequence[Active],
                 noises: dict[int, NoiseModel], regression: Regression) -> float:
    """Return the squares, whitened, that only this one of the active effects explains.

    On the drives that have a noise model here.
    """
    mine = {id(one) for one in candidate.active}
    _, _, without = regression.solve([one for one in active if id(one) not in mine], noises)
    _, _, beside = regression.solve(active, noises)
    return without - beside


def form_allowance(effect: type[CatalogueEffect], force: Array) -> Array:
    """Return the mean square that an effect's form may leave of a force (N, ...), (...) [N^2]."""
    constant = FORM_AMPLITUDE ** 2 * effect.idealised
    allowance: Array = (REMAINDER_SHARE * np.nanvar(force, axis=0)
                        + constant * np.nanmean(force, axis=0) ** 2)
    return allowance


def friction_allowance(force: Array) -> Array:
    """Return the mean square that the form of the model's own friction may leave [N^2]."""
    allowance: Array = FRICTION_SHARE ** 2 * np.nanmean(force ** 2, axis=0)
    return allowance
