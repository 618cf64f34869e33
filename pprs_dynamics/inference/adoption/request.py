# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Requests for an effect: EFFECT, EFFECT:drive,drive or measured_curve:DRIVE@VARIABLE."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from pprs_dynamics.drives import DRIVES
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
    def of(cls, text: str, known: tuple[str, ...] = DRIVES) -> EffectRequest:
        """Read a request for the drives that are known.

        Raises
        ------
        EffectRequestError
            For an effect or a drive that does not exist.
        """
        name, colon, listed = text.partition(':')
        if name == MeasuredCurve.name:
            drive, at, variable = listed.partition('@')
            if not at:
                raise EffectRequestError(f'{text} must be measured_curve:DRIVE@VARIABLE, e.g. '
                                         f'measured_curve:{known[0]}@position')
            if drive not in known:
                raise UnknownNameError('drive', drive, known, name)
            return cls(MeasuredCurve, (drive,), check_variable(name, variable, known))
        return cls.named(name, [drive.strip() for drive in listed.split(',')] if colon else None,
                         known)

    @classmethod
    def named(cls, name: str, on: Iterable[str] | None = None, known: tuple[str, ...] = DRIVES,
              ) -> EffectRequest:
        """Return the request of an effect by name, on some of the drives that are known.

        Raises
        ------
        EffectRequestError
            For an effect or a drive that does not exist.
        """
        effect = find_effect(name)
        if effect is None:
            raise EffectRequestError(f'unknown effect {name!r}{suggestion(name, catalogue())}, '
                                     f'must be one of {", ".join(catalogue())}')
        if on is None:
            return cls(effect)
        drives = tuple(dict.fromkeys(on))
        if not issubclass(effect, DriveEffect):
            raise EffectRequestError(f'{name} is in the structure and must be requested '
                                     f'without {", ".join(drives) or "drives"}')
        for drive in drives:
            if drive not in known:
                raise EffectRequestError(f'unknown drive {drive!r}{suggestion(drive, known)}, '
                                         f'must be one of {", ".join(known)}')
        return cls(effect, tuple(sorted(drives, key=known.index)))

    def placed(self, model: DriveModel) -> EffectRequest:
        """Return the request of the effect with the joints and links of what a model is of.

        Raises
        ------
        EffectRequestError
            Where it cannot act there.
        """
        if self.variable:
            return self
        if not model.offers(self.effect):
            offered = [name for name, effect in catalogue().items() if model.offers(effect)]
            raise EffectRequestError(f'{self.name} does not act in {model.title}, must be one of '
                                     f'{", ".join(offered)}')
        return replace(self, effect=model.bound(self.effect))

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


def requested(text: str, model: DriveModel) -> EffectRequest:
    """Read a request for a model.

    Raises
    ------
    PprsError
        As `EffectRequest.of` and `EffectRequest.placed`.
    """
    return EffectRequest.of(text, model.drives).placed(model)
