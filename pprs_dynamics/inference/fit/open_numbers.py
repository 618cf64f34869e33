# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Numbers that a model's tolerances leave open, fitted without any effect."""

from __future__ import annotations

from collections.abc import Sequence

from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.estimates import Calibration, calibrations
from pprs_dynamics.inference.search.fitted_model import fitted_model
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.inference.search.relinearisation import relinearised
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.force_model import ForceModel


def fit_open_numbers(model: ForceModel, recordings: Sequence[Recording],
                     ) -> tuple[ForceModel, list[Calibration]]:
    """Return the model with its open numbers fitted, and these.

    Their prior is the tolerance, as in a diagnosis; how friction turns over is left free.

    Raises
    ------
    PprsError
        As `measure_residuals`.
    """
    fits = FittedSets(Design.of(model, recordings), DECISIONS)
    fits, found = relinearised(fits, fits.evaluate(()))
    return fitted_model(fits, found), calibrations(fits, found, {})
