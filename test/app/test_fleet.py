# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Surveys and trends: what changes is found with its day and size, and nothing is done twice."""

from __future__ import annotations

import ast
import json
import os
import re
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet
import pytest

from benchmarks.fleets.cluster_kills import write_axis
from pprs_dynamics import __version__
from pprs_dynamics.app.commands.pprs import main
from pprs_dynamics.app.fleet import engine
from pprs_dynamics.app.fleet.change_points import find_change_points
from pprs_dynamics.app.fleet.engine import cluster, run_each, run_survey
from pprs_dynamics.app.fleet.manifest import ManifestEntry, ManifestError, entries, find_recordings
from pprs_dynamics.app.fleet.store import DONE, FAILED, Store, key_of, schema
from pprs_dynamics.app.fleet.survey import SurveyJob, examine, identify
from pprs_dynamics.app.fleet.trend import FALSE_ALARMS, fleet_trends, main_change
from pprs_dynamics.app.fleet.trend_sentences import sentences
from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.measurement.files.recording import Recording, write_recording
from pprs_dynamics.physics.model.model_file import load_model

MODEL = 'config/single_axis.yaml'
EFFECTS = 'coulomb_friction'
DAYS, EPOCH = 30, 20_000
THRESHOLD = 1e-4
RNG_SEEDS = range(40)


def job(path: Path | str, robot: str = 'a') -> SurveyJob:
    model = load_model(MODEL)
    entry = ManifestEntry(str(path), robot, 1e9)
    return SurveyJob(entry, model.values, model.fingerprint, EFFECTS)


def write_values(store: Store, robot: str, values: np.ndarray, parameter: str = 'force') -> None:
    """Write one row a day, as a survey would."""
    for day, value in enumerate(values):
        sha256 = f'{robot} {day}'
        row = {'recording': f'{day}.csv', 'path': f'/{robot}/{day}.csv', 'sha256': sha256,
               'time': (EPOCH + day) * 86400 * 10 ** 6, 'model': 'm', 'options': EFFECTS,
               'version': __version__, 'drive': 'slide_2', 'effect': 'coulomb_friction',
               'parameter': parameter, 'value': float(value), 'std': 0.1, 'unit': 'N',
               'conditions': [('temperature', 20.0)]}
        store.write(robot, key_of(sha256, 'm', EFFECTS, __version__), [row])


def test_noise_is_no_change() -> None:
    """Of series without a change at most the promised share is told."""
    time = np.arange(float(DAYS))
    alarms = [bool(find_change_points(time, np.random.default_rng(seed).normal(size=DAYS),
                                0.1).found) for seed in range(200)]
    assert np.mean(alarms) < 0.1


def test_a_step_is_found_with_its_day_and_size() -> None:
    time = np.arange(float(DAYS))
    for seed in RNG_SEEDS:
        noise = np.random.default_rng(seed).normal(size=DAYS)
        found = find_change_points(time, noise + 6.0 * (time >= 17), THRESHOLD).found
        assert [one.kind for one in found] == ['step']
        assert abs(found[0].time - 17) <= 1
        assert abs(found[0].size - 6.0) < 4 * found[0].size_std


def test_slopes_lie_within_their_intervals() -> None:
    time = np.arange(float(DAYS))
    right, days, slopes = [], [], 0
    for seed in range(200):
        noise = np.random.default_rng(seed).normal(size=DAYS)
        found = find_change_points(time, noise + 0.7 * np.maximum(time - 12, 0), THRESHOLD).found
        if [one.kind for one in found] == ['slope']:
            slopes += 1
            days.append(abs(found[0].time - 12))
            right.append(abs(found[0].size - 0.7) < 1.96 * found[0].size_std)
    # Noise may bend one slope in twenty so that steps describe it as well.
    assert slopes >= 0.95 * 200
    assert np.median(days) < 4
    assert np.mean(right) >= 0.9


def test_one_bad_day_is_no_change() -> None:
    time = np.arange(float(DAYS))
    value = np.random.default_rng(3).normal(size=DAYS)
    value[13] += 50.0
    assert not find_change_points(time, value, THRESHOLD).found


