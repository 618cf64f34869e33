# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""State of the view of a set of ticks: fit, errors, values and evidence, in stages.

Linear at once, then noise, shapes and the exact model.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from pprs_dynamics.app.workbench.tick_fits import Offer, Tick, TickFits
from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.drives import DriveUnits, common_effort
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.diagnosis.sentences import word_terms
from pprs_dynamics.inference.search.candidates import CandidateSet, CostTerms
from pprs_dynamics.inference.search.estimates import Estimate
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.system.json_records import for_json

# How far a fit has come: at the noise of the fit before; with its own; with its shapes where the
# cost is lowest; and the fitted model evaluated.
LINEAR, FITTED, REFINED, EXACT = 'linear', 'fitted', 'refined', 'exact'
NOT_KNOWN = float('nan')
CHANGED_SHAPES = 1.0  # fall of the cost, from which what the others would gain is looked at again


@dataclass(frozen=True)
class DriveError:
    """Root of the mean squared error of a drive, or of all [N]; NaN where it is not known."""

    before: float
    now: float
    noise: float


@dataclass(frozen=True)
class Share:
    """Share of the squared error in a mask that an unticked effect explains.

    Parameters
    ----------
    effect : str
    drives : tuple of str or None
        On which it would sit.
    explained : float
        Of the squared error there, that would go.
    net : float
        The same less the prior cost of its freedom: what it explains of the whole recording counts
        only in as far as it pays. 0 where it does not pay at all.
    """

    effect: str
    drives: tuple[str, ...] | None
    explained: float
    net: float


@dataclass(frozen=True, eq=False)
class ViewState:
    """A moment.

    Parameters
    ----------
    revision : int
        Of the ticks.
    ticks : mapping of str to Tick
    free, found : CandidateSet
        The best fit of the ticked effects; and with what somebody chose, at the same noise.
    residual : (M, D) array
        With the ticked effects [N].
    estimates : mapping of str to mapping of str to Estimate
        By effect, of the values that are shown; NaN where the deviation is not known yet.
    stage : {'linear', 'fitted', 'refined', 'exact'}
    without : mapping of str to CostTerms
        Of the ticked effects: by how much the cost rises without each, term by term.
    offers : sequence of Offer
        The unticked effects, the best first; of the set before until `has_offers`.
    has_offers : bool
    model : DriveModel, optional
        With the ticked effects, at the last stage.
    notice : str
        Why there is no exact model, where there is none.
    """

    revision: int
    ticks: Mapping[str, Tick]
    free: CandidateSet
    found: CandidateSet
    residual: Array = field(repr=False)
    estimates: Mapping[str, Mapping[str, Estimate]]
    stage: str = LINEAR
    without: Mapping[str, CostTerms] = field(default_factory=dict)
    offers: Sequence[Offer] = ()
    has_offers: bool = False
    model: DriveModel | None = None
    notice: str = ''

    @property
    def is_free(self) -> bool:
        """True where nothing was chosen by hand."""
        return not any(tick.chosen for tick in self.ticks.values())

    @property
    def is_settled(self) -> bool:
        """True where nothing more would follow from these ticks."""
        return self.has_offers and (self.stage == EXACT or not self.ticks)

    @property
    def departure(self) -> float:
        """Cost above that of the best values."""
        return max(self.found.total - self.free.total, 0.0)

    @property
    def is_approximate(self) -> bool:
        """True where an effect is nonlinear and nothing exact is known yet."""
        return self.stage != EXACT and any(tick.effect.nonlinear for tick in self.ticks.values())


def linear(fits: TickFits, last: ViewState, ticks: Mapping[str, Tick], revision: int) -> ViewState:
    """Return the view of ticks at the noise of the previous state; takes milliseconds."""
    free = fits.at([tick.best for tick in ticks.values()], last.free)
    found = _with_chosen(fits, free, ticks)
    stds = {name: {key: estimate.std for key, estimate in last.estimates[name].items()}
            for name in ticks if name in last.estimates
            and last.ticks[name].best is ticks[name].best}
    values = {name: {key: Estimate(value, stds.get(name, {}).get(key, NOT_KNOWN), '')
                     for key, value in every.items()}
              for name, every in fits.values(found).items()}
    residual = fits.residual(found) if ticks else fits.before
    return ViewState(revision, ticks, free, found, residual, values, LINEAR if ticks else FITTED,
                     last.without, last.offers)


def following(fits: TickFits, view: ViewState) -> Iterator[ViewState]:
    """Yield the later stages: fitted noise, gains of other effects, shapes, exact model."""
    free = fits.fits.evaluate(tuple(tick.best for tick in view.ticks.values()))
    view = _fitted(fits, view, free, FITTED)
    yield view
    view = replace(view, offers=fits.offers(view.free), has_offers=True)
    yield view
    if not view.ticks:
        return
    refined = fits.fits.refined(free)
    if refined is not free:
        ticks = {c.name: replace(view.ticks[c.name], best=c) for c in refined.effects}
        view = _fitted(fits, replace(view, ticks=ticks), refined, REFINED)
        yield view
        if refined.total < free.total - CHANGED_SHAPES:
            view = replace(view, offers=fits.offers(view.free))
    view = replace(view, stage=REFINED)
    yield view
    try:
        model, residual, estimates = fits.exact(view.found, view.is_free)
        yield replace(view, model=model, residual=residual, stage=EXACT,
                      estimates=estimates or view.estimates)
    except PprsError as error:
        yield replace(view, stage=EXACT, notice=str(error))


