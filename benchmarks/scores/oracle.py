# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What somebody could say who knows which effect is hidden, and on which drives.

The catalogue's form of the true effect is fitted on the true drives, its shape refined; the noise
is that of its residual, as good as the true one. Rivals are fitted from the same noise.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from pprs_dynamics.inference.search.candidates import EffectCandidate
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.fitted_model import linear_error
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.inference.search.scan import Scan
from pprs_dynamics.inference.search.table import ModelTable
from pprs_dynamics.physics.effects.catalogue import catalogue

RIVALS = 6  # proposals that are fitted


def consult(selection: ModelTable, truth: Mapping[str, Any]) -> dict[str, Any]:
    """Return `best_error` [N], and `separable`: no other effect alone comes near its cost.

    Empty where nothing, several effects or none of the catalogue are hidden, or where the model
    has no place for it.
    """
    hidden = truth['effects']
    if len(hidden) != 1 or hidden[0]['name'] not in catalogue():
        return {}
    effect, design = catalogue()[hidden[0]['name']], selection.first.design
    drives = hidden[0]['drives'] and [design.drives.index(drive) for drive in hidden[0]['drives']]
    fits = FittedSets(design, DECISIONS)
    scan, nothing = Scan(fits), fits.evaluate(())
    offers = scan.offers(nothing).get(effect, [])
    chosen = ([component for _, component in offers if component.drive in drives] if drives
              else scan.best_drives(effect, offers, None)[1] if offers else [])
    if not chosen:
        return {}
    own = fits.refined(fits.evaluate((EffectCandidate.of(chosen),)))
    base = replace(nothing, fit=fits.regression.at((), own.fit))
    rivals = [fits.refined(fits.evaluate(proposal)).cost
              for proposal in scan.proposals(base, RIVALS) if proposal[0].name != effect.name]
    return {'best_error': linear_error(fits, own),
            'separable': min(rivals, default=nothing.cost) > own.cost + DECISIONS.rival_margin}
