# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Candidates: effects on drives and in the structure, patterns, and their prior costs."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import comb, inf, log, log1p
from operator import add, sub
from typing import Any, ClassVar

import numpy as np
from scipy.special import log_ndtr

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DriveUnits
from pprs_dynamics.inference.regression.joint_fit import JointFit, Regression
from pprs_dynamics.inference.regression.normal_equations import Block
from pprs_dynamics.inference.search.decisions import Decisions
from pprs_dynamics.inference.search.patterns import CURVE, Family, Pattern
from pprs_dynamics.physics.effects.catalogue import CATALOGUE, catalogue
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.effects.structure_effect import AddedBody
from pprs_dynamics.physics.model.drive_model import DriveModel

RowKey = frozenset[tuple[str, str]]  # names with their place, and kinds of courses
COURSE_TIMES = 200  # beginnings that are tried, evenly over the recordings
SINCE, DURING, DRIFT = 'since', 'during', 'drift'  # kinds of courses
# Kinds of nuisance columns: how friction reverses, deviations that effects declare, and any others.
REVERSAL, FORM, WAVES = 'reversal', 'form', 'waves'


@dataclass(frozen=True)
class CostTerms:
    """Terms of a cost, each -2 ln of a probability but for a constant; they add up to it.

    Parameters
    ----------
    fit : float
        Misfit: the residual in units of its noise, and ln of the noise.
    coefficients : float
        Prior of the coefficients: distance from its mean, and gain of precision over it.
    names : float
        Choice of the effects, with the odds of one more effect, of a zero, a gain or a pattern.
    drives : float
        Choice of the drives.
    shapes : float
        Choice of variants and shapes among those tried.
    signs : float
        Signs of coefficients; negative for physical ones.
    feasibility : float
        By how much possible bodies, and friction and inertia that are not negative, fit worse
        than those of the least squares.
    linearisation : float
        By how much the exact forces of its own fitted model fit worse than the linear ones; 0
        where that was not computed.
    forms : float
        What a form error of its effects explains, less than nothing.
    """

    fit: float = 0.0
    coefficients: float = 0.0
    names: float = 0.0
    drives: float = 0.0
    shapes: float = 0.0
    signs: float = 0.0
    feasibility: float = 0.0
    linearisation: float = 0.0
    forms: float = 0.0

    @property
    def total(self) -> float:
        """The cost."""
        return float(sum(vars(self).values()))

    def __add__(self, other: CostTerms) -> CostTerms:
        return CostTerms(*map(add, vars(self).values(), vars(other).values()))

    def __sub__(self, other: CostTerms) -> CostTerms:
        return CostTerms(*map(sub, vars(self).values(), vars(other).values()))


@dataclass(frozen=True)
class Course:
    """When an effect is there, of the time of all recordings together [s].

    Parameters
    ----------
    kind : {'since', 'during', 'drift'}
        From `begin` on; from `begin` to `end`; or growing in proportion to the time from nothing
        at `begin`.
    begin, end : float
    """

    kind: str
    begin: float
    end: float

    def weight(self, time: Array, period: float) -> Array:
        """Return the present share of the effect at times, (M,), as means over a period."""
        if self.kind == DRIFT:
            share: Array = (time - self.begin) / max(self.end - self.begin, 1e-300)
            return share
        share = np.clip((time - self.begin) / period + 0.5, 0.0, 1.0)
        if self.kind == DURING:
            share = share * np.clip((self.end - time) / period + 0.5, 0.0, 1.0)
        return share


