# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

r"""Joint fit of the errors of all drives: model numbers, added effects, and coloured noise.

With the transformed errors y_d of the drives, columns X_d and noise spectra S_d, a set of columns
with Gaussian priors of precision Lambda about 0 has the penalised deviance

.. math::

    D = \sum_{d, k} \left( \ln S_d + \frac{r_d^2}{S_d} \right) + c^T \Lambda c
        + \ln \det (H + \Lambda) - \ln \det \Lambda, \qquad H = \sum_d X_d^T S_d^{-1} X_d,

-2 ln of the likelihood with the coefficients integrated out (restricted likelihood). Coefficients
and noise are fitted in turn, without the constants, until D stands still. Then the coefficients are
fitted once more, to the constants as well. With the constants in each turn, what they leave would
change the noise, and the noise their weight, back and forth for ever.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
from scipy.linalg import block_diag

from pprs_dynamics.arrays import Array, Integers, root_mean_square
from pprs_dynamics.inference.regression.base_columns import BaseColumn
from pprs_dynamics.inference.regression.constrained import Inequalities, conditioned
from pprs_dynamics.inference.regression.normal_equations import (
    Block,
    NormalEquations,
    Posterior,
    Prior,
    Solution,
    term_gains,
)
from pprs_dynamics.inference.regression.terms import Term
from pprs_dynamics.inference.residuals.bands import DriveSeries, FrequencyBands, OpenForces
from pprs_dynamics.inference.residuals.noise import NoiseShapes, NoiseSpectrum
from pprs_dynamics.inference.residuals.residuals import Residuals, ResidualsError

# Prior precision of a coefficient that is known: far above any information on it, 1e6 or so.
CERTAIN = 1e14
LEAST_SAMPLES = 100  # measured on a drive, below which it takes no part
LEAST_POSES = 10  # that are held: their errors are independent
# The fit has converged when the next round would change the deviance by less than the first, the
# last one having changed it by less than the second; rounds are bounded.
CONVERGED, NEARLY, MOST_ROUNDS = 0.1, 0.5, 40
MOST_CROSSES = 60  # products of columns with blocks that are kept: those of a search's best sets
MOST_PRODUCTS = 8000  # products of blocks on a drive, both ways, that are kept: some 10 kB each


@dataclass(frozen=True, eq=False)
class JointFit(Solution):
    """A fit of blocks.

    Parameters
    ----------
    blocks : tuple of Block
    amplitudes : (D, J + 1) array
        Of the noise spectra [N^2].
    spectra : (D, B) array
        At the bands [N^2].
    places : mapping of Block to slice
        Of its coefficients.
    """

    blocks: tuple[Block, ...]
    amplitudes: Array
    spectra: Array
    places: Mapping[Block, slice] = field(repr=False)

    def of(self, block: Block) -> Array:
        """Return the coefficients of a block."""
        return self.coefficients[self.places[block]]

    def index_of(self, blocks: Iterable[Block]) -> Integers:
        """Return where the coefficients of blocks are, one block after the other."""
        return np.array([k for block in blocks for k in range(
            self.places[block].start, self.places[block].stop)], dtype=int)


class Regression:
    """Errors of drives, transformed, and the fits to them.

    Parameters
    ----------
    residuals : Residuals
    base : sequence of BaseColumn
        That take part in every fit.
    drives : sequence of int, optional
        Of the residuals; by default all that have enough samples.
    error_scale : mapping of drive to float, optional
        Force that priors of effects allow [N], so that costs of two designs mean the same; by
        default the rms of the error.
    open_forces : mapping of drive to OpenForces, optional
        That drives have in addition to their noise.

    Raises
    ------
    ResidualsError
        Where no drive has enough samples.
    """

    def __init__(self, residuals: Residuals, base: Sequence[BaseColumn] = (),
                 drives: Sequence[int] | None = None,
                 error_scale: Mapping[int, float] | None = None,
                 open_forces: Mapping[int, OpenForces] = MappingProxyType({})) -> None:
        self.residuals, self.columns = residuals, tuple(base)
        self.bands = FrequencyBands.for_residuals(residuals)
        self.noise_shapes = NoiseShapes(self.bands)
        every = {d: DriveSeries(residuals, d, self.bands, open_forces.get(d))
                 for d in (range(len(residuals.drives)) if drives is None else drives)}
        least = LEAST_SAMPLES if np.any(residuals.variables.get('velocity', 1)) else LEAST_POSES
        self.series = {d: series for d, series in every.items() if len(series) >= least}
        self.drives = tuple(self.series)
        if not self.drives:
            most = max(map(len, every.values()), default=0)
            what, rule = ('held poses', ', twice that for a fit') if least == LEAST_POSES else (
                'samples after treatment', '')
            raise ResidualsError('measured', f'a drive has at most {most} {what}',
                                 f'contain at least {least} of a drive{rule}: record '
                                 + ('more poses' if rule else 'a longer motion'))
        self.counts = np.stack([self.series[d].counts for d in self.drives])
        self.base_index = {d: np.array([k for k, column in enumerate(self.columns)
                                        if d in column.rows], dtype=int) for d in self.drives}
        # The error is the last row of each drive's base.
        self.base = {d: series.transform(np.stack(
            [self.columns[k].rows[d][series.index] for k in self.base_index[d]] + [series.error]))
            for d, series in self.series.items()}
        self.base_products = {d: self.series[d].products(rows, rows)
                              for d, rows in self.base.items()}
        self._products: dict[tuple[Block, Block | None, int], Array] = {}
        self.error_scale = error_scale or {
            d: root_mean_square(rows[-1]) for d, rows in self.base.items()}

    @property
    def samples(self) -> int:
        """Samples of the drive that has most."""
        return max(len(series) for series in self.series.values())

    def block(self, rows: Mapping[int, Array], precision: Array | None = None,
              mean: Array | None = None) -> Block:
        """Return a block of rows in time, (k, M) by drive, by default with the g-prior.

        By the g-prior the force of any combination of the rows has the size of the drives' error.
        Its determinant is ln of the number of samples that a coefficient is worth. What slow
        noise explains as well is cheap and weak.
        """
        return self.transformed_block(
            {d: self.series[d].transform(np.atleast_2d(values)) for d, values in rows.items()
             if d in self.series}, precision, mean)

    def transformed_block(self, rows: Mapping[int, Array], precision: Array | None = None,
                          mean: Array | None = None) -> Block:
        """Return a block of rows that are transformed already, (k, n) by drive."""
        if precision is None:
            precision = (self.g_prior({d: values @ values.T for d, values in rows.items()})
                         if rows else 1e-300 * np.eye(1))
        return Block(rows, precision, mean)

    def joined(self, blocks: Sequence[Block]) -> Block:
        """Return blocks as one, with the same priors."""
        rows = {d: np.concatenate([block.rows.get(d, np.zeros((block.size, len(series))))
                                   for block in blocks])
                for d, series in self.series.items() if any(d in block.rows for block in blocks)}
        return Block(rows, block_diag(*(block.precision for block in blocks)), np.concatenate(
            [np.zeros(block.size) if block.mean is None else block.mean for block in blocks]))

    def term_block(self, term: Term, names: Sequence[str]) -> Block:
        """Return the block of some coefficients of a term; of one that has none, of 1."""
        if not term.names:
            return self.block(term.rows, CERTAIN * np.eye(1), np.ones(1))
        chosen = [term.names.index(name) for name in names]
        return self.block({d: rows[chosen] for d, rows in term.rows.items()},
                          self._wave_prior(term, len(chosen)) if term.effect.is_wave else None)

    def _wave_prior(self, term: Term, count: int) -> Array:
        """Return the precision of amplitudes whose force is of the size of the error.

        Over whole waves, of mean square a half. By the g-prior amplitudes a thousand times the
        error would cost nothing where they cancel within the stroke: they make any smooth curve.
        """
        scales = [max(self.error_scale[d], 1e-12) for d in term.rows if d in self.series]
        precision: Array = 0.5 * float(np.mean(np.square(scales) ** -1.0)) * np.eye(count)
        return precision

    def g_prior(self, grams: Mapping[int, Array]) -> Array:
        """Return the precision of coefficients by their rows' sums of products, (..., k, k)."""
        acting = np.zeros(next(iter(grams.values())).shape[:-2])
        precision = np.zeros_like(next(iter(grams.values())))
        for d, gram in grams.items():
            acting += np.any(gram, axis=(-2, -1))
            precision += gram / (len(self.series[d]) * max(self.error_scale[d], 1e-12) ** 2)
        precision /= np.maximum(acting, 1)[..., None, None]
        size = precision.shape[-1]
        scale = np.trace(precision, axis1=-2, axis2=-1)[..., None, None] / size
        full: Array = precision + (1e-9 * scale + 1e-300) * np.eye(size)
        return full

    def products(self, blocks: Sequence[Block], d: int) -> dict[tuple[Block, Block | None], Array]:
        """Return band sums of the rows of all pairs of blocks, and with the base and error (None).

        Of new blocks all at once: a call is dearer than a product.
        """
        known = self._products
        if len(known) > MOST_PRODUCTS:
            for key in list(known)[:MOST_PRODUCTS // 2]:  # computed first
                del known[key]

        def multiply(some: Sequence[Block], others: Sequence[Block | None]) -> None:
            rows = [self.base[d] if b is None else b.rows[d] for b in others]
            found = self.series[d].products(np.concatenate([a.rows[d] for a in some]),
                                            np.concatenate(rows))
            edges = np.cumsum([0, *map(len, rows)]).tolist()
            first = 0
            for a in some:
                part = found[:, first:(first := first + a.size)]
                for b, i, j in zip(others, edges, edges[1:], strict=False):
                    known[a, b, d] = part[:, :, i:j]
                    if b is not None:
                        known[b, a, d] = part[:, :, i:j].transpose(0, 2, 1)

        if new := [a for a in blocks if (a, None, d) not in known]:
            multiply(new, [None, *blocks])
        for a in blocks:
            if others := [b for b in blocks if (a, b, d) not in known]:
                multiply([a], others)
        return {(a, b): known[a, b, d] for k, a in enumerate(blocks)
                for b in (None, *blocks[:k + 1])}

    def system(self, blocks: Sequence[Block]) -> NormalEquations:
        """Return the normal equations of blocks and the base columns."""
        return NormalEquations(self.columns, self.base_index, self.base_products, blocks,
                               self.products)

    def fit(self, blocks: Sequence[Block], start: JointFit | Array | None = None) -> JointFit:
        """Return the fit of blocks with the base columns and the noise.

        Parameters
        ----------
        blocks : sequence of Block
        start : JointFit or (D, J + 1) array, optional
            A fit or the amplitudes of the noise to start from.
        """
        system, shapes = self.system(blocks), self.noise_shapes
        amplitudes = (shapes.start(system.squares, self.counts) if start is None
                      else start.amplitudes if isinstance(start, JointFit) else start)
        before = last = np.inf
        for number in range(MOST_ROUNDS):
            spectra = shapes.without_constants(amplitudes)
            found = system.solve(spectra, self.counts)
            change = abs(before - found.deviance)
            # Changes fall as a geometric series: the next one is change^2 / last.
            if number and (change < CONVERGED or (
                    change < min(last, NEARLY) and change ** 2 < CONVERGED * last / 2)):
                break
            before, last = found.deviance, change
            amplitudes = shapes.fitted(amplitudes, found.squares, self.counts,
                                       system.leverage(found.covariance, spectra))
        return self._solved(system, blocks, amplitudes)

    def at(self, blocks: Sequence[Block], noise: JointFit | Array) -> JointFit:
        """Return the fit of blocks under the noise of another fit, or of given amplitudes."""
        return self._solved(self.system(blocks), blocks, noise)

    def _solved(self, system: NormalEquations, blocks: Sequence[Block], noise: JointFit | Array,
                ) -> JointFit:
        amplitudes, spectra = (noise.amplitudes, noise.spectra) if isinstance(
            noise, JointFit) else (noise, self.noise_shapes.spectra(noise))
        return JointFit(**vars(system.solve(spectra, self.counts)), blocks=tuple(blocks),
                        amplitudes=amplitudes, spectra=spectra, places=system.places)

    def stated(self, fit: JointFit, blocks: Sequence[Block] = ()) -> JointFit:
        """Return a fit, or one with further blocks at its noise, with the reported covariance.

        See `NormalEquations.uncertainty`.
        """
        found = self.at((*fit.blocks, *blocks), fit) if blocks else fit
        return replace(found, covariance=self.system(found.blocks).uncertainty(found.spectra))

    def held(self, fit: JointFit, index: Integers, values: Array) -> JointFit:
        """Return a fit conditioned on the values (k,) of some coefficients, at its noise."""
        return self.conditioned(fit, index, Inequalities(np.eye(len(index)), values))

    def conditioned(self, fit: JointFit, index: Integers, equalities: Inequalities) -> JointFit:
        """Return a fit given A c = b, at its noise.

        The deviance rises by the squared distance in units of the covariance. The covariance
        becomes that of the posterior given the equalities.

        Parameters
        ----------
        fit : JointFit
        index : (k,) int array
            Of the coefficients c.
        equalities : Inequalities
            Taken as equalities.
        """
        A = np.zeros((len(equalities.b), len(fit.coefficients)))
        A[:, index] = equalities.A
        found = conditioned(fit.coefficients, fit.covariance, Inequalities(A, equalities.b))
        return replace(fit, coefficients=found.coefficients, covariance=found.covariance,
                       squares=self.system(fit.blocks).left(found.coefficients),
                       deviance=fit.deviance + found.rise)

    def noise(self, fit: JointFit) -> dict[int, NoiseSpectrum]:
        """Return the noise of every drive."""
        return {d: NoiseSpectrum(self.noise_shapes.corners, fit.amplitudes[k],
                                 self.residuals.period, float(fit.spectra[k, 0]))
                for k, d in enumerate(self.drives)}

    def misfit(self, fit: JointFit) -> float:
        """Return the deviance without what the coefficients' prior has in it."""
        return float(np.sum(self.counts * np.log(fit.spectra) + fit.squares / fit.spectra))

    def noise_floor(self, fit: JointFit, d: int) -> float:
        """Return the root of the mean square of a drive's noise over its coefficients [N].

        With the constant that the lowest frequencies show, not with what may lie below them.
        """
        k = self.drives.index(d)
        power = fit.amplitudes[k] @ self.noise_shapes.at_bands
        return float(np.sqrt(self.counts[k] @ power / max(self.counts[k].sum(), 1)))

    def weights(self, fit: JointFit, d: int) -> Array:
        """Return 1 / S at the bands of a drive, (B,) [1/N^2]."""
        weights: Array = 1 / fit.spectra[self.drives.index(d)]
        return weights

    def whitened(self, fit: JointFit, d: int, rows: Array) -> Array:
        """Return rows (..., M or n) in time, of unit spectrum under the noise of a fit."""
        return self.in_time(fit, d, self.series[d].transform(rows))

    def in_time(self, fit: JointFit, d: int, transformed: Array) -> Array:
        """Return transformed rows in time, of unit spectrum under the noise of a fit."""
        series = self.series[d]
        return series.inverse(transformed * series.spread(np.sqrt(self.weights(fit, d))))

    def local(self, fit: JointFit, d: int) -> tuple[Integers, list[Block]]:
        """Return places of a drive's coefficients in those of a fit, and the blocks it feels."""
        acting = [block for block in fit.blocks if d in block.rows]
        return np.concatenate((self.base_index[d], fit.index_of(acting))), acting

    def rows(self, fit: JointFit, d: int) -> tuple[Integers, Array]:
        """Return places of a drive's columns in a fit, and these with the error below, (p + 1, n).

        Transformed.
        """
        index, acting = self.local(fit, d)
        return index, np.concatenate([self.base[d][:-1], *(block.rows[d] for block in acting),
                                      self.base[d][-1:]])

    def from_others(self, fit: JointFit, parts: Integers) -> list[Posterior]:
        """Return the posterior of all coefficients of a fit without each part of the samples.

        Parameters
        ----------
        fit : JointFit
            At whose noise.
        parts : (M,) int array
            Part of each sample, from 0.
        """
        count, size = int(parts.max()) + 1, len(fit.coefficients)
        H, b = np.zeros((count, size, size)), np.zeros((count, size))
        for d, series in self.series.items():
            index, rows = self.rows(fit, d)
            white = self.in_time(fit, d, rows)
            for k in range(count):
                part = white[:, parts[series.index] == k]
                H[k][np.ix_(index, index)] += part[:-1] @ part[:-1].T
                b[k, index] += part[:-1] @ part[-1]
        prior = Prior.of(self.columns, fit.blocks)
        return [prior.posterior(H.sum(axis=0) - H[k], b.sum(axis=0) - b[k]) for k in range(count)]

    def remaining(self, fit: JointFit, d: int) -> Array:
        """Return the DCT coefficients of the residual of a drive, (n,) [N]."""
        rest: Array = (self.base[d][-1]
                       - fit.coefficients[self.base_index[d]] @ self.base[d][:-1])
        for block in fit.blocks:
            if d in block.rows:
                rest = rest - fit.of(block) @ block.rows[d]
        return rest

    def gain(self, fit: JointFit, block: Block) -> float:
        """Return by how much the deviance falls with one more block, at the noise of a fit."""
        S, b = self._beside(fit, block)
        mean = np.zeros(block.size) if block.mean is None else block.mean
        return float(term_gains(S[None], b[None], block.precision[None], mean[None])[0])

    def own_information(self, fit: JointFit, block: Block) -> Array:
        """Return the information on a block's coefficients beyond those of a fit, (k, k)."""
        return self._beside(fit, block)[0]

    def _beside(self, fit: JointFit, block: Block) -> tuple[Array, Array]:
        """Return a block's sums of products beyond a fit, and those with its residual."""
        taken, b = Columns(self, block.rows).projected(fit)
        S = np.sum([np.tensordot(self.weights(fit, d), self.products([block], d)[block, block], 1)
                    for d in block.rows], axis=0)
        return S - taken @ fit.covariance @ taken.T, b


class Columns:
    """Rows on some drives, against what is in a fit; band sums of products are kept.

    Parameters
    ----------
    regression : Regression
    rows : mapping of drive to (R, n) array
        Transformed; products have their precision.
    """

    def __init__(self, regression: Regression, rows: Mapping[int, Array]) -> None:
        self.regression, self.rows = regression, rows
        self._crosses: dict[tuple[int, Block | None], Array] = {}

    def __len__(self) -> int:
        return max((len(values) for values in self.rows.values()), default=0)

    def _compute(self, d: int, blocks: Sequence[Block | None]) -> None:
        """Compute band sums of all rows with blocks, None: base and error, that are not known.

        Of all at once, (B, R, k) each: reading the rows takes most of the time.
        """
        new = [block for block in blocks if (d, block) not in self._crosses]
        if not new:
            return
        if len(self._crosses) > MOST_CROSSES * len(self.rows):
            self._crosses = {key: cross for key, cross in self._crosses.items()
                             if key[1] is None or key[1] in blocks}
        rows, base = self.rows[d], self.regression.base[d]
        others = [base if block is None else block.rows[d] for block in new]
        found = self.regression.series[d].products(
            rows, np.concatenate(others).astype(rows.dtype)).astype(rows.dtype)
        for block, cross in zip(new, np.split(found, np.cumsum(list(map(len, others)))[:-1],
                                              axis=2), strict=True):
            self._crosses[d, block] = np.ascontiguousarray(cross)

    def projected(self, fit: JointFit) -> tuple[Array, Array]:
        """Return whitened products with all columns of a fit, (R, P), and with its residual.

        What the fit can take of products of the rows with each other is T C T^T, with its
        covariance C (Schur's complement).
        """
        taken, side = np.zeros((len(self), len(fit.coefficients))), np.zeros(len(self))
        for d, rows in self.rows.items():
            index, acting = self.regression.local(fit, d)
            weights = self.regression.weights(fit, d).astype(rows.dtype)
            self._compute(d, [None, *acting])

            def weighted(block: Block | None, d: int = d, weights: Array = weights) -> Array:
                cross = self._crosses[d, block]
                found: Array = (weights @ cross.reshape(len(weights), -1)).reshape(
                    cross.shape[1:]).astype(float)
                return found

            with_base = weighted(None)
            known = np.concatenate([with_base[:, :-1], *map(weighted, acting)], axis=1)
            side += with_base[:, -1] - known @ fit.coefficients[index]
            taken[:, index] += known
        return taken, side
