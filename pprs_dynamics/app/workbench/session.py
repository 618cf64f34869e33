# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A session: recordings, a model, and effects that are ticked, looked at, adopted, taken back."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from os import PathLike
from pathlib import Path
from threading import Lock, RLock
from typing import Any

from pprs_dynamics.app.api.inputs import Given, Inputs
from pprs_dynamics.app.workbench import view_state
from pprs_dynamics.app.workbench.background import Cancelled, Job, run_in_process
from pprs_dynamics.app.workbench.errors import SessionError, StaleError
from pprs_dynamics.app.workbench.history import History, Moment
from pprs_dynamics.app.workbench.long_work import DesignedMotion, designed, diagnosed
from pprs_dynamics.app.workbench.masks import Mask, quantity, region_mask, shares_in, span_mask
from pprs_dynamics.app.workbench.session_file import SavedSession, SavedTick
from pprs_dynamics.app.workbench.tick_fits import Place, Tick, TickFits
from pprs_dynamics.app.workbench.view_state import NOT_KNOWN, DriveError, Share, ViewState
from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.adoption.adopt import adopt, original
from pprs_dynamics.inference.adoption.adoption import Adoption
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.diagnosis.quantities import word_little
from pprs_dynamics.inference.diagnosis.sentences import word_reference
from pprs_dynamics.inference.experiments.next_experiment import check_duration
from pprs_dynamics.inference.fit.reference import Reference
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.inference.search.explained_effort import little_explained
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.ledger import Step, read_steps, without_last_step
from pprs_dynamics.physics.model.model_writer import write_model
from pprs_dynamics.system.numbers import finite
from pprs_dynamics.system.plain_text import for_json


