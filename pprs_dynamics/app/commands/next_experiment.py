# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""pprs next-experiment: the motion that would tell most about what recordings leave open."""

from __future__ import annotations

import argparse
import math
import shlex

from pprs_dynamics.app.api.next_experiment import RATE, next_experiment
from pprs_dynamics.app.commands.arguments import (
    POSES,
    add_as_it_is,
    add_overwrite,
    add_recordings,
    add_report,
    number,
    output_file,
    seed,
)
from pprs_dynamics.app.commands.input_output import read_inputs, tell
from pprs_dynamics.app.report.terminal import console, shown, staged_bar
from pprs_dynamics.inference.experiments.arm_motions import ArmLimits
from pprs_dynamics.inference.experiments.motion_limits import MotionLimits
from pprs_dynamics.inference.experiments.next_experiment import (
    LONGEST,
    PURPOSES,
    SHORTEST,
    check_purpose,
)
from pprs_dynamics.physics.model.force_model import ForceModel

LEAST_NOISE = 1e-6  # [N]; what is finer no sensor of forces resolves
FASTEST = 1e4  # [Hz]; beyond what any controller takes, and a file of 1.2 million poses at most
LIMITS = MotionLimits()
PLAYED = 'positions, velocities and accelerations of its joints'

EXAMPLE = 'pprs next-experiment run.mcap --output next.csv'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    add_recordings(parser, required=False)
    add_as_it_is(parser)
    parser.add_argument('--output', metavar='FILE.csv', type=output_file(*POSES),
                        required=True, help='poses for play_trajectory; of an arm, positions, '
                        'velocities and accelerations of its joints')
    add_overwrite(parser)
    parser.add_argument('--purpose', choices=PURPOSES, default='separate',
                        help='separate: what the recordings leave open (default); commission: '
                        'the first motion of a new robot')
    parser.add_argument('--seed', type=seed, default=0, help='of the search (default 0)')
    parser.add_argument('--duration', type=number(SHORTEST, LONGEST, 's'), default=20.0,
                        help='[s] (default 20)')
    parser.add_argument('--rate', type=number(1.0, FASTEST, 'Hz'), default=RATE,
                        help='of the poses, as play_trajectory is to play them [Hz] (default 100)')
    parser.add_argument('--velocity', type=number(0.0, 100.0, 'm/s', above=True),
                        help=f'limit of every drive [m/s] (default {LIMITS.velocity:g}), of an '
                        "arm's joints [rad/s, m/s] (default that of the URDF)")
    parser.add_argument('--acceleration', type=number(0.0, 1e4, 'm/s^2', above=True),
                        default=LIMITS.acceleration,
                        help=f'limit of every drive [m/s^2] (default {LIMITS.acceleration:g})')
    parser.add_argument('--tilt', type=number(0.0, math.pi, 'rad', above=True), default=LIMITS.tilt,
                        help=f'limit of the platform [rad] (default {LIMITS.tilt:g})')
    parser.add_argument('--condition', type=number(1.0, 1e6), default=LIMITS.condition_number,
                        help='limit of the condition number, where the model file allows more '
                        f'(default {LIMITS.condition_number:g})')
    parser.add_argument('--margin', type=number(0.0, 0.9), default=LIMITS.margin,
                        help='share of every limit, those of the model file included, that stays '
                        f'unused (default {LIMITS.margin:g})')
    parser.add_argument('--noise', type=number(LEAST_NOISE, 1e3, 'N'), default=0.05,
                        help='of the efforts over 0.01 s, for --purpose commission without '
                        'recordings [N] (default 0.05)')
    add_report(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    screen = console()
    check_purpose(options.purpose, options.recordings)
    inputs = read_inputs(options, screen)
    with staged_bar(screen) as progress:
        result = next_experiment(
            inputs.model, inputs, purpose=options.purpose, limits=_limits(options, inputs.model),
            duration=options.duration, seed=options.seed, noise=options.noise,
            rate=options.rate, progress=progress)
    command = '' if inputs.model.moves_joints else shlex.join([
        'ros2', 'run', 'pprs_dynamics', 'play_trajectory', '--ros-args', '-p', 'source:=csv',
        '-p', f'file:={options.output}', '-p', f'rate:={options.rate}', '-p', 'lead_in:=3.0'])
    tell(result, options, screen, lambda: result.page(command), output=options.output)
    result.save(options.output)
    if command:
        screen.print(f'[bold]play it[/]: {shown(command)}')
    else:
        screen.print(f'[bold]play it[/] with a controller of joint trajectories: {PLAYED} '
                     f'stand in {shown(options.output)}')
    return 0


def _limits(options: argparse.Namespace, model: ForceModel) -> MotionLimits | ArmLimits:
    if model.moves_joints:
        return ArmLimits(options.velocity or ArmLimits.velocity, options.acceleration,
                         options.margin)
    return MotionLimits(options.velocity or LIMITS.velocity, options.acceleration, options.tilt,
                        options.condition, options.margin)
