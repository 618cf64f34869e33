"""What every catalogue effect, in every shape tried, would gain beside what is adopted."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import minimize_scalar

from pprs_dynamics.diagnosis.design import Term
from pprs_dynamics.diagnosis.joint_fit import Active, Regression
from pprs_dynamics.diagnosis.noise import NoiseModel
from pprs_dynamics.effects.catalogue import catalogue
from pprs_dynamics.effects.drive_effect import DriveEffect
from pprs_dynamics.effects.effect import CatalogueEffect
from pprs_dynamics.effects.homing_error import HomingError
from pprs_dynamics.mechanism.robot import Array

# What the model and the adopted effects have taken already cannot be told apart from them: of
# its square, at least this share of a column must be its own.
OWN_SHARE = 1e-7
REFINEMENTS = 12  # evaluations of a shape parameter between its neighbours in the grid


@dataclass(frozen=True)
class Candidate:
    """An effect on some drives, or in the structure, with what it gains.

    Parameters
    ----------
    active : tuple of Active
        One per drive, or one.
    gain : float
        Twice the log-likelihood ratio under the given noise.
    penalty : float
    """

    active: tuple[Active, ...]
    gain: float
    penalty: float

    @property
    def effect(self) -> type[CatalogueEffect]:
        """The effect."""
        return self.active[0].term.effect

    @property
    def name(self) -> str:
        """Its name."""
        return self.effect.name

    @property
    def drives(self) -> tuple[int, ...] | None:
        """Drives on which it sits; None for the structure."""
        drives = [one.term.drive for one in self.active]
        return None if drives[0] is None else tuple(d for d in drives if d is not None)

    @property
    def score(self) -> float:
        """Gain less penalty."""
        return self.gain - self.penalty


class Library:
    """All terms that the catalogue offers for a design.

    Parameters
    ----------
    regression : Regression
    """

    def __init__(self, regression: Regression) -> None:
        self.regression = regression
        design = regression.design
        self.names = len(catalogue())
        present = {(effect.name, drive) for effect in design.model.effects
                   if isinstance(effect, DriveEffect) for drive in effect.drives}
        self.structure = design.structure
        self.trials: dict[tuple[str, int], int] = {}
        self.local: dict[int, list[Term]] = {d: [] for d in regression.series}
        self.spanning = [term for term in design.homing
                         if (HomingError.name, design.drives[term.drive or 0]) not in present]
        for effect in catalogue().values():
            if not issubclass(effect, DriveEffect) or effect is HomingError:
                continue
            for d in regression.series:
                if (effect.name, design.drives[d]) in present:
                    continue
                shapes = effect.trials(design.covered[d])
                self.trials[effect.name, d] = len(shapes)
                self.local[d] += design.trial_terms(effect, d, shapes)
        self._stacked: dict[int, tuple[Array, list[int]]] = {}

    def stacked(self, d: int) -> tuple[Array, list[int]]:
        """Return all local rows of a drive, (n, N), and where each term's begin."""
        if d not in self._stacked:
            series = self.regression.series[d]
            rows = [term.rows[d][:, series.index] for term in self.local[d]]
            ends = np.cumsum([0, *(len(block) for block in rows)]).tolist()
            self._stacked[d] = (np.concatenate(rows), ends)
        return self._stacked[d]

    def penalty(self, active: Active) -> float:
        """Return the price of one term: its coefficients, shapes, variants and place."""
        term, logarithm = active.term, float(np.log(self.regression.samples))
        price = active.size * logarithm + 2 * float(np.log(len(term.effect.variants)))
        if term.shape:
            tried = self.trials.get((term.effect.name, term.drive or 0), 1)
            price += max(len(term.shape) * logarithm, 2 * float(np.log(tried)))
        if term.drive is not None:
            price += 2 * float(np.log(len(self.regression.series)))
        return price

    @property
    def name_penalty(self) -> float:
        """Price of the choice among effects."""
        return 2 * float(np.log(self.names))