def test_recordings_at_one_time_are_no_trend() -> None:
    noise = np.random.default_rng(5).normal(size=DAYS)
    assert not find_change_points(np.zeros(DAYS), noise, THRESHOLD).found
    # Many at the end, as of a robot that was recorded ten times on its last day.
    time = np.minimum(np.arange(float(DAYS)), 20.0)
    (found,) = find_change_points(time, noise + 8.0 * (time >= 10), THRESHOLD).found
    assert (found.kind, found.time) == ('step', 10.0)


def test_the_robot_that_changes_is_told_with_its_limit(tmp_path: Path) -> None:
    store, rng = Store(str(tmp_path / 'store')), np.random.default_rng(7)
    days = np.arange(DAYS)
    for robot in ('1', '2', '3', '4', '5'):
        grown = 0.05 * np.maximum(days - 10, 0) if robot == '3' else 0.0
        write_values(store, robot, rng.normal(scale=0.05, size=DAYS) + 0.3 + grown)
    fleet = fleet_trends(store, {'coulomb_friction.force': 2.0})
    told = {robot: fleet.flagged(robot) for robot in fleet.robots}
    assert [robot for robot, found in told.items() if found] == ['3']
    change = main_change(told['3'][0])
    assert abs(change.size - 0.05) < 2 * change.size_std
    reach = told['3'][0].reach
    assert reach is not None
    truth = EPOCH + 10 + (2.0 - 0.3) / 0.05
    assert reach.times[0] < truth < reach.times[2]
    first = sentences(fleet)[0]
    assert first.startswith('robot 3, slide_2: coulomb_friction.force grows by 1.')
    assert 'N per month since 2024-10-1' in first
    assert 'limit 2 N in about' in first
    assert told['3'][0].changes.probability < FALSE_ALARMS


def test_the_page_shows_names_as_text(tmp_path: Path) -> None:
    store = Store(str(tmp_path / 'store'))
    for robot in ('</script><b>x', 'b'):
        write_values(store, robot, np.random.default_rng(1).normal(size=DAYS))
    report, data = tmp_path / 'fleet.html', tmp_path / 'trend.json'
    assert main(['trend', store.path, '--report', str(report), '--json', str(data),
                 '--beside', 'temperature']) == 0
    assert '</script><b>x' not in report.read_text()
    assert json.loads(data.read_text())['robots'] == ['</script><b>x', 'b']


def test_trend_refuses_what_the_store_does_not_have(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['trend', str(tmp_path / 'nowhere')]) == 2
    assert 'there is no store' in capsys.readouterr().err
    write_values(Store(str(tmp_path / 's')), 'a', np.zeros(3))
    assert main(['trend', str(tmp_path / 's'), '--limit', 'friction=1']) == 2
    assert "unknown quantity 'friction'" in capsys.readouterr().err


def test_a_manifest_says_whose_and_when(tmp_path: Path) -> None:
    manifest = tmp_path / 'robots.csv'
    manifest.write_text('path,robot,time,temperature\nx.csv,7,1970-01-02T00:00:00,21.5\n')
    (entry,) = entries((), str(manifest))
    assert entry == ManifestEntry(str(tmp_path / 'x.csv'), '7', 86400.0, None,
                                  {'temperature': 21.5})


def test_a_quote_in_a_manifest_loses_no_recording_in_silence(tmp_path: Path) -> None:
    manifest = tmp_path / 'robots.csv'
    manifest.write_text('path,robot,note\na.csv,1,ok\nb.csv,1,"5 inch\nc.csv,1,ok\n')
    with pytest.raises(UnreadableFileError, match='row 3 has a quote'):
        list(entries((), str(manifest)))


@pytest.mark.parametrize(('text', 'rule'), [
    *((f'path,robot,time\nx.csv,7,{time}\n', f"line 2: time '{time}', must be an ISO 8601 date")
      # The last in milliseconds, a year after 50 000.
      for time in ('yesterday', '-5', '1e300', '1767225600000')),
    ('path;robot\nx;7\n', 'line 1: there is no column path, must have the columns path and'),
    ('', 'line 1: there is no column path'), ('path,robot\nx.csv,\n', 'line 2: robot is empty')])
def test_a_manifest_that_says_something_impossible_is_refused(
        tmp_path: Path, text: str, rule: str) -> None:
    manifest = tmp_path / 'robots.csv'
    manifest.write_text(text)
    with pytest.raises(ManifestError, match=re.escape(rule)):
        list(entries((), str(manifest)))


