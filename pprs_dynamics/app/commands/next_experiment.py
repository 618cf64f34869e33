# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`pprs next-experiment`: design the motion that separates the candidates."""

from __future__ import annotations

import argparse
import shlex

from pprs_dynamics.app.api.next_experiment import RATE, next_experiment
from pprs_dynamics.app.commands.arguments import POSES, add_shared, answer, output_file, seed, show
from pprs_dynamics.app.report.terminal import shell_command, shown
from pprs_dynamics.inference.experiments.next_experiment import PURPOSES, check_purpose
from pprs_dynamics.system.plain_text import displayed

EXAMPLE = 'pprs next-experiment run.mcap --model robot.yaml --output next.csv'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    add_shared(parser, 'recordings', 'topic', 'as-it-is', 'report', required=False)
    parser.add_argument('--output', metavar='FILE.csv', type=output_file(*POSES),
                        required=True, help='file of the motion: poses for play_trajectory; for '
                        'an arm, positions, velocities and accelerations of its joints')
    parser.add_argument('--purpose', choices=PURPOSES, default='separate',
                        help='separate: a motion that separates the effects which the '
                        'recordings leave open (default); commission: the first motion of a new '
                        'robot')
    parser.add_argument('--seed', metavar='N', type=seed, default=0,
                        help='seed of the search (default 0)')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    check_purpose(options.purpose, options.recordings)
    screen, result = answer(next_experiment, options, purpose=options.purpose, seed=options.seed)
    show(result, options, screen)
    result.save(options.output)
    if not result.inputs.model.robot.plans_poses:
        screen.print('[bold]Play it[/] with a controller of joint trajectories: positions, '
                     f'velocities and accelerations are in {shown(options.output)}')
    else:
        command = shlex.join([
            'ros2', 'run', 'pprs_dynamics', 'play_trajectory', '--ros-args', '-p', 'source:=csv',
            '-p', f'file:={options.output}', '-p', f'rate:={RATE}', '-p', 'lead_in:=3.0'])
        screen.print('[bold]Play it[/]:')
        screen.print(shell_command(displayed(command)))
    return 0