class Scan:
    """Gains of all terms beside active ones, under given noise models.

    Parameters
    ----------
    library : Library
    active : sequence of Active
    noises : dict of drive to NoiseModel
    """

    def __init__(self, library: Library, active: Sequence[Active],
                 noises: dict[int, NoiseModel]) -> None:
        self.library, self.active, self.noises = library, tuple(active), noises
        regression = self.regression = library.regression
        count = len(regression.design.base) + sum(one.size for one in active)
        self._parts = {d: regression.assemble(active, d, noise) for d, noise in noises.items()}
        H, b = np.zeros((count, count)), np.zeros(count)
        for index, rows, y in self._parts.values():
            H[np.ix_(index, index)] += rows @ rows.T
            b[index] += rows @ y
        diagonal = np.einsum('ii->i', H)
        diagonal[:len(regression.precision)] += regression.precision
        self._scale = 1 / np.sqrt(diagonal + 1e-12)
        matrix = H * np.outer(self._scale, self._scale) + 1e-11 * np.eye(count)
        self._root = np.linalg.cholesky(matrix)
        self._b = solve_triangular(self._root, self._scale * b, lower=True)

    def projected(self, rows: dict[int, Array]) -> tuple[Array, Array, Array]:
        """Return own Gram matrix, own right-hand side, and full squares of rows, (k, k), (k,)."""
        k = len(next(iter(rows.values())))
        gram, side = np.zeros((k, k)), np.zeros(k)
        cross = np.zeros((len(self._scale), k))
        for d, one in rows.items():
            if d not in self._parts:
                continue
            index, known, y = self._parts[d]
            white = self.regression.series[d].whiten(
                self.noises[d], one[:, self.regression.series[d].index])
            cross[index] += known @ white.T
            gram += white @ white.T
            side += white @ y
        return self._without(gram, side, cross)

    def _without(self, gram: Array, side: Array, cross: Array) -> tuple[Array, Array, Array]:
        taken = solve_triangular(self._root, self._scale[:, None] * cross, lower=True)
        whole = np.diag(gram).copy()
        return gram - taken.T @ taken, side - taken.T @ self._b, whole

    def gain(self, active: Active) -> float:
        """Return twice the log-likelihood gain of one more term."""
        S, b, whole = self.projected(active.term.rows)
        return _gain(S, b, whole, active)

    def terms(self) -> Iterator[tuple[Active, float]]:
        """Yield every term in every variant, with its gain."""
        taken = {(one.term.effect.name, one.term.drive) for one in self.active}
        for term in (*self.library.structure, *self.library.spanning):
            if (term.effect.name, term.drive) in taken or not any(
                    np.any(rows) for rows in term.rows.values()):
                continue
            S, b, whole = self.projected(term.rows)
            for variant in term.effect.variants or ((),):
                active = Active(term, variant)
                yield active, _gain(S, b, whole, active)
        for d, terms in self.library.local.items():
            rows, ends = self.library.stacked(d)
            index, known, y = self._parts[d]
            white = self.regression.series[d].whiten(self.noises[d], rows)
            cross = np.zeros((len(self._scale), len(white)))
            cross[index] = known @ white.T
            taken_by = solve_triangular(self._root, self._scale[:, None] * cross, lower=True)
            sides = white @ y - taken_by.T @ self._b
            for term, (a, z) in zip(terms, pairwise(ends), strict=True):
                if (term.effect.name, d) in taken:
                    continue
                block, gone = white[a:z], taken_by[:, a:z]
                gram = block @ block.T
                S, whole = gram - gone.T @ gone, np.diag(gram)
                for variant in scanned_variants(term.effect):
                    active = Active(term, variant)
                    yield active, _gain(S, sides[a:z], whole, active)

    def candidates(self) -> list[Candidate]:
        """Return every effect on the drives where it pays, the best first."""
        best: dict[tuple[str, int | None], Candidate] = {}
        for active, gain in self.terms():
            key = (active.term.effect.name, active.term.drive)
            one = Candidate((active,), gain, self.library.penalty(active))
            if key not in best or one.score > best[key].score:
                best[key] = one
        effects: dict[str, list[Candidate]] = {}
        for (name, _), one in best.items():
            effects.setdefault(name, []).append(one)
        joined = []
        for found in effects.values():
            found.sort(key=lambda one: -one.score)
            kept = [one for one in found if one.score > 0] or found[:1]
            joined.append(Candidate(
                tuple(active for one in kept for active in one.active),
                sum(one.gain for one in kept),
                sum(one.penalty for one in kept) + self.library.name_penalty))
        return sorted(joined, key=lambda one: -one.score)

    def refined(self, candidate: Candidate) -> Candidate:
        """Return the candidate with its shape parameters between the grid's values."""
        active, gain, penalty = [], 0.0, self.library.name_penalty
        for one in candidate.active:
            if one.term.shape and one.term.drive is not None:
                better = self._refined(one)
                trials = [Active(better.term, variant) for variant in one.term.effect.variants]
                one = max(trials, key=lambda a: self.gain(a) - self.library.penalty(a))
            active.append(one)
            gain += self.gain(one)
            penalty += self.library.penalty(one)
        return Candidate(tuple(active), gain, penalty)

    def _refined(self, active: Active) -> Active:
        term, d = active.term, active.term.drive
        assert d is not None and issubclass(term.effect, DriveEffect)
        effect = term.effect
        design = self.regression.design
        shape = dict(term.shape)
        grid = effect.trials(design.covered[d])

        def gain_at(trial: dict[str, float]) -> float:
            return self.gain(Active(design.term(effect, d, trial), active.variant))

        active = Active(design.term(effect, d, shape), active.variant)
        best_gain = self.gain(active)
        for name in shape:
            values = sorted({trial[name] for trial in grid})
            at = int(np.argmin(np.abs(np.array(values) - shape[name])))
            if len(values) < 3:
                continue
            low, high = values[max(at - 1, 0)], values[min(at + 1, len(values) - 1)]
            trial, gain = _best_between(low, high, lambda value, name=name: gain_at(
                {**shape, name: value}))
            if gain > best_gain:
                shape[name], best_gain = trial, gain
        return Active(design.term(effect, d, shape), active.variant)