@pytest.mark.parametrize(('arguments', 'said'), [
    (['--output', 'file'], 'argument --output: file: is no folder, must be one'),
    (['--output', 'file/store'], 'file/store: Not a directory'),
    (['--output', 'foo://store'], 'foo://store: Protocol not known: foo'),
    (['--output', 's', '--effects', ''], "--effects '': must be auto or names of effects"),
    (['--output', 's', '--effects', 'friction'], "unknown effect 'friction' (did you mean"),
    (['--output', 's', '--manifest', 'binary'], 'binary: is no text, must be CSV in UTF-8'),
    (['--output', 's', '--manifest', 'empty'], 'empty: no recording is listed')])
def test_what_cannot_be_is_said_before_anything_is_started(
        recordings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str], arguments: list[str], said: str) -> None:
    def started(*_: object) -> None:
        raise AssertionError('a cluster was started')

    monkeypatch.setattr('pprs_dynamics.app.commands.survey.cluster', started)
    model = Path(MODEL).absolute()
    monkeypatch.chdir(tmp_path)
    Path('file').write_text('x')
    Path('binary').write_bytes(b'\xff\xfe\x00')
    Path('empty').write_text('path,robot\n')
    given = [] if '--manifest' in arguments else [str(recordings)]
    effects = [] if '--effects' in arguments else ['--effects', EFFECTS]
    try:
        status: object = main(['survey', *given, '--model', str(model), *effects, *arguments])
    except SystemExit as end:  # what is wrong with an argument alone
        status = end.code
    assert status == 2
    error = capsys.readouterr().err
    assert error.startswith(f'pprs survey: {said}')
    assert error.count('\n') == 1
    assert not Path('s').exists()


def test_parquet_files_of_others_are_no_store(tmp_path: Path,
                                              capsys: pytest.CaptureFixture[str]) -> None:
    pyarrow.parquet.write_table(pyarrow.table({'a': [1]}), tmp_path / 'x.parquet')
    assert main(['trend', str(tmp_path)]) == 2
    assert 'there is no store of pprs survey' in capsys.readouterr().err


def test_a_file_is_found_by_its_name_though_that_reads_as_a_pattern(tmp_path: Path) -> None:
    for name in ('run[1].csv', 'run1.csv', 'run2.csv'):
        (tmp_path / name).write_text('time\n')

    def found(pattern: str) -> list[str]:
        return [Path(one.path).name for one in find_recordings([str(tmp_path / pattern)])]

    assert found('run[1].csv') == ['run[1].csv']
    assert found('run[12].csv') == ['run1.csv', 'run2.csv']


def test_robots_are_called_as_their_folders(tmp_path: Path) -> None:
    for name in ('r2/b.csv', 'r1/a.csv', 'r1/note.txt', 'r3/bag/metadata.yaml'):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text('x')
    found = [(Path(one.path).name, one.robot) for one in find_recordings([str(tmp_path)])]
    assert found == [('a.csv', 'r1'), ('b.csv', 'r2'), ('bag', 'r3')]


def test_friction_of_a_recording_lies_within_its_deviation(tmp_path: Path) -> None:
    path = write_axis(tmp_path / 'a' / '1.csv', friction=4.0)
    result = examine(job(path), identify(str(path)))
    assert result.error is None
    (row,) = (row for row in result.rows if row.get('effect') == 'coulomb_friction')
    assert abs(row['value'] - 4.0) < 4 * row['std']
    assert row['unit'] == 'N'


def test_recordings_are_read_through_fsspec(tmp_path: Path) -> None:
    import fsspec

    path = write_axis(tmp_path / '1.csv')
    fsspec.filesystem('memory').pipe_file('/fleet/robot_1/1.csv', path.read_bytes())
    (entry,) = find_recordings(['memory://fleet'])
    assert entry.robot == 'robot_1'
    content = identify(entry.path)
    assert content == identify(str(path))
    assert examine(job(entry.path), content).error is None


def test_what_is_refused_is_a_row_with_the_reason(tmp_path: Path) -> None:
    path = tmp_path / 'bad.csv'
    path.write_text('this is no recording\n')
    refused = examine(job(path), identify(str(path)))
    assert refused.error is not None
    assert 'bad.csv' in refused.error
    assert not refused.failed
    gone = examine(job(tmp_path / 'gone.csv'), identify(str(tmp_path / 'gone.csv')))
    assert gone.failed  # it may be there the next time


