# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The adoption of all effects that a diagnosis reports."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from pprs_dynamics.inference.adoption.adopt import adopt, original
from pprs_dynamics.inference.adoption.adoption import Adoption
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis, FoundEffect
from pprs_dynamics.inference.diagnosis.quantities import listed
from pprs_dynamics.inference.fit.reference import Reference
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.system.plain_text import for_json

REFUSED, AMBIGUOUS = 'refused', 'ambiguous'


@dataclass(frozen=True)
class AdoptionRun:
    """Result of adopting all reported effects: the steps, and why the run ended.

    Parameters
    ----------
    steps : tuple of Adoption
        Those that were refused at the end are the last ones.
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
    """Adopt the effects that one diagnosis reports, in the values that they have together.

    What is refused is tried again after another effect was adopted. Of effects that explain the
    recordings alike, the best is adopted as the last: it lowers the error, and which of them it is
    another recording must show.

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
        Of the model as given, where it is known already.
    reference : Reference, optional
        As in `adopt`.

    Raises
    ------
    PprsError
        As `measure_residuals`.
    """
    report = progress or (lambda what, share: None)
    given = original(model)
    if diagnosis is None or given is not model:
        diagnosis = diagnose(given, recordings, (), lambda share: report('diagnosing', share),
                             reference=reference)
    rivals = {names[0] for names in diagnosis.indistinguishable}
    open_effects = sorted(diagnosis.effects, key=lambda effect: effect.name in rivals)
    steps: list[Adoption] = []
    adopted: list[FoundEffect] = []
    refused: list[Adoption] = []
    while len(refused) < len(open_effects):
        # First what was not refused beside the effects that are adopted already.
        effect = open_effects[len(refused)]
        report(f'adopting {effect.name}', len(adopted) / len(diagnosis.effects))
        step = adopt(model, EffectRequest(effect.effect, effect.drives), recordings, validate,
                     diagnosis=diagnosis, reference=reference, beside=adopted)
        if not step.adopted:
            refused.append(step)
            continue
        model = record(step)
        steps.append(step)
        adopted.append(effect)
        open_effects.remove(effect)
        refused = []
    return AdoptionRun((*steps, *refused), *_end(diagnosis, steps, refused), model)


def _end(diagnosis: Diagnosis, steps: Sequence[Adoption], refused: Sequence[Adoption],
         ) -> tuple[str, str]:
    """Return how a run ends, and why."""
    if refused:
        return REFUSED, '; '.join(f'{step.effect}: {step.reason}' for step in refused)
    if steps and steps[-1].rivals:
        return AMBIGUOUS, (f'{listed(steps[-1].rivals, "or")} explains these recordings as well as '
                           f'{steps[-1].effect}. Another motion separates them')
    if diagnosis.verdict != 'unknown':
        return 'adequate', 'the remaining error does not differ from noise'
    return 'unknown', (
        f'no effect of the catalogue explains what remains: {diagnosis.depends_on[0].text}'
        if diagnosis.depends_on else
        'the remaining error is larger than the noise, and no effect is supported')
