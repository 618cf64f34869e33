"""All that the catalogue offers for a design: terms by drive and shape, with their prices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.diagnosis.joint_fit import Active, Regression
from pprs_dynamics.diagnosis.noise import NoiseModel
from pprs_dynamics.diagnosis.parallel import each
from pprs_dynamics.effects.catalogue import catalogue
from pprs_dynamics.effects.drive_effect import DriveEffect
from pprs_dynamics.effects.effect import CatalogueEffect
from pprs_dynamics.effects.homing_error import HomingError
from pprs_dynamics.regression.design import Term

# Of its square, at least this share of a column must be its own, in single precision.
SCANNED_SHARE = 1e-5
LEAST_EIGENVALUE = 1e-5
HELD = 1e-3  # of a column's square may lie outside the span of another effect's


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


def holds(larger: Candidate, smaller: Candidate) -> bool:
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
        for d, (terms, trials) in zip(regression.series, each(
                lambda d: self._local_terms(d, present), regression.series), strict=True):
            self.local[d] = terms
            self.trials.update({(name, d): count for name, count in trials.items()})
        self._groups: dict[int, list[Group]] = {}
        self._rows: dict[int, Array] = {}
        self._white: dict[int, list[tuple[NoiseModel, Array]]] = {d: [] for d in self.local}

    def _local_terms(
        self, d: int, present: set[tuple[str, str]],
    ) -> tuple[list[Term], dict[str, int]]:
        """Return the terms of a drive, and how many shapes of each effect are tried."""
        design = self.regression.design
        terms, trials = [], {}
        for effect in catalogue().values():
            if (not issubclass(effect, DriveEffect) or effect is HomingError
                    or (effect.name, design.drives[d]) in present
                    or (effect.needs_motion and not design.moves(d))
                    or not design.model.offers(effect)):
                continue
            shapes = effect.trials(design.covered[d])
            trials[effect.name] = len(shapes)
            terms += design.trial_terms(effect, d, shapes)
        return terms, trials

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

    def special_cases(self, candidate: Candidate) -> list[Candidate]:
        """Return effects without a shape, on the same drives, that the candidate can be as well."""
        drives = candidate.drives
        if drives is None:
            return []
        by_effect: dict[type[CatalogueEffect], dict[int | None, Term]] = {}
        for term in (term for terms in self.local.values() for term in terms):
            if not term.shape and not term.fixed and term.effect is not candidate.effect:
                by_effect.setdefault(term.effect, {})[term.drive] = term
        found = []
        for effect, terms in by_effect.items():
            for variant in effect.variants if set(drives) <= set(terms) else ():
                active = tuple(Active(terms[d], variant) for d in drives)
                one = Candidate(active, 0.0, sum(map(self.penalty, active)) + self.name_penalty)
                if holds(candidate, one):
                    found.append(one)
        return found

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


def scanned_variants(effect: type[CatalogueEffect]) -> list[tuple[str, ...]]:
    """Return the variants that the rows of a scan suffice for."""
    return [variant for variant in effect.variants if set(variant) <= set(effect.scanned)]
