# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The loop in 15 seconds: what the tutorial's commands print, one after the other.

    python docs/loop_animation.py

Writes docs/images/loop.svg from docs/tutorial.md, which `docs/tutorial.py` makes by running them.
"""

from __future__ import annotations

import re
from html import escape
from pathlib import Path

HERE = Path(__file__).parent
SHOWN = ('compare', 'diagnose', 'adopt', 'history')
SECONDS = 3.75  # of each
WIDTH, LINE, MOST = 84, 17, 13  # characters, pixels, lines


def screens(text: str) -> list[tuple[str, list[str]]]:
    """Return the first command of each kind, and what it prints."""
    found = []
    for name in SHOWN:
        command = re.search(rf'^pprs {name} .*', text, re.M)
        printed = re.search(rf'<!-- {name} -->\n```text\n(.*?)\n```', text, re.S)
        if command is None or printed is None:
            raise ValueError(f'the tutorial has no command and block {name}')
        found.append((command[0], printed[1].split('\n')))
    return found


def animation(frames: list[tuple[str, list[str]]]) -> str:
    """Return an SVG that shows one frame after the other, for ever."""
    height = (MOST + 3) * LINE
    total, share = SECONDS * len(frames), 100 / len(frames)
    groups = []
    for number, (command, lines) in enumerate(frames):
        rows = [f'<tspan class="c">$ {escape(command[:WIDTH])}</tspan>', '',
                *(escape(line[:WIDTH]) for line in lines[:MOST])]
        text = ''.join(f'<text x="12" y="{(k + 1) * LINE + 4}" xml:space="preserve">{row}</text>'
                       for k, row in enumerate(rows))
        groups.append(f'<g style="animation-delay:{number * SECONDS - total:.2f}s">{text}</g>')
    style = ('text{font:13px ui-monospace,Menlo,Consolas,monospace;fill:#dde3ea}.c{fill:#7fd1b9}'
             f'g{{opacity:0;animation:s {total}s infinite}}'
             f'@keyframes s{{0%,{share - 1:.1f}%{{opacity:1}}{share:.1f}%,100%{{opacity:0}}}}')
    return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 700 {height}" role="img" '
            f'aria-label="compare, diagnose, adopt, history in a terminal"><style>{style}</style>'
            f'<rect width="700" height="{height}" rx="8" fill="#1b2027"/>{"".join(groups)}</svg>\n')


if __name__ == '__main__':
    frames = screens((HERE / 'tutorial.md').read_text(encoding='utf-8'))
    (HERE / 'images' / 'loop.svg').write_text(animation(frames), encoding='utf-8')