def scanned_variants(effect: type[CatalogueEffect]) -> list[tuple[str, ...]]:
    """Return the variants that the rows of a scan suffice for."""
    return [variant for variant in effect.variants if set(variant) <= set(effect.scanned)]


def _best_between(low: float, high: float, gain: Callable[[float], float],
                  ) -> tuple[float, float]:
    """Return where a gain is largest between two values, in their logarithm where both are > 0."""
    if low > 0:
        found = minimize_scalar(lambda x: -gain(float(np.exp(x))), method='bounded',
                                bounds=(np.log(low), np.log(high)),
                                options={'maxiter': REFINEMENTS, 'xatol': 1e-4})
        return float(np.exp(found.x)), -float(found.fun)
    found = minimize_scalar(lambda x: -gain(float(x)), method='bounded', bounds=(low, high),
                            options={'maxiter': REFINEMENTS, 'xatol': 1e-6})
    return float(found.x), -float(found.fun)


def _gain(S: Array, b: Array, whole: Array, active: Active) -> float:
    if active.term.fixed:
        return float(2 * b[0] - S[0, 0])
    chosen = active.chosen
    S, b, whole = S[np.ix_(chosen, chosen)], b[chosen], whole[chosen]
    if np.any(np.diag(S) <= OWN_SHARE * whole):
        return 0.0
    scale = 1 / np.sqrt(np.diag(S))
    S, b = S * np.outer(scale, scale), b * scale
    if len(b) == 1:
        return float(b[0] ** 2)
    values, axes = np.linalg.eigh(S)
    kept = values > 1e-6
    return float(np.sum((axes[:, kept].T @ b) ** 2 / values[kept]))
