# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A tab on the workbench, used as a user does."""

from __future__ import annotations

from typing import Any

from workbench_server import Workbench

PATIENCE = 180_000  # [ms], on a busy machine
SETTLED = 'bench.state && bench.state.is_settled && bench.curves'


class Page:
    """A tab on the workbench, and its errors and warnings.

    A context costs Chromium two processes, so tests share one and open the page again.
    """

    def __init__(self, browser: Any, bench: Workbench, **options: Any) -> None:
        self.bench = bench
        self.context = browser.new_context(**{'bypass_csp': True, **options})
        self.tab = self.context.new_page()
        self.tab.set_default_timeout(PATIENCE)
        self.complaints: list[str] = []
        self.tab.on('console', self._hear)
        self.tab.on('pageerror', lambda error: self.complaints.append(str(error)))
        self.open()

    def open(self, width: int = 1500, scheme: str = 'light') -> None:
        """Open the page as in a new browser with a window of this width and this colour scheme."""
        self.tab.set_viewport_size({'width': width, 'height': 950})
        self.tab.emulate_media(color_scheme=scheme)
        self.tab.goto(self.bench.post('/api/invite').json['address'])
        if self.tab.evaluate('localStorage.length'):
            self.tab.evaluate('localStorage.clear()')
            self.tab.reload()

    def _hear(self, message: Any) -> None:
        # The browser tells of every request that was refused; the page says why.
        if 'the server responded with a status of 400' not in message.text:
            self.complaints.append(message.text)

    def settled(self) -> dict[str, Any]:
        self.tab.wait_for_function(SETTLED)
        found: dict[str, Any] = self.tab.evaluate('bench.state')
        return found

    def tick(self, name: str) -> dict[str, Any]:
        """Click a box and wait for all that follows."""
        before = self.tab.evaluate('bench.settled.length')
        self.tab.locator(f'#tick-{name}').click()
        self.tab.wait_for_function(f'bench.settled.length > {before}')
        return self.settled()

    def mark(self, drive: int, start: float, end: float) -> None:
        """Drag over a drive's curve, from and to shares of its width."""
        self.tab.evaluate('window.scrollTo(0, 0)')
        box = self.tab.locator('#curves .u-over').nth(drive).bounding_box()
        y = box['y'] + box['height'] / 2
        self.tab.mouse.move(box['x'] + start * box['width'], y)
        self.tab.mouse.down()
        self.tab.mouse.move(box['x'] + end * box['width'], y, steps=4)
        self.tab.mouse.up()
