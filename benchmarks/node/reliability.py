# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Run the benchmarks of the feedforward node and write their results.

    python -m benchmarks.node.reliability [--full] [PART ...]

PARTs are latency, storm, restart, stall, soak, fuzz; all by default. What each found is kept in
output/reliability, also while it runs, so that parts can be run one by one and a run that is ended
early is not lost; the page is written from what is there. `--resume` skips parts that have
been run at the size that is asked for.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from functools import partial
from types import ModuleType
from typing import Any

from benchmarks import ROOT
from benchmarks.node import fuzz, latency, parameter_storm, restart, soak, stall
from benchmarks.node.reliability_page import SECTIONS
from benchmarks.results import write_results

KEPT = ROOT / 'output' / 'reliability'
# Part: its module, and its size in short and in full.
PARTS: dict[str, tuple[ModuleType, float, float]] = {
    'latency': (latency, 10.0, 60.0),
    'storm': (parameter_storm, 2_000, 10_000),
    'restart': (restart, 5, 20),
    'stall': (stall, 3.0, 3.0),
    'soak': (soak, 5.0, 20.0),
    'fuzz': (fuzz, 100_000, 1_000_000),
}
KEPT_AS_THEY_GROW = ('storm', 'restart', 'fuzz')


def main() -> int:
    """Run what is asked for and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('parts', nargs='*', metavar='PART', help=', '.join(PARTS))
    parser.add_argument('--full', action='store_true', help='the sizes that were asked for')
    parser.add_argument('--size', type=float, help='of every part, in place of those')
    parser.add_argument('--write', action='store_true', help='run nothing')
    parser.add_argument('--resume', action='store_true', help='leave out what has been run')
    arguments = parser.parse_args()
    unknown = set(arguments.parts) - set(PARTS)
    if unknown:
        parser.error(f'no such part: {", ".join(sorted(unknown))}')
    KEPT.mkdir(parents=True, exist_ok=True)
    good = True
    for name in () if arguments.write else arguments.parts or PARTS:
        part, short, full = PARTS[name]
        size = type(short)(arguments.size or (full if arguments.full else short))
        if arguments.resume and kept_size(name) >= size:
            continue
        growing = {'keep': partial(keep, name)} if name in KEPT_AS_THEY_GROW else {}
        found = part.run(size, **growing)
        keep(name, size, found)
        print(f'{name}: {json.dumps(found)}', flush=True)
        if hasattr(part, 'passed') and not part.passed(found):
            print(f'{name}: FAILED')
            good = False
    write_results('reliability', 'Reliability of the feedforward node', 'make reliability', page())
    return 0 if good else 1


def keep(name: str, size: float, found: dict[str, Any]) -> None:
    """Keep what a part found, with the load of the machine."""
    (KEPT / f'{name}.json').write_text(json.dumps({
        'size': size, 'cores': os.cpu_count(), 'load': round(os.getloadavg()[1], 2),
        'found': found}, indent=1))


def kept_size(name: str) -> float:
    """Return the size at which a part has been run; 0 where it has not."""
    file = KEPT / f'{name}.json'
    return float(json.loads(file.read_text())['size']) if file.is_file() else 0.0


def page() -> str:
    """Return the page, from what has been kept."""
    text = []
    for name, (_, _, full) in PARTS.items():
        file = KEPT / f'{name}.json'
        title, words = SECTIONS[name]
        text.append(f'## {title}\n')
        if not file.is_file():
            text.append(f'Not run yet: `python -m benchmarks.node.reliability {name}`.\n')
            continue
        kept = json.loads(file.read_text())
        size = 'Full size'
        if kept['size'] < full:
            size = (f'Size {kept["size"]:,.0f} of {full:,.0f} '
                    f'(`python -m benchmarks.node.reliability --full {name}`)')
        text.append(words(kept['found']))
        text.append(f'{size}; {kept["cores"]} cores, load of the machine over the last five '
                    f'minutes {kept["load"]}.\n')
    return '\n'.join(text)


if __name__ == '__main__':
    sys.exit(main())
