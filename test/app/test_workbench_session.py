# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The session behind the workbench: ticks, evidence, shares, departures, adoption, export."""

from __future__ import annotations

import json
import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from work_apart import end, fail, sleep
from workbench_bench import AXIS, HIDDEN, write_axis, write_hidden

from pprs_dynamics import DriveModel, compare
from pprs_dynamics.app.commands.pprs import main
from pprs_dynamics.app.workbench import Session
from pprs_dynamics.app.workbench.jobs import Cancelled, Job, run_in_process
from pprs_dynamics.app.workbench.ticks import SessionError, StaleError
from pprs_dynamics.app.workbench.view_state import EXACT, FITTED, LINEAR
from pprs_dynamics.errors import ModelError, PprsError
from pprs_dynamics.physics.model.ledger import read_steps
from pprs_dynamics.system.worker_process import EndedError

FORCE = HIDDEN['effects.coulomb_friction.lift_2.force']
MASS = HIDDEN['effects.payload_mass.mass']


@pytest.fixture(scope='module')
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_hidden(tmp_path_factory.mktemp('workbench') / 'run.csv', 1, 16.0)


@pytest.fixture(scope='module')
def shared(recording: Path) -> Session:
    session = Session.open([recording])
    session.ticks.settle()
    return session


@pytest.fixture
def session(shared: Session) -> Session:
    for name in list(shared.ticks.view.ticks):
        shared.ticks.untick(name)
    shared.ticks.settle()
    return shared


def steps_of(session: Session) -> list[str]:
    return [step.effect for step in read_steps(session.ticks.model.values)]


def test_ticks_lower_the_error_at_once_and_find_what_was_hidden(session: Session) -> None:
    before = session.overall().before
    assert session.overall().now == before
    shown = session.ticks.tick('payload_mass')
    assert shown.stage == LINEAR
    session.ticks.tick('coulomb_friction', ['lift_2'])
    assert session.overall().now < 0.5 * before
    shown = session.ticks.settle()
    assert shown.stage == EXACT
    force = shown.estimates['coulomb_friction']['lift_2.force']
    mass = shown.estimates['payload_mass']['mass']
    assert abs(force.value - FORCE) < 4 * force.std < 0.1 * FORCE
    assert abs(mass.value - MASS) < 4 * mass.std < 0.1 * MASS
    assert min(terms.total for terms in shown.without.values()) > 100
    told = next(row for row in session.to_dict()['effects'] if row['name'] == 'payload_mass')
    assert told['evidence'] == pytest.approx(shown.without['payload_mass'].total)
    assert told['evidence_terms'].startswith('fit +')
    # Noise is shown once the diagnosis has estimated it.
    assert math.isnan(session.errors()['lift_2'].noise)


@pytest.mark.parametrize('ticks', [('payload_mass', 'coulomb_friction'), pytest.param(
    ('time_delay',), marks=pytest.mark.slow)])
def test_errors_that_are_shown_are_those_of_compare_after_export(
    session: Session, recording: Path, tmp_path: Path, ticks: tuple[str, ...],
) -> None:
    for name in ticks:
        session.ticks.tick(name)
    assert session.ticks.view.is_approximate is bool({'time_delay', 'homing_error'} & {*ticks})
    session.ticks.settle()
    assert not session.ticks.view.is_approximate
    assert not session.ticks.view.notice
    session.export(tmp_path / 'ticked.yaml', with_ticked=True)
    assert main(['compare', str(recording), '--model', str(tmp_path / 'ticked.yaml'),
                 '--json', str(tmp_path / 'compared.json')]) == 0
    found = json.loads((tmp_path / 'compared.json').read_text())
    for name, error in session.errors().items():
        assert error.now == pytest.approx(found['drives'][name]['rms'], rel=5e-5)
    assert session.overall().now == pytest.approx(found['overall']['rms'], rel=5e-5)


def test_a_value_that_is_typed_holds_and_costs_what_it_departs(session: Session) -> None:
    session.ticks.tick('payload_mass')
    session.ticks.tick('coulomb_friction', ['lift_2'])
    best = session.ticks.settle().estimates['coulomb_friction']['lift_2.force']
    shown = session.ticks.choose('coulomb_friction', 'lift_2.force', best.value + 3 * best.std)
    assert shown.estimates['coulomb_friction']['lift_2.force'].value == pytest.approx(
        best.value + 3 * best.std)
    # Of a Gaussian, three standard deviations away.
    assert shown.departure == pytest.approx(9.0, rel=0.1)
    far = session.ticks.choose('coulomb_friction', 'lift_2.force', 2 * FORCE)
    assert far.departure > 100
    # The noise did not grow to hide it.
    settled = session.ticks.settle()
    assert settled.departure == pytest.approx(far.departure, rel=0.05)
    assert session.ticks.release('coulomb_friction').departure == 0.0


def test_shares_say_where_an_error_is_from_less_its_prior_cost(session: Session) -> None:
    lifts = session.shares(2.0, 6.0, ['lift_1', 'lift_3'])
    assert lifts[0].net > 0.8
    assert 'payload_mass' in {lift.effect for lift in lifts if lift.net > 0.9 * lifts[0].net}
    session.ticks.tick('payload_mass')
    session.ticks.settle()
    of_lift_2 = session.shares(2.0, 6.0, ['lift_2'])
    assert of_lift_2[0].effect in (
        'coulomb_friction', 'asymmetric_friction', 'load_friction', 'gear_efficiency')
    assert of_lift_2[0].net > 0.8
    assert all(gain.net <= max(gain.explained, 0.0) + 1e-12 for gain in of_lift_2)
    session.ticks.tick('coulomb_friction', ['lift_2'])
    session.ticks.settle()
    # Nothing is left to be explained: what fits to noise does not pay.
    assert all(share.net < 0.05 for share in session.shares(2.0, 6.0))


