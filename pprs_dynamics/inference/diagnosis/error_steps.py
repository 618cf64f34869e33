# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How the error falls on the way from a model as given to one with all that was found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.diagnosis.diagnose import Diagnosis
from pprs_dynamics.inference.residuals.residuals import Residuals

# The model's own numbers that move without changing the error by this share are no step.
LEAST_STEP = 1e-3


@dataclass(frozen=True)
class ErrorStep:
    """The error once something more is in the model.

    Parameters
    ----------
    label : str
        What came in.
    overall : float
        Root of the mean square over samples and drives [N].
    drives : (D,) array
        The same by drive [N]; NaN where nothing was measured.
    """

    label: str
    overall: float
    drives: Array


def error_steps(diagnosis: Diagnosis, after: Residuals) -> tuple[ErrorStep, ...]:
    """Return the steps, first the model as given, last the model with everything.

    Both ends are what a comparison with these models gives. In between, parameters are those of
    the last fit, so that a step shows what one effect does beside those before it.

    Parameters
    ----------
    diagnosis : Diagnosis
    after : Residuals
        Of `diagnosis.adopted` on the same recordings.
    """
    effects = diagnosis.effects
    missing = sum((one.force for one in effects), np.zeros_like(after.error))
    steps = [_step('model as given', diagnosis.residuals.error)]
    refitted = _step('its own numbers', after.error + missing)
    if abs(refitted.overall / steps[0].overall - 1) > LEAST_STEP:
        steps.append(refitted)
    for one in effects:
        missing = missing - one.force
        steps.append(_step(one.name, after.error + missing))
    return tuple(steps)


def _step(label: str, error: Array) -> ErrorStep:
    known = np.isfinite(error)
    squares = np.where(known, error, 0.0) ** 2
    count = known.sum(axis=0)
    drives = np.sqrt(np.divide(squares.sum(axis=0), count, where=count > 0,
                               out=np.full(error.shape[1], np.nan)))
    return ErrorStep(label, float(np.sqrt(squares.sum() / max(int(count.sum()), 1))), drives)
