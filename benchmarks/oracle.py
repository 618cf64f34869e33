"""What somebody could say who knows which effect is hidden, and on which drives.

The catalogue's form of the true effect is fitted on the true drives, its shape refined; the
noise is that of its residual, as good as the true one. Rivals are fitted the same way.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pprs_dynamics.diagnosis.library import Candidate
from pprs_dynamics.diagnosis.scan import Scan
from pprs_dynamics.diagnosis.selection import NEAR_SCORE, Selector

from pprs_dynamics.effects.catalogue import catalogue


def consult(selector: Selector, truth: Mapping[str, Any]) -> dict[str, Any]:
    """Return `best_error` [N], and `separable`: no other effect scores as well.

    Empty where nothing, several effects or none of the catalogue are hidden.
    """
    hidden = truth['effects']
    if len(hidden) != 1 or hidden[0]['name'] not in catalogue():
        return {}
    name, regression = hidden[0]['name'], selector.regression
    true = None if hidden[0]['drives'] is None else {
        regression.design.drives.index(drive) for drive in hidden[0]['drives']}
    scan = Scan(selector.library, (), selector.rich)
    best: dict[int | None, Candidate] = {}
    for one in [*(Candidate((active,), gain, selector.library.penalty(active))
                  for active, gain in scan.terms()), *scan.local_bests()]:
        drive = one.active[0].term.drive
        if one.name == name and (true is None or drive in true) and (
                drive not in best or one.score > best[drive].score):
            best[drive] = one
    chosen = Candidate(tuple(a for one in best.values() for a in one.active),
                       sum(one.gain for one in best.values()),
                       sum(one.penalty for one in best.values()) + selector.library.name_penalty)
    chosen = scan.refined(chosen)
    fit = regression.fit(chosen.active, selector.rich)
    scan = Scan(selector.library, (), fit.noises)
    own = scan.refined(chosen)
    rivals = [scan.refined(one).score for one in scan.candidates()[:6] if one.name != name]
    fit = regression.fit(own.active, fit.noises)
    return {'best_error': regression.error(fit.active, fit.coefficients),
            'separable': own.score > max(rivals, default=0.0) + NEAR_SCORE}
