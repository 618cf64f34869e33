"""Around which model effects are searched.

Some effects bend all columns: a delay, a shifted zero, a force constant, an offset of the centre of
mass, a tilt of the base. Their own columns hold only nearby, too, since friction follows loads.
Where one of these is adopted, the search starts again around a model that has it. And where such an
effect competes with another one for the first place, both ways are gone to their end and compared
there. Where several effects are adopted and reversals turn over in widths far from the model's, the
search starts again around these widths: what a linear column leaves of them looks like friction.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pprs_dynamics.diagnosis.adoption import fitted_model
from pprs_dynamics.diagnosis.form import within_form
from pprs_dynamics.diagnosis.joint_fit import Regression
from pprs_dynamics.diagnosis.judging import MARGIN, Judged, actives_of
from pprs_dynamics.diagnosis.reversal_widths import estimate_widths, with_widths
from pprs_dynamics.diagnosis.selection import FAR_SCORE, NEAR_SCORE, Selection, Selector
from pprs_dynamics.measurement.recording import Recording
from pprs_dynamics.model.force_model import ForceModel
from pprs_dynamics.regression.design import Design

# Effects that change how all others show, or that their columns describe only nearby.
NOT_LINEAR = frozenset({'time_delay', 'homing_error', 'effort_gain', 'payload_offset',
                        'base_tilt'})
# Widths of reversal so much larger or smaller than the model's bend the columns of friction, too.
FAR_WIDTH = 1.5
COMPETES = 0.5  # of the best evidence, from which on an effect may be the first, too
# Shares of the work, for the progress bar.
DESIGN, FIRST, AGAIN = 0.5, 0.5, 0.25

Report = Callable[[float], None]


@dataclass(frozen=True)
class Stage:
    """A selection from one model."""

    design: Design
    regression: Regression
    selector: Selector
    selection: Selection

    @classmethod
    def of(cls, model: ForceModel, recordings: Sequence[Recording], report: Report,
           earlier: Sequence[Judged] = ()) -> Stage:
        """Return the selection around a model that has some effects already."""
        design = Design.of(model, recordings, lambda share: report(DESIGN * share))
        return cls.around(design, lambda share: report(DESIGN + (1 - DESIGN) * share), earlier)

    @classmethod
    def around(cls, design: Design, report: Report, earlier: Sequence[Judged] = (),
               excluded: Collection[str] = ()) -> Stage:
        """Return the selection from a design's columns."""
        regression = Regression(design)
        selector = Selector(regression, report, earlier, excluded)
        selection = selector.select()
        regression.tell_widths(list(estimate_widths(regression, selection.fit)))
        return cls(design, regression, selector, selection)

    def with_only(self, one: Judged) -> Stage:
        """Return the stage as if one candidate for the first place had been all."""
        selection = replace(self.selection, adopted=[one], fit=one.fit, rivals={})
        selection.rivals = self.selector.find_rivals(selection)
        regression = Regression(self.design)
        regression.tell_widths(list(estimate_widths(regression, one.fit)))
        return replace(self, regression=regression, selection=selection)


@dataclass(frozen=True)
class Way:
    """From the model as given to all effects.

    Parameters
    ----------
    first : Stage
    bent : tuple of Judged
        Of the first stage, and in the model of the last.
    last : Stage
        The first, where nothing bends.
    """

    first: Stage
    bent: tuple[Judged, ...]
    last: Stage

    @property
    def adopted(self) -> list[Judged]:
        """All effects, those in the last stage's model first."""
        return [*self.bent, *self.last.selection.adopted]

    @property
    def cost(self) -> float:
        """Deviance at the end with the prices of all effects; the cheaper way is better."""
        return self.last.selection.fit.deviance + sum(
            one.candidate.penalty + MARGIN for one in self.adopted)

    def may_leave(self, squares: float) -> bool:
        """Return whether squares, whitened, may be what the form of an effect leaves here."""
        selection = self.last.selection
        active = actives_of(selection.adopted)
        return any(within_form(squares, one.candidate, active, selection.fit.noises,
                               self.last.regression) for one in selection.adopted)

    @property
    def rivals(self) -> dict[str, list[str]]:
        """Effects that explain as well as an adopted one."""
        early, late = self.first.selection.rivals, self.last.selection.rivals
        found = {one.candidate.name: early.get(one.candidate.name, []) for one in self.bent}
        for name, others in late.items():
            found[name] = list(dict.fromkeys((*found.get(name, []), *others)))
        return found


