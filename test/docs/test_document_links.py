# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Links of README and docs lead somewhere: to files that exist and headings that stand there."""

from __future__ import annotations

from pathlib import Path

import pytest
from documents import PROJECT, anchors, links, pages, text_of


def broken(page: Path, text: str) -> list[str]:
    """Return the links of a page's text that lead nowhere."""
    wrong = []
    for target in links(text):
        path, _, anchor = target.partition('#')
        file = (page.parent / path).resolve() if path else page
        known = anchors(text if file == page else text_of(file)) if (
            anchor and file.is_file()) else set()
        if not file.exists() or PROJECT not in file.parents or (anchor and anchor not in known):
            wrong.append(target)
    return wrong


@pytest.mark.parametrize('page', pages(), ids=lambda page: str(page.relative_to(PROJECT)))
def test_every_link_leads_to_a_file_and_a_heading(page: Path) -> None:
    assert broken(page, text_of(page)) == []


def test_every_page_is_linked_from_another() -> None:
    reached = {(page.parent / target.partition('#')[0]).resolve()
               for page in pages() for target in links(text_of(page)) if target[0] != '#'}
    # These two include README and CONTRIBUTING for the site.
    entry = {PROJECT / 'README.md', PROJECT / 'docs' / 'index.md',
             PROJECT / 'docs' / 'CONTRIBUTING.md'}
    texts = {page for page in pages() if page.stem.endswith('_text')}
    lonely = {*pages()} - reached - entry - texts
    assert {str(page.relative_to(PROJECT)) for page in lonely} == set()


@pytest.mark.parametrize('link', ['nowhere.md', 'docs/nodes.md#no-such-heading', '#no-heading',
                                  '../outside.md', 'docs/images/no.png'])
def test_a_link_that_leads_nowhere_is_found(link: str) -> None:
    text = f'# Heading\n[good](docs/nodes.md) [good](#heading) ![bad]({link}) `[code](x.md)`'
    assert broken(PROJECT / 'README.md', text) == [link]
