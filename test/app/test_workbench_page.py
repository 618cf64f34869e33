# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The workbench as a user meets it: ticks, marks, adoption, in a real Chromium."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from accessibility import broken_rules
from browser import LEAST_CONTRAST, LEAST_TEXT, READABLE, chromium, needs_browser
from workbench_bench import write_hidden
from workbench_page import Page
from workbench_server import Workbench, workbench

from pprs_dynamics.app.commands.pprs import main
from pprs_dynamics.app.workbench.session_file import SavedSession
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.ledger import read_steps

pytestmark = needs_browser


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('page')
    write_hidden(folder / 'run.csv', 1)
    write_hidden(folder / 'other.csv', 2)
    return folder


@pytest.fixture(scope='module')
def browser() -> Iterator[Any]:
    with chromium() as running:
        yield running


@pytest.fixture(scope='module')
def bench(folder: Path) -> Iterator[Workbench]:
    with workbench(folder / 'run.csv', '--validate', folder / 'other.csv',
                   folder=folder) as running:
        running.enter()
        yield running


@pytest.fixture
def page(browser: Any, bench: Workbench) -> Iterator[Page]:
    bench.settled()
    for effect in bench.screen()['effects']:
        if effect['is_ticked']:
            bench.post('/api/tick', effect=effect['name'], is_ticked=False,
                       revision=bench.screen()['revision'])
    bench.at_rest()
    found = Page(browser, bench)
    found.settled()
    yield found
    assert found.complaints == []
    found.context.close()


def parameters(state: dict[str, Any], effect: str) -> dict[str, Any]:
    (found,) = (one for one in state['effects'] if one['name'] == effect)
    return {one['key']: one for one in found['parameters']}


def errors(state: dict[str, Any]) -> dict[str, float]:
    return {name: one['now'] for name, one in state['errors'].items()}


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
    page.tab.locator('#message', has_text='must be between').wait_for()


def test_a_shape_is_dragged(page: Page) -> None:
    page.tick('payload_mass')
    before = page.tick('stribeck_friction')
    row = page.tab.locator('[data-effect=stribeck_friction] .parameter').filter(
        has=page.tab.locator('input[type=range]')).first
    key = row.locator('label').inner_text()
    row.locator('input[type=range]').focus()
    for _ in range(5):
        page.tab.keyboard.press('ArrowRight')
    page.tab.wait_for_function('bench.state.effects.some((one) => one.parameters.some('
                               '(parameter) => parameter.is_chosen))')
    after = page.settled()
    old, new = (parameters(state, 'stribeck_friction') for state in (before, after))
    assert [name for name, one in new.items() if one['is_chosen']] == [key]
    assert new[key]['value'] > old[key]['value']
    # The forces are fitted again around it, and the error follows.
    forces = [name for name, one in old.items() if not one['is_shape']]
    assert any(new[name]['value'] != old[name]['value'] for name in forces)
    assert errors(after) != errors(before)


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


def test_the_robot_moves(page: Page) -> None:
    page.tab.keyboard.press('3')
    page.tab.wait_for_function('bench.robot.time')
    picture = page.tab.locator('#robot').screenshot()
    page.tab.locator('#robot-time').fill('300')
    assert page.tab.locator('#robot').screenshot() != picture
    assert ' s' in page.tab.locator('#robot-clock').inner_text()
    picture = page.tab.locator('#robot').screenshot()
    page.tab.locator('#robot').press('ArrowLeft')
    assert page.tab.locator('#robot').screenshot() != picture


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
def test_all_text_can_be_read(browser: Any, bench: Workbench, scheme: str, width: int) -> None:
    bench.settled()
    page = Page(browser, bench, color_scheme=scheme, viewport={'width': width, 'height': 900})
    page.settled()
    page.tick('payload_mass')
    contrast, size = page.tab.evaluate(READABLE.replace('main *, header *', 'body *'))
    assert contrast >= LEAST_CONTRAST
    assert size >= LEAST_TEXT
    assert page.tab.evaluate('document.documentElement.scrollWidth') <= width
    unnamed = page.tab.evaluate('''() => [...document.querySelectorAll('button, input, select, a')]
        .filter((one) => one.getClientRects().length && !(one.labels?.length || one.ariaLabel
            || one.textContent.trim() || one.title)).map((one) => one.outerHTML)''')
    assert unnamed == []
    page.tick('payload_mass')
    assert page.complaints == []
    page.context.close()


def test_a_second_browser_follows(page: Page, browser: Any, bench: Workbench) -> None:
    second = Page(browser, bench)
    second.settled()
    page.tick('payload_mass')
    second.tab.wait_for_function("document.getElementById('tick-payload_mass').checked")
    assert errors(second.settled()) == errors(page.settled())
    second.context.close()