def find_way(model: ForceModel, recordings: Sequence[Recording], report: Report) -> Way:
    """Return the way on which effects explain the recordings best.

    Raises
    ------
    PprsError
        As `measure_residuals`.
    """
    way = _followed(Stage.of(model, recordings, lambda share: report(FIRST * share)), recordings,
                     lambda share: report(FIRST + AGAIN * share))
    contender = _contender(way.first)
    if contender is None:
        report(1.0)
        return way
    favourite = way.first.selection.adopted[0].candidate.name
    other = _without(way, favourite, contender, recordings,
                     lambda share: report(FIRST + AGAIN + AGAIN * share))
    report(1.0)
    better, worse = sorted((way, other), key=lambda one: one.cost)
    if len(worse.adopted) < len(better.adopted) and worse.may_leave(worse.cost - better.cost):
        return worse
    names = favourite, contender.candidate.name
    _tell_rivals(better, worse, names if better is way else names[::-1])
    return better


def _followed(first: Stage, recordings: Sequence[Recording], report: Report) -> Way:
    """Return the way from a first stage on."""
    adopted = first.selection.adopted
    bent = tuple(one for one in adopted if one.candidate.name in NOT_LINEAR)
    widths = _far_widths(first) if adopted else {}
    if not bent and not (widths and len(adopted) > 1):
        return Way(first, (), first)
    model = with_widths(model_with(first, bent), first.design, widths)
    return Way(first, bent, Stage.of(model, recordings, report, bent))


def _far_widths(stage: Stage) -> dict[int, float]:
    """Return widths of reversal that are far from the model's [m/s]."""
    old = np.broadcast_to(stage.design.model.reversal.velocity, len(stage.design.drives))
    found = estimate_widths(stage.regression, stage.selection.fit)
    return {d: width for d, width in found.items()
            if not 1 / FAR_WIDTH < width / old[d] < FAR_WIDTH}


def _contender(first: Stage) -> Judged | None:
    """Return what competes for the first place, where only one of the two bends the columns."""
    selection = first.selection
    if not selection.adopted:
        return None
    bends = selection.adopted[0].candidate.name in NOT_LINEAR
    names = {one.candidate.name for one in selection.adopted}
    return next((
        one for one in selection.candidates
        if (one.candidate.name in NOT_LINEAR) != bends and one.candidate.name not in names
        and one.evidence > COMPETES * selection.candidates[0].evidence
        and first.selector.stands_alone(one)), None)


def _without(way: Way, favourite: str, contender: Judged, recordings: Sequence[Recording],
             report: Report) -> Way:
    """Return the way on which a contender has the first place and its favourite none."""
    first = way.first
    if contender.candidate.name in NOT_LINEAR:
        return _followed(first.with_only(contender), recordings, report)
    straight = Stage.around(first.design, report, excluded=(favourite,))
    # What could be the first of all remains what it was.
    straight.selection.candidates = first.selection.candidates
    return _followed(straight, recordings, report)


def _tell_rivals(better: Way, worse: Way, names: tuple[str, str]) -> None:
    """Make the worse way's effect a rival, where it is hardly worse; where it is far, none."""
    name, other = names
    if name not in {one.candidate.name for one in better.adopted}:
        return
    bent = {one.candidate.name for one in better.bent}
    stage = better.first if name in bent else better.last
    known = stage.selection.rivals.get(name, [])
    gap = worse.cost - better.cost
    if gap < NEAR_SCORE and other not in known:
        stage.selection.rivals[name] = [*known, other]
    elif gap > FAR_SCORE:
        stage.selection.rivals[name] = [rival for rival in known if rival != other]


def model_with(stage: Stage, adopted: Sequence[Judged]) -> ForceModel:
    """Return the model with some of what a stage adopted, its own numbers as they were."""
    fit = stage.selection.fit
    kept = {id(active) for active in actives_of(adopted)}
    place = len(stage.design.base)
    active, places = [], list(range(place))
    for one in fit.active:
        if id(one) in kept:
            active.append(one)
            places += range(place, place + one.size)
        place += one.size
    part = replace(fit, active=tuple(active), coefficients=fit.coefficients[places],
                   covariance=fit.covariance[np.ix_(places, places)])
    return fitted_model(stage.regression, part, calibrate=False)
