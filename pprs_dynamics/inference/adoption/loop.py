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
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis, FoundEffect
from pprs_dynamics.inference.diagnosis.quantities import listed
from pprs_dynamics.inference.fit.reference import Reference
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.system.plain_text import for_json

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
    """

    steps: tuple[Adoption, ...]
    ended: str
    reason: str
    model: DriveModel

    @property
    def adopted(self) -> tuple[Adoption, ...]:
        """The steps that were taken."""
        return tuple(step for step in self.steps if step.adopted)

    def to_dict(self) -> dict[str, Any]:
        """Return the run for JSON."""
        content: dict[str, Any] = for_json(
            {'ended': self.ended, 'reason': self.reason, 'steps': self.steps})
        return content


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
    decisions = (DECISIONS if diagnosis is None or diagnosis.selection is None
                 else diagnosis.selection.first.decisions)
    if original(model) is not model:
        diagnosis = None
    while True:
        if diagnosis is None:
            diagnosis = diagnose(original(model), recordings, (),
                                 lambda share: report('diagnosing', share), decisions,
                                 reference=reference)
        found = _next(diagnosis, {step.effect for step in refused})
        if found is None or sum(step.adopted for step in steps) == MOST_STEPS:
            return AdoptionRun(tuple(steps), *_end(diagnosis, refused), model)
        name = found.name
        step = adopt(model, EffectRequest(found.effect, found.drives), recordings, validate,
                     progress=lambda share: report(f'adopting {name}', share),  # noqa: B023
                     diagnosis=diagnosis, reference=reference)
        steps.append(step)
        if not step.adopted:
            refused.append(step)
            continue
        model, refused, diagnosis = record(step), [], None
        if step.rivals:
            return AdoptionRun(tuple(steps), AMBIGUOUS, (
                f'{listed(step.rivals, "or")} explains these recordings as well as {name}. Another '
                'motion separates them'), model)


def _end(diagnosis: Diagnosis, refused: Sequence[Adoption]) -> tuple[str, str]:
    """Return how a run ends after its last diagnosis, and why."""
    if refused:
        return REFUSED, '; '.join(f'{step.effect}: {step.reason}' for step in refused)
    if diagnosis.verdict != 'unknown':
        return 'adequate', 'the remaining error does not differ from noise'
    return 'unknown', (
        f'no effect of the catalogue explains what remains: {diagnosis.depends_on[0].text}'
        if diagnosis.depends_on else
        'the remaining error is larger than the noise, and no effect is supported')


def _next(diagnosis: Diagnosis, refused: Set[str]) -> FoundEffect | None:
    """Return what to adopt: those that are certain first, an ambiguous one as the last."""
    ambiguous = {name for names in diagnosis.indistinguishable for name in names}
    new = [effect for effect in diagnosis.effects if effect.name not in refused]
    return min(new, key=lambda effect: effect.name in ambiguous, default=None)
