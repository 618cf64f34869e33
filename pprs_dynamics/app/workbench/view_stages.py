# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Stages of a fit of ticked effects: linear at once, then noise, shapes and the exact model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from pprs_dynamics.app.workbench.tick_fits import Tick, TickFits
from pprs_dynamics.app.workbench.view_state import (
    EXACT,
    FITTED,
    LINEAR,
    NOT_KNOWN,
    REFINED,
    ViewState,
)
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.search.candidates import CandidateSet
from pprs_dynamics.inference.search.estimates import Estimate

CHANGED_SHAPES = 1.0  # fall of the cost, from which what the others would gain is looked at again


def without_ticks(fits: TickFits, revision: int) -> ViewState:
    """Return what is shown of a model as it is."""
    return ViewState(revision, {}, fits.none, fits.none, fits.before, {}, FITTED)


def linear(fits: TickFits, last: ViewState, ticks: Mapping[str, Tick], revision: int) -> ViewState:
    """Return what is shown of ticks at the noise of the state before, in milliseconds."""
    free = fits.at([tick.best for tick in ticks.values()], last.free)
    found = _with_chosen(fits, free, ticks)
    stds = {name: {key: one.std for key, one in last.estimates[name].items()}
            for name in ticks if name in last.estimates
            and last.ticks[name].best is ticks[name].best}
    values = {name: {key: Estimate(value, stds.get(name, {}).get(key, NOT_KNOWN), '')
                     for key, value in every.items()}
              for name, every in fits.values(found).items()}
    residual = fits.residual(found) if ticks else fits.before
    return ViewState(revision, ticks, free, found, residual, values, LINEAR if ticks else FITTED,
                     last.evidence, last.offers)


def following(fits: TickFits, view: ViewState) -> Iterator[ViewState]:
    """Yield what follows: the noise fitted, what others would gain, shapes, the model itself."""
    free = fits.fitted([tick.best for tick in view.ticks.values()])
    view = _fitted(fits, view, free, FITTED)
    yield view
    view = replace(view, offers=fits.offers(view.free), has_offers=True)
    yield view
    if not view.ticks:
        return
    refined = fits.refined(free)
    if refined is not free:
        ticks = {c.name: replace(view.ticks[c.name], best=c) for c in refined.effects}
        view = _fitted(fits, replace(view, ticks=ticks), refined, REFINED)
        yield view
        if refined.total < free.total - CHANGED_SHAPES:
            view = replace(view, offers=fits.offers(view.free))
    view = replace(view, stage=REFINED)
    yield view
    try:
        exact = fits.exact(view.found, view.is_free)
        yield replace(view, exact=exact, residual=exact.residual, stage=EXACT,
                      estimates=exact.parameters or view.estimates)
    except PprsError as error:
        yield replace(view, stage=EXACT, notice=str(error))


def _fitted(fits: TickFits, view: ViewState, free: CandidateSet, stage: str) -> ViewState:
    evidence = {}
    for candidate in free.effects:
        rest = [one for one in free.effects if one is not candidate]
        evidence[candidate.name] = fits.fitted(rest).total - free.total
    free = fits.at(free.effects, free)
    found = _with_chosen(fits, free, view.ticks)
    residual = fits.residual(found) if view.ticks else fits.before
    return replace(view, free=free, found=found, residual=residual, evidence=evidence,
                   stage=stage, estimates=fits.estimates(found))


def _with_chosen(fits: TickFits, free: CandidateSet, ticks: Mapping[str, Tick]) -> CandidateSet:
    if not any(tick.chosen for tick in ticks.values()):
        return free
    shaped = fits.at([fits.with_chosen(tick) for tick in ticks.values()], free)
    return fits.held(shaped, list(ticks.values()))
