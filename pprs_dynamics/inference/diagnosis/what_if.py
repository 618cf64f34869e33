# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What-if fits of a diagnosis: all effects that were tried, as one small ridge system.

At the noise that the diagnosis ended with, the fit of any subset of effects needs only the
whitened products of their columns with each other and with the error, and the error that it
leaves on a drive only the plain products there (`regression.joint_fit`). A page solves for the
subset that its reader ticks.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import chain
from math import inf

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.regression.normal_equations import (
    Block,
    DriveEquations,
    NormalEquations,
)
from pprs_dynamics.inference.search.candidates import CandidateSet, Component, EffectCandidate
from pprs_dynamics.inference.search.scan import Scan
from pprs_dynamics.inference.search.table import ModelTable
from pprs_dynamics.physics.effects.catalogue import catalogue


@dataclass(frozen=True)
class OptionalPlacement:
    """An effect on one drive, or in the structure, that can be in a what-if fit or not.

    Parameters
    ----------
    drive : str or None
    is_found : bool
        The diagnosis adopted it.
    is_first_choice : bool
        Where the effect is put first: where it was found, or explains most by itself.
    columns, fixed : tuple of int
        Its columns, those with fitted coefficients and those whose coefficient is 1.
    signs : tuple of (int, float)
        Columns and the bounds below which their coefficients are unphysical.
    prior_cost : float
        Of its shape and of physical signs, less ln det of its prior's precision.
    hypotheses : tuple of str
        That it claims: over all placements of an effect each costs the prior odds of a name.
    """

    drive: str | None
    is_found: bool
    is_first_choice: bool
    columns: tuple[int, ...]
    fixed: tuple[int, ...]
    signs: tuple[tuple[int, float], ...]
    prior_cost: float
    hypotheses: tuple[str, ...]


@dataclass(frozen=True)
class OptionalEffect:
    """An effect in all placements that were tried, each in its best shape.

    Parameters
    ----------
    name : str
    is_approximate : bool
        It changes how others show: away from what was found the linear fit is only nearly right.
    placements : tuple of OptionalPlacement
    """

    name: str
    is_approximate: bool
    placements: tuple[OptionalPlacement, ...]


@dataclass(frozen=True)
class OptionalForces:
    """What the columns add to the force of one drive.

    Parameters
    ----------
    name : str
        Of the drive.
    noise : float
        Root of the mean square [N].
    samples : int
        Of the fit.
    columns : (p,) int array
        Those that change the force here; patterns of no catalogue are not among them, since no
        model can have them.
    products : (p + 1, p + 1) array
        Sums over samples of products of the columns, the error last [N^2].
    rows : (p, M) array
        In time [N].
    error : (M,) array
        What they are to explain, NaN where nothing was measured [N].
    given : (M,) array
        Measured minus model as given [N]; `error` but for what effects that bend columns make of
        it around the fitted model.
    """

    name: str
    noise: float
    samples: int
    columns: np.typing.NDArray[np.int_]
    products: Array = field(repr=False)
    rows: Array = field(repr=False)
    error: Array = field(repr=False)
    given: Array = field(repr=False)


@dataclass(frozen=True)
class WhatIf:
    """The system of all columns, from which that of any subset is taken.

    Parameters
    ----------
    effects : tuple of OptionalEffect
        What was found first, then by how much each explains.
    always : tuple of int
        Columns of every fit: the model's own numbers, reversals, patterns of no catalogue.
    limited : tuple of int
        Those of numbers with a tolerance, which is a limit.
    gram : (P, P) array
        Whitened products of the columns, with the precision of their prior.
    side : (P,) array
        Whitened products with the error.
    name_prior_cost : float
        Of an effect.
    wrong_sign_odds : float
        Of coefficients beyond their bounds.
    drive_prior_costs : tuple of float
        Of a choice of one drive, of two and so on.
    drives : tuple of OptionalForces
    """

    effects: tuple[OptionalEffect, ...]
    always: tuple[int, ...]
    limited: tuple[int, ...]
    gram: Array = field(repr=False)
    side: Array = field(repr=False)
    name_prior_cost: float
    wrong_sign_odds: float
    drive_prior_costs: tuple[float, ...]
    drives: tuple[OptionalForces, ...]


def what_if(diagnosis: Diagnosis) -> WhatIf | None:
    """Return the system of all effects that a diagnosis tried; None where its searches are gone."""
    if diagnosis.selection is None:
        return None
    return _System(diagnosis, diagnosis.selection).what_if()


