# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How fast the workbench answers, in a real browser.

    python -m benchmarks.speed.workbench [ROUNDS [PICTURE.png]]

A recording of 40 s of the simulated robot with two hidden effects; the server as a process,
Chromium without a graphics card. From the event of a click to the frame that shows its
answer, as the page itself notes it. The machine's load is printed, for it is part of the result.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from browser import chromium
from ros_processes import executable
from workbench_server import workbench

ROUNDS = 30
PATIENCE = 300_000  # [ms]
TICKED = ('payload_mass', 'stribeck_friction', 'viscous_friction', 'effort_offset', 'hysteresis')
SETTLED = 'bench.state && bench.state.is_settled && bench.curves'
GOALS = {'tick to paint': '60 / 100', 'evidence with its own noise': '300',
         'mark to shares': '100', 'start to first screen': '5000'}


def main() -> None:
    """Measure and print a table."""
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else ROUNDS
    with TemporaryDirectory() as folder, chromium() as browser:
        recording = Path(folder) / 'run.mcap'
        subprocess.run([executable('pprs'), 'simulate', '--output', str(recording), '--effect',
                        'stribeck_friction', '--effect', 'payload_mass', '--seed', '3'],
                       check=True, stdout=subprocess.DEVNULL)
        before = os.getloadavg()[0]
        found: dict[str, list[float]] = {'start to first screen': []}
        for _ in range(3):
            began = time.monotonic()
            with workbench(recording, folder=Path(folder)) as running:
                tab = browser.new_page()
                tab.goto(running.address)
                tab.locator('#curves canvas').nth(5).wait_for(timeout=PATIENCE)
                found['start to first screen'].append(1e3 * (time.monotonic() - began))
                tab.close()
        with workbench(recording, folder=Path(folder)) as running:
            page = browser.new_page(viewport={'width': 1500, 'height': 950}, bypass_csp=True)
            page.set_default_timeout(PATIENCE)
            page.goto(running.address)
            # Nothing else at work: the diagnosis in the background has ended.
            page.wait_for_function(f'{SETTLED} && bench.state.verdict')
            for number in range(rounds):
                click(page, TICKED[number % len(TICKED)])
            for number in range(rounds):
                mark(page, number)
            if len(sys.argv) > 2:
                picture(page, sys.argv[2])
            found['tick to paint'] = page.evaluate('bench.latencies')
            found['evidence with its own noise'] = page.evaluate('bench.settled')
            found['mark to shares'] = page.evaluate('bench.shares')
    print(f'load {before:.1f} before, {os.getloadavg()[0]:.1f} after, {os.cpu_count()} cores')
    print('| from … to, in ms | goal | median | 90 % | worst |')
    print('|---|---|---|---|---|')
    for name, goal in GOALS.items():
        values = np.array(found[name])
        print(f'| {name} ({len(values)} times) | {goal} | {np.median(values):.0f} | '
              f'{np.percentile(values, 90):.0f} | {values.max():.0f} |')


def click(page: Any, effect: str) -> None:
    """Click a box, and wait until all has followed."""
    seen = page.evaluate('bench.settled.length')
    page.locator(f'#tick-{effect}').click()
    page.wait_for_function(f'bench.settled.length > {seen}')
    page.wait_for_function(SETTLED)


def picture(page: Any, file: str) -> None:
    """Take the picture of docs/workbench.md: one effect ticked, the other asked for."""
    for effect in TICKED:
        ticked = page.locator(f'#tick-{effect}').is_checked()
        if ticked is not (effect == 'payload_mass'):
            click(page, effect)
    mark(page, 5)
    page.mouse.move(5, 5)
    page.evaluate('window.scrollTo(0, 0)')
    page.wait_for_timeout(500)
    page.screenshot(path=file)


def mark(page: Any, number: int) -> None:
    """Drag over a curve."""
    seen = page.evaluate('bench.shares.length')
    box = page.locator('#curves .u-over').nth(number % 4).bounding_box()
    x, y = box['x'] + 0.02 * number * box['width'] / 2, box['y'] + box['height'] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 120, y, steps=3)
    page.mouse.up()
    page.wait_for_function(f'bench.shares.length > {seen}')


if __name__ == '__main__':
    main()
