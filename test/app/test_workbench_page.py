# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The workbench as a user meets it: ticks, marks, adoption, in a real Chromium."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from accessibility import broken_rules
from browser import LEAST_CONTRAST, LEAST_TEXT, READABLE, needs_browser
from workbench_bench import write_hidden
from workbench_page import Page
from workbench_server import Workbench, workbench

pytestmark = needs_browser


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('page')
    write_hidden(folder / 'run.csv', 1, 5.0)
    write_hidden(folder / 'other.csv', 2, 5.0)
    return folder


@pytest.fixture(scope='module')
def bench(folder: Path) -> Iterator[Workbench]:
    with workbench(folder / 'run.csv', '--validate', folder / 'other.csv',
                   folder=folder) as running:
        running.enter()
        yield running


@pytest.fixture(scope='module')
def tab(browser: Any, bench: Workbench) -> Page:
    return Page(browser, bench)


@pytest.fixture
def page(tab: Page, bench: Workbench) -> Iterator[Page]:
    bench.settled()
    for effect in bench.screen()['effects']:
        if effect['is_ticked']:
            bench.post('/api/tick', effect=effect['name'], is_ticked=False,
                       revision=bench.screen()['revision'])
    bench.at_rest()
    tab.open()
    tab.settled()
    yield tab
    assert tab.complaints == []


def errors(state: dict[str, Any]) -> dict[str, float]:
    return {name: error['now'] for name, error in state['errors'].items()}


def test_the_page_loads_under_its_own_policy(browser: Any, bench: Workbench) -> None:
    bench.settled()
    page = Page(browser, bench, bypass_csp=False)
    page.tab.locator('#curves canvas').nth(5).wait_for()
    page.tab.locator('.error .figures').nth(5).wait_for()
    assert page.tab.locator('.effect').count() == len(bench.screen()['effects']) > 20
    page.tab.locator('#errors', has_text='noise').wait_for()  # once the diagnosis has estimated it
    page.tab.keyboard.press('2')
    page.tab.locator('#scatter').wait_for()
    assert page.complaints == []
    page.context.close()


def test_a_tick_moves_the_curves_and_the_errors(page: Page) -> None:
    before = errors(page.settled())
    curve = 'Array.from(bench.curves.plots[3].data[2]).slice(100, 200)'
    drawn = page.tab.evaluate(curve)
    state = page.tick('payload_mass')
    after = errors(state)
    assert all(after[name] < 0.5 * before[name] for name in ('lift_1', 'lift_3'))
    moved = page.tab.evaluate(curve)
    assert np.abs(np.mean(drawn)) > 5 * np.abs(np.mean(moved))
    row = page.tab.locator('[data-effect=payload_mass]')
    assert '±' in row.inner_text()
    assert 'kg' in row.inner_text()
    text = page.tab.locator('[data-drive=lift_1] .figures').inner_text()
    assert f'{after["lift_1"]:.3f}' in text
    assert page.tab.evaluate('bench.latencies.length') == 1
    page.tick('payload_mass')
    assert errors(page.tab.evaluate('bench.state')) == before


def test_drives_are_chips_and_values_can_be_typed(page: Page) -> None:
    page.tick('payload_mass')
    page.tick('coulomb_friction')
    row = page.tab.locator('[data-effect=coulomb_friction]')
    assert row.locator('.chip[aria-pressed=true]').all_inner_texts() == ['lift_2']
    row.locator('.chip', has_text='slide_1').click()
    page.tab.wait_for_function("bench.state.effects.find((one) => one.name === 'coulomb_friction')"
                               '.drives.length === 2')
    page.settled()
    field = page.tab.locator('[id="coulomb_friction-lift_2.force"]')
    best = float(field.input_value())
    assert best == pytest.approx(0.6, abs=0.05)
    field.fill(str(2 * best))
    field.press('Enter')
    page.tab.wait_for_function('bench.state.departure > 100')
    assert 'cost' in page.tab.locator('.departure').inner_text()
    row.get_by_role('button', name='Best values').click()
    page.tab.wait_for_function('bench.state.departure === 0')
    field.fill('1e99')
    field.press('Enter')
    page.tab.locator('#message', has_text='must be a number between').wait_for()


