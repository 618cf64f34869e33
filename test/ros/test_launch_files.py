# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Launch files, where a ROS 2 installation has launch: no wheel does."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip('launch_ros')
launch = pytest.importorskip('launch')
sources = pytest.importorskip('launch.launch_description_sources')

FILES = sorted((Path(__file__).parents[2] / 'launch').glob('*.launch.py'))
PAPER = Path(__file__).parents[2] / 'config' / 'paper.yaml'


@pytest.mark.parametrize('file', FILES, ids=lambda file: file.name)
def test_a_model_that_does_not_exist_starts_nothing(
    file: Path, capfd: pytest.CaptureFixture[str],
) -> None:
    """Launch itself leaves the file out with a warning: the robot would be the paper's."""
    service = launch.LaunchService(argv=[])
    service.include_launch_description(launch.LaunchDescription([
        launch.actions.IncludeLaunchDescription(
            sources.PythonLaunchDescriptionSource(str(file)), launch_arguments=[
                ('model', f'{PAPER}.not'), ('urdf', 'robot.urdf')])]))
    assert service.run() == 1
    said = ''.join(capfd.readouterr())
    assert 'paper.yaml.not: No such file' in said
    assert 'process started' not in said
