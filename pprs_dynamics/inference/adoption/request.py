# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Requests for an effect: EFFECT, EFFECT:drive,drive or measured_curve:DRIVE@VARIABLE."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from pprs_dynamics.errors import PprsError, UnknownNameError, suggestion
from pprs_dynamics.physics.effects.catalogue import catalogue, find_effect
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.effects.laws.measured_curve import MeasuredCurve, check_variable
from pprs_dynamics.physics.model.drive_model import DriveModel


class EffectRequestError(PprsError, ValueError):
    """An effect or drive that does not exist, or that the recordings cannot give."""


@dataclass(frozen=True)
class EffectRequest:
    """A requested effect, and on which drives.

    Parameters
    ----------
    effect : type of CatalogueEffect
    drives : tuple of str or None
        On which; None: where the recordings call for it.
    variable : str
        Of a measured curve, as in the results of a comparison; '' for any other effect.
    """

    effect: type[CatalogueEffect]
    drives: tuple[str, ...] | None = None
    variable: str = ''

    @classmethod
    def of(cls, text: str, model: DriveModel) -> EffectRequest:
        """Read a request for a model.

        Raises
        ------
        EffectRequestError
            For an effect or a drive that does not exist, or does not act there.
        """
        name, colon, listed = text.partition(':')
        if name == MeasuredCurve.name:
            drive, at, variable = listed.partition('@')
            if not at:
                raise EffectRequestError(f'{text} must be measured_curve:DRIVE@VARIABLE, e.g. '
                                         f'measured_curve:{model.drives[0]}@position')
            if drive not in model.drives:
                raise UnknownNameError('drive', drive, model.drives, name)
            return cls(MeasuredCurve, (drive,), check_variable(name, variable, model.drives))
        return cls.named(name, [drive.strip() for drive in listed.split(',')] if colon else None,
                         model)

    @classmethod
    def named(cls, name: str, on: Iterable[str] | None, model: DriveModel) -> EffectRequest:
        """Return the request of an effect by name, on some of a model's drives; errors as `of`.

        The effect has the joints and links that the model has.
        """
        effect = find_effect(name)
        if effect is None:
            raise EffectRequestError(f'unknown effect {name!r}{suggestion(name, catalogue())}, '
                                     f'must be one of {", ".join(catalogue())}')
        drives = None if on is None else tuple(dict.fromkeys(on))
        if drives is not None and not issubclass(effect, DriveEffect):
            raise EffectRequestError(f'{name} is in the structure and must be requested '
                                     f'without {", ".join(drives) or "drives"}')
        for drive in drives or ():
            if drive not in model.drives:
                raise EffectRequestError(f'unknown drive {drive!r}{suggestion(drive, model.drives)}'
                                         f', must be one of {", ".join(model.drives)}')
        if not model.offers(effect):
            offered = [name for name, effect in catalogue().items() if model.offers(effect)]
            raise EffectRequestError(f'{name} does not act in {model.title}, must be one of '
                                     f'{", ".join(offered)}')
        return cls(model.bound(effect), drives and tuple(sorted(drives, key=model.drives.index)))

    @property
    def name(self) -> str:
        """Name of the effect, as in results and ledgers."""
        return f'{self.effect.name}:{self.drive}@{self.variable}' if (
            self.variable) else self.effect.name

    @property
    def drive(self) -> str:
        """The drive of a measured curve."""
        assert self.drives is not None
        return self.drives[0]

