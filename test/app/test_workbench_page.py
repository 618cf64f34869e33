# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The workbench as a user meets it: ticks, marks, adoption, in a real Chromium."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

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


def test_what_is_seen_is_saved_for_slides_and_as_numbers(page: Page, tmp_path: Path) -> None:
    page.tab.evaluate('bench.curves.zoom([3, 5])')
    saved = {}
    for kind in ('svg', 'csv'):
        with page.tab.expect_download() as download:
            page.tab.locator(f'#save-{kind}').click()
        assert download.value.suggested_filename == f'error.{kind}'
        download.value.save_as(path := tmp_path / f'error.{kind}')
        saved[kind] = path
    table = np.genfromtxt(saved['csv'], delimiter=',', skip_header=1)
    assert table.shape[1] == 13
    assert table[0, 0] >= 3.0
    assert table[-1, 0] <= 5.0
    assert len(table) > 100
    shown = np.array(page.tab.evaluate('Array.from(bench.curves.before[3])'), dtype=float)
    time = np.array(page.tab.evaluate('Array.from(bench.curves.times[3])'))
    seen = (time >= 3.0) & (time <= 5.0)
    np.testing.assert_allclose(table[:, 7], shown[seen], rtol=1e-6)
    drawing = ElementTree.parse(saved['svg']).getroot()
    texts = [each.text for each in drawing.iter('{http://www.w3.org/2000/svg}text')]
    assert {'time [s]', 'lift 1 [N]', 'slide 1 [N]', '3', '5'} <= set(texts)


def test_an_answer_that_comes_after_the_mark_was_forgotten_is_not_shown(page: Page) -> None:
    held: list[Any] = []
    page.tab.route('**/api/shares', lambda route: held.append(route))
    page.mark(3, 0.3, 0.6)
    page.tab.wait_for_function("document.getElementById('brush-drive').value === 'lift_1'")
    page.tab.keyboard.press('Escape')
    while not held:
        page.tab.wait_for_timeout(10)
    with page.tab.expect_response('**/api/shares'):
        held[0].continue_()
    page.tab.evaluate('new Promise((done) => requestAnimationFrame(() => setTimeout(done)))')
    assert page.tab.locator('#share-list li').count() == 0


def test_what_did_not_change_is_not_sent_again(page: Page, bench: Workbench) -> None:
    """A change of one effect is not answered with all of them and all curves."""
    whole = bench.get('/api/screen')
    same = bench.get(f'/api/screen?since={whole.header["version"]}')
    assert same.header['effects'] == []
    assert same.arrays == {}
    assert len(same.body) < 200 < 50_000 < len(whole.body)
    tick = bench.post('/api/tick', effect='payload_mass', since=whole.header['version'],
                      revision=whole.header['revision'])
    assert 'payload_mass' in [one['name'] for one in tick.header['effects']]
    assert tick.arrays['now'].shape == whole.arrays['now'].shape
    assert 'recordings' in tick.header
    assert 'verdict' not in tick.header
    page.tab.wait_for_function("document.getElementById('tick-payload_mass').checked")
    # The page, by changes alone, shows what a page shows that is opened now.
    whole = bench.settled()
    state = page.settled()
    for key in ('effects', 'errors', 'overall', 'recordings', 'revision', 'stage'):
        assert state[key] == whole[key]


def test_a_region_of_a_scatter_leads_to_its_times(page: Page) -> None:
    page.tick('payload_mass')
    page.tab.keyboard.press('2')
    page.tab.select_option('#scatter-drive', 'lift_2')
    page.tab.wait_for_function("bench.scatter.x.length && bench.scatter.names[0] === 'velocity'")
    box = page.tab.locator('#scatter').bounding_box()
    page.tab.mouse.move(box['x'] + 0.55 * box['width'], box['y'] + 20)
    page.tab.mouse.down()
    page.tab.mouse.move(box['x'] + 0.95 * box['width'], box['y'] + 0.4 * box['height'], steps=4)
    page.tab.mouse.up()
    page.tab.locator('#share-list', has_text='friction on lift_2').wait_for()
    page.tab.locator('#spans button').click()
    assert page.tab.locator('#view-curves').is_visible()
    whole = page.tab.evaluate('bench.curves.times[0].at(-1) - bench.curves.times[0][0]')
    seen = page.tab.evaluate('bench.curves.range()')
    assert seen[1] - seen[0] < whole


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


def test_an_adoption_is_called_off(page: Page) -> None:
    page.tick('payload_mass')
    page.tab.locator('[data-effect=payload_mass]').get_by_role('button', name='Adopt').click()
    page.tab.get_by_role('button', name='Cancel judging payload mass').click()
    page.tab.locator('#message', has_text='called off').wait_for()
    assert page.settled()['steps'] == []


