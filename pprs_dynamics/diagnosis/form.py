"""What an adopted effect leaves may be its form, where that is an idealisation.

Friction, springs and cords are only nearly of the catalogue's form, and what a strong effect
leaves is no further effect and nothing unknown. Inertia, gravity and geometry are exact.
"""

from __future__ import annotations

import numpy as np

from pprs_dynamics.diagnosis.joint_fit import JointFit
from pprs_dynamics.diagnosis.judging import Judged
from pprs_dynamics.diagnosis.library import Candidate
from pprs_dynamics.effects.effect import CatalogueEffect
from pprs_dynamics.mechanism.robot import Array

# A further effect on the same drives has to gain this share of what the first one gained.
FORM_SHARE = 0.08
# And have this share of its force, both weighed under the same noise.
FORM_AMPLITUDE = 0.1
# Of the mean square that an effect explains on a drive beside its mean: less is its form.
REMAINDER_SHARE = 0.06
# The model's own friction: laws of friction seldom hold to this share of the force.
FRICTION_SHARE = 0.02


def is_form(one: Judged, other: Judged, without: JointFit) -> bool:
    """Return whether an effect is no more than another's form may be off by.

    Parameters
    ----------
    one, other : Judged
        The other is adopted, here or before.
    without : JointFit
        Of what is adopted here, under the noise of `one`.
    """
    if one.evidence < FORM_SHARE * other.evidence:
        return True
    here = all(any(active is known for known in without.active)
               for active in other.candidate.active)
    return within_form(squared_size(one.candidate, one.fit), without if here else other.fit,
                       other.candidate)


def within_form(squares: float, fit: JointFit, candidate: Candidate) -> bool:
    """Return whether squares that a fitted effect leaves, whitened, may be those of its form."""
    size = FORM_AMPLITUDE ** 2 * squared_size(candidate, fit)
    return candidate.effect.idealised and squares < size


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


def squared_size(candidate: Candidate, fit: JointFit) -> float:
    """Return the squared force, whitened, that only this effect of a fit explains."""
    wanted = {id(active) for active in candidate.active}
    place = len(fit.coefficients) - sum(one.size for one in fit.active)
    at: list[int] = []
    for one in fit.active:
        if id(one) in wanted:
            at += range(place, place + one.size)
        place += one.size
    found = fit.coefficients[at]
    return float(found @ np.linalg.pinv(fit.covariance[np.ix_(at, at)]) @ found)
