"""RECORDING arguments of commands: declared and read in one way."""

from __future__ import annotations

import argparse
from typing import Any

from pprs_dynamics.measurement.recording import Recording, read_recording
from pprs_dynamics.report.progress import progress_bar


def add_recordings(parser: argparse.ArgumentParser) -> None:
    """Declare RECORDING… and --topic."""
    parser.add_argument('recordings', metavar='RECORDING', nargs='+',
                        help='rosbag2 folder, .mcap, .db3 or .csv')
    parser.add_argument('--topic', metavar='NAME', help='of sensor_msgs/JointState, where a file '
                        'holds several')


def read_all(options: argparse.Namespace, screen: Any) -> list[Recording]:
    """Read every recording of the arguments, with progress."""
    recordings = []
    for path in options.recordings:
        with progress_bar(screen, f'reading {path}') as progress:
            recordings.append(read_recording(path, topic=options.topic, progress=progress))
    return recordings
