# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The project's pages, their links, anchors and what they show as code."""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema

PROJECT = Path(__file__).parents[2]
FENCE = re.compile(r'^(`{3,}|~{3,})[^\n]*\n(.*?)^\1\s*$', re.M | re.S)
INLINE = re.compile(r'(?<!`)`([^`\n]+(?:\n[^`\n]+)?)`(?!`)')
LINK = re.compile(r'\[[^\]]*\]\(([^)\s]+)\)')


def pages() -> list[Path]:
    """Return README, CONTRIBUTING and every page and notebook of docs that is kept in git."""
    docs = PROJECT / 'docs'
    found = [file for pattern in ('*.md', '*.ipynb') for file in docs.rglob(pattern)
             if 'generated' not in file.relative_to(docs).parts]
    return [PROJECT / 'README.md', PROJECT / 'CONTRIBUTING.md', *sorted(found)]


@cache
def text_of(page: Path) -> str:
    """Return a page as Markdown; cells of code of a notebook come as fences."""
    text = page.read_text(encoding='utf-8')
    if page.suffix != '.ipynb':
        return text
    cells = []
    for cell in json.loads(text)['cells']:
        source = ''.join(cell['source'])
        cells.append(source if cell['cell_type'] == 'markdown' else f'```python\n{source}\n```')
    return '\n\n'.join(cells)


def prose(text: str) -> str:
    """Return a text without its blocks of code."""
    return FENCE.sub('', text)


def code(text: str) -> list[str]:
    """Return what a text shows as code: lines of blocks, continued ones joined, and inline."""
    blocks = [match[2].replace('\\\n', ' ') for match in FENCE.finditer(text)]
    indented = re.findall(r'(?:^ {4}.*\n)+', prose(text).replace('\\\n', ' '), re.M)
    return [line.strip() for block in (*blocks, *indented) for line in block.splitlines()] + [
        ' '.join(found.split()) for found in INLINE.findall(prose(text))]


def links(text: str) -> list[str]:
    """Return the targets of a text's links and images that stay within the project."""
    return [target for target in LINK.findall(INLINE.sub('', prose(text)))
            if not re.match(r'[a-z]+:', target)]


def anchors(text: str) -> set[str]:
    """Return the anchors of a text's headings, as sites that show Markdown make them."""
    found: set[str] = set()
    for heading in re.findall(r'^#+ (.+?)\s*$', prose(text), re.M):
        words = re.sub(r'[^\w\- ]', '', heading.lower()).replace(' ', '-')
        copies = sum(1 for anchor in found if re.fullmatch(rf'{re.escape(words)}(-\d+)?', anchor))
        found.add(f'{words}-{copies}' if copies else words)
    return found


def checked(data: str, schema: str = 'status') -> dict[str, Any]:
    """Return a JSON text's content, or raise ValidationError where its schema differs."""
    content: dict[str, Any] = json.loads(data)
    text = (PROJECT / f'config/schemas/{schema}.schema.json').read_text(encoding='utf-8')
    jsonschema.validate(content, json.loads(text))
    return content