@pytest.mark.slow
def test_adopt_refuse_export_undo(page: Page, folder: Path) -> None:
    page.tick('payload_mass')
    page.tick('drive_spring')
    page.tab.locator('[data-effect=drive_spring]').get_by_role('button', name='Adopt').click()
    page.tab.locator('#message', has_text='drive spring is refused').wait_for()
    assert page.tab.locator('#ledger li').count() == 1
    page.tick('drive_spring')
    page.tab.locator('[data-effect=payload_mass]').get_by_role('button', name='Adopt').click()
    page.tab.locator('#message', has_text='payload mass is adopted').wait_for()
    assert 'payload mass' in page.tab.locator('#ledger').inner_text()
    state = page.settled()
    with page.tab.expect_download() as started:
        page.tab.locator('#export').click()
    started.value.save_as(folder / 'model.yaml')
    assert [step.effect for step in read_steps(DriveModel.load(folder / 'model.yaml').values)] == [
        'payload_mass']
    page.tick('coulomb_friction')
    ticked = page.settled()
    with page.tab.expect_download() as started:
        page.tab.locator('#export-ticked').click()
    started.value.save_as(folder / 'ticked.yaml')
    for name, key, shown in (('model.yaml', 'before', state), ('ticked.yaml', 'now', ticked)):
        assert main(['compare', str(folder / 'run.csv'), '--model', str(folder / name),
                     '--json', str(folder / 'compared.json')]) == 0
        found = json.loads((folder / 'compared.json').read_text())
        for drive, one in shown['errors'].items():
            assert one[key] == pytest.approx(found['drives'][drive]['rms'], rel=5e-5)
    with page.tab.expect_download() as started:
        page.tab.locator('#save-session').click()
    started.value.save_as(folder / 'session.json')
    saved = SavedSession.read(folder / 'session.json')
    assert [one.effect for one in saved.ticks] == ['coulomb_friction']
    assert [step.effect for step in read_steps(saved.model.values)] == ['payload_mass']
    page.tab.locator('#back').click()  # the tick, then the adoption
    page.tab.wait_for_function("bench.state.undoes === 'payload_mass adopted'")
    page.tab.locator('#back').click()
    page.tab.wait_for_function('bench.state.steps.length === 0')
    page.settled()
    # What cannot be saved is told on the page.
    run = folder / 'run.csv'
    run.rename(folder / 'elsewhere.csv')
    page.tab.locator('#save-session').click()
    page.tab.locator('#message', has_text='run.csv: No such file').wait_for()
    (folder / 'elsewhere.csv').rename(run)


@pytest.mark.slow
def test_the_next_experiment_is_designed_and_downloaded(page: Page, folder: Path) -> None:
    page.tab.keyboard.press('4')
    page.tab.locator('#experiment-duration').fill('5')
    page.tab.locator('#design').click()
    page.tab.locator('#experiment-file').wait_for()
    assert page.tab.locator('#experiment-text').inner_text()
    with page.tab.expect_download() as started:
        page.tab.locator('#experiment-file').click()
    started.value.save_as(folder / 'next.csv')
    lines = (folder / 'next.csv').read_text().splitlines()
    assert lines[0].startswith('time,x,y,z,qx,qy,qz,qw')
    assert len(lines) == 1 + 501


def test_a_tick_is_taken_back_and_done_again_by_keys(page: Page) -> None:
    before = errors(page.settled())
    after = errors(page.tick('payload_mass'))
    page.tab.locator('h1').click()
    page.tab.keyboard.press('Control+z')
    page.tab.wait_for_function("!document.getElementById('tick-payload_mass').checked")
    assert errors(page.settled()) == before
    assert 'payload_mass ticked' in page.tab.locator('#forward').get_attribute('title')
    page.tab.keyboard.press('Control+y')
    page.tab.wait_for_function("document.getElementById('tick-payload_mass').checked")
    assert errors(page.settled()) == pytest.approx(after, rel=1e-3)


def test_files_are_dropped_and_let_go_of(page: Page, folder: Path) -> None:
    """A recording of another motion comes in by a drop, and goes by its button."""
    write_hidden(folder / 'dropped.csv', 3, 4.0)
    text = (folder / 'dropped.csv').read_text()
    page.tab.evaluate("""text => {
        const data = new DataTransfer();
        data.items.add(new File([text], 'dropped.csv', {type: 'text/csv'}));
        for (const kind of ['dragover', 'drop']) {
            document.body.dispatchEvent(new DragEvent(kind, {
                dataTransfer: data, bubbles: true, cancelable: true}));
        }
    }""", text)
    page.tab.wait_for_function('bench.state.recordings.length === 2')
    page.settled()
    page.tab.get_by_role('button', name='Remove dropped.csv').click()
    page.tab.wait_for_function('bench.state.recordings.length === 1')
    page.settled()


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
