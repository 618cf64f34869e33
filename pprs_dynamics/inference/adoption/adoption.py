# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The answer to a requested effect: the model with it, errors before and after, objections."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pprs_dynamics.inference.adoption.fit_curve import CurveRequest, FittedCurve
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.inference.search.estimates import Calibration, Estimate
from pprs_dynamics.physics.model.drive_model import DriveModel

BLOCKS, VALIDATION = 'blocks', 'validation'


@dataclass(frozen=True)
class Adoption:
    """The answer to a requested effect.

    Parameters
    ----------
    request : EffectRequest or CurveRequest
    drives : tuple of str or None
        On which it was fitted.
    adopted, forced : bool
        Forced: in spite of objections.
    reason : str
        Why, in one sentence.
    objections, remarks : tuple of str
    parameters : dict of str to Estimate
    calibrated : tuple of Calibration
        Numbers of the model that moved within their tolerances.
    rivals : tuple of str
        Effects that explain the recordings as well.
    before, after : DriveModel
        As given; and with the effect. The latter is the former where the effect gives no model.
    residuals_before, residuals_after : Residuals
        On the recordings.
    error_before, error_after, held_out_before, held_out_after : float
        [N]
    held_out_on : {'blocks', 'validation'}
    noise_floor : float
        Root of the mean square of the noise, as the diagnosis has it [N].
    noise_floors : mapping of str to float
        The same by drive [N].
    curve : FittedCurve, optional
        Of a measured curve, with its band.
    moments : mapping of str to Estimate
        First moments of added bodies: see `Estimates`.
    reference : tuple of str
        Runs since which the effect is a change; errors are beyond what they show as well.
    """

    request: EffectRequest | CurveRequest
    drives: tuple[str, ...] | None
    adopted: bool
    forced: bool
    reason: str
    objections: tuple[str, ...]
    remarks: tuple[str, ...]
    parameters: dict[str, Estimate]
    calibrated: tuple[Calibration, ...]
    rivals: tuple[str, ...]
    before: DriveModel
    after: DriveModel
    residuals_before: Residuals
    residuals_after: Residuals
    error_before: float
    error_after: float
    held_out_before: float
    held_out_after: float
    held_out_on: str
    noise_floor: float
    noise_floors: dict[str, float]
    curve: FittedCurve | None = None
    moments: Mapping[str, Estimate] = field(default_factory=dict)
    reference: tuple[str, ...] = ()

    @property
    def unit(self) -> str:
        """Unit of errors over all drives."""
        return self.residuals_before.unit

    @property
    def effect(self) -> str:
        """Name of the effect."""
        return self.request.name

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON of `pprs adopt`."""
        return {
            'adopted': self.adopted, 'reason': self.reason, 'effect': self.effect,
            'drives': None if self.drives is None else list(self.drives),
            'error_before': self.error_before, 'error_after': self.error_after,
            'held_out_before': self.held_out_before, 'held_out_after': self.held_out_after,
            'held_out_on': self.held_out_on, 'noise_floor': self.noise_floor,
            'forced': self.forced, 'objections': list(self.objections),
            'remarks': list(self.remarks), 'rivals': list(self.rivals),
            'parameters': {key: one.to_dict() for key, one in self.parameters.items()},
            **({'moments': {key: one.to_dict() for key, one in self.moments.items()}}
               if self.moments else {}),
            **({'reference': list(self.reference)} if self.reference else {}),
            'calibrated': [one.to_dict() for one in self.calibrated]}