def test_bad_requests_are_a_sentence_and_change_nothing(session: Session) -> None:
    session.ticks.tick('coulomb_friction', ['lift_2'])
    revision = session.ticks.revision
    for call, error in (
            (lambda: session.ticks.tick('coulomb'), PprsError),
            (lambda: session.ticks.tick('payload_mass', ['lift_1']), PprsError),
            (lambda: session.ticks.tick('coulomb_friction', ['lift_9']), PprsError),
            (lambda: session.ticks.untick('payload_mass'), SessionError),
            (lambda: session.ticks.choose('coulomb_friction', 'lift_1.force', 1.0), SessionError),
            (lambda: session.ticks.choose('coulomb_friction', 'lift_2.force', math.nan),
             ModelError),
            (lambda: session.ticks.choose('coulomb_friction', 'lift_2.force', 1e99), ModelError),
            (lambda: session.ticks.untick('coulomb_friction', revision - 1), StaleError)):
        with pytest.raises(error):
            call()
        assert session.ticks.revision == revision
    assert set(session.ticks.view.ticks) == {'coulomb_friction'}


def test_a_tick_in_between_ends_what_follows_the_one_before(session: Session) -> None:
    session.ticks.tick('payload_mass')
    stages = []

    def change() -> None:
        stages.append(session.ticks.view.stage)
        if stages == [FITTED]:
            session.ticks.tick('effort_offset')
    end = session.ticks.subscribe(change)
    shown = session.ticks.settle()
    end()
    assert shown.stage == LINEAR
    assert set(shown.ticks) == {'payload_mass', 'effort_offset'}
    assert session.ticks.settle().stage == EXACT


def test_an_effect_is_adopted_refused_exported_and_taken_back(tmp_path: Path) -> None:
    spring = {'axis.stiffness': 300.0, 'axis.position': 0.01}
    recording, other = (write_axis(tmp_path / f'{seed}.csv', seed, drive_spring=spring)
                        for seed in (1, 2))
    session = Session.open([recording], AXIS, validation=[other])
    given = dict(session.ticks.model.values)
    session.jobs.diagnose().result(300)
    assert session.jobs.diagnosis is not None
    noise = compare(DriveModel.load(AXIS), recording).comparison.drives
    for name, error in session.errors().items():
        assert error.noise == pytest.approx(noise[name].noise_floor, rel=1e-6)
    refused = session.jobs.adopt('quadratic_friction').result(300)
    assert not refused.adopted
    assert 'explains these recordings better' in refused.reason
    assert dict(session.ticks.model.values) == given
    session.ticks.tick('drive_spring')
    session.ticks.tick('coulomb_friction')
    adopted = session.jobs.adopt('drive_spring').result(300)
    assert adopted.adopted, adopted.reason
    assert adopted.held_out_on == 'validation'
    assert set(session.ticks.view.ticks) == {'coulomb_friction'}
    assert steps_of(session) == ['drive_spring']
    session.export(tmp_path / 'adopted.yaml')
    assert DriveModel.load(tmp_path / 'adopted.yaml').values == session.ticks.model.values
    session.ticks.back()
    assert dict(session.ticks.model.values) == given


def test_work_apart_answers_fails_and_is_ended() -> None:
    shares: list[float] = []
    assert run_in_process(sleep, 0.5, report=shares.append) == 'slept'
    assert 0.5 in shares
    with pytest.raises(PprsError, match='must be 2'):
        run_in_process(fail, report=shares.append)
    with pytest.raises(EndedError, match='status 3'):
        run_in_process(end, report=shares.append)
    began = time.monotonic()
    job: Job[str] = Job('diagnose', '', lambda report: run_in_process(
        sleep, 60, report=report)).start()
    time.sleep(0.5)
    job.cancel()
    with pytest.raises(Cancelled):
        job.result(20)
    assert time.monotonic() - began < 20


def ticked(session: Session) -> dict[str, Any]:
    return {name: (tick.best.drives, dict(tick.chosen))
            for name, tick in session.ticks.view.ticks.items()}


def test_ticks_and_values_are_taken_back_and_done_again(session: Session) -> None:
    session.ticks.tick('payload_mass')
    session.ticks.tick('coulomb_friction', ['lift_2'])
    force = session.ticks.settle().estimates['coulomb_friction']['lift_2.force'].value
    for share in (1.1, 1.2, 1.3):  # a slider is one deed
        session.ticks.choose('coulomb_friction', 'lift_2.force', share * force)
    session.ticks.untick('payload_mass')
    after, error = ticked(session), session.overall().now
    undone = []
    while session.ticks.view.ticks:
        undone.append(session.ticks.undoes)
        session.ticks.back()
    assert undone == ['payload_mass unticked', 'coulomb_friction: lift_2.force chosen',
                      'coulomb_friction ticked on lift_2', 'payload_mass ticked']
    np.testing.assert_array_equal(session.ticks.view.residual, session.ticks.fits.before)
    for _ in undone:
        session.ticks.forward()
    assert ticked(session) == after
    assert session.overall().now == pytest.approx(error, rel=0.02)
    with pytest.raises(SessionError, match='nothing was undone'):
        session.ticks.forward()
    session.ticks.back()
    session.ticks.tick('effort_offset')
    assert not session.ticks.redoes


