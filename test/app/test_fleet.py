# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Surveys and trends: rows of each recording, nothing done twice, steps with date and size."""

from __future__ import annotations

import re
import time
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pandas
import pytest
from documents import checked
from work_apart import work
from workbench_bench import AXIS, write_axis

from pprs_dynamics.app.commands import survey
from pprs_dynamics.app.commands.pprs import main
from pprs_dynamics.app.fleet.recordings import (
    COLUMNS,
    ManifestError,
    SurveyedRecording,
    find_recordings,
    read_manifest,
    write_rows,
)
from pprs_dynamics.app.fleet.trend import find_steps, fleet_trends
from pprs_dynamics.errors import UnreadableFileError

MODEL = str(AXIS)
EFFECTS = 'coulomb_friction'
DAYS = 30
FIRST = datetime(2026, 3, 1, tzinfo=UTC)


def days(count: int) -> pandas.Series:
    return pandas.Series(pandas.date_range(FIRST, periods=count))


def test_noise_has_no_step() -> None:
    found = [find_steps(days(DAYS), np.random.default_rng(seed).normal(size=DAYS), 100)
             for seed in range(200)]
    assert sum(map(bool, found)) <= 4


def test_a_step_has_its_date_and_size() -> None:
    for seed in range(10):
        value = np.random.default_rng(seed).normal(scale=0.1, size=DAYS)
        value[20:] += 0.8
        (step,) = find_steps(days(DAYS), value, 100)
        assert step.time == (FIRST + pandas.Timedelta(days=20)).isoformat()
        assert abs(step.after - step.before - 0.8) < 4 * step.std < 0.4


@pytest.mark.parametrize('value', [
    np.arange(7.0), np.ones(DAYS), np.where(np.arange(DAYS) == 12, 9.0, np.arange(DAYS) % 2)],
    ids=['too few', 'a constant', 'one bad day'])
def test_too_little_is_no_step(value: np.ndarray) -> None:
    assert find_steps(days(len(value)), value) == ()


def write_values(store: Path, robot: str, values: np.ndarray) -> None:
    """Write one row a day, as a survey does."""
    for day, value in enumerate(values):
        write_rows(store, f'{robot}{day}', [{
            'recording': f'{day}.csv', 'sha256': f'{robot} {day}', 'robot': robot,
            'time': FIRST + pandas.Timedelta(days=day), 'model': 'm', 'options': EFFECTS,
            'version': '1', 'drive': 'slide_2', 'effect': 'coulomb_friction',
            'parameter': 'force', 'value': value, 'std': 0.1, 'unit': 'N'}])


