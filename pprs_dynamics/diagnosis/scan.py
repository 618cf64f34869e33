"""What every catalogue effect, in every shape tried, would gain beside what is adopted."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

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
HELD = 1e-3  # of a column's square may lie outside the span of another effect's
DRIVE_MARGIN = 6.0
SCANNED_SHARE = 1e-5  # the same in single precision
LEAST_EIGENVALUE = 1e-5
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


@dataclass(frozen=True)
class Group:
    """Terms on one drive with equally many rows.

    Parameters
    ----------
    active : list of n Active
    rows : (n, k) int array
        Places in the drive's stacked rows.
    penalties : (n,) array
    effects : dict of str to slice
        Of the n, by effect.
    fixed : bool
    """

    active: list[Active]
    rows: np.typing.NDArray[np.int_]
    penalties: Array
    effects: dict[str, slice]
    fixed: bool

    @classmethod
    def of(cls, active: list[Active], rows: list[list[int]], penalties: list[float],
           fixed: bool) -> Group:
        """Return the group, its effects each in one run."""
        order = sorted(range(len(active)), key=lambda k: active[k].term.effect.name)
        names = [active[k].term.effect.name for k in order]
        effects = {name: slice(names.index(name), names.index(name) + names.count(name))
                   for name in dict.fromkeys(names)}
        return cls([active[k] for k in order], np.array([rows[k] for k in order]),
                   np.array([penalties[k] for k in order]), effects, fixed)

    def gains(self, white: Array, gone: Array, sides: Array) -> Array:
        """Return twice the log-likelihood gain of each, (n,)."""
        own = white[self.rows]
        gram = (own @ own.transpose(0, 2, 1)).astype(float)
        taken = gone.T[self.rows]
        S = gram - taken @ taken.transpose(0, 2, 1)
        b = sides[self.rows]
        size = np.einsum('nkk->nk', S)
        if self.fixed:
            gains: Array = 2 * b[:, 0] - size[:, 0]
            return gains
        possible = np.all(size > SCANNED_SHARE * np.einsum('nkk->nk', gram), axis=1)
        scale = 1 / np.sqrt(np.where(possible[:, None], size, 1.0))
        b = b * scale
        if self.rows.shape[1] == 1:
            return np.where(possible, b[:, 0] ** 2, 0.0)
        values, axes = np.linalg.eigh(S * scale[:, :, None] * scale[:, None, :])
        along = np.einsum('nkj,nk->nj', axes, b)
        kept = values > LEAST_EIGENVALUE
        gains = np.sum(np.where(kept, along ** 2 / np.where(kept, values, 1.0), 0.0), axis=1)
        return np.where(possible, gains, 0.0)


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
        self._groups: dict[int, list[Group]] = {}
        self._rows: dict[int, Array] = {}
        self._white: dict[int, list[tuple[NoiseModel, Array]]] = {d: [] for d in self.local}

    def groups(self, d: int) -> list[Group]:
        """Return all local terms in all variants, grouped by their number of rows."""
        if d not in self._groups:
            sizes: dict[tuple[int, bool], list[tuple[Active, list[int]]]] = {}
            first = 0
            for term in self.local[d]:
                for variant in scanned_variants(term.effect):
                    active = Active(term, variant)
                    rows = [0] if term.fixed else active.chosen
                    sizes.setdefault((len(rows), term.fixed), []).append(
                        (active, [first + row for row in rows]))
                first += len(term.rows[d])
            self._groups[d] = [
                Group.of([active for active, _ in found], [rows for _, rows in found],
                         [self.penalty(active) for active, _ in found], fixed)
                for (_, fixed), found in sizes.items()]
        return self._groups[d]

    def whitened(self, d: int, noise: NoiseModel) -> Array:
        """Return all local rows of a drive, whitened, (n, N), in single precision."""
        for known, white in self._white[d]:
            if known is noise:
                return white
        series = self.regression.series[d]
        if d not in self._rows:
            self._rows[d] = np.concatenate(
                [term.rows[d][:, series.index] for term in self.local[d]]).astype(np.float32)
        white = series.whiten(noise, self._rows[d])
        self._white[d] = [*self._white[d][-1:], (noise, white)]
        return white

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
        """Yield every term that is not on one drive alone, in every variant, with its gain."""
        taken = {(one.term.effect.name, one.term.drive) for one in self.active}
        for term in (*self.library.structure, *self.library.spanning):
            if (term.effect.name, term.drive) in taken or not any(
                    np.any(rows) for rows in term.rows.values()):
                continue
            S, b, whole = self.projected(term.rows)
            for variant in term.effect.variants or ((),):
                active = Active(term, variant)
                yield active, _gain(S, b, whole, active)

    def local_bests(self) -> Iterator[Candidate]:
        """Yield the best shape and variant of every effect on every drive."""
        taken = {(one.term.effect.name, one.term.drive) for one in self.active}
        for d in self.library.local:
            index, known, y = self._parts[d]
            white = self.library.whitened(d, self.noises[d])
            cross = np.zeros((len(self._scale), len(white)))
            cross[index] = known.astype(np.float32) @ white.T
            gone = solve_triangular(self._root, self._scale[:, None] * cross, lower=True)
            sides = (white @ y.astype(np.float32)).astype(float) - gone.T @ self._b
            best: dict[str, Candidate] = {}
            for group in self.library.groups(d):
                gains = group.gains(white, gone, sides)
                scores = gains - group.penalties
                for name, part in group.effects.items():
                    at = part.start + int(np.argmax(scores[part]))
                    if (name, d) not in taken and (
                            name not in best or scores[at] > best[name].score):
                        best[name] = Candidate((group.active[at],), float(gains[at]),
                                               float(group.penalties[at]))
            yield from best.values()

    def candidates(self) -> list[Candidate]:
        """Return every effect on the drives where it pays, the best first."""
        best: dict[tuple[str, int | None], Candidate] = {}
        for active, gain in self.terms():
            key = (active.term.effect.name, active.term.drive)
            one = Candidate((active,), gain, self.library.penalty(active))
            if key not in best or one.score > best[key].score:
                best[key] = one
        for one in self.local_bests():
            best[one.name, one.active[0].term.drive] = one
        effects: dict[str, list[Candidate]] = {}
        for (name, _), one in best.items():
            effects.setdefault(name, []).append(one)
        joined = []
        for found in effects.values():
            found.sort(key=lambda one: -one.score)
            # A further drive has to be more than a share in what the others explain.
            kept = [one for one in found if one.score > DRIVE_MARGIN] or found[:1]
            if len(found[0].active[0].term.rows) > 1 and found[0].drives is not None:
                kept = self._one_by_one(found)
            joined.append(Candidate(
                tuple(active for one in kept for active in one.active),
                sum(one.gain for one in kept),
                sum(one.penalty for one in kept) + self.library.name_penalty))
        return sorted(joined, key=lambda one: -one.score)

    def _one_by_one(self, found: list[Candidate]) -> list[Candidate]:
        """Return drives whose terms reach all others, each for what it adds to those before."""
        kept, left = [found[0]], [one for one in found[1:] if one.score > 0]
        while left:
            scan = Scan(self.library, (*self.active, *(a for one in kept for a in one.active)),
                        self.noises)
            left = sorted((Candidate(one.active, scan.gain(one.active[0]), one.penalty)
                           for one in left), key=lambda one: -one.score)
            if left[0].score <= DRIVE_MARGIN:
                break
            kept.append(left.pop(0))
        return kept

    def holds(self, larger: Candidate, smaller: Candidate) -> bool:
        """Return whether an effect with more coefficients can be all that another one is."""
        if sum(one.size for one in larger.active) <= sum(one.size for one in smaller.active):
            return False
        reached: dict[int | None, Active] = {one.term.drive: one for one in larger.active}
        for one in smaller.active:
            other = reached.get(one.term.drive)
            if other is None:
                return False
            for d in one.term.rows:
                theirs, mine = other.on(d), one.on(d)
                if theirs is None or mine is None:
                    return False
                rest = mine - np.linalg.lstsq(theirs.T, mine.T, rcond=None)[0].T @ theirs
                if np.sum(rest ** 2) > HELD * np.sum(mine ** 2):
                    return False
        return True

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
        assert d is not None
        assert issubclass(term.effect, DriveEffect)
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

            def gain_of(value: float, name: str = name) -> float:
                return gain_at({**shape, name: value})

            trial, gain = _best_between(low, high, gain_of)
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
    kept = values > LEAST_EIGENVALUE
    return float(np.sum((axes[:, kept].T @ b) ** 2 / values[kept]))
