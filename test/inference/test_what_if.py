# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What-if fits in the page of a diagnosis, in a real Chromium, against the regression's own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Seen, chromium, needs_browser

from pprs_dynamics import DriveModel
from pprs_dynamics.app.report.diagnosis_report import diagnosis_page
from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.diagnosis.sentences import word_diagnosis
from pprs_dynamics.inference.diagnosis.what_if import what_if
from pprs_dynamics.inference.regression.joint_fit import JointFit
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.search.candidates import CandidateSet, EffectCandidate
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.mechanism.paths import Excitation
from pprs_dynamics.physics.model.model_file import build_model

HIDDEN = {'stribeck_friction', 'payload_mass'}
MOST_BYTES = 4_000_000
Tried = tuple[EffectCandidate, CandidateSet]


@pytest.fixture(scope='module')
def found() -> tuple[Diagnosis, Recording]:
    """Return a diagnosis of two effects, and the recording."""
    model = DriveModel.load()
    true = build_model({
        **model.values, 'effects.active': sorted(HIDDEN),
        'effects.payload_mass.mass': 0.4,
        'effects.stribeck_friction.slide_1.force': 1.5,
        'effects.stribeck_friction.slide_1.velocity': 0.01})
    time = np.arange(6000) * 0.002
    forces = true.drive_forces(Excitation().motion(time).with_time(time))
    noise = 0.08 * np.random.default_rng(0).normal(size=forces.total.shape)
    noise[2000:2300, 3] = np.nan  # lift_1 was not measured for a while
    recording = Recording.from_arrays('made', time, forces.mechanism.position,
                                      effort=forces.total + noise)
    return diagnose(model, [recording]), recording


@pytest.fixture(scope='module')
def file(found: tuple[Diagnosis, Recording], tmp_path_factory: pytest.TempPathFactory) -> Path:
    diagnosis, recording = found
    after, _ = measure_residuals(diagnosis.adopted, [recording])
    page = diagnosis_page(diagnosis, word_diagnosis(diagnosis), after, ['made'],
                          system=what_if(diagnosis))
    return page.write(tmp_path_factory.mktemp('what_if') / 'page.html')


@pytest.fixture(scope='module')
def browser() -> Iterator[Any]:
    with chromium() as running:
        yield running


@pytest.fixture
def see(browser: Any, file: Path) -> Iterator[Any]:
    opened = []

    def open_page(**options: Any) -> Seen:
        seen = Seen(browser, file, **options)
        opened.append(seen)
        seen.tab.click('summary:has-text("What if")')
        seen.tab.wait_for_selector('#what-if[data-ready]')
        return seen
    yield open_page
    for seen in opened:
        seen.context.close()


def alone(diagnosis: Diagnosis) -> dict[str, Tried]:
    """Return every effect that was fitted as the only one, where it explains most."""
    assert diagnosis.selection is not None
    return {name: (one.effects[0], one) for name, one in diagnosis.selection.alone.items()}


def fitted(diagnosis: Diagnosis, tried: list[Tried]) -> tuple[JointFit, float]:
    """Return the fit of effects at the noise of the diagnosis, and the cost."""
    selection = diagnosis.selection
    assert selection is not None
    fits = selection.last
    blocks = [block for candidate, one in tried for component in candidate.components
              for block in (fits.components.block(component), *one.nuisance.get(component, ()))]
    fit = fits.regression.at(blocks, selection.reported.fit.amplitudes)
    components = [component for one, _ in tried for component in one.components]
    prior_cost = sum(fits.components.prior_cost(one).total for one, _ in tried) + sum(
        fits.prior_costs.of_wrong_signs(one, one.values(fit.of(fits.components.block(one))))
        for one in components)
    return fit, fit.deviance + prior_cost


def errors(diagnosis: Diagnosis, fit: JointFit) -> Array:
    """Return what is left over all drives, then on each [N]."""
    assert diagnosis.selection is not None
    counts = diagnosis.selection.last.regression.counts.sum(axis=1)
    squares = fit.squares.sum(axis=1)
    return np.sqrt(np.append(squares.sum() / counts.sum(), squares / counts))


def tick(seen: Seen, tried: list[Tried]) -> None:
    """Tick these effects on these drives, and nothing else."""
    seen.tab.evaluate('''(wanted) => {
      for (const row of document.querySelectorAll('.effect')) {
        const box = row.querySelector('input'), drives = wanted[row.dataset.effect];
        if (box.checked !== (drives !== undefined)) box.click();
        if (!drives?.length) continue;
        const chips = [...row.querySelectorAll('.chip')];
        // What comes before what goes: without any drive it would be ticked no more.
        for (const isOn of [false, true]) {
          for (const chip of chips) {
            const is = chip.ariaPressed === 'true', should = drives.includes(chip.textContent);
            if (is === isOn && is !== should) chip.click();
          }
        }
      }
    }''', {one.name: [DRIVES[d] for d in one.drives or ()] for one, _ in tried})


def shown(seen: Seen) -> Array:
    """Return the errors of the page, over all drives and on each, with all digits [N]."""
    found: Array = np.array(seen.tab.evaluate(
        """[whatIf.state.overall, ...Object.values(whatIf.state.errors)].map((one) => one.now)"""))
    return found


