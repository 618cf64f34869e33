# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The answer to a requested effect: the model with it, errors before and after, objections."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pprs_dynamics.inference.adoption.fit_curve import CurveRequest, FittedCurve
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.residuals.residuals import Residuals, rms
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
    before, after : DriveModel
        As given; and with the effect. The latter is the former where the effect gives no model.
    residuals_before, residuals_after : Residuals
        On the recordings.
    held_out_before, held_out_after : float
        Errors on held-out data [N].
    held_out_on : {'blocks', 'validation'}
    noise_floors : mapping of str to float
        Root of the mean square of the noise of each drive, as the diagnosis has it [N].
    noise_floor : float
        The same over drives [N].
    parameters : mapping of str to Estimate
    objections, remarks : tuple of str
    calibrated : tuple of Calibration
        Numbers of the model that moved within their tolerances.
    rivals : tuple of str
        Effects that explain the recordings as well.
    moments : mapping of str to Estimate
        First moments of added bodies: see `Estimates`.
    curve : FittedCurve, optional
        Of a measured curve, with its band.
    reference : tuple of str
        Runs since which the effect is a change; errors are beyond what they show as well.
    adopted : bool
    reason : str
        Why, in one sentence.
    """

    request: EffectRequest | CurveRequest
    drives: tuple[str, ...] | None
    before: DriveModel
    after: DriveModel
    residuals_before: Residuals
    residuals_after: Residuals
    held_out_before: float
    held_out_after: float
    held_out_on: str
    noise_floors: Mapping[str, float]
    noise_floor: float
    parameters: Mapping[str, Estimate] = field(default_factory=dict)
    objections: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    calibrated: tuple[Calibration, ...] = ()
    rivals: tuple[str, ...] = ()
    moments: Mapping[str, Estimate] = field(default_factory=dict)
    curve: FittedCurve | None = None
    reference: tuple[str, ...] = ()
    adopted: bool = True
    reason: str = ''

    @property
    def forced(self) -> bool:
        """Whether it was adopted in spite of objections."""
        return self.adopted and bool(self.objections)

    @property
    def error_before(self) -> float:
        """Error on the recordings as given [N]."""
        return rms(self.residuals_before)

    @property
    def error_after(self) -> float:
        """Error on the recordings with the effect [N]."""
        return rms(self.residuals_after)

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
        moments = {key: estimate.to_dict() for key, estimate in self.moments.items()}
        return {
            **{name: getattr(self, name) for name in (
                'adopted', 'reason', 'effect', 'error_before', 'error_after', 'held_out_before',
                'held_out_after', 'held_out_on', 'noise_floor', 'forced')},
            'drives': None if self.drives is None else list(self.drives),
            'objections': list(self.objections), 'remarks': list(self.remarks),
            'rivals': list(self.rivals),
            'parameters': {key: estimate.to_dict() for key, estimate in self.parameters.items()},
            **({'moments': moments} if moments else {}),
            **({'reference': list(self.reference)} if self.reference else {}),
            'calibrated': [number.to_dict() for number in self.calibrated]}
