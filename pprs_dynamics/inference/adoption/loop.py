# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The adoption loop: diagnose, adopt, diagnose again, until nothing is reported."""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass
from typing import Any

from pprs_dynamics.inference.adoption.adopt import adopt, original
from pprs_dynamics.inference.adoption.adoption import Adoption
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.diagnosis.found_effects import FoundEffect
from pprs_dynamics.inference.fit.reference import Reference
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.drive_model import DriveModel

MOST_STEPS = 8
REFUSED, AMBIGUOUS = 'refused', 'ambiguous'


@dataclass(frozen=True)
class AdoptionRun:
    """What was adopted, one after the other, and why it ended.

    Parameters
    ----------
    steps : tuple of Adoption
        Those that were refused are among them.
    ended : {'adequate', 'ambiguous', 'unknown', 'refused'}
    reason : str
    model : DriveModel
        With all that was adopted.
    last : Diagnosis
        Of the model where the run ended.
    """

    steps: tuple[Adoption, ...]
    ended: str
    reason: str
    model: DriveModel
    last: Diagnosis

    @property
    def adopted(self) -> tuple[Adoption, ...]:
        """The steps that were taken."""
        return tuple(step for step in self.steps if step.adopted)

    def to_dict(self) -> dict[str, Any]:
        """Return the run for JSON."""
        return {'ended': self.ended, 'reason': self.reason,
                'steps': [step.to_dict() for step in self.steps]}


def adopt_all(
    model: DriveModel, recordings: Sequence[Recording], validate: Sequence[Recording] = (),
    record: Callable[[Adoption], DriveModel] = lambda adoption: adoption.after,
    progress: Callable[[str, float], None] | None = None, diagnosis: Diagnosis | None = None,
    reference: Reference | None = None,
) -> AdoptionRun:
    """Adopt the reported effects until a diagnosis reports nothing or is ambiguous.

    Of effects that explain the recordings alike, the best is adopted as the last: it lowers the
    error, and which of them it is another recording must show. What is refused is left out
    until something else has been adopted, and the run goes on with what else was found.

    Parameters
    ----------
    model : DriveModel
    recordings : sequence of Recording
        To fit to.
    validate : sequence of Recording, optional
        Never fitted: an effect with which the error on them does not fall is refused.
    record : callable, optional
        Returns the model of an adoption with its entry in the ledger.
    progress : callable, optional
        Called with what is being done and the share of it that is done.
    diagnosis : Diagnosis, optional
        Of the model as given, where it is known already; its decisions hold for all others.
    reference : Reference, optional
        As in `adopt`.

    Raises
    ------
    PprsError
        As `measure_residuals`.
    """
    report = progress or (lambda what, share: None)
    steps: list[Adoption] = []
    refused: list[Adoption] = []
    decisions = DECISIONS if diagnosis is None else diagnosis.decisions
    if original(model) is not model:
        diagnosis = None
    while True:
        if diagnosis is None:
            diagnosis = diagnose(original(model), recordings, (),
                                 lambda share: report('diagnosing', share), decisions,
                                 reference=reference)
        found = _next(diagnosis, {step.effect for step in refused})
        if found is None or sum(step.adopted for step in steps) == MOST_STEPS:
            return AdoptionRun(tuple(steps), *_end(diagnosis, refused), model, diagnosis)
        name = found.name
        step = adopt(model, EffectRequest(found.effect, found.drives), recordings, validate,
                     progress=lambda share: report(f'adopting {name}', share),  # noqa: B023
                     diagnosis=diagnosis, reference=reference)
        steps.append(step)
        if not step.adopted:
            refused.append(step)
            continue
        model = record(step)
        refused.clear()
        if step.rivals:
            reason = (f'{", ".join(step.rivals)} would explain these recordings as well as {name}: '
                      'pprs next-experiment designs the motion that separates them')
            return AdoptionRun(tuple(steps), AMBIGUOUS, reason, model, diagnosis)
        diagnosis = None


def _end(diagnosis: Diagnosis, refused: Sequence[Adoption]) -> tuple[str, str]:
    """Return how a run ends after its last diagnosis, and why."""
    if refused:
        return REFUSED, '; '.join(f'{step.effect}: {step.reason}' for step in refused)
    if diagnosis.verdict != 'unknown':
        return 'adequate', 'the remaining error does not differ from noise'
    if diagnosis.depends_on:
        return 'unknown', ('no effect of the catalogue explains what remains: '
                           f'{diagnosis.depends_on[0].text}')
    return 'unknown', 'the remaining error is larger than the noise, and no effect is supported'


def _next(diagnosis: Diagnosis, refused: Set[str]) -> FoundEffect | None:
    """Return what to adopt: those that are certain first, an ambiguous one as the last."""
    new = [effect for effect in diagnosis.effects if effect.name not in refused]
    ambiguous = {name for names in diagnosis.indistinguishable for name in names}
    certain = [effect for effect in new if effect.name not in ambiguous]
    return next(iter(certain or new), None)
