# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The path of a ROS 2 user: colcon build, source, and the file that `ros2 run` starts."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from node_bench import bench
from ros_processes import environment, node_process

pytestmark = [pytest.mark.nodes, pytest.mark.slow]

PROJECT = Path(__file__).parents[1]
TESTED = ('pyproject.toml', 'test', 'demo', 'benchmarks', 'docs', 'README.md')
PACKAGED = ('pprs_dynamics', 'config', 'resource', 'package.xml', 'setup.py', 'setup.cfg')


def colcon_environment(domain: int) -> dict[str, str]:
    """Return a shell's environment: the wheels' marks of an already started Python removed."""
    inherited = environment(domain)
    for name in ('_ROS_WHEELS_BOOTSTRAP_COMPLETE', 'LD_LIBRARY_PATH', 'PYTHONPATH'):
        inherited.pop(name, None)
    prefix = Path(sys.executable).parent
    # Where a ROS 2 is sourced, its own prefix path stays; else the wheels' environment is one.
    inherited.setdefault('AMENT_PREFIX_PATH', str(prefix.parent))
    # A new folder would be compiled anew, for longer than the node is waited for here.
    return {**inherited, 'PATH': f'{prefix}{os.pathsep}{inherited["PATH"]}',
            'NUMBA_DISABLE_JIT': '1'}


def copy_source(workspace: Path, names: tuple[str, ...]) -> None:
    """Put files and folders of the project into the source space of a workspace."""
    source = workspace / 'src' / 'pprs_dynamics'
    source.mkdir(parents=True)
    for name in names:
        if (PROJECT / name).is_dir():
            shutil.copytree(PROJECT / name, source / name,
                            ignore=shutil.ignore_patterns('__pycache__'))
        else:
            shutil.copy(PROJECT / name, source / name)


def colcon(arguments: list[str], workspace: Path, clean: dict[str, str]) -> str:
    """Run colcon, which must succeed; return what it printed."""
    done = subprocess.run(['colcon', *arguments], cwd=workspace, env=clean, capture_output=True,
                          text=True, timeout=180)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_colcon_test_runs_the_tests_that_need_no_more_than_package_xml_names(
    tmp_path: Path, ros_domain: int,
) -> None:
    copy_source(tmp_path, (*PACKAGED, *TESTED))
    clean = colcon_environment(ros_domain)
    colcon(['build'], tmp_path, clean)
    # Two of the files, for the sake of time; those that are not chosen are counted as collected.
    colcon(['test', '--return-code-on-test-failure', '--pytest-args', '-k',
            'test_paths or test_architecture'], tmp_path, clean)
    result = colcon(['test-result'], tmp_path, clean)
    found = re.search(r'(\d+) tests, 0 errors, 0 failures, 0 skipped', result)
    assert found is not None, result
    assert int(found[1]) > 100
    output = (tmp_path / 'log/latest_test/pprs_dynamics/stdout.log').read_text()
    assert 'deselected' in output
    assert not re.search(r'\d+ errors?\b', output)


@pytest.mark.parametrize('symlink', [False, True], ids=['copied', 'symlinked'])
def test_the_built_workspace_runs_the_node(tmp_path: Path, ros_domain: int, symlink: bool) -> None:
    copy_source(tmp_path, PACKAGED)
    clean = colcon_environment(ros_domain)
    colcon(['build', *(['--symlink-install'] if symlink else [])], tmp_path, clean)
    started_by_ros2_run = 'install/pprs_dynamics/lib/pprs_dynamics/feedforward'
    script = (f'source install/setup.bash && exec {started_by_ros2_run} --ros-args '
              '--params-file install/pprs_dynamics/share/pprs_dynamics/config/paper.yaml')
    where = ('source install/setup.bash && python3 -c "import pprs_dynamics as p; '
             'print(p.__file__); print(p.DriveModel.load().source)"')
    found = subprocess.run(['bash', '-c', where], cwd=tmp_path, env=clean, capture_output=True,
                           text=True, timeout=60)
    assert found.returncode == 0, found.stderr
    assert all(line.startswith(str(tmp_path)) for line in found.stdout.split()), found.stdout
    for name in ('play_trajectory', 'pprs'):
        assert (tmp_path / 'install/pprs_dynamics/lib/pprs_dynamics' / name).is_file()
    with bench() as running:
        log = tmp_path / 'feedforward.log'
        command = ['bash', '-c', f'cd {tmp_path} && {script}']
        with node_process(command, ros_domain, log, clean) as process:
            running.follow_status('/feedforward/status')
            assert running.spin_until(lambda: running.status, 20), log.read_text()
            assert running.status[0]['level'] == 'OK'
            process.terminate()
            assert process.wait(5) == 0
