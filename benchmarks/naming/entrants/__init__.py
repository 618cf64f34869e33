# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The entrants by name. A method of one's own joins by a line here, or by files (README.md)."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import pprs_dynamics
from benchmarks.naming.entrants.ablations import given_model, greedy, white_noise, without_prices
from benchmarks.naming.entrants.averaging import model_averaging
from benchmarks.naming.entrants.controls import random, silent
from benchmarks.naming.entrants.cross_validation import block_cross_validation
from benchmarks.naming.entrants.least_squares import relative_deviations
from benchmarks.naming.entrants.penalised import adaptive_group_lasso, lasso
from benchmarks.naming.entrants.pprs import pprs
from benchmarks.naming.entrants.sindy import has_evidence_greedy, sindy
from benchmarks.naming.entrants.spike_and_slab import spike_and_slab
from benchmarks.naming.entrants.split_test import split_test
from benchmarks.naming.entrants.stepwise import stepwise
from benchmarks.naming.problems import Answer, Problem

OURS, PEER, PART, CONTROL = 'ours', 'peer', 'ours without a part', 'control'
LAYERS = ('physics', 'measurement', 'inference', 'app/api')  # that a diagnosis is made of


@dataclass(frozen=True)
class Entrant:
    """A method with its settings.

    Parameters
    ----------
    method : callable
        From a problem, and settings as keywords, to an answer.
    settings : mapping of str to float, str or bool
    tuning : tuple of str and values, optional
        The one setting that is chosen on the public problems, and what is tried.
    tuned : float, optional
        What came: the value with most right answers; by default none was better.
    library : str
        That is called.
    sort : str
        `OURS`, `PEER`, `PART` or `CONTROL`.
    """

    method: Callable[..., Answer]
    settings: Mapping[str, float | str | bool] = field(default_factory=dict)
    tuning: tuple[str, tuple[float, ...]] | None = None
    tuned: float | None = None
    library: str = 'numpy'
    sort: str = PEER

    def __call__(self, problem: Problem) -> Answer:
        """Return what it says."""
        return self.method(problem, **self.settings)

    def set_to(self, value: float) -> Entrant:
        """Return the entrant with another value of the setting that may be tuned."""
        assert self.tuning is not None
        return replace(self, settings={**self.settings, self.tuning[0]: value})

    def key(self) -> str:
        """Return the versions that an answer depends on: sources, settings, library."""
        try:
            library = version(self.library)
        except PackageNotFoundError:
            library = ''
        found = hashlib.sha256(repr((self.method.__qualname__, sorted(self.settings.items()),
                                     self.library, library)).encode())
        for file in self._sources():
            found.update(file.read_bytes())
        return found.hexdigest()[:16]

    def _sources(self) -> list[Path]:
        own = sys.modules[self.method.__module__]
        used = {own.__name__} | {str(getattr(m, '__module__', '')) for m in vars(own).values()}
        files = [Path(str(sys.modules[name].__file__)) for name in sorted(used)
                 if name.startswith(f'{__name__}.')]
        if self.sort in (OURS, PART):
            package = Path(pprs_dynamics.__file__).parent
            files += [file for room in LAYERS for file in sorted((package / room).rglob('*.py'))]
        return files


PEERS: dict[str, Entrant] = {
    'stepwise BIC, white': Entrant(stepwise, {'whiten': False}, ('weight', (1, 3, 10, 30)), 10),
    'stepwise BIC, AR': Entrant(stepwise, {'whiten': True}, ('weight', (1, 3, 10, 30)), 3),
    'stepwise BIC, AR again': Entrant(stepwise, {'whiten': True, 'rounds': 4},
                                      ('weight', (1, 3, 10, 30)), 3),
    'block cross-validation': Entrant(block_cross_validation, {}, ('errors', (0, 1, 2, 4))),
    'LASSO': Entrant(lasso, {}, ('errors', (0, 1, 3)), 3, library='scikit-learn'),
    'adaptive group LASSO': Entrant(adaptive_group_lasso, {}, ('weight', (1, 3, 10, 30)), 30,
                                    library='skglm'),
    'PySINDy STLSQ': Entrant(sindy, {'optimiser': 'STLSQ'},
                             ('threshold', (0.1, 0.3, 1, 3)), 3, library='pysindy'),
    'PySINDy SR3': Entrant(sindy, {'optimiser': 'SR3'}, ('threshold', (0.1, 0.3, 1, 3)),
                           library='pysindy'),
    'PySINDy FROLS': Entrant(sindy, {'optimiser': 'FROLS'}, ('steps', (1, 2, 3, 10)), 1,
                             library='pysindy'),
    'PySINDy EvidenceGreedy': Entrant(sindy, {'optimiser': 'EvidenceGreedy'},
                                      ('precision', (1, 1e-2, 1e-4, 1e-6)), library='pysindy'),
    'Bayesian averaging, AR': Entrant(model_averaging, {}, ('window', (1.001, 20, 150))),
    'spike and slab, AR': Entrant(spike_and_slab, {}, ('odds', (1e-2, 1e-4, 1e-8, 1e-16))),
    # Its test takes noise for independent.
    'held-out F-test (LISDD)': Entrant(split_test, {}, ('whiten', (0, 1)), 1),
    'least squares (FIGAROH)': Entrant(relative_deviations, {}, ('limit', (0.3, 0.1, 0.03, 0.01))),
}


def _with_tuned(peers: Mapping[str, Entrant]) -> dict[str, Entrant]:
    """Return peers with default settings, and with tuned ones where they were tuned."""
    found = {}
    for name, peer in peers.items():
        if peer.settings.get('optimiser') == 'EvidenceGreedy' and not has_evidence_greedy():
            continue  # answers of another installation are scored as they are
        found[name] = peer
        if peer.tuned is not None:
            assert peer.tuning is not None
            found[f'{name}, {peer.tuning[0]} {peer.tuned:g}'] = peer.set_to(peer.tuned)
    return found


ENTRANTS: dict[str, Entrant] = {
    'pprs diagnose': Entrant(pprs, library='pprs_dynamics', sort=OURS),
    **_with_tuned(PEERS),
    'pprs, noise white': Entrant(white_noise, sort=PART),
    'pprs, no prior penalties': Entrant(without_prices, sort=PART),
    'pprs, greedy': Entrant(greedy, sort=PART),
    'pprs, columns of the given model': Entrant(given_model, sort=PART),
    'silent': Entrant(silent, sort=CONTROL),
    'random': Entrant(random, sort=CONTROL),
}
