# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""From a click on a tick box of a diagnosis's page until the curves are painted.

    pprs diagnose run.mcap --report why.html && python -m benchmarks.speed.what_if why.html
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
from pathlib import Path

import numpy as np

CLICKS = 60
# The time of the frame after the next: what the click changed is painted by then.
PAINTED = '''(box) => new Promise((done) => {
  const start = performance.now();
  box.click();
  requestAnimationFrame(() => {
    const channel = new MessageChannel();
    channel.port1.onmessage = () => done(performance.now() - start);
    channel.port2.postMessage(null);
  });
})'''


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or '').splitlines()[0])
    parser.add_argument('page', type=Path)
    options = parser.parse_args()
    from playwright.sync_api import sync_playwright

    with sync_playwright() as running:
        browser = running.chromium.launch(executable_path=shutil.which('chromium'),
                                          args=['--no-sandbox'])
        tab = browser.new_page(viewport={'width': 1280, 'height': 900})
        tab.goto(options.page.resolve().as_uri())
        tab.wait_for_function("performance.getEntriesByType('paint').length")
        paint = tab.evaluate("performance.getEntriesByType('paint')[0].startTime")
        tab.click('summary:has-text("What if")')
        tab.wait_for_selector('#what-if[data-ready]')
        tab.evaluate("document.querySelector('#what-if').scrollIntoView()")
        tab.wait_for_timeout(500)
        boxes = tab.query_selector_all('.effect input')
        times = []
        for click in range(CLICKS):
            times.append(boxes[click % len(boxes)].evaluate(PAINTED))
            tab.wait_for_timeout(50)
        browser.close()
    print(f'{len(boxes)} effects, {options.page.stat().st_size / 1e6:.2f} MB, first paint '
          f'{paint:.0f} ms; click to painted curves: median {np.median(times):.0f} ms, '
          f'90 % {np.quantile(times, 0.9):.0f} ms, most {max(times):.0f} ms '
          f'({CLICKS} clicks, load {os.getloadavg()[0]:.1f})')
    return 0


if __name__ == '__main__':
    sys.exit(main())