def test_a_button_stays_while_it_is_pressed(page: Page) -> None:
    """Progress comes in between: a button that it replaces would never be clicked."""
    page.tab.evaluate("""async () => {
        const {showJobs} = await import('/static/panels.mjs');
        const job = {number: 1e6, kind: 'experiment', what: '', share: 0.1, is_running: true};
        window.shown = (share) => showJobs([{...job, share}], () => { window.pressed = true; });
        window.shown(0.1);
    }""")
    button = page.tab.get_by_role('button', name='Cancel designing')
    box = button.bounding_box()
    page.tab.mouse.move(box['x'] + box['width'] / 2, box['y'] + box['height'] / 2)
    page.tab.mouse.down()
    page.tab.evaluate('window.shown(0.6)')
    page.tab.mouse.up()
    assert page.tab.evaluate('window.pressed') is True
    assert page.tab.get_by_role('progressbar', name='designing').evaluate('bar => bar.value') == 0.6


def test_nothing_moves_under_a_press(page: Page, bench: Workbench) -> None:
    """A fit that ends in between, or another browser, would carry the button away."""
    page.tick('payload_mass')
    field = page.tab.locator('[id="payload_mass-mass"]')
    field.fill('1.5')
    field.press('Enter')
    page.tab.wait_for_function('bench.state.departure > 10')
    page.settled()
    release = page.tab.locator('[data-effect=payload_mass]').get_by_role('button', name='Best')
    release.hover()
    box = release.bounding_box()
    page.tab.mouse.down()
    assert bench.post('/api/release', effect='payload_mass',
                      revision=bench.screen()['revision']).status == 200
    page.tab.wait_for_function('bench.state.departure === 0 && bench.state.is_settled')
    assert release.bounding_box() == box
    with page.tab.expect_response('**/api/release'):
        page.tab.mouse.up()
    release.wait_for(state='hidden')


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


def test_a_link_shows_what_is_seen(page: Page, browser: Any, bench: Workbench) -> None:
    page.mark(1, 0.3, 0.4)
    page.tab.keyboard.press('z')
    page.tab.wait_for_function("location.hash.includes('window')")
    seen = page.tab.evaluate('[bench.curves.range(), bench.curves.span, bench.curves.on]')
    second = Page(browser, bench)
    second.settled()
    second.tab.evaluate('hash => { location.hash = hash; }', page.tab.evaluate('location.hash'))
    second.tab.wait_for_function('window.bench?.curves?.span && bench.curves.window')
    assert second.tab.evaluate('[bench.curves.range(), bench.curves.span, bench.curves.on]') == [
        pytest.approx(seen[0], abs=1e-3), pytest.approx(seen[1], abs=1e-3), seen[2]]
    second.tab.evaluate("location.hash = '#view=robot'")
    second.tab.wait_for_function('window.bench?.robot?.time')
    second.tab.locator('#view-robot').wait_for()
    assert second.complaints == []
    second.context.close()


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


def test_the_robot_is_where_a_curve_was_clicked_on(page: Page) -> None:
    page.tab.keyboard.press('3')
    page.tab.wait_for_function('bench.robot.time')
    page.tab.keyboard.press('1')
    box = page.tab.locator('#curves .u-over').nth(2).bounding_box()
    page.tab.mouse.click(box['x'] + 0.5 * box['width'], box['y'] + 0.5 * box['height'])
    where, time, end = page.tab.evaluate(
        '[bench.curves.playhead, bench.robot.time[bench.robot.frame], bench.curves.range()[1]]')
    assert where == pytest.approx(0.5 * end, rel=0.02)
    assert time == pytest.approx(where, abs=0.2)


def test_the_error_is_seen_closer_with_alt_and_the_wheel(page: Page) -> None:
    height = ('(() => { const {min, max} = bench.curves.plots[0].scales.y; return max - min; })()')
    before, other = page.tab.evaluate(height), page.tab.evaluate(height.replace('[0]', '[1]'))
    page.tab.locator('#curves .u-over').nth(0).hover()
    page.tab.keyboard.down('Alt')
    page.tab.mouse.wheel(0, -120)
    page.tab.keyboard.up('Alt')
    page.tab.wait_for_function(f'{height} < {0.9 * before}')
    assert page.tab.evaluate(height) == pytest.approx(0.8 * before, rel=1e-6)
    assert page.tab.evaluate(height.replace('[0]', '[1]')) == other
    page.tab.locator('h1').click()
    page.tab.keyboard.press('a')
    page.tab.wait_for_function(f'Math.abs({height} - {before}) < 1e-9')


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
