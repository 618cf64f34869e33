"""What every catalogue effect, in every shape tried, would gain beside what is adopted."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import minimize_scalar

from pprs_dynamics.arrays import Array
from pprs_dynamics.diagnosis.joint_fit import Active
from pprs_dynamics.diagnosis.library import LEAST_EIGENVALUE, Candidate, Library
from pprs_dynamics.diagnosis.noise import NoiseModel
from pprs_dynamics.diagnosis.parallel import each
from pprs_dynamics.effects.drive_effect import DriveEffect

# What the model and the adopted effects have taken already cannot be told apart from them: of
# its square, at least this share of a column must be its own.
OWN_SHARE = 1e-7
DRIVE_MARGIN = 6.0
# Evaluations of a shape parameter between its neighbours in the grid: of a proposal, and of what
# is adopted.
COARSE, FINE = 9, 24


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
        gram, side, taken = self._products(rows)
        return gram - taken.T @ taken, side, np.diag(gram).copy()

    def _products(self, rows: dict[int, Array]) -> tuple[Array, Array, Array]:
        """Return the Gram matrix, the own right-hand side, and what the active ones take."""
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
        taken = solve_triangular(self._root, self._scale[:, None] * cross, lower=True)
        return gram, side - taken.T @ self._b, taken

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
        for best in each(self._local_bests, self.library.local):
            yield from (one for one in best if (one.name, one.active[0].term.drive) not in taken)

    def _local_bests(self, d: int) -> list[Candidate]:
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
                if name not in best or scores[at] > best[name].score:
                    best[name] = Candidate((group.active[at],), float(gains[at]),
                                           float(group.penalties[at]))
        return list(best.values())

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
            reaches_all = len(found[0].active[0].term.rows) > 1
            kept = found if reaches_all else [
                one for one in found if one.score > DRIVE_MARGIN] or found[:1]
            joined.append(Candidate(
                tuple(active for one in kept for active in one.active),
                sum(one.gain for one in kept),
                sum(one.penalty for one in kept) + self.library.name_penalty))
        return sorted(joined, key=lambda one: -one.score)

    def _together(self, found: Sequence[Active]) -> Candidate:
        """Return the drives, of those proposed, on which an effect pays beside the others.

        What one drive's error does to the model's own numbers shows on all drives, so that a
        drive may seem to have the effect as long as it is missing on another one.
        """
        prices = [self.library.penalty(one) for one in found]
        sizes = [1 if one.fixed else one.size for one in found]
        ends = np.cumsum([0, *sizes])
        stacked: dict[int, Array] = {}
        for k, one in enumerate(found):
            for d in one.term.rows:
                rows = one.on(d)
                assert rows is not None
                stacked.setdefault(d, np.zeros((int(ends[-1]), rows.shape[1])))
                stacked[d][ends[k]:ends[k + 1]] = rows
        S, b, whole = self.projected(stacked)

        def gain_of(chosen: list[int]) -> float:
            at = np.concatenate([np.arange(ends[k], ends[k + 1]) for k in chosen])
            if found[0].fixed:
                return float(2 * b[at].sum() - S[np.ix_(at, at)].sum())
            return _joint_gain(S[np.ix_(at, at)], b[at], whole[at])

        chosen: list[int] = []
        gain = -np.inf
        while len(chosen) < len(found):
            trials = {k: gain_of([*chosen, k]) for k in range(len(found)) if k not in chosen}
            best = max(trials, key=lambda k: trials[k] - prices[k])
            if chosen and trials[best] - gain - prices[best] <= DRIVE_MARGIN:
                break
            chosen.append(best)
            gain = trials[best]
        return Candidate(tuple(found[k] for k in chosen), gain,
                         sum(prices[k] for k in chosen) + self.library.name_penalty)

    def refined(self, candidate: Candidate, evaluations: int = COARSE) -> Candidate:
        """Return the candidate with its shape parameters between the grid's values."""
        found = []
        for one in candidate.active:
            if one.term.shape and one.term.drive is not None:
                better = self._refined(one, evaluations)
                trials = [Active(better.term, variant) for variant in one.term.effect.variants]
                one = max(trials, key=lambda a: self.gain(a) - self.library.penalty(a))
            found.append(one)
        return self._together(found)

    def alternatives(self, candidate: Candidate) -> list[Candidate]:
        """Return the candidate in the shapes that its own is easily taken for, refined."""
        found = []
        shapes = [one.term.effect.alternatives(one.term.shape) if issubclass(
            one.term.effect, DriveEffect) else () for one in candidate.active]
        for number in range(min(map(len, shapes))):
            active = []
            for one, others in zip(candidate.active, shapes, strict=True):
                assert one.term.drive is not None
                assert issubclass(one.term.effect, DriveEffect)
                term = self.regression.design.term(one.term.effect, one.term.drive,
                                                   others[number])
                active.append(Active(term, one.variant))
            found.append(self.refined(Candidate(tuple(active), 0.0, 0.0)))
        return found

    def _refined(self, active: Active, evaluations: int) -> Active:
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

            trial, gain = _best_between(low, high, gain_of, evaluations)
            if gain > best_gain:
                shape[name], best_gain = trial, gain
        return Active(design.term(effect, d, shape), active.variant)


def _best_between(low: float, high: float, gain: Callable[[float], float], evaluations: int,
                  ) -> tuple[float, float]:
    """Return where a gain is largest between two values, in their logarithm where both are > 0."""
    if low > 0:
        found = minimize_scalar(lambda x: -gain(float(np.exp(x))), method='bounded',
                                bounds=(np.log(low), np.log(high)),
                                options={'maxiter': evaluations, 'xatol': 1e-5})
        return float(np.exp(found.x)), -float(found.fun)
    found = minimize_scalar(lambda x: -gain(float(x)), method='bounded', bounds=(low, high),
                            options={'maxiter': evaluations, 'xatol': 1e-7})
    return float(found.x), -float(found.fun)


def _gain(S: Array, b: Array, whole: Array, active: Active) -> float:
    if active.term.fixed:
        return float(2 * b[0] - S[0, 0])
    chosen = active.chosen
    return _joint_gain(S[np.ix_(chosen, chosen)], b[chosen], whole[chosen])


def _joint_gain(S: Array, b: Array, whole: Array) -> float:
    if np.any(np.diag(S) <= OWN_SHARE * whole):
        return 0.0
    scale = 1 / np.sqrt(np.diag(S))
    S, b = S * np.outer(scale, scale), b * scale
    if len(b) == 1:
        return float(b[0] ** 2)
    values, axes = np.linalg.eigh(S)
    kept = values > LEAST_EIGENVALUE
    return float(np.sum((axes[:, kept].T @ b) ** 2 / values[kept]))