@dataclass(frozen=True)
class Component:
    """An effect on one drive or in the structure: what it is, and no arrays.

    The columns come from a linearisation (`Components.block`), so that a component means the same
    around every operating point.

    Parameters
    ----------
    effect : type of CatalogueEffect
    drive : int or None
    names : tuple of str
        Coefficients that are fitted; none where the shape says it all.
    shape : tuple of (str, float)
        Parameters of the shape, by name.
    centre : tuple of float
        Of an added body with a first moment: about where it is, from its place's centre [m].
    given : tuple of float
        All coefficients that the given model has of the effect there, which the fitted ones
        change; none where it does not have it.
    course : Course or None
        None: all the time.
    is_shared : bool
        Its shape is that of the effect on all drives whose components are shared.
    """

    effect: type[CatalogueEffect]
    drive: int | None
    names: tuple[str, ...]
    shape: tuple[tuple[str, float], ...] = ()
    centre: tuple[float, ...] = ()
    given: tuple[float, ...] = ()
    course: Course | None = None
    is_shared: bool = False

    @classmethod
    def of(cls, effect: type[CatalogueEffect], drive: int | None, shape: Mapping[str, float],
           names: tuple[str, ...]) -> Component:
        """Return an effect on a drive or in the structure, of one shape."""
        return cls(effect, drive, names, tuple(sorted(shape.items())))

    def is_within(self, coefficients: Array, units: DriveUnits) -> bool:
        """Return whether all linear parameters are within their bounds in a drive of such units."""
        values = self.values(coefficients)
        return all(p.lower <= values[p.name] <= p.upper
                   for p in (parameter.of(units.turns) for parameter in self.effect.linear))

    @property
    def signed(self) -> tuple[str, ...]:
        """Fitted coefficients of which one sign is unphysical."""
        return tuple(name for name in self.names if name in self.effect.unphysical_below)

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters of the shape."""
        return dict(self.shape)

    def every(self, coefficients: Array) -> Array:
        """Return the coefficients of all of the effect's, 0 for those that are not fitted."""
        if not self.names:
            return coefficients
        known = [c.name for c in self.effect.coefficients]
        found = np.zeros(len(known))
        found[[known.index(name) for name in self.names]] = coefficients
        return found

    def total(self, coefficients: Array) -> Array:
        """Return all coefficients of the effect, those of the given model added."""
        every = self.every(coefficients)
        if self.centre and issubclass(self.effect, AddedBody):
            # Columns about another centre than the body's put its distance from it in its inertia.
            every = self.effect.about_own_centre(self.names, every, self.centre)
        return every + np.array(self.given) if self.given else every

    def values(self, coefficients: Array) -> dict[str, float]:
        """Return all linear parameters of the effect, with what the given model has of it."""
        every = {c.name: float(value) for c, value in zip(
            self.effect.coefficients, self.total(coefficients), strict=False)}
        return {name: float(value) for name, value in self.effect.from_coefficients(every).items()}


@dataclass(frozen=True)
class EffectCandidate:
    """An effect on some drives, or in the structure.

    Parameters
    ----------
    effect : type of CatalogueEffect
    components : tuple of Component
        One for each drive, ascending, or one.
    """

    effect: type[CatalogueEffect]
    components: tuple[Component, ...]

    @classmethod
    def of(cls, components: Iterable[Component]) -> EffectCandidate:
        """Return the candidate of components of one effect."""
        ordered = tuple(sorted(components, key=lambda c: -1 if c.drive is None else c.drive))
        return cls(ordered[0].effect, ordered)

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name

    @property
    def course(self) -> Course | None:
        """When it is there; None: all the time."""
        return self.components[0].course

    @property
    def placed_name(self) -> str:
        """Name, with the link or joint of an effect that is on one: what a rival denies."""
        places = self.effect.places_of(self.components[0].names)
        return f'{self.name}:{places[0][0]}' if places else self.name

    @property
    def rank(self) -> tuple[Any, ...]:
        """Place in a set: that of the catalogue, before patterns of no catalogue."""
        return (0, list(catalogue()).index(self.name), self.drives or ())

    @property
    def drives(self) -> tuple[int, ...] | None:
        """Drives on which it sits; None for the structure."""
        drives = [component.drive for component in self.components]
        return None if drives[0] is None else tuple(d for d in drives if d is not None)

    @property
    def key(self) -> Hashable:
        """What makes it differ from other candidates."""
        return self

    @property
    def shared(self) -> frozenset[str]:
        """Names of parameters that all its drives have in common."""
        return frozenset(parameter.name for parameter in self.effect.shape if all(
            component.is_shared for component in self.components))

    @property
    def hypotheses(self) -> frozenset[Hashable]:
        """Hypotheses that it contains, each with the prior odds of a name.

        With other coefficients, on other drives or on one, it may be more than one hypothesis:
        asymmetric friction that is dry and viscous is two.
        """
        return frozenset[Hashable]().union(*(self.effect.hypotheses(component.names)
                                             for component in self.components))


@dataclass(frozen=True, eq=False)
class UnknownCandidate:
    """A pattern of the error of a drive that belongs to no effect of the catalogue.

    Parameters
    ----------
    family : Family
    pattern : Pattern
    drive : int
    rows : (1 or 2, M) array
        In time [1].
    block : Block
    terms : CostTerms
        Of its prior cost.
    """

    components: ClassVar[tuple[Component, ...]] = ()  # none of the catalogue's

    family: Family
    pattern: Pattern
    drive: int
    rows: Array = field(repr=False)
    block: Block = field(repr=False)
    terms: CostTerms

    @property
    def name(self) -> str:
        """Name in lists of effects."""
        return f'unknown, {self.family.variable}'

    @property
    def rank(self) -> tuple[Any, ...]:
        """Place in a set."""
        return (1, self.family.variable, self.drives, repr(self.pattern))

    @property
    def drives(self) -> tuple[int, ...]:
        """Drives on which it sits."""
        return (self.drive,)

    @cached_property
    def key(self) -> Hashable:
        """What makes it differ from other candidates."""
        return (self.drives, self.family.variable, self.pattern)


