"""All drives' errors fitted together: what is adopted, what the model has, and the noise.

Drives have noise of their own and share the model's numbers and the effects on the platform.
The fit is generalised least squares with Gaussian priors on what is known within a tolerance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from pprs_dynamics.arrays import Array
from pprs_dynamics.diagnosis.noise import COEFFICIENT_PENALTY, NoiseModel
from pprs_dynamics.diagnosis.regression import slow_noise
from pprs_dynamics.diagnosis.search import DriveSearch
from pprs_dynamics.regression.design import Design, Term

LEAST_SAMPLES = 100  # measured on a drive, below which it takes no part
FIT_ITERATIONS = 2
BLOCKS = 10  # of block cross-validation
WEAK = 1e-9  # prior precision of a coefficient, relative to what the data tell


@dataclass(frozen=True)
class Active:
    """A term with the coefficients of it that are fitted."""

    term: Term
    variant: tuple[str, ...]

    @property
    def chosen(self) -> list[int]:
        """Rows of the variant."""
        names = [c.name for c in self.term.effect.coefficients]
        return [names.index(name) for name in self.variant]

    @property
    def size(self) -> int:
        """Number of coefficients that are fitted."""
        return 0 if self.term.fixed else len(self.variant)

    @property
    def fixed(self) -> bool:
        """True where its only row has the coefficient 1."""
        return self.term.fixed

    def on(self, d: int) -> Array | None:
        """Return its rows on a drive, (k, M), None where it has none."""
        rows = self.term.rows.get(d)
        return rows if rows is None or self.fixed else rows[self.chosen]


@dataclass(frozen=True)
class Columns:
    """Columns without an effect behind them, to be fitted beside active terms."""

    rows: dict[int, Array]
    fixed: bool = False

    @property
    def size(self) -> int:
        """Number of coefficients that are fitted."""
        return len(next(iter(self.rows.values())))

    def on(self, d: int) -> Array | None:
        """Return its rows on a drive, (k, M), None where it has none."""
        return self.rows.get(d)


Fitted = Active | Columns


@dataclass(frozen=True)
class JointFit:
    """A fit of active terms.

    Parameters
    ----------
    active : tuple of Active
    coefficients : (P,) array
        Of the base columns, then of the active terms in order.
    covariance : (P, P) array
    noises : dict of drive to NoiseModel
    rest : dict of drive to (n,) array
        What is left [N].
    deviance : float
        -2 log-likelihood, with the priors and the noise models' penalties.
    """

    active: tuple[Fitted, ...]
    coefficients: Array
    covariance: Array
    noises: dict[int, NoiseModel]
    rest: dict[int, Array]
    deviance: float


class Regression:
    """The errors of a design and the fits to them.

    Parameters
    ----------
    design : Design
    """

    def __init__(self, design: Design) -> None:
        self.design = design
        residuals = design.residuals
        self.series = {
            d: DriveSearch(residuals, d) for d in range(len(design.drives))
            if np.isfinite(residuals.measured[:, d]).sum() >= LEAST_SAMPLES}
        self.base_index: dict[int, list[int]] = {}
        self.base_rows: dict[int, Array] = {}
        for d, series in self.series.items():
            index = [k for k, column in enumerate(design.base) if d in column.rows]
            rows = [design.base[k].rows[d][series.index] for k in index]
            self.base_index[d] = index
            self.base_rows[d] = (np.stack(rows) if rows else np.zeros((0, len(series.index))))
        self.nuisance = np.array([k for k, column in enumerate(design.base)
                                  if column.kind == 'width'], dtype=int)
        self.widths: dict[int, tuple[JointFit, dict[int, float]]] = {}
        self.precision = np.array([column.precision for column in design.base])
        self._white: dict[tuple[int, int], tuple[NoiseModel, Array, Array]] = {}

    @property
    def samples(self) -> int:
        """Measured samples of the drive that has most."""
        return max(int(series.known.sum()) for series in self.series.values())

    def tell_widths(self, drives: Sequence[int]) -> None:
        """Count other widths of reversal on these drives as part of the model from now on."""
        told = tuple(f'{self.design.drives[d]} ' for d in drives)
        self.nuisance = np.array([k for k in self.nuisance if not (
            told and self.design.base[k].label.startswith(told))], dtype=int)

    def whitened_base(self, d: int, noise: NoiseModel) -> tuple[Array, Array]:
        """Return whitened base rows and error of a drive; kept for the next time."""
        key = (d, id(noise))
        if key not in self._white:
            series = self.series[d]
            rows = series.whiten(noise, np.concatenate((self.base_rows[d], series.error[None])))
            # The noise model is kept with it so that its id stays its own.
            self._white[key] = (noise, rows[:-1], rows[-1])
            if len(self._white) > 60:
                self._white.pop(next(iter(self._white)))
        return self._white[key][1:]

    def rows(self, active: Fitted, d: int) -> Array | None:
        """Return an active term's rows on a drive, (k, n), None where it has none."""
        rows = active.on(d)
        return None if rows is None else rows[:, self.series[d].index]

    def assemble(self, active: Sequence[Fitted], d: int, noise: NoiseModel,
                 ) -> tuple[list[int], Array, Array]:
        """Return places in the coefficients, whitened rows and whitened error of a drive."""
        base, y = self.whitened_base(d, noise)
        index, blocks = list(self.base_index[d]), [base]
        place = len(self.design.base)
        for one in active:
            rows = self.rows(one, d)
            if rows is not None:
                white = self.series[d].whiten(noise, rows)
                if one.fixed:
                    y = y - white[0]
                else:
                    blocks.append(white)
                    index += range(place, place + one.size)
            place += one.size
        return index, np.concatenate(blocks), y

    def solve(self, active: Sequence[Fitted], noises: dict[int, NoiseModel],
              ) -> tuple[Array, Array, float]:
        """Return coefficients, covariance, and the penalised sum of squares, whitened."""
        count = len(self.design.base) + sum(one.size for one in active)
        H, b, yy = np.zeros((count, count)), np.zeros(count), 0.0
        for d, noise in noises.items():
            index, rows, y = self.assemble(active, d, noise)
            H[np.ix_(index, index)] += rows @ rows.T
            b[index] += rows @ y
            yy += float(y @ y)
        diagonal = np.einsum('ii->i', H)
        diagonal[:len(self.precision)] += self.precision
        diagonal += WEAK * diagonal + 1e-12
        scale = 1 / np.sqrt(diagonal)
        factor = cho_factor(H * np.outer(scale, scale))
        coefficients = scale * cho_solve(factor, scale * b)
        covariance = cho_solve(factor, np.eye(count)) * np.outer(scale, scale)
        return coefficients, covariance, yy - float(b @ coefficients)

    def rest(self, active: Sequence[Fitted], coefficients: Array, d: int) -> Array:
        """Return what the fit leaves of a drive's error [N]."""
        series = self.series[d]
        rest = series.error - coefficients[self.base_index[d]] @ self.base_rows[d]
        place = len(self.design.base)
        for one in active:
            rows = self.rows(one, d)
            if rows is not None:
                rest = rest - (rows[0] if one.fixed
                               else coefficients[place:place + one.size] @ rows)
            place += one.size
        return rest

    def fit(self, active: Sequence[Fitted], noises: dict[int, NoiseModel],
            refit: Sequence[int] | None = None, iterations: int = FIT_ITERATIONS) -> JointFit:
        """Return the fit with the noise of the drives `refit` (default all) fitted beside it."""
        drives = list(self.series) if refit is None else [d for d in refit if d in self.series]
        best: JointFit | None = None
        for _ in range(iterations):
            coefficients, _, _ = self.solve(active, noises)
            noises = {d: self.series[d].fit_noise(self.rest(active, coefficients, d))
                      if d in drives else noise for d, noise in noises.items()}
            fit = self.at(active, noises)
            if best is None or fit.deviance < best.deviance:
                best = fit
        assert best is not None
        return best

    def at(self, active: Sequence[Fitted], noises: dict[int, NoiseModel]) -> JointFit:
        """Return the fit under given noise models."""
        coefficients, covariance, squares = self.solve(active, noises)
        deviance = squares
        for d, noise in noises.items():
            series = self.series[d]
            logs = noise.log_deviation(len(series.error), series.stretches)
            deviance += float(2 * logs[series.known].sum()) + COEFFICIENT_PENALTY * noise.order
        rest = {d: self.rest(active, coefficients, d) for d in noises}
        return JointFit(tuple(active), coefficients, covariance, noises, rest, deviance)

    def guarded_gain(self, fit: JointFit, without: Sequence[Fitted]) -> float:
        """Return twice the log-likelihood gain over `without` if noise went on growing slowly.

        See `slow_noise`: at the noise of the fit, both sides may use noise slower than the
        record shows.
        """
        squares = []
        slow = {d: self.series[d].whiten(noise, slow_noise(noise, len(self.series[d].error)))
                for d, noise in fit.noises.items()}
        for active in (without, fit.active):
            count = len(self.design.base) + sum(one.size for one in active)
            H, b, yy = np.zeros((count, count)), np.zeros(count), 0.0
            for d, noise in fit.noises.items():
                index, rows, y = self.assemble(active, d, noise)
                s = slow[d]
                inner = cho_factor(s @ s.T + np.eye(len(s)))
                rs, ys = rows @ s.T, s @ y
                H[np.ix_(index, index)] += rows @ rows.T - rs @ cho_solve(inner, rs.T)
                b[index] += rows @ y - rs @ cho_solve(inner, ys)
                yy += float(y @ y - ys @ cho_solve(inner, ys))
            diagonal = np.einsum('ii->i', H)
            diagonal[:len(self.precision)] += self.precision
            diagonal += 1e-7 * diagonal + 1e-12
            scale = 1 / np.sqrt(np.maximum(diagonal, 1e-12))
            c = np.linalg.lstsq(H * np.outer(scale, scale), scale * b, rcond=1e-10)[0]
            squares.append(yy - float(scale * b @ c))
        return squares[0] - squares[1]

    def block_losses(self, active: Sequence[Fitted], noises: dict[int, NoiseModel],
                     blocks: int = BLOCKS) -> BlockLosses:
        """Return the whitened squared error of each block, fitted on the others.

        The priors take part in the fits, so that a number that is known within a tolerance may
        move within it in either.
        """
        count = len(self.design.base) + sum(one.size for one in active)
        H, b, yy = np.zeros((blocks, count, count)), np.zeros((blocks, count)), np.zeros(blocks)
        total = len(self.design.residuals)
        edges = np.linspace(0, total, blocks + 1)
        for d, noise in noises.items():
            index, rows, y = self.assemble(active, d, noise)
            at = np.searchsorted(self.series[d].index, edges)
            for k in range(blocks):
                part = rows[:, at[k]:at[k + 1]]
                H[k][np.ix_(index, index)] += part @ part.T
                b[k, index] += part @ y[at[k]:at[k + 1]]
                yy[k] += float(y[at[k]:at[k + 1]] @ y[at[k]:at[k + 1]])
        prior = np.concatenate((self.precision, np.zeros(count - len(self.precision))))
        whole_H, whole_b = H.sum(axis=0) + np.diag(prior), b.sum(axis=0)
        fits = np.stack([_solved(whole_H - H[k], whole_b - b[k]) for k in range(blocks)])
        losses = yy - 2 * np.einsum('ki,ki->k', fits, b) + np.einsum('ki,kij,kj->k', fits, H, fits)
        # Numbers that are stretched beyond what is known of them cost their share in every block.
        losses += fits ** 2 @ prior / blocks
        return BlockLosses(losses, fits, edges)

    def squares(self, active: Sequence[Fitted], coefficients: Array, samples: slice | None = None,
                ) -> tuple[float, int]:
        """Return the sum of squared errors [N^2] and their number, without `Regression.nuisance`.

        Parameters
        ----------
        active : sequence of Active
        coefficients : (P,) array
        samples : slice, optional
            Of the design's samples; all by default.
        """
        kept = coefficients.copy()
        kept[self.nuisance] = 0.0
        total, count = 0.0, 0
        for d, series in self.series.items():
            part = series.known.copy()
            if samples is not None:
                part &= (series.index >= samples.start) & (series.index < samples.stop)
            rest = self.rest(active, kept, d)[part]
            total, count = total + float(rest @ rest), count + len(rest)
        return total, count

    def error(self, active: Sequence[Fitted], coefficients: Array) -> float:
        """Return the root of the mean squared error, over samples and drives [N]."""
        total, count = self.squares(active, coefficients)
        return float(np.sqrt(total / max(count, 1)))

    def held_out_error(self, active: Sequence[Fitted], noises: dict[int, NoiseModel]) -> float:
        """Return the same over blocks, each predicted from the others [N]."""
        found = self.block_losses(active, noises)
        parts = [self.squares(active, fit, slice(round(a), round(b))) for fit, a, b in zip(
            found.fits, found.edges[:-1], found.edges[1:], strict=True)]
        return float(np.sqrt(sum(part[0] for part in parts) / max(sum(p[1] for p in parts), 1)))


@dataclass(frozen=True)
class BlockLosses:
    """Block cross-validation.

    Parameters
    ----------
    losses : (B,) array
        Whitened squared error of each block.
    fits : (B, P) array
        Coefficients fitted on the others.
    edges : (B + 1,) array
        Of the blocks, in samples of the design.
    """

    losses: Array
    fits: Array
    edges: Array


def _solved(H: Array, b: Array) -> Array:
    scale = 1 / np.sqrt(np.diag(H) * (1 + WEAK) + 1e-12)
    matrix = H * np.outer(scale, scale) + 1e-9 * np.eye(len(H))
    solution: Array = scale * np.linalg.solve(matrix, scale * b)
    return solution
