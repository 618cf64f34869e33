"""What a diagnosis says of one effect: found, or ranked among the candidates."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from pprs_dynamics.arrays import Array
from pprs_dynamics.diagnosis.adoption import Estimate
from pprs_dynamics.effects.effect import CatalogueEffect


@dataclass(frozen=True)
class FoundEffect:
    """An effect that the recordings call for.

    Parameters
    ----------
    effect : type of CatalogueEffect
    drives : tuple of str or None
        On which it sits; None for the structure.
    parameters : dict of str to Estimate
    evidence : float
        Twice the gain in log-likelihood, less penalty and margin.
    error_before, error_after, held_out_before, held_out_after : float
        [N], with the effects before it, and with it as well.
    force : (M, D) array
        What it contributes [N].
    at_bound : tuple of str
        Parameters that stand at a bound.
    """

    effect: type[CatalogueEffect]
    drives: tuple[str, ...] | None
    parameters: dict[str, Estimate]
    evidence: float
    error_before: float
    error_after: float
    held_out_before: float
    held_out_after: float
    force: Array
    at_bound: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name in the catalogue."""
        return self.effect.name

    def as_data(self) -> dict[str, Any]:
        """Return the keys of the interface."""
        return {'name': self.name, 'drives': listed(self.drives),
                'parameters': {key: one.as_data() for key, one in self.parameters.items()},
                'evidence': self.evidence,
                'error_before': self.error_before, 'error_after': self.error_after,
                'held_out_before': self.held_out_before, 'held_out_after': self.held_out_after}


@dataclass(frozen=True)
class RankedEffect:
    """A candidate for the first place, or a suspect."""

    name: str
    drives: tuple[str, ...] | None
    evidence: float
    error_after: float

    def as_data(self) -> dict[str, Any]:
        """Return the keys of the interface."""
        return {'name': self.name, 'drives': listed(self.drives), 'evidence': self.evidence,
                'error_after': self.error_after}


def joined(early: list[FoundEffect], late: list[FoundEffect], order: tuple[str, ...],
            ) -> list[FoundEffect]:
    """Return all effects; what comes late on further drives is the same effect."""
    effects = list(early)
    for one in late:
        k = next((k for k, other in enumerate(early) if other.name == one.name), None)
        if k is None:
            effects.append(one)
            continue
        old, last = effects[k], len(early) - 1
        effects[k] = replace(
            old, drives=tuple(sorted({*(old.drives or ()), *(one.drives or ())}, key=order.index)),
            parameters={**old.parameters, **one.parameters}, evidence=old.evidence + one.evidence,
            force=old.force + one.force, at_bound=(*old.at_bound, *one.at_bound))
        effects[last] = replace(effects[last], error_after=one.error_after,
                                held_out_after=one.held_out_after)
    return effects


def listed(drives: tuple[str, ...] | None) -> list[str] | None:
    """Return names of drives for JSON."""
    return None if drives is None else list(drives)
