# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The numbers that decide what a diagnosis says, in one table."""

from __future__ import annotations

from dataclasses import dataclass, field, fields


def _number(value: float, unit: str, decides: str, reason: str) -> float:
    found: float = field(default=value, metadata={
        'unit': unit, 'decides': decides, 'reason': reason})
    return found


@dataclass(frozen=True)
class Decisions:
    """What is chosen rather than computed; `docs/diagnosis.md` prints this table."""

    effect_odds: float = _number(
        0.1, '1', 'prior odds that one more effect is missing',
        'models are seldom wrong in many ways at once; the smaller, the fewer false claims')
    wrong_sign_odds: float = _number(
        0.01, '1', 'prior odds of friction, mass or stiffness with the wrong sign',
        'physically impossible as such, but a model may have too much of it')
    unknown_odds: float = _number(
        0.01, '1', 'prior odds of a form that is in no catalogue, against one that is',
        'a free curve imitates effects; it has to be much better to be believed')
    form_share: float = _number(
        0.1, '1', 'share of the force of an idealised effect that its lack of fit may leave',
        'forms of friction and springs in the literature differ by 5 to 15 %')
    own_form_share: float = _number(
        0.02, '1', "the same for the model's own friction",
        'load-dependent friction is computed from frictionless loads, 1 to 2 % off')
    exact_share: float = _number(
        0.02, '1', 'share of an idealised effect that its lack of fit may put into an exact one',
        'masses, gravity and sensors are exact: little else looks like them')
    left_ratio: float = _number(
        1.5, '1', 'error that a drive may keep over its noise as lack of fit of what was found',
        'what stands out of the noise to the eye has to be told')
    rival_margin: float = _number(
        10.0, 'deviance', 'how near a set must come to the best to be told as its rival',
        'odds of 150 to 1')
    level_ratio: float = _number(
        3.0, '1', "a drive's slow noise over its fast noise, against its peers', told as unknown",
        'robots have like drives; a factor of 3 in rms is an order of magnitude in power')

    def table(self) -> list[tuple[str, float, str, str, str]]:
        """Return name, value, unit, what it decides and why, for the documentation."""
        return [(one.name, getattr(self, one.name), one.metadata['unit'],
                 one.metadata['decides'], one.metadata['reason']) for one in fields(self)]


DECISIONS = Decisions()
