# Copyright 2026 The pprs_dynamics founders
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Numbers that a model's tolerances leave open, fitted without any effect."""

from __future__ import annotations

from collections.abc import Sequence

from pprs_dynamics.measurement.recording import Recording
from pprs_dynamics.model.force_model import ForceModel
from pprs_dynamics.regression.design import Design
from pprs_dynamics.selection.decisions import DECISIONS
from pprs_dynamics.selection.estimates import Calibration, calibrations
from pprs_dynamics.selection.expansion import expanded, fitted_model
from pprs_dynamics.selection.search import Search


def fit_open_numbers(model: ForceModel, recordings: Sequence[Recording],
                     ) -> tuple[ForceModel, list[Calibration]]:
    """Return the model with its open numbers fitted, and these.

    Their prior is the tolerance, as in a diagnosis; how friction turns over is left free.

    Raises
    ------
    PprsError
        As `measure_residuals`.
    """
    search = Search(Design.of(model, recordings), DECISIONS, with_unknown=False)
    search, found = expanded(search, search.evaluate(()), DECISIONS)
    return fitted_model(search, found), calibrations(search, found, {})