def test_no_row_of_a_store_is_ever_non_finite(tmp_path: Path) -> None:
    store = Store(str(tmp_path / 'store'))
    store.write('r', 'k', [{'recording': 'x', 'sha256': 'y', 'rms': np.inf, 'value': np.nan,
                            'noise': 0.5}])
    (row,) = store.read(['rms', 'value', 'noise']).to_pylist()
    assert row == {'rms': None, 'value': None, 'noise': 0.5}


def test_a_store_holds_whole_files_of_the_documented_schema(tmp_path: Path) -> None:
    store = Store(str(tmp_path / 'store'))
    store.write('r 1', 'k', [{'recording': 'x', 'error': 'no'}], failed=True)
    assert not store.has('r 1', 'k')
    store.write('r 1', 'k', [{'recording': 'x'}])
    files = [path for path in (tmp_path / 'store').rglob('*') if path.is_file()]
    assert [path.name for path in files] == [f'k{DONE}']
    assert pyarrow.parquet.ParquetFile(files[0]).schema_arrow.equals(schema())
    assert store.read().column('robot').to_pylist() == ['r 1']


@pytest.fixture(scope='module')
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('fleet')
    for k in range(6):
        write_axis(folder / 'robot_1' / f'{k}.csv', seed=k)
    (folder / 'robot_1' / 'bad.csv').write_text('this is no recording\n')
    return folder


@pytest.fixture(scope='module')
def client() -> Iterator[object]:
    with cluster(2) as found:
        yield found


def test_a_killed_worker_changes_nothing(recordings: Path, client, tmp_path: Path) -> None:
    store = Store(str(tmp_path / 'store'))
    jobs = [job(entry.path, entry.robot) for entry in find_recordings([str(recordings)])]
    results = run_survey(client, jobs, store)
    first = next(results)
    # Of the cluster that this test has started itself.
    os.kill(client.run(os.getpid).popitem()[1], signal.SIGKILL)
    done = [first, *results]
    assert sorted(one.rows[0]['recording'] for one in done if one and one.error is None) == [
        f'{k}.csv' for k in range(6)]
    table = store.read(('recording', 'sha256', 'error')).to_pylist()
    assert len({row['sha256'] for row in table}) == 7
    assert [row['recording'] for row in table if row['error']] == ['bad.csv']
    assert not list(Path(store.path).rglob(f'*{FAILED}'))
    # What is done is not done again; what is missing is.
    next(Path(store.path).rglob(f'*{DONE}')).unlink()
    again = list(run_survey(client, jobs, store))
    assert sum(one is not None for one in again) == 1
    assert store.read(('recording',)).num_rows == len(table)


@pytest.mark.parametrize('damage', [lambda part: part[:300], lambda part: b'',
                                    lambda part: part[:900] + b'~' * 60 + part[960:]])
def test_a_torn_part_is_done_again(damage: Callable[[bytes], bytes], client,
                                   tmp_path: Path) -> None:
    store, path = Store(str(tmp_path / 'store')), write_axis(tmp_path / 'robot' / 'a.csv')
    assert len([one for one in run_survey(client, [job(path)], store) if one]) == 1
    part = next(Path(store.path).rglob(f'*{DONE}'))
    whole = store.read(('recording', 'value')).to_pylist()
    part.write_bytes(damage(part.read_bytes()))
    if part.stat().st_size < 500:  # the bytes of a page are seen once it is read
        with pytest.raises(UnreadableFileError, match='damaged; pprs survey on the same'):
            store.read(('recording', 'value'))
    assert len([one for one in run_survey(client, [job(path)], store) if one]) == 1
    assert store.read(('recording', 'value')).to_pylist() == whole
    assert list(run_survey(client, [job(path)], store)) == [None]


def test_a_worker_that_stands_still_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, 'SILENCE', '3s')
    with cluster(1) as client:
        results = run_each(client, str, range(8))
        found = [next(results)]
        # Of the cluster that this test has started itself.
        os.kill(client.run(os.getpid).popitem()[1], signal.SIGSTOP)
        found += results
        assert sorted(value for _, value, error in found if error is None) == list('01234567')


