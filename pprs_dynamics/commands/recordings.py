"""RECORDING arguments of commands: declared and read in one way."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.markup import escape

from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.measurement.recording import Recording, read_recording
from pprs_dynamics.plain_text import displayed
from pprs_dynamics.report.progress import progress_bar


def add_recordings(parser: argparse.ArgumentParser, required: bool = True) -> None:
    """Declare RECORDING… and --topic."""
    parser.add_argument('recordings', metavar='RECORDING', nargs='+' if required else '*',
                        help='rosbag2 folder, .mcap, .db3 or .csv')
    parser.add_argument('--topic', metavar='NAME', help='of sensor_msgs/JointState, where a file '
                        'holds several')


def add_validation(parser: argparse.ArgumentParser) -> None:
    """Declare --validate."""
    parser.add_argument('--validate', metavar='RECORDING', action='append', default=[],
                        help='a recording that is never fitted: held-out errors are taken on it; '
                        'may be repeated')


def read_all(options: argparse.Namespace, screen: Any, drives: tuple[str, ...]) -> list[Recording]:
    """Read the drives of every recording of the arguments, with progress."""
    return _read(options.recordings, options, screen, drives)


def read_validation(options: argparse.Namespace, screen: Any, drives: tuple[str, ...],
                    ) -> list[Recording]:
    """Read the drives of every recording that is held out, with progress.

    Raises
    ------
    UnreadableFileError
        Where one is to be fitted, too; or as `read_recording`.
    """
    fitted = {Path(path).resolve() for path in options.recordings}
    for path in options.validate:
        if Path(path).resolve() in fitted:
            raise UnreadableFileError(path, 'is given to be fitted and with --validate, but what '
                                      'is held out must be another recording')
    return _read(options.validate, options, screen, drives)


def show_findings(recordings: Sequence[Recording], screen: Any) -> None:
    """Print what is wrong with recordings."""
    for recording in recordings:
        for finding in recording.findings:
            screen.print(f'[yellow]![/] {escape(recording.name)}: {escape(finding.text)}')


def _read(paths: Sequence[str], options: argparse.Namespace, screen: Any,
          drives: tuple[str, ...]) -> list[Recording]:
    recordings = []
    for path in paths:
        with progress_bar(screen, f'reading {displayed(path)}') as progress:
            recordings.append(read_recording(path, drives, options.topic, progress))
    return recordings
