# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Information (Gram) matrices of columns under the noise of the drives.

As in a fit, columns are transformed by the orthonormal DCT and divided by the root of the noise's
power spectrum.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import fft

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.experiments.columns import ColumnPlan, Columns
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.joint_fit import JointFit, Regression
from pprs_dynamics.inference.residuals.noise import NoiseSpectrum


@dataclass(frozen=True)
class Information:
    """Gram matrices of a plan's columns, (P, P).

    Parameters
    ----------
    plan : ColumnPlan
    noise : mapping of drive to NoiseSpectrum
        Other drives tell nothing.
    """

    plan: ColumnPlan
    noise: Mapping[int, NoiseSpectrum]

    def of_recordings(self, design: Design, regression: Regression, fit: JointFit) -> Array:
        """Return what recordings tell, and what is known of the base columns beforehand."""
        white = {}
        for d, (index, rows) in self.plan.on_recordings(design).items():
            if d in self.noise:
                series = regression.series[d]
                factor = series.spread(np.sqrt(regression.weights(fit, d)))
                white[d] = index, series.transform(rows) * factor
        return self._gram(white) + self.prior()

    def prior(self) -> Array:
        """Return what is known of the base columns beforehand."""
        known = np.zeros(self.plan.size)
        known[:len(self.plan.base)] = [column.precision for column in self.plan.base]
        return np.diag(known)

    def of_motion(self, columns: Columns, duration: float) -> Array:
        """Return what a motion of some duration [s] would tell, however densely it is sampled."""
        return self._gram({d: (index, whitened(rows, self.noise[d], duration))
                           for d, (index, rows) in columns.items() if d in self.noise})

    def _gram(self, white: Columns) -> Array:
        gram = np.zeros((self.plan.size, self.plan.size))
        for index, rows in white.values():
            gram[np.ix_(index, index)] += rows @ rows.T
        return gram


def whitened(rows: Array, noise: NoiseSpectrum, duration: float) -> Array:
    """Return the DCT of rows of a motion, (p, n), per standard deviation of the noise.

    Fewer samples than the noise has count for as many, as long as they follow the motion.
    """
    count = rows.shape[-1]
    density = noise.power(np.arange(count) / (2 * duration)) * count * noise.period / duration
    white: Array = fft.dct(rows, norm='ortho', axis=-1) / np.sqrt(density)
    return white
