# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The base model fitted again beside the effects that were added to it.

A base model that was fitted without them holds a part of what they explain: its friction that of
loads and temperatures, its links that of a cable.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from pprs_dynamics.arrays import root_mean_square
from pprs_dynamics.inference.fit.base_fit import HALVES, BaseFit, errors_of, fit_base
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.force_model import ForceModel


@dataclass(frozen=True)
class Refit:
    """A base model fitted again, taken or not.

    Parameters
    ----------
    fit : BaseFit
    taken : bool
        Whether the error on data that took no part in the fit falls.
    reason : str
    """

    fit: BaseFit
    taken: bool
    reason: str

    def to_dict(self) -> dict[str, Any]:
        """Return the refit for JSON."""
        return {**self.fit.to_dict(), 'taken': self.taken, 'reason': self.reason}


def refit_base(model: ForceModel, recordings: Sequence[Recording],
               validate: Sequence[Recording] = (),
               progress: Callable[[float], None] | None = None) -> Refit:
    """Return the base model fitted again; its effects stay as they are.

    Parameters
    ----------
    model : ForceModel
        With effects.
    recordings : sequence of Recording
        To fit to.
    validate : sequence of Recording, optional
        On which the error must fall; else each recording, or half of the only one, is predicted
        from the others.
    progress : callable, optional

    Raises
    ------
    FitError
        Where the model has nothing that can be fitted.
    PprsError
        As `measure_residuals`.
    """
    found = fit_base(model, recordings, validate, progress)
    before = errors_of(model, validate) if validate else found.before
    drives = [drive for drive in before if drive in found.held_out]
    # Drives of different sizes and units count alike.
    ratio = root_mean_square([
        found.held_out[drive] / max(before[drive], 1e-300) for drive in drives])
    where = ('the validation recordings' if validate else 'its halves, each predicted from the '
             'other,' if found.held_out_on == HALVES else 'recordings predicted from the others')
    change = f'the error on {where} is {ratio:.3g} of that before, over all drives'
    return Refit(found, ratio < 1, f'{change}: base model fitted again' if ratio < 1 else
                 f'{change}, must fall: the base model stays as it was')
