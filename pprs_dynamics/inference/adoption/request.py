# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Requests for an effect: EFFECT, or EFFECT:drive,drive; parsed and checked."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from pprs_dynamics.drives import DRIVES
from pprs_dynamics.errors import PprsError, suggestion
from pprs_dynamics.inference.adoption.fit_curve import CurveRequest
from pprs_dynamics.physics.effects.catalogue import catalogue, find_effect
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.effects.laws.measured_curve import MeasuredCurve
from pprs_dynamics.physics.model.drive_model import DriveModel


class EffectRequestError(PprsError, ValueError):
    """An effect or drive that does not exist."""


@dataclass(frozen=True)
class EffectRequest:
    """A requested effect, and on which drives.

    Parameters
    ----------
    effect : type of CatalogueEffect
    drives : tuple of str or None
        On which; None: where the recordings call for it.
    """

    effect: type[CatalogueEffect]
    drives: tuple[str, ...] | None = None

    @classmethod
    def of(cls, text: str, known: tuple[str, ...] = DRIVES) -> EffectRequest:
        """Read EFFECT or EFFECT:drive,drive, of the drives that are known.

        Raises
        ------
        EffectRequestError
            For an effect or a drive that does not exist.
        """
        name, colon, listed = text.partition(':')
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
            raise EffectRequestError(f'{name} is in the structure and must stand alone, without '
                                     f'{", ".join(drives) or "drives"}')
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
        if not model.offers(self.effect):
            offered = [name for name, effect in catalogue().items() if model.offers(effect)]
            raise EffectRequestError(f'{self.name} does not act in {model.title}, must be one of '
                                     f'{", ".join(offered)}')
        return replace(self, effect=model.bound(self.effect))

    @property
    def name(self) -> str:
        """Of the effect."""
        return self.effect.name

    def present(self, model: DriveModel) -> bool:
        """Return whether the model has it already, on every drive that is asked for if any is."""
        return any(effect.name == self.name and (
            not isinstance(effect, DriveEffect) or set(self.drives or ()) <= set(effect.drives))
            for effect in model.effects)


def requested(text: str, model: DriveModel) -> EffectRequest | CurveRequest:
    """Read EFFECT, EFFECT:drive,drive or measured_curve:DRIVE@VARIABLE for a model.

    Raises
    ------
    PprsError
        As `EffectRequest.of`, `EffectRequest.placed` and `CurveRequest.of`.
    """
    name, _, rest = text.partition(':')
    if name == MeasuredCurve.name:
        return CurveRequest.of(rest, model.drives)
    return EffectRequest.of(text, model.drives).placed(model)
