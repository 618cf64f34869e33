# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Rivals of adopted effects, fitted: what stands in their place in sets nearly as good."""

from __future__ import annotations

from collections.abc import Sequence

from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.diagnosis.diagnose import Diagnosis
from pprs_dynamics.inference.diagnosis.found_effects import RivalEffect
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.residuals.paired_errors import rms
from pprs_dynamics.inference.search.candidates import CandidateSet
from pprs_dynamics.inference.search.estimates import estimate
from pprs_dynamics.inference.search.fitted_model import fitted_model, linear_error, linear_residual
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.inference.search.held_out import hold_out
from pprs_dynamics.measurement.files.recording import Recording


def rival_effects(diagnosis: Diagnosis, validate: Sequence[Recording] = (),
                  ) -> tuple[RivalEffect, ...]:
    """Return each rival that a diagnosis names, from the best set that holds it.

    Parameters
    ----------
    diagnosis : Diagnosis
    validate : sequence of Recording, optional
        Those of the diagnosis; without them held-out errors are taken on blocks.
    """
    selection = diagnosis.selection
    if selection is None:
        return ()
    found = []
    adopted = {c.name: c.claim for c in selection.kept.effects}
    for of, name in ((names[0], name) for names in diagnosis.indistinguishable
                     for name in names[1:]):
        best = next((one for one in selection.sets
                     if any(name in (c.name, c.claim) for c in one.effects)
                     and adopted[of] not in {c.claim for c in one.effects}), None)
        if best is None:
            continue
        fits = selection.fits_of(best)
        candidate = next(c for c in best.effects if name in (c.name, c.claim))
        remaining = linear_residual(fits, best)
        found.append(RivalEffect(
            candidate.effect, fits.design.named(candidate.drives),
            estimate(fits, best, candidate).parameters,
            fits.library.force(best, candidate, remaining.shape), of, linear_error(fits, best),
            _held_out(fits, best, validate), best.cost - selection.best.cost, remaining))
    return tuple(found)


def _held_out(fits: FittedSets, found: CandidateSet, validate: Sequence[Recording]) -> float:
    if not validate:
        return hold_out(fits, found).error
    try:
        return rms(measure_residuals(fitted_model(fits, found), validate)[0])
    except PprsError:
        return float('nan')
