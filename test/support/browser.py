# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Pages in a real browser: Chromium, headless and without a network, driven by Playwright."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

NAMES = ('chromium', 'chromium-browser', 'google-chrome', 'chrome')
# Drawing in three dimensions without a graphics card.
ARGUMENTS = ('--no-sandbox', '--use-gl=swiftshader', '--enable-unsafe-swiftshader',
             '--disable-background-networking')
# The software renderer's remarks on its own pace, told as if the page had spoken.
ABOUT_PACE = ('GL Driver Message', 'Canvas2D: Multiple readback operations')
PATIENCE = 60_000  # [ms], on a busy machine


def find_browser() -> str | None:
    """Return Chromium's command, or None where it or what drives it is missing."""
    if find_spec('playwright') is None:
        return None
    return next((found for name in NAMES if (found := shutil.which(name))), None)


needs_browser = pytest.mark.skipif(
    find_browser() is None, reason='no Chromium on PATH, or no playwright, to look at pages with')


@contextmanager
def chromium() -> Iterator[Any]:
    """Run a browser while the block lasts."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as running:
        browser = running.chromium.launch(executable_path=find_browser(), args=list(ARGUMENTS))
        yield browser
        browser.close()


class Seen:
    """A page in a tab, and what it complained about.

    Parameters
    ----------
    browser : Browser
        Of Playwright.
    file : Path
    options
        Of the tab, as Playwright has them.
    """

    def __init__(self, browser: Any, file: Path, **options: Any) -> None:
        self.context = browser.new_context(**{
            'viewport': {'width': 1280, 'height': 800}, 'offline': True, **options})
        self.tab = self.context.new_page()
        self.tab.set_default_timeout(PATIENCE)
        self.complaints: list[str] = []
        self.tab.on('console', self._hear)
        self.tab.on('pageerror', lambda error: self.complaints.append(str(error)))
        self.tab.goto(file.as_uri())

    def _hear(self, message: Any) -> None:
        if not any(remark in message.text for remark in ABOUT_PACE):
            self.complaints.append(message.text)

    def drawn(self, count: int) -> None:
        """Wait until so many figures are drawn."""
        self.tab.wait_for_function(
            f"document.querySelectorAll('.plot[data-drawn]').length >= {count}")

    def unfold(self) -> int:
        """Open every fold, scroll to every figure, and return how many there are."""
        self.tab.evaluate("document.querySelectorAll('details').forEach((d) => d.open = true)")
        plots = self.tab.query_selector_all('.plot')
        for number, plot in enumerate(plots, start=1):
            plot.scroll_into_view_if_needed()
            self.drawn(number)
        return len(plots)
