# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The setting of each peer that is right most often on public problems.

    python -m benchmarks.naming.run make FOLDER --seed 1 --problems 24
    python -m benchmarks.naming.tune FOLDER

Peers get one sensible tuning each, on the seed that is public; `Entrant.tuned` holds what came.
Like `enter` of `run` it goes on where it was stopped.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from benchmarks.naming.entrants import PEERS
from benchmarks.naming.page import is_right
from benchmarks.naming.run import enter_all, score_all
from benchmarks.naming.scoring import Rate


def main() -> None:
    """Print, for each peer, how often each value of its setting is right."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('folder', type=Path)
    parser.add_argument('--workers', type=int, default=2)
    parser.add_argument('--minutes', type=float, default=np.inf)
    options = parser.parse_args()
    tried = {f'{name}, {peer.tuning[0]} {value:g}': peer.set_to(value)
             for name, peer in PEERS.items() if peer.tuning for value in peer.tuning[1]}
    if enter_all(options.folder, tried, options.workers, options.minutes):
        return
    scored = score_all(options.folder)
    for name in tried:
        print(f'{name}: {Rate.of(is_right(judged) for _, _, judged in scored[name])}')


if __name__ == '__main__':
    main()