def evidence(seen: Seen, name: str) -> float:
    return float(seen.tab.evaluate(
        '(name) => whatIf.state.effects.find((one) => one.name === name).evidence', name))


@needs_browser
def test_errors_and_evidence_of_ticked_effects_are_those_of_the_regression(
    see: Any, found: tuple[Diagnosis, Recording],
) -> None:
    diagnosis, _ = found
    assert diagnosis.selection is not None
    assert diagnosis.selection.first is diagnosis.selection.last
    reported = diagnosis.selection.reported
    kept = [(candidate, reported) for candidate in reported.effects]
    assert {candidate.name for candidate, _ in kept} == HIDDEN
    # In the shape in which it was found, where it was.
    others = {**alone(diagnosis), **{one[0].name: one for one in kept}}
    assert len(others) > 3
    seen = see()
    cases = [kept, [], kept[:1], kept[1:], *([one] for one in others.values()),
             [*kept, *(one for name, one in others.items() if name not in HIDDEN)]]
    costs = []
    for case in cases:
        tick(seen, case)
        fit, cost = fitted(diagnosis, case)
        costs.append(cost)
        np.testing.assert_allclose(shown(seen), errors(diagnosis, fit), rtol=1e-5)
    # Numbers of the model stretch to their limits where the payload is not ticked.
    size = len(diagnosis.selection.last.design.base)
    assert np.abs(fitted(diagnosis, [])[0].coefficients[:size]).max() > 2.5
    tick(seen, kept)
    for gone in (0, 1):
        name = kept[gone][0].name
        assert evidence(seen, name) == pytest.approx(costs[3 - gone] - costs[0], rel=1e-5)
    tick(seen, [])
    for name, one in others.items():
        assert evidence(seen, name) == pytest.approx(
            costs[1] - fitted(diagnosis, [one])[1], rel=1e-5, abs=1e-3)
    assert seen.complaints == []


@needs_browser
def test_a_tick_repaints_and_what_bends_others_is_marked(see: Any) -> None:
    seen = see()
    status = "document.querySelector('#what-if [role=status]').textContent"
    picture = "document.querySelector('.curve canvas').toDataURL()"
    before, first = shown(seen), seen.tab.evaluate(picture)
    assert 'stribeck_friction' in seen.tab.evaluate(status)
    label = '#tick-{}'
    # By keyboard: a tick box is a stop, and the space bar its switch.
    seen.tab.focus(label.format('stribeck_friction'))
    seen.tab.keyboard.press('Space')
    assert shown(seen)[1] > 2 * before[1]
    seen.tab.wait_for_function(f'{picture} !== {first!r}')
    assert '≈' not in seen.tab.evaluate(status)
    assert 'time delay ≈' in seen.tab.inner_text('.effect-list')
    seen.tab.check(label.format('time_delay'))
    assert '≈' in seen.tab.evaluate(status)
    seen.tab.click('#what-if button')
    np.testing.assert_array_equal(shown(seen), before)
    assert '≈' not in seen.tab.evaluate(status)


@needs_browser
def test_spans_and_cursor_are_shared_by_all_drives(see: Any) -> None:
    seen = see()
    chart = seen.tab.query_selector('.curve .u-over')
    chart.scroll_into_view_if_needed()
    box = chart.bounding_box()
    middle = box['y'] + box['height'] / 2
    seen.tab.mouse.move(box['x'] + 0.5 * box['width'], middle)
    seen.tab.wait_for_function('''[...document.querySelectorAll('.curve h3 span')].every(
        (reading) => / s: .* → .* N/.test(reading.textContent))''')
    seen.tab.evaluate('window.first = [...document.querySelectorAll(".curve canvas")].map('
                      '(canvas) => canvas.toDataURL())')
    seen.tab.mouse.down()
    seen.tab.mouse.move(box['x'] + 0.8 * box['width'], middle, steps=4)
    seen.tab.mouse.up()
    seen.tab.wait_for_function('''[...document.querySelectorAll('.curve canvas')].every(
        (canvas, k) => canvas.toDataURL() !== window.first[k])''')


@needs_browser
@pytest.mark.parametrize('width', [1280, 390])
def test_the_part_fits_phones_and_the_file_stays_small(see: Any, file: Path, width: int) -> None:
    seen = see(viewport={'width': width, 'height': 844}, color_scheme='dark')
    assert seen.tab.evaluate('document.documentElement.scrollWidth') <= width
    sizes = '''[...document.querySelectorAll('#what-if *')].filter((node) => node.innerText)
        .map((node) => parseFloat(getComputedStyle(node).fontSize))'''
    assert min(seen.tab.evaluate(sizes)) >= 12
    assert seen.tab.evaluate('''[...document.querySelectorAll('#what-if input')].every(
        (box) => box.labels.length === 1)''')
    assert seen.tab.evaluate('''[...document.querySelectorAll('.over-time')].every(
        (chart) => chart.role === 'img' && chart.ariaLabel)''')
    assert file.stat().st_size <= MOST_BYTES


def test_without_its_searches_a_diagnosis_has_no_what_if(
    found: tuple[Diagnosis, Recording],
) -> None:
    assert what_if(replace(found[0], selection=None)) is None
