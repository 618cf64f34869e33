# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`pprs simulate`: simulate a robot with hidden effects, and write its recording.

Runs the physics-engine robot without ROS, faster than real time, and writes what its sensors say.
"""

from __future__ import annotations

import argparse

from pprs_dynamics.app.api.simulate import RATE, simulate
from pprs_dynamics.app.commands.arguments import UsageError, number, output_file, seed, show
from pprs_dynamics.app.report.terminal import console, shown, staged_bar
from pprs_dynamics.measurement.files.recording import ENDINGS
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.mechanism.paths import HelicalPath, sampled
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.parameter_file import find_file
from pprs_dynamics.simulation.injection import NAMES, RANDOM
from pprs_dynamics.simulation.motion_files import read_poses
from pprs_dynamics.system.plain_text import displayed

LONGEST = 3600.0  # [s], of an excitation: minutes of simulation, and hundreds of megabytes

EXAMPLE = 'pprs simulate --demo --output run.mcap --effect stribeck_friction --seed 2'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    parser.add_argument('--output', metavar='RECORDING', type=output_file(*ENDINGS, ''),
                        required=True,
                        help='.mcap, .csv, or the name of a rosbag2 folder to make')
    parser.add_argument('--effect', metavar='EFFECT', action='append', default=[],
                        choices=(*NAMES, RANDOM),
                        help='an effect of the simulated robot that the model lacks: a name of '
                        'docs/effects.md, or random; its size depends on --seed; may be repeated')
    parser.add_argument('--seed', type=seed, metavar='N', default=0,
                        help='seed of noise and effects (default 0)')
    parser.add_argument('--path', default='excitation',
                        metavar='PATH',
                        help='motion: excitation (random, default), helix, or a CSV file of poses')
    parser.add_argument('--duration', metavar='S', type=number(1.0, LONGEST, 's'), default=40.0,
                        help='length of an excitation [s] (default 40)')
    parser.add_argument('--path-seed', metavar='N', type=seed, default=0,
                        help='seed of an excitation (default 0)')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    screen = console()
    model = DriveModel.load(find_file(options.model))
    motion = _motion(options, model)
    with staged_bar(screen) as progress:
        result = simulate(
            model, options.effect, seed=options.seed, motion=motion, duration=options.duration,
            path_seed=options.path_seed, progress=progress)
    result.save(options.output)
    show(result, options, screen)
    screen.print(f'recording: {shown(options.output)}', soft_wrap=True)
    return 0


def _motion(options: argparse.Namespace, model: DriveModel) -> PlatformMotion | None:
    if options.path == 'excitation':
        return None
    if not model.robot.plans_poses:
        raise UsageError(f'--path is {displayed(options.path)}, must be excitation for '
                         f'{model.title}: only a 3-PPRS follows poses of its platform')
    if options.path != 'helix':
        return read_poses(options.path).resampled(RATE)
    return sampled(HelicalPath(), RATE)
