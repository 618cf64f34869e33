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
LEAST_CONTRAST, LEAST_TEXT = 4.5, 12.0  # WCAG 2.2 AA; [px]
# The text that is seen with the least contrast, and with the least size.
READABLE = '''() => {
  const light = (colour) => {
    const [r, g, b] = colour.match(/[\\d.]+/g).slice(0, 3).map((part) => {
      const c = part / 255;
      return c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
    });
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const ground = (node) => {
    for (let one = node; one; one = one.parentElement) {
      const colour = getComputedStyle(one).backgroundColor;
      if (!/, 0\\)$/.test(colour)) return colour;
    }
    return 'rgb(255, 255, 255)';
  };
  let contrast = 99, size = 99;
  for (const node of document.querySelectorAll('main *, header *')) {
    const own = [...node.childNodes].some((one) => one.nodeType === 3 && one.data.trim());
    if (!own || node.closest('svg, script') || !node.getClientRects().length) continue;
    const style = getComputedStyle(node);
    const [a, b] = [light(style.color), light(ground(node))].sort();
    contrast = Math.min(contrast, (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05));
    size = Math.min(size, parseFloat(style.fontSize));
  }
  for (const button of document.querySelectorAll('.plot .updatemenu-button')) {
    const [text, box] = ['text', 'rect'].map(
      (name) => light(getComputedStyle(button.querySelector(name)).fill));
    contrast = Math.min(contrast, (Math.max(text, box) + 0.05) / (Math.min(text, box) + 0.05));
  }
  for (const text of document.querySelectorAll('.plot text, .plot tspan')) {
    size = Math.min(size, parseFloat(getComputedStyle(text).fontSize));
  }
  return [contrast, size];
}'''


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
            # Not Playwright's way, which waits for frames that a busy machine may not paint.
            plot.evaluate('(plot) => plot.scrollIntoView()')
            self.drawn(number)
        return len(plots)