class _System:
    """Columns of all placements that were tried, in the last search."""

    def __init__(self, diagnosis: Diagnosis, selection: ModelTable) -> None:
        self.diagnosis, self.kept, self.fits = diagnosis, selection.reported, selection.last
        self.first_choice: dict[str, set[int | None]] = {}
        self.placements: dict[tuple[str, int | None], Component] = {}
        self.blocks: dict[Component, tuple[Block, ...]] = {}
        for candidates, found in self._tried(selection):
            for candidate in candidates:
                drives = {component.drive for component in candidate.components}
                self.first_choice.setdefault(candidate.name, drives)
                for placement in candidate.components:
                    key = (candidate.name, placement.drive)
                    if key not in self.placements:
                        self.placements[key] = placement
                        self.blocks[placement] = (self.fits.components.block(placement),
                                                  *found.nuisance.get(placement, ()))
        self.unknown = [block for candidate in self.kept.unknowns for block in candidate.blocks]
        blocks = [*self.unknown, *chain.from_iterable(self.blocks.values())]
        # Here fixed columns stand like others; a fit takes them with the coefficient 1.
        standing = [block if block.mean is None else replace(block, precision=np.eye(1))
                    for block in blocks]
        self.equations = NormalEquations(self.fits.regression, standing)
        self.columns: Mapping[Block, tuple[int, ...]] = {
            block: tuple(range(place.start, place.stop)) for block, place in zip(
                blocks, (self.equations.places[one] for one in standing), strict=True)}
        self.gram, self.side = self.equations.prior.precision.copy(), np.zeros(
            len(self.equations.prior.mean))
        for block in blocks:
            if block.mean is not None:
                self.gram[self.columns[block] * 2] = 0.0
        for d, drive, index in zip(self.fits.regression.drives, self.equations.drives,
                                   self.equations.indices, strict=True):
            products, with_error = drive.weighted(
                self.fits.regression.weights(selection.reported.fit, d))
            self.gram[np.ix_(index, index)] += products
            self.side[index] += with_error

    def _tried(self, selection: ModelTable,
               ) -> Iterable[tuple[tuple[EffectCandidate, ...], CandidateSet]]:
        """Yield the effects of sets, and the sets, those that matter most first."""
        order = [effect.name for effect in self.diagnosis.effects]
        yield tuple(sorted(self.kept.effects, key=lambda candidate: (
            order.index(candidate.name) if candidate.name in order else len(order)))), self.kept
        for sets in (selection.alone.values(), selection.last.sets):
            for fitted in sorted(sets, key=lambda fitted: fitted.total):
                yield fitted.effects, fitted
        # Where no set has an effect, a scan beside what was found says in which shape and where.
        for proposal in Scan(self.fits).proposals(self.kept, least=-inf):
            yield tuple(one for one in proposal if isinstance(one, EffectCandidate)), self.kept

    def what_if(self) -> WhatIf:
        """Return what a page needs of it."""
        fits, prior_costs = self.fits, self.fits.prior_costs
        always = [*range(len(fits.design.base)),
                  *(column for block in self.unknown for column in self.columns[block])]
        return WhatIf(
            tuple(OptionalEffect(
                name, catalogue()[name].nonlinear,
                tuple(self._optional(placement) for (of, _), placement in sorted(
                    self.placements.items(), key=lambda item: item[0][1] or 0) if of == name)
            ) for name in self.first_choice),
            tuple(always), tuple(np.flatnonzero(self.equations.prior.limited).tolist()),
            self.gram, self.side, prior_costs.of_name(), fits.decisions.wrong_sign_odds,
            tuple(prior_costs.of_drives(count + 1) for count in range(len(fits.regression.drives))),
            tuple(self._forces(d, drive, index) for d, drive, index in zip(
                fits.regression.drives, self.equations.drives, self.equations.indices,
                strict=True)))

    def _optional(self, placement: Component) -> OptionalPlacement:
        effect, d = placement.effect, placement.drive
        own = self.blocks[placement]
        free = [block for block in own if block.mean is None]
        return OptionalPlacement(
            None if d is None else self.fits.design.drives[d],
            any(placement in candidate.components for candidate in self.kept.effects),
            d in self.first_choice[effect.name],
            tuple(column for block in free for column in self.columns[block]),
            tuple(column for block in own if block.mean is not None
                  for column in self.columns[block]),
            tuple((column, effect.unphysical_below[name]) for name, column in zip(
                placement.names, self.columns[own[0]], strict=False) if name in placement.signed),
            self.fits.components.component_prior_cost(placement).total
            - sum(float(np.linalg.slogdet(one.precision)[1]) for one in free),
            tuple(sorted(map(str, effect.hypotheses(placement.names)))))

    def _forces(self, d: int, drive: DriveEquations, index: np.typing.NDArray[np.int_],
                ) -> OptionalForces:
        regression, diagnosis = self.fits.regression, self.diagnosis
        series, name = regression.series[d], self.fits.design.drives[d]
        rows = {int(k): row for k, row in zip(regression.base_index[d], regression.base[d],
                                              strict=False)}
        for block, places in self.columns.items():
            if d in block.rows:
                rows |= zip(places, block.rows[d], strict=True)
        unknown = {column for block in self.unknown for column in self.columns[block]}
        kept = [k for k, column in enumerate(index) if int(column) not in unknown]
        columns = index[kept]
        gram, side = drive.weighted(np.ones(len(regression.bands)))
        products = np.empty((len(kept) + 1, len(kept) + 1))
        products[:-1, :-1] = gram[np.ix_(kept, kept)]
        products[:-1, -1] = products[-1, :-1] = side[kept]
        products[-1, -1] = drive.squares.sum()
        in_time = np.zeros((len(products), len(diagnosis.residuals)))
        in_time[:, series.index] = series.inverse(np.stack(
            [*(rows[int(column)] for column in columns), regression.base[d][-1]]))
        measured = np.zeros(in_time.shape[1], dtype=bool)
        measured[series.index] = True
        return OptionalForces(
            name, diagnosis.noise_floors[name], len(series), columns, products, in_time[:-1],
            np.where(measured, in_time[-1], np.nan), diagnosis.residuals.error[:, d])