def _fitted(fits: TickFits, view: ViewState, free: CandidateSet, stage: str) -> ViewState:
    without = {}
    for candidate in free.effects:
        rest = tuple(effect for effect in free.effects if effect is not candidate)
        without[candidate.name] = fits.fits.evaluate(rest).terms - free.terms
    free = fits.at(free.effects, free)
    found = _with_chosen(fits, free, view.ticks)
    residual = fits.residual(found) if view.ticks else fits.before
    return replace(view, free=free, found=found, residual=residual, without=without,
                   stage=stage, estimates=fits.estimates(found))


def _with_chosen(fits: TickFits, free: CandidateSet, ticks: Mapping[str, Tick]) -> CandidateSet:
    if not any(tick.chosen for tick in ticks.values()):
        return free
    shaped = fits.at([fits.with_chosen(tick) for tick in ticks.values()], free)
    return fits.held(shaped, list(ticks.values()))


def effect_to_dict(view: ViewState, effect: type[CatalogueEffect], fits: TickFits,
                   called_for: Set[str] | None) -> dict[str, Any]:
    """Return the state of one effect, for JSON.

    Parameters
    ----------
    view : ViewState
    effect : type of CatalogueEffect
    fits : TickFits
    called_for : set of str or None
        Effects that the diagnosis calls for; None where there is none yet.
    """
    tick = view.ticks.get(effect.name)
    offer = next((offer for offer in view.offers if offer.candidate.effect is effect), None)
    candidate = tick.best if tick else offer.candidate if offer else None
    without = view.without.get(effect.name) if tick else None
    evidence = without.total if without else offer.evidence if offer and not tick else None
    return {
        'name': effect.name, 'is_ticked': tick is not None,
        'drives': candidate and fits.design.named(candidate.drives),
        'is_on_drives': issubclass(effect, DriveEffect), 'evidence': for_json(evidence),
        'evidence_terms': '' if without is None else word_terms(without),
        'evidence_is_pending': (view.stage == LINEAR if tick else not view.has_offers),
        'nonlinear': effect.nonlinear,
        'is_called_for': called_for is not None and effect.name in called_for,
        'is_judged': called_for is not None,
        **asdict(effect.card),
        'parameters': _parameters(view, effect, fits) if tick else []}


def units_to_dict(model: DriveModel) -> dict[str, Any]:
    """Return the units of all drives together, and drive by drive."""
    return {'unit': common_effort(model.units), 'units': {
        drive: {'effort': unit.effort, 'position': unit.position, 'velocity': unit.of('m/s'),
                'acceleration': unit.of('m/s^2').replace('^2', '²')}
        for drive, unit in zip(model.drives, model.units, strict=True)}}


def _parameters(view: ViewState, effect: type[CatalogueEffect], fits: TickFits,
                ) -> list[dict[str, Any]]:
    units = dict(zip(fits.drives, fits.model.units, strict=True))
    chosen = {fits.key(*place) for place in view.ticks[effect.name].chosen}
    known = {parameter.name: parameter for parameter in effect.parameters}
    shapes = {parameter.name for parameter in effect.shape}
    rows = []
    for key, estimate in view.estimates.get(effect.name, {}).items():
        drive, name = effect.place_and_parameter(key)
        unit = units.get(drive, DriveUnits())
        parameter = known[name].of(unit.turns)
        rows.append({
            'key': key, 'symbol': parameter.symbol, 'value': for_json(estimate.value),
            'std': for_json(estimate.std), 'description': parameter.description,
            'unit': unit.of(parameter.unit),
            'lower': parameter.lower, 'upper': parameter.upper, 'scale': parameter.scale,
            'is_shape': parameter.name in shapes, 'is_relative': parameter.is_relative,
            'is_chosen': key in chosen})
    return rows


def recordings_to_dict(recordings: Mapping[str, Recording], fits: TickFits, now: Array,
                       ) -> list[dict[str, Any]]:
    """Return every recording with its times and its error before and now."""
    found, first = [], 0
    time = fits.design.residuals.time
    for (key, recording), reconstruction in zip(
            recordings.items(), fits.design.reconstructions, strict=True):
        part = slice(first, first + len(reconstruction.treat.starts))
        first = part.stop
        found.append({
            'key': key, 'name': recording.name,
            'start': float(time[part][0]), 'end': float(time[part][-1]),
            'before': for_json(root_mean_square(fits.before[part])),
            'now': for_json(root_mean_square(now[part])),
            'findings': [finding.text for finding in recording.findings]})
    return found


def errors_of(fits: TickFits, view: ViewState, noise: Mapping[str, float]) -> dict[str, DriveError]:
    """Return the errors of the measured drives."""
    return {name: DriveError(root_mean_square(fits.before[:, d]),
                             root_mean_square(view.residual[:, d]), noise.get(name, NOT_KNOWN))
            for d, name in enumerate(fits.drives) if np.isfinite(fits.before[:, d]).any()}