def test_no_name_is_no_recording_of_the_present_folder(tmp_path: Path,
                                                       monkeypatch: pytest.MonkeyPatch,
                                                       capsys: pytest.CaptureFixture[str]) -> None:
    write_recording(tmp_path / 'bag', Recording.from_arrays(
        'x', np.arange(9.0), np.zeros((9, 1)), None, np.zeros((9, 1)), ('axis',)))
    monkeypatch.chdir(tmp_path / 'bag')
    for command in (['info', ''], ['info', '.', '--model', ''], ['survey', '', '--output', 'x']):
        status = main([command[0], *command[1:], *(
            [] if '--model' in command else ['--model', MODEL])])
        assert status == 2, command
        assert "''" in capsys.readouterr().err


def test_the_command_says_what_it_did(recordings: Path, tmp_path: Path,
                                      capsys: pytest.CaptureFixture[str]) -> None:
    store, summary = tmp_path / 'store', tmp_path / 'survey.json'
    arguments = ['survey', str(recordings), '--model', MODEL, '--effects', EFFECTS,
                 '--output', str(store), '--workers', '1', '--json', str(summary)]
    assert main(arguments) == 0
    assert json.loads(summary.read_text())['done'] == 6
    assert main(arguments) == 0
    assert '0 done, 7 done before' in capsys.readouterr().out
    assert main(['survey', str(tmp_path / 'none*'), '--output', str(store)]) == 2
    assert 'there is no recording' in capsys.readouterr().err


@pytest.fixture
def told_store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a store called as in docs/fleets.md, with a growing friction and a refusal."""
    store = Store(str(tmp_path / 'store'))
    for robot in ('1', '2'):
        write_values(store, robot, np.arange(5.0) * (robot == '2'))
    store.write('2', 'k', [{'recording': 'bad.csv', 'error': 'no header'}])
    monkeypatch.chdir(tmp_path)
    return tmp_path


def _examples(language: str) -> list[str]:
    text = (Path(__file__).parents[2] / 'docs' / 'fleets.md').read_text()
    return re.findall(rf'```{language}\n(.*?)```', text, re.DOTALL)


def _value_of(code: str) -> Any:
    """Run an example, and return what its last line shows."""
    *before, last = ast.parse(code).body
    assert isinstance(last, ast.Expr)
    names: dict[str, Any] = {}
    exec(compile(ast.Module(before, []), 'docs/fleets.md', 'exec'), names)
    return eval(compile(ast.Expression(last.value), 'docs/fleets.md', 'eval'), names)


def test_the_examples_of_the_documentation_read_a_store(told_store: Path) -> None:
    with_pandas, with_polars = map(_value_of, _examples('python'))
    assert with_pandas.shape == (5, 2)
    assert with_pandas.max().tolist() == [0.0, 4.0]
    assert with_polars.rows() == [(2, 'bad.csv', 'no header')]
    import duckdb

    (query,) = _examples('sql')
    assert sorted(duckdb.sql(query).fetchall()) == [(1, 'slide_2', 0.0), (2, 'slide_2', 4.0)]


def test_the_documented_columns_are_those_of_the_schema() -> None:
    text = (Path(__file__).parents[2] / 'docs' / 'fleets.md').read_text()
    documented = re.findall(r'^\| `(\w+)` \|', text, re.MULTILINE)
    assert set(documented) == {'robot', *schema().names}


def test_auto_diagnoses_each_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_axis(tmp_path / 'a' / 'right.csv', 0.0, seed=1)
    write_axis(tmp_path / 'a' / 'worn.csv', 6.0, seed=2)
    store = tmp_path / 'store'
    assert main(['survey', str(tmp_path / 'a'), '--model', MODEL, '--output', str(store),
                 '--workers', '1']) == 0
    assert '2 recordings: 2 done' in capsys.readouterr().out
    rows = Store(str(store)).read().to_pylist()
    assert {row['options'] for row in rows} == {'auto'}
    verdicts = {row['recording']: row['verdict'] for row in rows}
    assert verdicts == {'right.csv': 'adequate', 'worn.csv': 'effect'}
    (found,) = (row for row in rows if row['effect'] == 'coulomb_friction')
    assert found['recording'] == 'worn.csv'
    assert abs(found['value'] - 6.0) < 4 * found['std']
    assert all(row['seconds'] > 0 and row['rms'] > 0 for row in rows)
    # What was not found that day is 0 in a trend.
    (trend,) = (one for one in fleet_trends(Store(str(store))).trends
                if one.quantity.name == 'coulomb_friction.force')
    assert sorted(trend.value) == [0.0, found['value']]