def test_a_mark_says_where_the_error_is_from(page: Page) -> None:
    page.mark(3, 0.3, 0.6)
    page.tab.wait_for_function('bench.shares.length === 1')
    assert 'lift_1' in page.tab.locator('#shares-of').inner_text()
    assert 'payload mass' in page.tab.locator('#share-list').inner_text()
    start, end = (float(page.tab.locator(place).input_value()) for place in ('#from', '#to'))
    span = page.tab.evaluate('bench.curves.range()')
    assert start == pytest.approx(span[0] + 0.3 * (span[1] - span[0]), abs=0.3)
    assert end == pytest.approx(span[0] + 0.6 * (span[1] - span[0]), abs=0.3)
    page.tab.keyboard.press('z')
    page.tab.wait_for_function(f'Math.abs(bench.curves.plots[5].scales.x.min - {start}) < 0.01')
    page.tab.keyboard.press('a')
    page.tab.locator('#share-list button', has_text='payload mass').click()
    page.tab.wait_for_function("bench.state.effects.find((one) => one.name === 'payload_mass')"
                               '.is_ticked')
    page.settled()
    page.tab.keyboard.press('Escape')
    page.tab.wait_for_function("!document.querySelector('#share-list li')")


def test_all_is_done_by_keyboard(page: Page) -> None:
    page.tab.keyboard.press('/')
    page.tab.keyboard.type('payload mass')
    assert page.tab.locator('.effect:visible').count() == 1
    page.tab.keyboard.press('Tab')
    assert page.tab.evaluate('document.activeElement.id') == 'tick-payload_mass'
    page.tab.keyboard.press('Space')
    page.tab.wait_for_function('bench.settled.length === 1')
    assert page.settled()['effects']
    assert page.tab.evaluate("getComputedStyle(document.activeElement).outlineStyle") != 'none'
    for number, name in enumerate(('curves', 'scatter', 'robot', 'experiment', 'recordings'), 1):
        page.tab.evaluate('document.activeElement.blur()')
        page.tab.keyboard.press(str(number))
        assert page.tab.locator(f'#view-{name}').is_visible()


@pytest.mark.parametrize(('scheme', 'width'), [('light', 1500), ('dark', 390)])
def test_all_text_can_be_read(page: Page, scheme: str, width: int) -> None:
    page.open(width, scheme)
    page.settled()
    assert page.tab.evaluate('document.documentElement.dataset.scheme') == scheme
    page.tick('payload_mass')
    contrast, size = page.tab.evaluate(READABLE.replace('main *, header *', 'body *'))
    assert contrast >= LEAST_CONTRAST
    assert size >= LEAST_TEXT
    assert page.tab.evaluate('document.documentElement.scrollWidth') <= width
    unnamed = page.tab.evaluate('''() => [...document.querySelectorAll('button, input, select, a')]
        .filter((one) => one.getClientRects().length && !(one.labels?.length || one.ariaLabel
            || one.textContent.trim() || one.title)).map((one) => one.outerHTML)''')
    assert unnamed == []


@pytest.mark.parametrize('scheme', ['light', 'dark'])
def test_no_rule_of_accessibility_is_broken(page: Page, scheme: str) -> None:
    """As axe-core has them, in every view; what is drawn on canvases it cannot see."""
    page.mark(1, 0.3, 0.4)
    page.tick('payload_mass')
    if page.tab.evaluate('document.documentElement.dataset.scheme') != scheme:
        page.tab.locator('#scheme').click()
    assert page.tab.evaluate('document.documentElement.dataset.scheme') == scheme
    for number, view in enumerate(('curves', 'scatter', 'robot', 'experiment', 'recordings'), 1):
        page.tab.locator('h1').click()
        page.tab.keyboard.press(str(number))
        page.tab.locator(f'#view-{view}').wait_for()
        assert broken_rules(page.tab) == [], view


# The last test: the diagnosis that follows is not waited for.
def test_a_file_that_is_dropped_is_opened_and_one_that_is_none_is_a_sentence(
    page: Page, folder: Path,
) -> None:
    names = [recording['name'] for recording in page.settled()['recordings']]
    dropped = write_hidden(folder / 'dropped.csv', 3, 5.0)
    drop = '''([name, text]) => { const files = new DataTransfer();
        files.items.add(new File([text], name));
        document.body.dispatchEvent(
            new DragEvent('drop', {bubbles: true, dataTransfer: files})); }'''
    page.tab.evaluate(drop, ['words.csv', 'Dear robot'])
    page.tab.locator('#message', has_text='words.csv').wait_for()
    page.tab.evaluate(drop, [dropped.name, dropped.read_text()])
    page.tab.wait_for_function(f'bench.state.recordings.length === {len(names) + 1}')
    assert [run['name'] for run in page.settled()['recordings']] == [*names, 'dropped.csv']