Candidate = EffectCandidate | UnknownCandidate
Candidates = tuple[Candidate, ...]


@dataclass(frozen=True, eq=False)
class CandidateSet:
    """A set of candidates, fitted.

    Parameters
    ----------
    candidates : tuple of Candidate
    fit : JointFit
    terms : CostTerms
        Of the penalised deviance with all prior costs.
    blocks : mapping of Component to Block
        Columns of the components.
    nuisance : mapping of Component to mapping of str to Block
        Columns for the uncertainty of the components' forms by kind, fitted with them.
    barred : str
        Why it is inadmissible: no possible values come near, or a candidate may be the form error
        of others; '' for an admissible set.
    form_of : tuple of Candidate, optional
        The set of which one of its candidates may be a form error.
    with_form : CandidateSet, optional
        The set with a form error of this one, by which it costs less.
    """

    candidates: tuple[Candidate, ...]
    fit: JointFit
    terms: CostTerms
    blocks: Mapping[Component, Block] = field(default_factory=dict, repr=False)
    nuisance: Mapping[Component, Mapping[str, Block]] = field(default_factory=dict, repr=False)
    barred: str = ''
    form_of: Candidates | None = field(default=None, repr=False)
    with_form: CandidateSet | None = field(default=None, repr=False)

    @property
    def nuisance_blocks(self) -> tuple[Block, ...]:
        """Columns for the uncertainty of forms, of all components."""
        return tuple(block for blocks in self.nuisance.values() for block in blocks.values())

    @cached_property
    def total(self) -> float:
        """Sum of all terms, also of an inadmissible set."""
        return self.terms.total

    @property
    def form(self) -> Candidates:
        """Candidates that are a form error of the set; none where it has none."""
        return () if self.with_form is None else tuple(
            c for c in self.with_form.candidates if c not in self.candidates)

    @property
    def plain(self) -> float:
        """Sum of all terms but form errors."""
        return self.total - self.terms.forms

    @property
    def is_admissible(self) -> bool:
        """Whether it may be."""
        return not self.barred

    @property
    def cost(self) -> float:
        """Cost that the search minimises: infinite for an inadmissible set."""
        return self.total if self.is_admissible else inf

    @cached_property
    def key(self) -> Hashable:
        """Key that is equal for sets of the same candidates."""
        return set_key(self.candidates)

    @property
    def effects(self) -> tuple[EffectCandidate, ...]:
        """Effects of the catalogue."""
        return tuple(c for c in self.candidates if isinstance(c, EffectCandidate))

    @cached_property
    def row_key(self) -> RowKey:
        """Names of the candidates, whatever their drives and shapes."""
        return frozenset((candidate.placed_name, candidate.course.kind if candidate.course else '')
                         if isinstance(candidate, EffectCandidate)
                         else (candidate.name, CURVE * (candidate.pattern.kind == CURVE))
                         for candidate in self.candidates)

    @property
    def is_dated(self) -> bool:
        """Whether one of its effects begins, ends or grows within the recordings."""
        return any(candidate.course is not None for candidate in self.effects)

    @property
    def is_nonlinear(self) -> bool:
        """Whether an effect that is there all the time changes how others show.

        What begins within the recordings is part of no linearisation.
        """
        return any(candidate.effect.nonlinear for candidate in self.effects
                   if candidate.course is None)

    @property
    def unknowns(self) -> tuple[UnknownCandidate, ...]:
        """Patterns of no catalogue."""
        return tuple(c for c in self.candidates if isinstance(c, UnknownCandidate))

    def without(self, *gone: Candidate) -> tuple[Candidate, ...]:
        """Return the candidates but some."""
        return tuple(c for c in self.candidates if not any(c is left_out for left_out in gone))

    def coefficients(self, component: Component) -> Array:
        """Return the coefficients of a component; not that of what is known of it."""
        return self.fit.of(self.blocks[component])[:max(len(component.names), 1)]

    def blocks_of(self, candidate: Candidate) -> tuple[Block, ...]:
        """Return the columns of a candidate."""
        if isinstance(candidate, UnknownCandidate):
            return (candidate.block,)
        return tuple(self.blocks[component] for component in candidate.components)


