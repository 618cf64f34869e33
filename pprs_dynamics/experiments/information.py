"""What recordings and motions say about columns: Gram matrices under correlated noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import fft

from pprs_dynamics.arrays import Array
from pprs_dynamics.diagnosis.joint_fit import Regression
from pprs_dynamics.diagnosis.noise import NoiseModel
from pprs_dynamics.experiments.columns import Block, ColumnPlan, MotionColumns, RecordedColumns

LEAST_FREQUENCIES = 1024  # at which a noise model's spectrum is taken, at least


@dataclass(frozen=True)
class NoiseSpectra:
    """Noise of every drive, as it weighs on a motion.

    Parameters
    ----------
    models : dict of drive to NoiseModel
    period : float
        Between the samples of the noise models [s].
    """

    models: dict[int, NoiseModel]
    period: float

    @classmethod
    def white(cls, deviation: float, period: float, drives: int = 6) -> NoiseSpectra:
        """Return the same white noise of samples `period` apart on all drives [N]."""
        return cls({d: NoiseModel((), (0,), (np.zeros(0),), (deviation,))
                    for d in range(drives)}, period)

    def weights(self, d: int, samples: int, duration: float) -> Array:
        """Return factors for `fft.rfft` of values at coarse samples of a periodic motion.

        The sum of squares of what they give is the whitened sum of squares at `period`.
        """
        model = self.models[d]
        whole = duration / self.period
        size = max(LEAST_FREQUENCIES, len(model.filter), round(whole))
        power = model.spectrum(size)
        at = np.arange(samples // 2 + 1) / duration * self.period * size
        density = np.interp(at, np.arange(len(power)), power)
        twice = np.where((np.arange(len(density)) == 0)
                         | (2 * np.arange(len(density)) == samples), 1.0, 2.0)
        weights: Array = np.sqrt(twice * whole / samples ** 2 / density)
        return weights


class Information:
    """Gram matrices of a plan's columns.

    Parameters
    ----------
    plan : ColumnPlan
    noise : NoiseSpectra
    """

    def __init__(self, plan: ColumnPlan, noise: NoiseSpectra) -> None:
        self.plan, self.noise = plan, noise
        self._weights: dict[tuple[int, int, float], Array] = {}

    def of_recordings(self, regression: Regression) -> Array:
        """Return what recordings tell, (P, P)."""
        source = RecordedColumns(regression.design)
        gram = np.zeros((self.plan.size, self.plan.size))
        rows = [block.rows(source) for block in self.plan.blocks]
        for d, noise in self.noise.models.items():
            series = regression.series[d]
            base, _ = regression.whitened_base(d, noise)
            index, parts = list(regression.base_index[d]), [base]
            for found, place in zip(rows, self.plan.places(), strict=True):
                if d in found:
                    index += range(place.start, place.stop)
                    parts.append(series.whiten(noise, found[d][:, series.index]))
            stacked = np.concatenate(parts)
            gram[np.ix_(index, index)] += stacked @ stacked.T
        return gram

    def of_motion(self, columns: MotionColumns) -> Array:
        """Return what a motion at the noise's own rate would tell, (P, P)."""
        gram = np.zeros((self.plan.size, self.plan.size))
        for d, index, rows in self._by_drive(columns):
            white = self.noise.models[d].whiten(rows, [slice(0, rows.shape[1])])
            gram[np.ix_(index, index)] += white @ white.T
        return gram

    def of_coarse_motion(self, columns: MotionColumns, duration: float) -> Array:
        """Return nearly the same from few samples of a periodic motion, (P, P)."""
        gram = np.zeros((self.plan.size, self.plan.size))
        for d, index, rows in self._by_drive(columns):
            key = (d, rows.shape[1], duration)
            if key not in self._weights:
                self._weights[key] = self.noise.weights(*key)
            lines = fft.rfft(rows, axis=1) * self._weights[key]
            white = np.concatenate((lines.real, lines.imag), axis=1)
            gram[np.ix_(index, index)] += white @ white.T
        return gram

    def _by_drive(self, columns: MotionColumns) -> list[tuple[int, list[int], Array]]:
        blocks = [block.rows(columns) for block in self.plan.blocks]
        found = []
        for d in self.noise.models:
            index = [k for k, rows in enumerate(columns.base) if d in rows]
            parts = [columns.base[k][d][None] for k in index]
            for rows, place in zip(blocks, self.plan.places(), strict=True):
                if d in rows:
                    index += range(place.start, place.stop)
                    parts.append(rows[d])
            found.append((d, index, np.concatenate(parts)))
        return found


def block_index(plan: ColumnPlan, blocks: Sequence[Block]) -> list[int]:
    """Return the places of the columns of some of a plan's blocks."""
    wanted = {id(block) for block in blocks}
    return [k for block, place in zip(plan.blocks, plan.places(), strict=True)
            if id(block) in wanted for k in range(place.start, place.stop)]