def test_the_robot_that_changed_is_reported_on_page_and_in_json(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store, rng = tmp_path / 'store', np.random.default_rng(1)
    write_values(store, '<b>', 1.0 + (np.arange(DAYS) >= 10) + 0.05 * rng.normal(size=DAYS))
    write_values(store, 'quiet', 1.0 + 0.05 * rng.normal(size=DAYS))
    write_rows(store, 'bad', [{'path': 'bad.csv', 'robot': 'quiet', 'error': 'no header'}])
    assert main(['trend', str(store), '--json', str(tmp_path / 'x.json'),
                 '--report', str(tmp_path / 'x.html')]) == 0
    content = checked((tmp_path / 'x.json').read_text(), 'trend')
    (change,) = content['changes']
    assert (change['robot'], change['drive'], change['parameter']) == ('<b>', 'slide_2', 'force')
    assert change['steps'][0]['time'].startswith('2026-03-11')
    assert content['refused'] == {'bad.csv': 'no header'}
    assert 'slide_2 coulomb_friction force: 2026-03-11: 1' in ' '.join(
        capsys.readouterr().out.split())
    assert '1 of 2 robots changed' in (tmp_path / 'x.html').read_text()
    assert '<b>,' not in (tmp_path / 'x.html').read_text()


def test_a_manifest_names_robots_times_and_models(tmp_path: Path) -> None:
    manifest = tmp_path / 'fleet.csv'
    manifest.write_text('path,robot,time,model\na.csv,007,2026-03-02T08:00:00Z,own.yaml\n'
                        'b.csv,8,0,\n')
    first, second = read_manifest(str(manifest))
    assert first == SurveyedRecording(str(tmp_path / 'a.csv'), '007',
                                      datetime(2026, 3, 2, 8, tzinfo=UTC),
                                      str(tmp_path / 'own.yaml'))
    assert (second.time, second.model) == (datetime(1970, 1, 1, tzinfo=UTC), None)


@pytest.mark.parametrize(('text', 'rule'), [
    ('path,time\na.csv,0\n', 'no column robot'), ('path,robot\n,1\n', 'line 2: path is empty'),
    ('path,robot,time\na.csv,1,yesterday\n', "time 'yesterday'")])
def test_an_impossible_manifest_is_refused(tmp_path: Path, text: str, rule: str) -> None:
    (tmp_path / 'fleet.csv').write_text(text)
    with pytest.raises(ManifestError, match=re.escape(rule)):
        list(read_manifest(str(tmp_path / 'fleet.csv')))


def test_robots_have_the_names_of_their_folders(tmp_path: Path) -> None:
    for name in ('r1/a.csv', 'r2/b.csv', 'r3/bag/metadata.yaml', 'r3/bag/0.mcap', 'r3/x.txt'):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text('x')
    found = [(Path(run.path).name, run.robot) for run in find_recordings([str(tmp_path)])]
    assert found == [('a.csv', 'r1'), ('b.csv', 'r2'), ('bag', 'r3')]
    assert [run.robot for run in find_recordings([f'{tmp_path}/r[12]/*.csv'])] == ['r1', 'r2']
    for name in ('', str(tmp_path / 'none*')):
        with pytest.raises(UnreadableFileError, match='there is no recording'):
            list(find_recordings([name]))


def test_a_survey_writes_documented_columns_and_does_nothing_twice(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for k in range(3):
        write_axis(tmp_path / 'robot_1' / f'{k}.csv', k, friction=4.0)
    (tmp_path / 'robot_1' / 'bad.csv').write_text('this is no recording\n')
    store, summary = tmp_path / 'store', tmp_path / 'survey.json'
    command = ['survey', str(tmp_path / 'robot_1'), '--model', MODEL, '--effects', EFFECTS,
               '--output', str(store), '--workers', '1', '--json', str(summary)]
    assert main(command) == 0
    assert checked(summary.read_text(), 'survey')['done'] == 3
    assert main(command) == 0
    assert '0 done, 4 done before' in ' '.join(capsys.readouterr().out.split())
    rows = pandas.read_parquet(store)
    text = (Path(__file__).parents[2] / 'docs' / 'fleets.md').read_text()
    assert [*rows.columns] == [*COLUMNS] == re.findall(
        r'^\| `(\w+)` \|', text, re.MULTILINE)
    found = rows[rows.effect == 'coulomb_friction']
    assert len(found) == 3
    assert (abs(found.value - 4.0) < 4 * found['std']).all()
    assert {*rows.robot} == {'robot_1'}
    assert rows.error.notna().sum() == 1


def test_of_a_worker_that_is_killed_only_the_item_that_kills_it_is_lost(
        monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip('distributed')
    monkeypatch.setattr(survey, 'ALLOWED_FAILURES', 0)  # a worker takes seconds to start
    with survey.cluster(1) as client:
        found = {}
        items = ['first', 'second', 'kills', 'last']
        for item, done, error in survey.run_each(client, work, items):
            found[item] = done, error
            time.sleep(0.3)  # what is written slowly is not taken for lost
    assert 'KilledWorker' in found.pop('kills')[1]
    assert found == {name: (name, None) for name in ('first', 'second', 'last')}


def test_auto_diagnoses_and_an_effect_that_is_not_found_is_0(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_axis(tmp_path / 'a' / 'right.csv', 1, friction=0.0)
    write_axis(tmp_path / 'a' / 'worn.csv', 2, friction=6.0)
    store = tmp_path / 'store'
    assert main(['survey', str(tmp_path / 'a'), '--model', MODEL, '--output', str(store),
                 '--workers', '1']) == 0
    rows = pandas.read_parquet(store)
    assert dict(zip(rows.recording, rows.verdict, strict=True)) == {
        'right.csv': 'adequate', 'worn.csv': 'effect'}
    (trend,) = (course for course in fleet_trends(str(store)).trends if course.parameter == 'force')
    value, = rows[rows.effect == 'coulomb_friction'].value
    assert sorted(trend.value) == [0.0, value]
    assert abs(value - 6.0) < 0.5