def set_key(candidates: tuple[Candidate, ...]) -> Hashable:
    """Return a key that is equal for sets of the same candidates."""
    return frozenset(candidate.key for candidate in candidates)


@dataclass(frozen=True)
class PriorCosts:
    """Twice the logarithms of prior odds, for everything that is chosen.

    Parameters
    ----------
    names : int
        Effects that the robot can have.
    drives : int
    samples : int
        Of a drive.
    decisions : Decisions
    """

    names: int
    drives: int
    samples: int
    decisions: Decisions

    @classmethod
    def of(cls, regression: Regression, decisions: Decisions,
           model: DriveModel | None = None) -> PriorCosts:
        """Return the prior costs for the drives and samples of a regression, of a model's errors.

        Names are those of effects that can act in what it is a model of, those of other packages
        among them. Of errors without a model they are the package's own.
        """
        names = len(CATALOGUE) if model is None else sum(
            map(model.offers, catalogue().values()))
        return cls(names, len(regression.drives), regression.samples, decisions)

    def of_name(self) -> float:
        """Return the prior cost of one more effect."""
        return 2 * log(self.names) - 2 * log(self.decisions.effect_odds)

    def of_drives(self, count: int) -> float:
        """Return the prior cost of a choice of drives: all, one or some; how many, and which.

        One cause is in one drive or in all of them; to be in five of seven takes five.
        """
        D = self.drives
        some = max(D - 2, 1) if 1 < count < D else 1
        return 2 * log(min(D, 3)) + 2 * log(some) + 2 * log(comb(D, count))

    def of_candidate(self, candidate: Candidate,
                     of_component: Callable[[Component], CostTerms]) -> CostTerms:
        """Return the prior cost of what was chosen: hypotheses, drives, and each component.

        A shape that components share was chosen once.
        """
        if isinstance(candidate, UnknownCandidate):
            return candidate.terms
        terms = CostTerms(
            names=len(candidate.hypotheses) * self.of_name(),
            drives=0.0 if candidate.drives is None else self.of_drives(len(candidate.components)),
            shapes=0.0 if candidate.course is None else self.of_course(candidate.course))
        costs = [of_component(component) for component in candidate.components]
        shared = [k for k, component in enumerate(candidate.components) if component.is_shared]
        for k in shared[1:]:
            costs[k] = replace(costs[k], shapes=0.0)
        return sum(costs, terms)

    def of_component(self, effect: type[CatalogueEffect], tried: int) -> float:
        """Return the prior cost of a variant and of a shape among those tried.

        A shape is worth at least what a coefficient of weak prior is.
        """
        prior_cost = 2 * log(len(effect.variants))
        if effect.shape:
            prior_cost += max(len(effect.shape) * log(self.samples), 2 * log(max(tried, 1)))
        return prior_cost

    def of_course(self, course: Course) -> float:
        """Return the prior cost of a change within the recordings: that there is one, and when."""
        times = {SINCE: 1, DURING: 2, DRIFT: 0}[course.kind]
        return 2 * times * log(COURSE_TIMES) - 2 * log(self.decisions.onset_odds)

    def of_pattern(self, families: int, patterns: int) -> CostTerms:
        """Return the prior cost of an unknown pattern among those tried on each drive."""
        return CostTerms(names=self.of_name() - 2 * log(self.decisions.unknown_odds),
                         drives=self.of_drives(1),
                         shapes=2 * log(families) + 2 * log(patterns))

    def of_sign(self, deviations: float) -> float:
        """Return the penalty of a coefficient that is physical on one side only.

        -2 ln of the prior's mean over the posterior: e of the prior probability is on the wrong
        side, where e are the odds of a wrong sign.

        Parameters
        ----------
        deviations : float
            Distance from the least physical value, in standard deviations of the posterior.
        """
        e = self.decisions.wrong_sign_odds
        return -2 * float(log(2) + np.logaddexp(log1p(-e) + log_ndtr(deviations),
                                                log(e) + log_ndtr(-deviations)))


def joined(candidates: Candidates, components: Iterable[Component]) -> Candidates:
    """Return candidates with more components, each in the candidate of its effect if there is."""
    for component in components:
        old = next((c for c in candidates if isinstance(c, EffectCandidate)
                    and c.effect is component.effect and c.course == component.course), None)
        candidates = (*(c for c in candidates if c is not old),
                      EffectCandidate.of([*(old.components if old else ()), component]))
    return candidates
