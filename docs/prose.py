# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Check pages and docstrings for long sentences and for words that readers do not know.

    python docs/prose.py            # what `make lint` runs; exit status 1 if anything is wrong
    python docs/prose.py --counts   # words, sentences and mean length of every page
"""

from __future__ import annotations

import argparse
import ast
import re
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

PROJECT = Path(__file__).parents[1]
LONGEST = 40  # words of a sentence
MEAN = 18.0  # words of a sentence, over all pages
TOTAL = 30_000  # words of all pages
README, ACCURACY = 900, 800  # words
README_COLUMNS = 120  # characters of a line, tables and links apart

# Words with another meaning here than anywhere else, and what to write in their place.
WORDS = {
    r'\b(?:told|tells?)\b': 'report, print, warn, distinguish',
    r'\bwhat was found\b': 'the reported effects',
    r'\bwhat is left\b': 'residual',
    r'\bleaves\b': 'residual',
    r'\bgo(?:es|ne|ing)? over\b': 'switch, is checked',
    r'\bbends?\b': 'is nonlinear in',
    r'\bstands? (?:for|beside|out|there|here)\b': 'is listed with, differs from',
    r'\bbeside\b': 'next to, in addition to, with',
    r'\bcalled so\b': 'is named',
    r'\bas it is\b': 'unchanged, the input model',
    r'\bcomes? back\b': 'repeats',
    r'\bmend(?:s|ed|ing)?\b': 'fix',
    r'\bkeeps?\b': 'retains, has a residual of',
    r'\bholds?\b': 'contains, is supported by the data',
}
# In docstrings these are also terms of robots and of code: drives hold a pose.
ON_PAGES_ONLY = (r'\bkeeps?\b', r'\bholds?\b')
ALLOWED = re.compile(r'--as-it-is|as_it_is|\bhold_gravity\b|\bHOLD\b|held[- ]out')


def without_code(text: str) -> str:
    """Return Markdown without code blocks, comments, inline code and link targets."""
    text = re.sub(r'^(```|~~~).*?^\1\s*$', ' ', text, flags=re.S | re.M)
    text = re.sub(r'<!--.*?-->', ' ', text, flags=re.S)
    text = re.sub(r'`[^`\n]+`', 'CODE', text)
    return re.sub(r'\]\([^)]*\)', ']', text)


def sentences(text: str) -> Iterator[str]:
    """Yield the sentences of Markdown or of a docstring; a cell or an item ends a sentence."""
    paragraph: list[str] = []
    for line in [*text.splitlines(), '']:
        plain = line.strip()
        item = re.match(r'([-*>]|\d+\.)\s+', plain)
        apart = not plain or plain.startswith(('|', '#', '!', '<', '==='))
        if apart or item:
            yield from split(paragraph)
            paragraph = [plain[item.end():]] if item else []
            if plain.startswith('|'):
                for cell in plain.strip('|').split('|'):
                    yield from split([cell.strip()])
        else:
            paragraph.append(plain)


def split(paragraph: list[str]) -> list[str]:
    """Return the sentences of one paragraph."""
    found = re.split(r'(?<=[.!?:])\s+(?=[A-Z`*\[])', ' '.join(paragraph))
    return [sentence for sentence in found if len(sentence.split()) > 2]


def faults(text: str, allowed: Sequence[str] = ()) -> Iterator[str]:
    """Yield what is wrong with a text; some patterns may be allowed."""
    for sentence in sentences(text):
        if (count := len(sentence.split())) > LONGEST:
            yield f'{count} words, at most {LONGEST}: {sentence[:90]} ...'
        for pattern, instead in WORDS.items():
            if pattern in allowed:
                continue
            for match in re.finditer(pattern, ALLOWED.sub('', sentence), re.I):
                yield f'"{match[0]}" (write {instead}): {sentence[:90]}'


def pages() -> list[Path]:
    """Return the pages of the project."""
    docs, naming = PROJECT / 'docs', PROJECT / 'benchmarks' / 'naming'
    return [PROJECT / 'README.md', PROJECT / 'CONTRIBUTING.md', docs / 'example_effect/README.md',
            naming / 'README.md', naming / 'recordings/README.md',
            *sorted(page for page in docs.glob('*.md') if page.name != 'CONTRIBUTING.md')]


def results() -> list[Path]:
    """Return the generated pages of results, which count for no limit of words."""
    return sorted((PROJECT / 'benchmarks' / 'results').glob('*.md'))


def with_short_cells(text: str) -> str:
    """Return Markdown whose cells end at commas: a cell of results is a list of effects."""
    return re.sub(r'^\|.*$', lambda row: row[0].replace(',', ' |'), text, flags=re.M)


def docstrings() -> Iterator[tuple[str, str]]:
    """Yield place and text of every docstring but those of tests."""
    folders = ('pprs_dynamics', 'benchmarks', 'demo', 'docs', 'launch')
    for file in sorted(file for folder in folders for file in (PROJECT / folder).rglob('*.py')):
        tree = ast.parse(file.read_text(encoding='utf-8'))
        for node in ast.walk(tree):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                text = ast.get_docstring(node)
                if text:
                    line = 1 if isinstance(node, ast.Module) else node.lineno
                    yield f'{file.relative_to(PROJECT)}:{line}', text


def prose_of(docstring: str) -> str:
    """Return a docstring without headings, names and types of parameters, commands and code."""
    prose = []
    lines = docstring.splitlines()
    for line, following in zip(lines, [*lines[1:], ''], strict=True):
        plain = line.strip()
        heading = set(plain) == {'-'} or set(following.strip()) == {'-'}
        name = re.match(r'\w[\w, *]* : ', line)
        code = re.match(r'(>>>| {4,}.*(=|\bpython\b))', line) or plain.startswith('pprs ')
        prose.append('' if heading or name or code else re.sub(r'``?[^`]+``?', 'CODE', line))
    return '\n'.join(prose)


def main() -> int:
    """Print what is wrong, and return whether anything is."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument('--counts', action='store_true')
    options = parser.parse_args()
    wrong, words, lengths = [], 0, []
    for page in pages():
        text = page.read_text(encoding='utf-8')
        plain, name = without_code(text), page.relative_to(PROJECT)
        own = [len(sentence.split()) for sentence in sentences(plain)]
        words += len(text.split())
        lengths += own
        wrong += [f'{name}: {fault}' for fault in faults(plain)]
        if options.counts:
            print(f'{len(text.split()):6} words {len(own):5} sentences '
                  f'{sum(own) / max(len(own), 1):5.1f} words each  {name}')
        if page.name == 'README.md' and page.parent == PROJECT:
            wrong += [f'{name}:{k}: {len(line)} characters, at most {README_COLUMNS}'
                      for k, line in enumerate(text.splitlines(), 1)
                      if len(line) > README_COLUMNS and not line.startswith(('|', '!', '['))]
        most = {'README.md': README, 'docs/accuracy.md': ACCURACY}.get(str(name), TOTAL)
        if len(text.split()) > most:
            wrong.append(f'{name}: {len(text.split())} words, at most {most}')
    for page in results():
        plain = with_short_cells(without_code(page.read_text(encoding='utf-8')))
        wrong += [f'{page.relative_to(PROJECT)}: {fault}' for fault in faults(plain)]
    mean = sum(lengths) / len(lengths)
    if words > TOTAL:
        wrong.append(f'all pages: {words} words, at most {TOTAL}')
    if mean > MEAN:
        wrong.append(f'all pages: {mean:.1f} words a sentence, at most {MEAN:g}')
    wrong += [f'{place}: {fault}' for place, text in docstrings()
              for fault in faults(prose_of(text), ON_PAGES_ONLY)]
    print('\n'.join(wrong))
    print(f'{words} words, {len(lengths)} sentences of {mean:.1f} words, {len(wrong)} faults')
    return int(bool(wrong))


if __name__ == '__main__':
    sys.exit(main())