class Session:
    """Recordings, a model, and what effects would do to its error.

    Ticks are answered at once, at the noise as it is; `settle` fits the noise and the shapes
    beside them and evaluates the fitted model. All methods may be called from several threads.
    Nothing on disk changes before `export`.

    Parameters
    ----------
    model : DriveModel
    recordings : mapping of str to Recording
        To fit to, by whatever name.
    validation : mapping of str to Recording, optional
        Never fitted, adoptions are judged on them.
    base : path, optional
        The model's file, whose comments exported models keep.
    reference : Reference, optional
        Run since which it is asked what has changed.

    Attributes
    ----------
    inputs : Inputs
        Recordings, and the model as it was given.
    fits : TickFits
        Design, regression and library of the model.
    view_state : ViewState
        Fit, values and evidence of one moment.
    history : History
        What somebody did, for `back` and `forward`.
    revision : int
        Counts what somebody changed.
    fitted_since : int
        Revision at which the fits began that ticks belong to.

    Raises
    ------
    PprsError
        As `measure_residuals`.
    """

    def __init__(self, model: DriveModel, recordings: Mapping[str, Recording],
                 validation: Mapping[str, Recording] | None = None,
                 base: str | PathLike[str] | None = None,
                 reference: Reference | None = None) -> None:
        if not recordings:
            raise SessionError('no recording is given, must be at least one')
        self.inputs = Inputs(model, recordings, validation or {},
                             base=None if base is None else Path(base), reference=reference)
        self.diagnosis: Diagnosis | None = None
        self.last_adoption: Adoption | None = None
        self.experiment: DesignedMotion | None = None
        self.jobs: dict[str, Job[Any]] = {}
        self.revision = 0
        self.history = History()
        self._lock, self._settling, self._reading = RLock(), RLock(), Lock()
        self._listeners: list[Callable[[], None]] = []
        self._use(_fits_of(model, self.inputs))

    @classmethod
    def open(cls, recordings: Sequence[str | PathLike[str]],
             model: str | PathLike[str] = 'config/paper.yaml',
             validation: Sequence[str | PathLike[str]] = (), topic: str | None = None,
             reference: Given | None = None) -> Session:
        """Read files by the readers of all commands.

        What has changed since `reference` is asked where runs are given, () for those that the
        model file names.

        Raises
        ------
        PprsError
            Where one cannot be read, or holds the samples of another; as `read_reference`.
        """
        session = cls.of(Inputs.read(model, recordings, validation, topic).since(reference))
        session.find_mistakes()
        return session

    @classmethod
    def of(cls, inputs: Inputs) -> Session:
        """Begin with what was read; what their numbers rather mean is not looked for yet.

        Raises
        ------
        PprsError
            As `measure_residuals`.
        """
        inputs = inputs.within_memory()
        try:
            session = cls(inputs.model, inputs.recordings, inputs.validation,
                          reference=inputs.reference)
        except PprsError:
            # Positions in millimetres are told as that, not as a pose out of reach.
            inputs.checked()
            raise
        session.inputs = inputs
        return session

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Session:
        """Go on with a session that was saved.

        Raises
        ------
        PprsError
            As `SavedSession.read`; as `of`.
        """
        saved = SavedSession.read(path)
        session = cls.of(saved.inputs)
        session.resume(saved)
        session.find_mistakes()
        return session

    def resume(self, saved: SavedSession) -> None:
        """Take over the model and the ticks of a saved session of the same recordings.

        Raises
        ------
        PprsError
            As `tick` and `choose`.
        """
        with self._lock:
            self._use(_fits_of(saved.model, self.inputs))
            for tick in saved.ticks:
                self.tick(tick.effect, tick.drives)
                for key, value in tick.values.items():
                    self.choose(tick.effect, key, value)
            self.history = History()

    def save(self, path: str | PathLike[str]) -> None:
        """Write what `load` goes on with.

        Raises
        ------
        PprsError
            As `SavedSession.write`.
        """
        with self._lock:
            ticks = tuple(SavedTick(name, view_state.names_of(tick.best, self.drives), {
                (name if drive is None else f'{self.drives[drive]}.{name}'): value
                for (drive, name), value in tick.chosen.items()})
                for name, tick in self.view_state.ticks.items())
            saved = SavedSession(self.inputs, self.model, ticks)
        saved.write(path)

    def _use(self, fits: TickFits, ticks: Mapping[str, Tick] | None = None) -> None:
        """Begin with a model, from what was ticked under another."""
        with self._lock:
            self.fits = fits
            self.noise_floors: dict[str, float] | None = None
            self.revision += 1
            self.fitted_since = self.revision
            self.view_state = view_state.without_ticks(fits, self.revision)
            for name, tick in (ticks or {}).items():
                with suppress(PprsError):  # what cannot act under this model is ticked no more
                    self._tick(EffectRequest.named(
                        name, view_state.names_of(tick.best, fits.drives), fits.drives).placed(
                            fits.model), tick.chosen)
            self.notify()

    def add(self, path: str | PathLike[str], is_held_out: bool = False) -> None:
        """Take one more recording, read by the reader of all commands.

        Raises
        ------
        PprsError
            Where it cannot be read, holds the samples of another, or the model cannot follow it.
        """
        with self._reading:
            more = self.inputs.with_more(path, is_held_out)
            while not self._take(more, self.fits if is_held_out
                                 else _fits_of(self.model, more)):
                pass  # the model was changed meanwhile
        self.notify()

    def remove(self, name: str) -> None:
        """Let go of a recording, fitted or held out; ticks and the model stay.

        Raises
        ------
        InputError
            For one that is not there, or the last one that is fitted.
        """
        with self._reading:
            fewer = self.inputs.without(name)
            while not self._take(fewer, self.fits if name in self.inputs.validation
                                 else _fits_of(self.model, fewer)):
                pass  # the model was changed meanwhile
        self.notify()

    def _take(self, inputs: Inputs, fits: TickFits) -> bool:
        """Go on with other recordings; False where their fits are of another model than this."""
        with self._lock:
            if fits.model is not self.model:
                return False
            self.inputs = inputs
            if fits is not self.fits:
                self.diagnosis = None
                self._use(fits, self.view_state.ticks)
            return True

    def find_mistakes(self) -> None:
        """Look for units, signs and orders that are not SI's, and add them to the findings.

        Raises
        ------
        UnreadableFileError
            For positions that are no metres.
        """
        with self._reading:
            self.inputs = self.inputs.checked()
        self.notify()

    # Those who look on

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

    def notify(self) -> None:
        """Tell everybody who subscribed that something changed."""
        with self._lock:
            listeners = list(self._listeners)
        for listener in listeners:
            listener()

    # What there is

    @property
    def model(self) -> DriveModel:
        """With everything that was adopted."""
        return self.fits.model

    @property
    def drives(self) -> tuple[str, ...]:
        """Names."""
        return self.fits.drives

    @property
    def data(self) -> Residuals:
        """Times, measured efforts and variables that errors may depend on."""
        return self.fits.design.residuals

    @property
    def candidates(self) -> list[type[CatalogueEffect]]:
        """Effects that the model may lack, by name."""
        return self.fits.candidates()

    @property
    def given_residual(self) -> Array:
        """What the model leaves, (M, D) [N]."""
        return self.fits.before

    @property
    def current_residual(self) -> Array:
        """What is left with the ticked effects, (M, D) [N]."""
        return self.view_state.residual

    @property
    def noise(self) -> dict[str, float]:
        """The rms of every drive's noise [N] by the diagnosis; empty before it."""
        return self.noise_floors or {}

    def errors(self) -> dict[str, DriveError]:
        """Return the error of every drive that was measured: before, now, and of the noise."""
        return view_state.errors_of(self.given_residual, self.current_residual, self.noise,
                                    self.drives)

    def overall(self) -> DriveError:
        """Return the error over all samples and drives."""
        return DriveError(root_mean_square(self.given_residual),
                          root_mean_square(self.current_residual),
                          root_mean_square(list(self.noise.values())) if self.noise
                          else NOT_KNOWN)

    @property
    def steps(self) -> list[Step]:
        """The ledger of the model, oldest first."""
        return read_steps(self.model.values)

    # Ticks

    def tick(self, effect: str, drives: Sequence[str] | None = None,
             revision: int | None = None) -> ViewState:
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
        request = EffectRequest.named(effect, drives, self.drives).placed(self.model)
        on = f' on {", ".join(drives)}' if drives else ''
        with self._changing(revision, f'{effect} ticked{on}'):
            return self._tick(request)

    def _tick(self, request: EffectRequest, chosen: Mapping[Place, float] | None = None,
              ) -> ViewState:
        effect, view = request.name, self.view_state
        offer = next((one.candidate for one in view.offers
                      if one.candidate.effect is request.effect), None)
        asked = None if request.drives is None else tuple(
            self.drives.index(name) for name in request.drives)
        if offer is None or (asked is not None and offer.drives != asked):
            rest = [tick.best for name, tick in view.ticks.items() if name != effect]
            offer = self.fits.offered(request.effect, asked, self.fits.at(rest, view.free))
        if offer is None:
            on = f' on {", ".join(request.drives)}' if request.drives else ''
            raise SessionError(f'{effect}{on} has nothing to act on in these recordings, or '
                               'the model has it already')
        return self._linear({**view.ticks, effect: Tick(offer, chosen or {})})

    def untick(self, effect: str, revision: int | None = None) -> ViewState:
        """Let an effect take no part."""
        with self._changing(revision, f'{effect} unticked'):
            self._ticked(effect)
            return self._linear({name: tick for name, tick in self.view_state.ticks.items()
                                 if name != effect})

    def choose(self, effect: str, key: str, value: float, revision: int | None = None) -> ViewState:
        """Set a parameter of a ticked effect, named as in its values; all others follow.

        `ViewState.departure` is what it costs. The noise stays that of the best fit.

        Raises
        ------
        SessionError
            For an effect that is not ticked, or a parameter that it does not have.
        ModelError
            For a value that the parameter may not have.
        """
        with self._changing(revision, f'{effect}: {key} chosen'):
            tick, view = self._ticked(effect), self.view_state
            known = view.estimates.get(effect, {})
            if key not in known:
                raise SessionError(f'{effect} has no parameter {key!r}, must be one of '
                                   f'{", ".join(known)}')
            drive, name = tick.effect.place_and_parameter(key)
            parameter = next(p for p in tick.effect.parameters if p.name == name)
            checked = parameter.check(f'{effect}.{key}', value)
            place = (self.drives.index(drive) if drive else None, name)
            return self._linear({**view.ticks, effect: replace(
                tick, chosen={**tick.chosen, place: checked})})

    def release(self, effect: str, revision: int | None = None) -> ViewState:
        """Let the fit decide about an effect's parameters again."""
        with self._changing(revision, f'{effect}: best values'):
            return self._linear({**self.view_state.ticks, effect: replace(
                self._ticked(effect), chosen={})})

    def settle(self) -> ViewState:
        """Fit noise and shapes beside the ticks, and evaluate the fitted model.

        Listeners are told after every part; a tick in between ends it.
        """
        with self._settling:
            with self._lock:
                fits, view = self.fits, self.view_state
            if not view.is_settled:
                for one in view_state.following(fits, view):
                    if not self._show(one):
                        break
            return self.view_state

    def _show(self, view: ViewState) -> bool:
        """Show it, where nothing was changed since; return whether it is so."""
        with self._lock:
            if view.revision != self.revision:
                return False
            self.view_state = view
            self.notify()
            return True

    def _ticked(self, effect: str) -> Tick:
        ticks = self.view_state.ticks
        if effect not in ticks:
            raise SessionError(f'{effect!r} is not ticked, must be one of '
                               f'{", ".join(ticks) or "those that are, and none is"}')
        return ticks[effect]

    @contextmanager
    def _changing(self, revision: int | None, deed: str) -> Iterator[None]:
        """Keep others from changing anything, and note the deed where it changed something.

        Raises StaleError where somebody changed something before.
        """
        with self._lock:
            self._require(revision)
            before = self._moment()
            yield
            if not self._moment().is_as(before):
                self.history.note(deed, before)

    def _require(self, revision: int | None) -> None:
        if revision is not None and revision != self.revision:
            raise StaleError(f'revision is {revision}, must be {self.revision}: something '
                             'was changed elsewhere')

    def _moment(self) -> Moment:
        return Moment(self.model, self.view_state.ticks, self.fitted_since)

    def back(self, revision: int | None = None) -> ViewState:
        """Take back what was done last: a tick, a value, an adoption, a step of the ledger.

        Raises
        ------
        SessionError
            Where nothing was done.
        StaleError
            Where the session is at another revision.
        """
        return self._move(revision, self.history.back, 'nothing was done that could be taken back')

    def forward(self, revision: int | None = None) -> ViewState:
        """Do again what was taken back last; errors as `back`."""
        return self._move(revision, self.history.forward, 'nothing was taken back')

    def _move(self, revision: int | None, to: Callable[[Moment], Moment | None], none: str,
              ) -> ViewState:
        with self._lock:
            self._require(revision)
            moment = to(self._moment())
            if moment is None:
                raise SessionError(none)
            if moment.fitted_since == self.fitted_since:
                return self._linear(dict(moment.ticks))
            self.diagnosis = self.diagnosis if moment.model is self.model else None
            fits = (self.fits if moment.model is self.model
                    else _fits_of(moment.model, self.inputs))
            self._use(fits, moment.ticks)
            return self.view_state

    def _linear(self, ticks: dict[str, Tick]) -> ViewState:
        self.revision += 1
        self.view_state = view_state.linear(self.fits, self.view_state, ticks, self.revision)
        self.notify()
        return self.view_state

    # Pointing at data

    def span(self, start: float, end: float, drives: Sequence[str] | None = None) -> Mask:
        """Return the samples between two times [s], on some drives or all."""
        return span_mask(self.data, start, end, self._indices(drives))

    def region(self, x: str, y: str, x_range: tuple[float, float], y_range: tuple[float, float],
               drive: str) -> Mask:
        """Return a drive's samples in a region of the scatter of y over x, see `quantities`."""
        d, = self._indices([drive])
        x_values, y_values = (quantity(self.fits, self.view_state, name, d) for name in (x, y))
        return region_mask(x_values, y_values, x_range, y_range, self.data, d)

    def shares(self, mask: Mask) -> list[Share]:
        """Return what each unticked effect explains of the error in a mask, less its prior cost."""
        return shares_in(mask, self.fits, self.view_state)

    def _indices(self, drives: Sequence[str] | None) -> list[int]:
        for name in drives or ():
            if name not in self.drives:
                raise SessionError(f'unknown drive {name!r}, must be one of '
                                   f'{", ".join(self.drives)}')
        return [d for d, name in enumerate(self.drives) if drives is None or name in drives]

    # In the background

    def diagnose(self) -> Job[Diagnosis]:
        """Begin to look for what the recordings call for; it tells the noise, too."""
        fits = self.fits

        def work(report: Callable[[float], None]) -> Diagnosis:
            found: Diagnosis = run_in_process(diagnosed, original(fits.model), fits.recordings,
                                              self.inputs.reference, report=report)
            with self._lock:
                if fits is self.fits:
                    self.diagnosis, self.noise_floors = found, found.noise_floors
            return found
        return self._begin('diagnose', '', work)

    def adopt(self, effect: str, drives: Sequence[str] | None = None, force: bool = False,
              revision: int | None = None) -> Job[Adoption]:
        """Begin the check of `pprs adopt`; the model takes the effect where nothing speaks against.

        Drives that are not given are those of the tick.

        Raises
        ------
        EffectRequestError
            For an effect or a drive that does not exist.
        SessionError
            Where another adoption is under way.
        StaleError
            Where the session is at another revision.
        """
        with self._lock:
            self._require(revision)
            tick = self.view_state.ticks.get(effect)
            on = drives or (view_state.names_of(tick.best, self.drives) if tick else None)
            request = EffectRequest.named(effect, on or None, self.drives).placed(self.model)
            if 'adopt' in self.jobs and self.jobs['adopt'].is_running:
                raise SessionError(f'{self.jobs["adopt"].what} is being adopted, must end first')
            fits, inputs = self.fits, self.inputs

            def work(report: Callable[[float], None]) -> Adoption:
                return self._adopted(fits, inputs, request, force, report)
            return self._begin('adopt', effect, work)

    def _adopted(self, fits: TickFits, inputs: Inputs, request: EffectRequest, force: bool,
                 report: Callable[[float], None]) -> Adoption:
        self._await_diagnosis(report)
        answer: Adoption = run_in_process(
            partial(adopt, diagnosis=self.diagnosis, reference=inputs.reference), fits.model,
            request, fits.recordings,
            inputs.held_out, force, report=lambda share: report(0.9 * share))
        if answer.adopted:
            after = _fits_of(inputs.ledger.entered(answer), inputs)
            report(0.95)
            with self._lock:
                if fits is not self.fits:
                    raise SessionError('the model was changed while the effect was judged')
                with self._changing(None, f'{request.name} adopted'):
                    self.diagnosis = None
                    self._use(after, {name: tick for name, tick in self.view_state.ticks.items()
                                      if name != request.name})
        self.last_adoption = answer
        return answer

    def _await_diagnosis(self, report: Callable[[float], None]) -> None:
        """Wait for a diagnosis that is under way: an adoption would make it again."""
        job = self.jobs.get('diagnose')
        while job is not None and job.is_running:
            report(0.4 * job.share)
            with suppress(TimeoutError, Cancelled, PprsError):
                job.result(0.1)

    def next_experiment(self, duration: float = 20.0, seed: int = 0) -> Job[DesignedMotion]:
        """Begin to design the motion that would tell what these recordings leave open.

        Raises
        ------
        PprsError
            For a model of another mechanism, or a duration that no design is made for.
        """
        model = self.model
        check_duration(duration)

        def work(report: Callable[[float], None]) -> DesignedMotion:
            found: DesignedMotion = run_in_process(designed, model, self.fits.recordings, duration,
                                                   seed, report=report)
            self.experiment = found
            return found
        return self._begin('experiment', '', work)

    def cancel(self, kind: str) -> None:
        """Call off work in the background: 'adopt', 'diagnose' or 'experiment'."""
        if kind in self.jobs:
            self.jobs[kind].cancel()

    def _begin(self, kind: str, of: str,
               work: Callable[[Callable[[float], None]], Any]) -> Job[Any]:
        with self._lock:
            self.cancel(kind)
            job = self.jobs[kind] = Job(kind, of, work, lambda job: self.notify())
        return job.start()

    def undo(self, revision: int | None = None) -> Step:
        """Take the last step of the ledger back, and return it.

        Raises
        ------
        ModelError
            Where there is none.
        StaleError
            Where the session is at another revision.
        """
        with self._changing(revision, 'last step of the ledger taken back'):
            values, step = without_last_step(self.model.values)
            model = replace(DriveModel.from_parameters(values), source=self.model.source)
            self.diagnosis = None
            self._use(_fits_of(model, self.inputs), self.view_state.ticks)
            return step

    # What goes out

    def ticked_model(self) -> DriveModel:
        """Return the model with the ticked effects as they are shown, without a ledger entry.

        Raises
        ------
        SessionError
            Where it is not evaluated yet, or where no model may have these values.
        """
        view = self.settle()
        while not view.is_settled:  # somebody ticked in between
            view = self.settle()
        if not view.ticks:
            return self.model
        if view.exact is None:
            raise SessionError(f'no model has these values: {view.notice}')
        return view.exact.model

    def export(self, path: str | PathLike[str], with_ticked: bool = False) -> None:
        """Write the model with its ledger, or with what is ticked besides.

        Raises
        ------
        PprsError
            As `ticked_model`; where the file cannot be written, or is the model that was given.
        """
        model = self.ticked_model() if with_ticked else self.model
        write_model(path, model.values, self.inputs.base)

    def to_dict(self) -> dict[str, Any]:
        """Return all that one screen shows, but for the curves."""
        with self._lock:
            view, diagnosis, adoption = self.view_state, self.diagnosis, self.last_adoption
            since = self.fits.since
            called_for = {one.name for one in diagnosis.effects} if diagnosis else None
            return {
                'revision': self.revision, 'fitted_since': self.fitted_since, 'stage': view.stage,
                'is_settled': view.is_settled, 'is_approximate': view.is_approximate,
                'departure': finite(view.departure), 'notice': view.notice,
                'drives': list(self.drives),
                'errors': {name: one.to_dict() for name, one in self.errors().items()},
                'overall': self.overall().to_dict(), **view_state.units_to_dict(self.model),
                'effects': [
                    view_state.effect_to_dict(view, effect, self.model, called_for)
                    for effect in self.candidates],
                'verdict': diagnosis.verdict if diagnosis else None,
                'reference': None if since is None else {
                    **since.to_dict(), 'text': list(word_reference(since))},
                'little': word_little(little_explained(
                    self.model, self.fits.fits.design.residuals, self.current_residual)),
                'steps': [step.to_dict() for step in self.steps],
                'undoes': self.history.undoes, 'redoes': self.history.redoes,
                'jobs': {kind: job.to_dict() for kind, job in self.jobs.items()},
                'adoption': for_json(adoption.to_dict()) if adoption else None,
                'experiment': for_json(self.experiment.promise) if self.experiment else None,
                'recordings': view_state.recordings_to_dict(
                    self.inputs.recordings, self.fits, self.current_residual),
                'held_out': [{'key': key, 'name': one.name}
                             for key, one in self.inputs.validation.items()]}


def _fits_of(model: DriveModel, inputs: Inputs) -> TickFits:
    """Return the fits of a model to recordings, since their reference where there is one."""
    return TickFits(model, inputs.fitted, inputs.reference)
