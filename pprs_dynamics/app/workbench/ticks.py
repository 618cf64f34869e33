# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Ticked effects of a session: their fits, the values that a user chose, undo and redo."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from threading import Lock, RLock

from pprs_dynamics.app.api.inputs import Inputs
from pprs_dynamics.app.workbench import view_state
from pprs_dynamics.app.workbench.tick_fits import Place, Tick, TickFits
from pprs_dynamics.app.workbench.view_state import ViewState
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.physics.model.drive_model import DriveModel


class SessionError(PprsError, ValueError):
    """A request that a session refuses."""


class StaleError(SessionError):
    """A change that counts on a state which is not that of the session any more."""


MOST_MOMENTS = 200  # that undo remembers; a moment is a few kilobytes


@dataclass(frozen=True)
class Moment:
    """State before a deed: the model, the ticks, and the revision at which their fits began."""

    deed: str
    model: DriveModel = field(repr=False)
    ticks: Mapping[str, Tick]
    fitted_since: int


class Ticks:
    """Effects that take part in a model, and what they do to its error.

    A tick is answered at once, at the noise of the last fit. `settle` then fits noise and shapes
    and evaluates the fitted model. All methods may be called from several threads.

    Parameters
    ----------
    model : DriveModel
    inputs : Inputs
        Recordings.

    Attributes
    ----------
    fits : TickFits
        Design, regression and library of the model.
    view : ViewState
        Fit, values and evidence of the ticked effects.
    revision : int
        Counts changes by users.
    fitted_since : int
        Revision at which the present fits began.

    Raises
    ------
    PprsError
        As `measure_residuals`.
    """

    def __init__(self, model: DriveModel, inputs: Inputs) -> None:
        self.inputs, self.revision = inputs, 0
        self._lock, self._settling, self._changing = RLock(), RLock(), Lock()
        self._listeners: list[Callable[[], None]] = []
        self._done: list[Moment] = []
        self._undone: list[Moment] = []
        self.use(self.fits_of(model))

    @property
    def model(self) -> DriveModel:
        """Model in force, with all adopted effects."""
        return self.fits.model

    def fits_of(self, model: DriveModel, inputs: Inputs | None = None) -> TickFits:
        """Return the fits of a model to these recordings, or to others."""
        inputs = inputs or self.inputs
        return TickFits(model, inputs.fitted, inputs.reference)

    def use(self, fits: TickFits, ticks: Mapping[str, Tick] | None = None) -> None:
        """Replace model and fits; ticks that cannot act in the new model are dropped."""
        with self._lock:
            self.fits = fits
            self.revision += 1
            self.fitted_since = self.revision
            self.view = ViewState(self.revision, {}, fits.none, fits.none, fits.before, {},
                                  view_state.FITTED)
            for name, tick in (ticks or {}).items():
                with suppress(PprsError):
                    self._tick(EffectRequest.named(
                        name, fits.design.named(tick.best.drives), fits.model), tick.chosen)
            self.notify()

    def change_recordings(self, change: Callable[[Inputs], Inputs]) -> None:
        """Replace the recordings by what a function returns for them; model and ticks remain.

        Raises
        ------
        PprsError
            Of the function; where the model cannot follow a recording.
        """
        with self._changing:
            inputs = change(self.inputs)
            while True:
                fits = self.fits
                if [*inputs.recordings] != [*self.inputs.recordings]:
                    fits = self.fits_of(self.model, inputs)
                with self._lock:
                    if fits.model is self.model:  # else the model was changed meanwhile
                        self.inputs = inputs
                        if fits is not self.fits:
                            self.use(fits, self.view.ticks)
                        break
        self.notify()

    # Listeners

    @contextmanager
    def steady(self) -> Iterator[None]:
        """Prevent changes by other threads while the block lasts."""
        with self._lock:
            yield

    def subscribe(self, listener: Callable[[], None]) -> Callable[[], None]:
        """Call a function after every change; return the function that unsubscribes it."""
        with self._lock:
            self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    def notify(self) -> None:
        """Call the subscribed functions."""
        with self._lock:
            listeners = list(self._listeners)
        for listener in listeners:
            listener()

    # Changes

    def tick(self, effect: str, drives: Sequence[str] | None = None,
             revision: int | None = None) -> ViewState:
        """Add an effect, on some drives or where it reduces the cost most.

        Raises
        ------
        EffectRequestError
            For an effect or a drive that does not exist.
        SessionError
            For an effect that cannot act, or that the model has already.
        StaleError
            Where the session is at another revision.
        """
        request = EffectRequest.named(effect, drives, self.model)
        on = f' on {", ".join(drives)}' if drives else ''
        with self.changing(revision, f'{effect} ticked{on}'):
            return self._tick(request)

    def _tick(self, request: EffectRequest, chosen: Mapping[Place, float] | None = None,
              ) -> ViewState:
        view, drives = self.view, request.drives
        offer = next((offer.candidate for offer in view.offers
                      if offer.candidate.effect is request.effect), None)
        asked = None if drives is None else tuple(map(self.fits.drives.index, drives))
        if offer is None or (asked is not None and offer.drives != asked):
            rest = [tick.best for name, tick in view.ticks.items() if name != request.name]
            offer = self.fits.offered(request.effect, asked, self.fits.at(rest, view.free))
        if offer is None:
            on = f' on {", ".join(drives)}' if drives else ''
            raise SessionError(f'{request.name}{on} has nothing to act on in these recordings, or '
                               'the model has it already')
        return self._linear({**view.ticks, request.name: Tick(offer, chosen or {})})

    def untick(self, effect: str, revision: int | None = None) -> ViewState:
        """Remove an effect; errors as `choose`."""
        with self.changing(revision, f'{effect} unticked'):
            self._ticked(effect)
            return self._linear({name: tick for name, tick in self.view.ticks.items()
                                 if name != effect})

    def choose(self, effect: str, key: str, value: float, revision: int | None = None) -> ViewState:
        """Set a parameter of a ticked effect; the other parameters are fitted again.

        `ViewState.departure` is the rise of the cost. The noise remains that of the best fit.

        Raises
        ------
        SessionError
            For an effect that is not ticked, or a parameter that it does not have.
        ModelError
            For a value outside the parameter's bounds.
        StaleError
            Where the session is at another revision.
        """
        with self.changing(revision, f'{effect}: {key} chosen'):
            tick, known = self._ticked(effect), self.view.estimates.get(effect, {})
            if key not in known:
                raise SessionError(f'{effect} has no parameter {key!r}, must be one of '
                                   f'{", ".join(known)}')
            drive, name = tick.effect.place_and_parameter(key)
            parameter = next(p for p in tick.effect.parameters if p.name == name)
            checked = parameter.check(f'{effect}.{key}', value)
            place = (self.fits.drives.index(drive) if drive else None, name)
            return self._linear({**self.view.ticks, effect: replace(
                tick, chosen={**tick.chosen, place: checked})})

    def release(self, effect: str, revision: int | None = None) -> ViewState:
        """Fit all parameters of an effect again; errors as `choose`."""
        with self.changing(revision, f'{effect}: best values'):
            return self._linear({**self.view.ticks, effect: replace(
                self._ticked(effect), chosen={})})

    def _ticked(self, effect: str) -> Tick:
        ticks = self.view.ticks
        if effect not in ticks:
            raise SessionError(f'{effect!r} is not ticked, must be one of '
                               f'{", ".join(ticks) or "the ticked effects, and none is ticked"}')
        return ticks[effect]

    def _linear(self, ticks: Mapping[str, Tick]) -> ViewState:
        self.revision += 1
        self.view = view_state.linear(self.fits, self.view, ticks, self.revision)
        self.notify()
        return self.view

    def settle(self) -> ViewState:
        """Fit noise and shapes, and evaluate the fitted model; a tick in between ends it."""
        with self._settling:
            with self._lock:
                fits, view = self.fits, self.view
            if not view.is_settled:
                for following in view_state.following(fits, view):
                    with self._lock:
                        if following.revision != self.revision:
                            break
                        self.view = following
                        self.notify()
            return self.view

    def ticked_model(self) -> DriveModel:
        """Return the model with the ticked effects, without an entry in the ledger.

        Raises
        ------
        SessionError
            Where no model may have these values.
        """
        view = self.settle()
        while not view.is_settled:  # somebody ticked in between
            view = self.settle()
        if not view.ticks:
            return self.model
        if view.model is None:
            raise SessionError(f'no model has these values: {view.notice}')
        return view.model

    # Undo

    @property
    def undoes(self) -> str:
        """Deed that `back` takes back; '' for none."""
        return self._done[-1].deed if self._done else ''

    @property
    def redoes(self) -> str:
        """Deed that `forward` does again; '' for none."""
        return self._undone[-1].deed if self._undone else ''

    def require(self, revision: int | None) -> None:
        """Raise StaleError where the session is at another revision."""
        if revision is not None and revision != self.revision:
            raise StaleError(f'revision is {revision}, must be {self.revision}: something '
                             'was changed elsewhere')

    @contextmanager
    def changing(self, revision: int | None, deed: str) -> Iterator[None]:
        """Exclude other changes, and remember the moment before for `back`.

        A deed that follows itself, as of a slider, counts once. Raises as `require`.
        """
        with self._lock:
            self.require(revision)
            before = self._moment(deed)
            yield
            if before.model is not self.model or before.ticks != self.view.ticks:
                if deed != self.undoes:
                    self._done = [*self._done, before][-MOST_MOMENTS:]
                self._undone = []

    def _moment(self, deed: str) -> Moment:
        return Moment(deed, self.model, self.view.ticks, self.fitted_since)

    def back(self, revision: int | None = None) -> ViewState:
        """Undo the last tick, value or adoption.

        Raises
        ------
        SessionError
            Where nothing was done.
        StaleError
            Where the session is at another revision.
        """
        return self._move(revision, self._done, self._undone, 'nothing was done that can be undone')

    def forward(self, revision: int | None = None) -> ViewState:
        """Redo the last undone change; errors as `back`."""
        return self._move(revision, self._undone, self._done, 'nothing was undone')

    def _move(self, revision: int | None, source: list[Moment], target: list[Moment], none: str,
              ) -> ViewState:
        with self._lock:
            self.require(revision)
            if not source:
                raise SessionError(none)
            moment = source.pop()
            target.append(self._moment(moment.deed))
            if moment.fitted_since == self.fitted_since:
                return self._linear(moment.ticks)
            self.use(self.fits if moment.model is self.model else self.fits_of(moment.model),
                     moment.ticks)
            return self.view
