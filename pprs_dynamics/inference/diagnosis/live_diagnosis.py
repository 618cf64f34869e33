# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Live diagnosis: windows of a stream of joint states, one after the other.

A window is diagnosed as a recording. Its effects are claimed once the model that was fitted to it
predicts the next window better than the model without them, and the diagnosis of that window
reports them again. An effect is withdrawn when the latest window neither reports nor needs it. It
began where the first window that reports it says: within that window, or with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Annotated, Any

from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis, FoundEffect
from pprs_dynamics.inference.diagnosis.quantities import with_drives, word_little
from pprs_dynamics.inference.diagnosis.sentences import word_values
from pprs_dynamics.inference.fit.reference import Reference
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.search.held_out import predictive_gain
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.motion.rests import share_in_motion
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.system.json_records import JsonRecord

# Share of a window's samples in which some drive moves, below which it is not diagnosed, and share
# of a drive's highest speed above which it moves.
LEAST_MOTION, MOVING = 0.2, 0.02


@dataclass(frozen=True)
class LiveEffect(JsonRecord):
    """An effect of the stream.

    Parameters
    ----------
    found : FoundEffect
        As the latest window that names it has it.
    names : frozenset of str
        Its name and those of its rivals.
    since : float or None
        When it began [s], on the stream's clock; None: from the start.
    confirmed : bool
        Whether it was confirmed on a window that it was not fitted to.
    """

    json_of = 'found'
    json_keys = ('since', 'confirmed')

    found: FoundEffect
    names: frozenset[str]
    since: float | None = None
    confirmed: bool = False

    def is_same(self, other: LiveEffect) -> bool:
        """Return whether two windows report the same effect, or its rival, on the same drives."""
        return ((self.found.name in other.names or other.found.name in self.names)
                and self.found.drives == other.found.drives)

    def sentence(self, every: tuple[str, ...]) -> str:
        """Return the change in words; `every` names all drives."""
        found = self.found
        values = word_values(found.effect, found.parameters, found.moments, every, found.in_model)
        since = 'from the start' if self.since is None else (
            f'since {datetime.fromtimestamp(self.since):%H:%M:%S}')
        what = with_drives(found.name.replace('_', ' '), found.drives, every)
        return f'{what}: {"; ".join(values.values())}, {since}'


@dataclass(frozen=True)
class LiveDiagnosis(JsonRecord):
    """Effects found in a stream up to its latest window; immutable.

    Parameters
    ----------
    model : DriveModel
        As given: every window is diagnosed against it.
    effects : tuple of LiveEffect
        Effects of the latest windows; only confirmed ones are claimed.
    latest : mapping
        JSON of the diagnosis of the latest window.
    window : (float, float) or None
        Begin and end of the latest window, by the stamps of the stream [s].
    fitted : DriveModel, optional
        The model with the numbers and the effects of that diagnosis.
    withdrawn : tuple of LiveEffect
        Claimed before, but not supported by the latest window.
    note : str
        Why the latest window was not diagnosed; empty where it was.
    reference : Reference, optional
        Since which every window is diagnosed.
    """

    json_of = 'latest'
    json_keys = ('effects', 'withdrawn', 'confirmed', 'note', 'since', 'text', 'window')

    model: DriveModel
    effects: tuple[LiveEffect, ...] = ()
    latest: Annotated[Mapping[str, Any], Diagnosis] = field(default_factory=dict)
    window: tuple[float, float] | None = None
    fitted: DriveModel | None = None
    withdrawn: tuple[LiveEffect, ...] = ()
    note: str = ''
    reference: Reference | None = None

    @property
    def claimed(self) -> tuple[LiveEffect, ...]:
        """The confirmed effects."""
        return tuple(effect for effect in self.effects if effect.confirmed)

    def adopted(self) -> dict[str, Any]:
        """Return the values of the model with the claimed effects; none where that is unknown.

        Numbers of a window were fitted together: they are valid only with all of its effects.
        """
        names = {effect.found.name for effect in self.effects}
        if self.fitted is None or not names or self.claimed != self.effects or names != {
                effect['name'] for effect in self.latest['effects']}:
            return {}
        return dict(self.fitted.values)

    @property
    def confirmed(self) -> bool:
        """Whether any of the effects is claimed."""
        return bool(self.claimed)

    @property
    def since(self) -> float | None:
        """When the first of the claimed effects began [s]; null: from the start, or none."""
        return min((effect.since for effect in self.claimed if effect.since is not None),
                   default=None)

    @property
    def text(self) -> str:
        """The claimed effects in words; empty for none."""
        little = word_little(self.latest.get('little_explained', {}),
                             ' with the reported effects')
        return '; '.join(filter(None, [little, *(
            effect.sentence(self.model.drives) for effect in self.claimed)]))

    def with_window(self, recording: Recording, start: float) -> LiveDiagnosis:
        """Return the live diagnosis updated by one more window.

        Parameters
        ----------
        recording : Recording
            Of the model's drives, without overlap with the last window.
        start : float
            When it begins [s], on the stream's clock.

        Raises
        ------
        PprsError
            As `diagnose`.
        """
        if share_in_motion(recording.time, recording.position, MOVING) < LEAST_MOTION:
            return replace(self, withdrawn=(), note='the robot hardly moves: no diagnosis')
        answer = diagnose(self.model, [recording], reference=self.reference)
        holds, effects = self._holds(recording), []
        for found in answer.effects:
            begun = None if self.fitted is None else start
            effect = LiveEffect(found, frozenset({found.name}).union(*(
                names for names in answer.indistinguishable if found.name in names)),
                begun if found.course is None else start + found.course.begin)
            known = next((present for present in self.effects if present.is_same(effect)), None)
            if known is not None:
                effect = replace(effect, confirmed=known.confirmed or holds, since=known.since)
            effects.append(effect)
        missed = [present for present in self.claimed
                  if not any(present.is_same(effect) for effect in effects)]
        # A window in which a change happens to be weak does not end it while it still helps.
        return replace(
            self, effects=(*effects, *(missed if holds else ())), latest=answer.to_dict(),
            window=(start, start + float(recording.time[-1] - recording.time[0])),
            fitted=answer.adopted, note='', withdrawn=() if holds else tuple(missed))

    def _holds(self, recording: Recording) -> bool:
        """Return whether the model of the last window predicts a recording better."""
        if self.fitted is None or not self.effects:
            return False
        before, after = (measure_residuals(model, [recording])[0]
                         for model in (self.model, self.fitted))
        return predictive_gain(before, after).confirms
