"""Pages looked at in a real browser: headless Chromium, without a network."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

NAMES = ('chromium', 'chromium-browser', 'google-chrome', 'chrome')
# Nothing is to be fetched, and nothing is: an address that leads nowhere stands for a network.
OFFLINE = ('--proxy-server=127.0.0.1:9', '--disable-background-networking', '--disable-sync',
           '--disable-component-update', '--no-first-run', '--disable-quic')
# The software renderer's remarks on its own pace, told as if the page had spoken.
ABOUT_PACE = ('GL Driver Message', 'Canvas2D: Multiple readback operations')


@dataclass(frozen=True)
class Rendered:
    """What a browser made of a page: its document, complaints, and a picture."""

    document: str
    console: list[str]
    picture: Path


def find_browser() -> str | None:
    """Return Chromium's command, or None where there is none."""
    return next((found for name in NAMES if (found := shutil.which(name))), None)


def render(page: Path, picture: Path, width: int = 1280, height: int = 1600) -> Rendered:
    """Load a page from its file, and take its picture."""
    browser = find_browser()
    assert browser is not None
    document = ''
    console: list[str] = []
    for mode in ('--dump-dom', f'--screenshot={picture}'):
        with tempfile.TemporaryDirectory() as profile:
            done = subprocess.run(
                [browser, '--headless', '--no-sandbox', '--disable-gpu', *OFFLINE,
                 '--use-gl=swiftshader', '--enable-unsafe-swiftshader', '--enable-logging=stderr',
                 f'--user-data-dir={profile}', f'--window-size={width},{height}',
                 '--virtual-time-budget=10000', mode, page.as_uri()],
                capture_output=True, text=True, timeout=120)
        document = document or done.stdout
        # Chromium's own remarks stand beside those of the page, which carry this mark.
        console += [line for line in re.findall(r'CONSOLE[^"]*"(.*)", source', done.stderr)
                    if not any(remark in line for remark in ABOUT_PACE)]
    return Rendered(document, console, picture)
