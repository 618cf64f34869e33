# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""RECORDING arguments of commands: declared and read in one way."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from pprs_dynamics.app.commands.arguments import DEFAULT_MODEL
from pprs_dynamics.app.report.progress import progress_bar
from pprs_dynamics.app.report.terminal import shown
from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.inference.diagnosis.next_step import GivenFiles
from pprs_dynamics.measurement.files.recording import Recording, read_for
from pprs_dynamics.measurement.files.repeats import find_repeat
from pprs_dynamics.measurement.residuals.conventions import find_mistakes
from pprs_dynamics.measurement.residuals.readings import POSITION_UNIT
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.force_model import ForceModel
from pprs_dynamics.system.plain_text import displayed


def add_recordings(parser: argparse.ArgumentParser, required: bool = True) -> None:
    """Declare RECORDING… and --topic."""
    parser.add_argument('recordings', metavar='RECORDING', nargs='+' if required else '*',
                        help='rosbag2 folder, .mcap, .db3, .csv or .csv.gz')
    parser.add_argument('--topic', metavar='NAME', help='of sensor_msgs/JointState, where a file '
                        'holds several')


def add_validation(parser: argparse.ArgumentParser) -> None:
    """Declare --validate."""
    parser.add_argument('--validate', metavar='RECORDING', action='append', default=[],
                        help='a recording that is never fitted: held-out errors are taken on it; '
                        'may be repeated')


def read_recordings(options: argparse.Namespace, screen: Any, model: ForceModel,
                    ) -> list[Recording]:
    """Read every recording of the arguments, and print what is wrong with them.

    Raises
    ------
    UnreadableFileError
        Where one holds the samples of another; or as `read_for`.
    """
    recordings = read_each(options.recordings, options, screen, model)
    _refuse_repeats(options.recordings, recordings, (), 'every recording may be given once')
    _show_findings(options.recordings, recordings, screen, model)
    return recordings


def read_validation(options: argparse.Namespace, screen: Any, model: ForceModel,
                    fitted: Sequence[Recording]) -> list[Recording]:
    """Read every recording that is held out, and print what is wrong with them.

    Raises
    ------
    UnreadableFileError
        Where one holds the samples of another, or of one that is fitted; or as `read_for`.
    """
    recordings = read_each(options.validate, options, screen, model)
    _refuse_repeats(options.validate, recordings, fitted,
                    'what is held out must be another recording')
    _show_findings(options.validate, recordings, screen, model)
    return recordings


def read_each(paths: Sequence[str], options: argparse.Namespace, screen: Any, model: ForceModel,
              ) -> list[Recording]:
    """Read recordings one by one; what their numbers rather mean is added to their findings."""
    recordings = []
    for path in paths:
        with progress_bar(screen, f'reading {displayed(path)}') as progress:
            recording = read_for(model, path, options.topic, progress)
            mistakes = find_mistakes(model, recording)
            recordings.append(replace(recording, findings=(*mistakes, *recording.findings)))
    return recordings


def given_files(options: argparse.Namespace, model: str | None = None) -> GivenFiles:
    """Return what the next command is to be given: recordings, held-out ones, model and topic."""
    model = options.model if model is None else model
    return GivenFiles(tuple(options.recordings), tuple(getattr(options, 'validate', ())),
                      '' if model == DEFAULT_MODEL else model, options.topic or '')


def _show_findings(paths: Sequence[str], recordings: Sequence[Recording], screen: Any,
                   model: ForceModel) -> None:
    """Print what is wrong with recordings; refuse positions that no mechanism can follow."""
    for path, recording in zip(paths, recordings, strict=True):
        for finding in recording.findings:
            if finding.kind == POSITION_UNIT and isinstance(model, DriveModel):
                raise UnreadableFileError(path, f'{finding.what}, must be metres')
            screen.print(f'[yellow]![/] {shown(recording.name)}: {shown(finding.text)}')


def _refuse_repeats(paths: Sequence[str], recordings: Sequence[Recording],
                    earlier: Sequence[Recording], rule: str) -> None:
    repeat = find_repeat(recordings, earlier)
    if repeat is not None:
        index, clause = repeat
        raise UnreadableFileError(paths[index], f'{clause}, but {rule}')
