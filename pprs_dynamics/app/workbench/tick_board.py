# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Ticks on a model, and everything that follows from them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from threading import RLock

import numpy as np

from pprs_dynamics.app.workbench.errors import SessionError, StaleError
from pprs_dynamics.app.workbench.shown import (
    EXACT,
    FITTED,
    LINEAR,
    NOT_KNOWN,
    REFINED,
    DriveError,
    Shown,
    errors_of,
    rms,
)
from pprs_dynamics.app.workbench.what_if import Tick, WhatIf
from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.search.candidates import CandidateSet
from pprs_dynamics.inference.search.estimates import Estimate
from pprs_dynamics.measurement.residuals.residuals import Residuals
from pprs_dynamics.physics.effects.catalogue import catalogue
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.model.force_model import ForceModel

CHANGED_SHAPES = 1.0  # fall of the cost, from which what the others would gain is looked at again


class TickBoard:
    """Effects of a model's recordings that are ticked, and what they would do to its error.

    Ticks are answered at once, at the noise as it is; `settle` fits the noise and the shapes
    beside them and evaluates the fitted model. All methods may be called from several threads.

    Parameters
    ----------
    what_if : WhatIf

    Attributes
    ----------
    revision : int
        Counts what somebody changed.
    version : int
        Counts every change of what is shown.
    """

    def __init__(self, what_if: WhatIf) -> None:
        self.revision = self.version = 0
        self.noise_floors: dict[str, float] | None = None
        self._lock, self._settling, self._scanning = RLock(), RLock(), RLock()
        self._listeners: list[Callable[[], None]] = []
        self._use(what_if)

    def _use(self, what_if: WhatIf, ticks: Mapping[str, Tick] | None = None) -> None:
        """Begin with a model, from what was ticked under another."""
        with self._lock:
            self._what_if, self.noise_floors = what_if, None
            self.revision += 1
            none = what_if.none
            self._shown = Shown(self.revision, {}, none, none, what_if.before, {}, FITTED)
            for name, tick in (ticks or {}).items():
                on = tick.best.drives
                with suppress(PprsError):  # what cannot act under this model is ticked no more
                    self.tick(name, [what_if.drives[d] for d in on] if on else None)
            self.tell()

    @contextmanager
    def steady(self) -> Iterator[None]:
        """Keep everything as it is while the block lasts, so that it belongs together."""
        with self._lock:
            yield

    def subscribe(self, listener: Callable[[], None]) -> Callable[[], None]:
        """Call a function after every change, and return one that ends this."""
        with self._lock:
            self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    def tell(self) -> None:
        """Tell everybody that something changed."""
        with self._lock:
            self.version += 1
            listeners = list(self._listeners)
        for listener in listeners:
            listener()

    @property
    def model(self) -> ForceModel:
        """With everything that was adopted."""
        return self._what_if.model

    @property
    def drives(self) -> tuple[str, ...]:
        """Names."""
        return self._what_if.drives

    @property
    def data(self) -> Residuals:
        """Times, measured efforts and variables that errors may depend on."""
        return self._what_if.design.residuals

    @property
    def what_if(self) -> WhatIf:
        """Design, regression and library of the model."""
        return self._what_if

    @property
    def shown(self) -> Shown:
        """Fit, values and evidence of one moment."""
        return self._shown

    @property
    def candidates(self) -> list[type[CatalogueEffect]]:
        """Effects that the model may lack, by name."""
        design = self._what_if.design
        return [effect for effect in catalogue().values() if self.model.offers(effect) and (
            any(design.acts_on(effect, d) for d in range(len(self.drives)))
            if issubclass(effect, DriveEffect)
            else any(term.effect is effect for term in design.structure))]

    @property
    def before(self) -> Array:
        """What the model leaves, (M, D) [N]."""
        return self._what_if.before

    @property
    def now(self) -> Array:
        """What is left with the ticked effects, (M, D) [N]."""
        return self._shown.residual

    @property
    def noise(self) -> dict[str, float]:
        """The rms of every drive's noise [N]: the diagnosis', or a first guess before it."""
        if self.noise_floors is not None:
            return self.noise_floors
        return self._what_if.quiet_noise(self._shown.free)

    def errors(self) -> dict[str, DriveError]:
        """Return the error of every drive that was measured: before, now, and of the noise."""
        return errors_of(self.before, self.now, self.noise, self.drives)

    def overall(self) -> DriveError:
        """Return the error over all samples and drives."""
        noise = list(self.noise.values())
        return DriveError(rms(self.before), rms(self.now),
                          float(np.sqrt(np.mean(np.square(noise)))) if noise else NOT_KNOWN)

    # Ticks

    def tick(self, effect: str, drives: Sequence[str] | None = None,
             revision: int | None = None) -> Shown:
        """Let an effect take part, on some drives or where it pays best.

        Raises
        ------
        EffectRequestError
            For an effect or a drive that does not exist.
        SessionError
            For an effect that cannot act, or that the model has already.
        StaleError
            Where the session is at another revision.
        """
        text = effect if drives is None else f'{effect}:{",".join(drives)}'
        request = EffectRequest.of(text, self.drives)
        request.require_place(self.model)
        with self._changing(revision):
            shown = self._shown
            offer = next((one.candidate for one in shown.offers
                          if one.candidate.effect is request.effect), None)
            asked = None if request.drives is None else tuple(
                self.drives.index(name) for name in request.drives)
            if offer is None or (asked is not None and offer.drives != asked):
                rest = {name: tick for name, tick in shown.ticks.items() if name != effect}
                near = self._what_if.at([tick.best for tick in rest.values()], shown.free)
                with self._scanning:
                    offer = self._what_if.offered(request.effect, asked, near)
            if offer is None:
                raise SessionError(f'{text} has nothing to act on in these recordings, or the '
                                   'model has it already')
            return self._linear({**shown.ticks, effect: Tick(offer)})

    def untick(self, effect: str, revision: int | None = None) -> Shown:
        """Let an effect take no part."""
        with self._changing(revision):
            self._ticked(effect)
            return self._linear({name: tick for name, tick in self._shown.ticks.items()
                                 if name != effect})

    def choose(self, effect: str, key: str, value: float, revision: int | None = None) -> Shown:
        """Set a parameter of a ticked effect, named as in its values; all others follow.

        `Shown.departure` is what it costs. The noise stays that of the best fit.

        Raises
        ------
        SessionError
            For an effect that is not ticked, or a parameter that it does not have.
        ModelError
            For a value that the parameter may not have.
        """
        with self._changing(revision):
            tick = self._ticked(effect)
            known = self._shown.estimates.get(effect, {})
            if key not in known:
                raise SessionError(f'{effect} has no parameter {key!r}, must be one of '
                                   f'{", ".join(known)}')
            drive, _, name = key.rpartition('.')
            parameter = next(p for p in tick.effect.parameters if p.name == name)
            checked = parameter.check(f'{effect}.{key}', value)
            place = (self.drives.index(drive) if drive else None, name)
            return self._linear({**self._shown.ticks, effect: replace(
                tick, chosen={**tick.chosen, place: checked})})

    def release(self, effect: str, revision: int | None = None) -> Shown:
        """Let the fit decide about an effect's parameters again."""
        with self._changing(revision):
            return self._linear({**self._shown.ticks, effect: replace(
                self._ticked(effect), chosen={})})

    def _ticked(self, effect: str) -> Tick:
        if effect not in self._shown.ticks:
            raise SessionError(f'{effect!r} is not ticked, must be one of '
                               f'{", ".join(self._shown.ticks) or "those that are, and none is"}')
        return self._shown.ticks[effect]

    @contextmanager
    def _changing(self, revision: int | None) -> Iterator[None]:
        """Keep others from changing anything; raise StaleError where somebody did before."""
        with self._lock:
            if revision is not None and revision != self.revision:
                raise StaleError(f'revision is {revision}, must be {self.revision}: something '
                                 'was changed elsewhere')
            yield

    def _linear(self, ticks: dict[str, Tick]) -> Shown:
        """Show ticks at the noise as it is."""
        what_if, last = self._what_if, self._shown
        self.revision += 1
        free = what_if.at([tick.best for tick in ticks.values()], last.free)
        found = self._with_chosen(free, ticks)
        stds = {name: {key: one.std for key, one in last.estimates[name].items()}
                for name in ticks if name in last.estimates
                and last.ticks[name].best is ticks[name].best}
        values = {name: {key: Estimate(value, stds.get(name, {}).get(key, NOT_KNOWN), '')
                         for key, value in every.items()}
                  for name, every in what_if.values(found).items()}
        residual = what_if.residual(found) if ticks else what_if.before
        self._shown = Shown(self.revision, ticks, free, found, residual, values,
                            LINEAR if ticks else FITTED, last.evidence, last.offers)
        self.tell()
        return self._shown

    def _with_chosen(self, free: CandidateSet, ticks: Mapping[str, Tick]) -> CandidateSet:
        what_if = self._what_if
        if not any(tick.chosen for tick in ticks.values()):
            return free
        shaped = what_if.at([what_if.with_chosen(tick) for tick in ticks.values()], free)
        return what_if.held(shaped, list(ticks.values()))

    # What follows a tick

    def settle(self) -> Shown:
        """Fit noise and shapes beside the ticks, and evaluate the fitted model.

        Listeners are told after every part; a tick in between ends it.
        """
        with self._settling:
            shown, what_if = self._shown, self._what_if
            if shown.is_settled:
                return shown
            free = what_if.fitted([tick.best for tick in shown.ticks.values()], shown.free)
            shown = self._fitted(shown, free, FITTED)
            if not self._show(shown):
                return self._shown
            shown = self._offered(shown)
            if not self._show(shown) or not shown.ticks:
                return self._shown
            refined = what_if.refined(free)
            if refined is not free:
                ticks = {c.name: replace(shown.ticks[c.name], best=c) for c in refined.effects}
                shown = self._fitted(replace(shown, ticks=ticks), refined, REFINED)
                if self._show(shown) and refined.total < free.total - CHANGED_SHAPES:
                    shown = self._offered(shown)
            if not self._show(replace(shown, stage=REFINED)):
                return self._shown
            try:
                exact = what_if.exact(shown.found, shown.is_free)
                shown = replace(shown, exact=exact, residual=exact.residual, stage=EXACT,
                                estimates=exact.parameters or shown.estimates)
            except PprsError as error:
                shown = replace(shown, stage=EXACT, notice=str(error))
            self._show(shown)
            return self._shown

    def _fitted(self, shown: Shown, free: CandidateSet, stage: str) -> Shown:
        what_if = self._what_if
        evidence = {}
        for candidate in free.effects:
            rest = [one for one in free.effects if one is not candidate]
            evidence[candidate.name] = what_if.fitted(rest, free).total - free.total
        free = what_if.at(free.effects, free)
        found = self._with_chosen(free, shown.ticks)
        residual = what_if.residual(found) if shown.ticks else what_if.before
        return replace(shown, free=free, found=found, residual=residual, evidence=evidence,
                       stage=stage, estimates=what_if.estimates(found))

    def _offered(self, shown: Shown) -> Shown:
        with self._scanning:
            return replace(shown, offers=self._what_if.offers(shown.free), has_offers=True)

    def _show(self, shown: Shown) -> bool:
        """Show it, where nothing was changed since; return whether it is so."""
        with self._lock:
            if shown.revision != self.revision:
                return False
            if shown is not self._shown:
                self._shown = shown
                self.tell()
            return True
