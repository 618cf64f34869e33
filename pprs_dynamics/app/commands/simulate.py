# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""pprs simulate: a recording of the simulated robot, with hidden effects if wanted.

Runs the physics-engine robot without ROS, faster than real time, and writes what its sensors say.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from pprs_dynamics.app.commands.arguments import PAGE, RECORDING, number, output_file, seed
from pprs_dynamics.app.commands.output import write_json
from pprs_dynamics.app.report.progress import progress_bar
from pprs_dynamics.app.report.robot_view import write_robot_page
from pprs_dynamics.app.report.terminal import console, shown
from pprs_dynamics.measurement.files.pose_files import read_poses
from pprs_dynamics.measurement.files.recording import Recording, write_recording
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.mechanism.paths import Excitation, HelicalPath
from pprs_dynamics.physics.model.arm_model import ArmModel
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.keys import is_mechanism
from pprs_dynamics.physics.model.parameter_file import find_file, read_parameters
from pprs_dynamics.simulation.arm_forms import NAMES as ARM_EFFECTS
from pprs_dynamics.simulation.arm_run import RATE as ARM_RATE
from pprs_dynamics.simulation.arm_run import simulate_arm
from pprs_dynamics.simulation.drive_control import ControlSettings
from pprs_dynamics.simulation.hidden_effects import HIDDEN_EFFECTS, RANDOM, draw_effects
from pprs_dynamics.simulation.run import DriveReference, SimulatedRun, simulate
from pprs_dynamics.simulation.sensors import SensorSettings

RATE = 500.0
NOISE = 0.08  # [N]
LONGEST = 3600.0  # [s], of an excitation: minutes of simulation, and hundreds of megabytes
FEEDFORWARDS = ('friction', 'rigid_body', 'none')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    parser.add_argument('--output', metavar='RECORDING', type=output_file(*RECORDING),
                        required=True,
                        help='.mcap, .csv, or the name of a rosbag2 folder to make')
    parser.add_argument('--effect', metavar='NAME', action='append', default=[],
                        choices=(*dict.fromkeys((*HIDDEN_EFFECTS, *ARM_EFFECTS)), RANDOM),
                        help='physics that the model does not know of, drawn from the seed; may '
                        f'be repeated: random, {", ".join(HIDDEN_EFFECTS)}; of an arm '
                        f'{", ".join(ARM_EFFECTS)}')
    parser.add_argument('--scale', type=number(0.0, 1e6), default=1.0,
                        help='multiplies the strength of the effects (default 1)')
    parser.add_argument('--seed', type=seed, default=0, help='of noise and effects (default 0)')
    parser.add_argument('--path', default='excitation',
                        help='helix, excitation, or a CSV of poses (default excitation)')
    parser.add_argument('--duration', type=number(1.0, LONGEST, 's'), default=40.0,
                        help='of an excitation [s] (default 40)')
    parser.add_argument('--path-seed', type=seed, default=0, help='of an excitation (default 0)')
    parser.add_argument('--noise', type=number(0.0, 1e3, 'N'),
                        help=f'of the efforts, standard deviation [N] (default {NOISE:g}; of an '
                        'arm [N m, N] half a percent of the largest)')
    parser.add_argument('--feedforward', choices=FEEDFORWARDS, default='friction',
                        help='what the robot is driven with (default friction)')
    parser.add_argument('--report', metavar='FILE.html', type=output_file(*PAGE),
                        help='the robot moving, as a page')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    screen = console()
    if is_mechanism(read_parameters(find_file(options.model))):
        return _run_arm(options, screen)
    model = DriveModel.load(options.model)
    motion = _motion(options)
    forces = model.drive_forces(motion)
    model.limits.check_strokes(forces.mechanism.position)
    rng = np.random.default_rng(options.seed)
    effects = draw_effects(options.effect, rng, options.scale)
    effort = {'friction': forces.total, 'rigid_body': forces.parts['rigid_body'], 'none': None}
    with progress_bar(screen, 'simulating') as progress:
        result = simulate(
            model, DriveReference(forces.mechanism.position, forces.mechanism.velocity,
                                  effort[options.feedforward]),
            effects, seed=options.seed, rate=RATE, truth=False,
            control=ControlSettings(gravity_compensation=options.feedforward == 'none'),
            sensors=SensorSettings.with_effort_noise(
                NOISE if options.noise is None else options.noise),
            progress=lambda share: progress(share, 1.0))
    write_recording(options.output, Recording.from_arrays(
        Path(options.output).name, result.time, result.position, result.velocity, result.effort))
    for note in result.notes:
        screen.print(f'[yellow]{note.time:.2f} s {note.code}[/]: {shown(note.message)}')
    if options.report:
        write_robot_page(options.report, model, motion, 'The simulated motion')
    if options.json:
        write_json(options.json, _content(options, result))
    hidden = f'{len(effects)} hidden effect{"s" * (len(effects) != 1)}'
    screen.print(f'{len(result.time)} samples at {RATE:g} Hz, {hidden}: {shown(options.output)}')
    return 0


def _run_arm(options: argparse.Namespace, screen: Any) -> int:
    """Simulate an arm along a random motion."""
    model = ArmModel.load(options.model)
    with progress_bar(screen, 'simulating') as progress:
        result = simulate_arm(
            model, options.effect, options.seed, options.scale, options.noise, options.duration,
            options.path_seed, lambda share: progress(share, 1.0))
    assert result.motion.time is not None
    write_recording(options.output, Recording.from_arrays(
        Path(options.output).name, result.motion.time, result.position, None, result.effort,
        model.drives))
    if options.json:
        write_json(options.json, {
            'recording': options.output, 'samples': len(result.position), 'rate': ARM_RATE,
            'seed': options.seed, 'effects': list(result.effects), 'notes': []})
    hidden = f'{len(result.effects)} hidden effect{"s" * (len(result.effects) != 1)}'
    screen.print(f'{len(result.position)} samples at {ARM_RATE:g} Hz, {hidden}: '
                 f'{shown(options.output)}')
    return 0


def _motion(options: argparse.Namespace) -> PlatformMotion:
    if options.path not in ('helix', 'excitation'):
        return read_poses(options.path).resampled(RATE)
    path: HelicalPath | Excitation = HelicalPath()
    if options.path == 'excitation':
        path = Excitation(duration=options.duration, seed=options.path_seed)
    return path.motion(np.arange(0.0, path.duration, 1 / RATE))


def _content(options: argparse.Namespace, result: SimulatedRun) -> dict[str, object]:
    return {'recording': options.output, 'samples': len(result.time), 'rate': RATE,
            'seed': options.seed, 'effects': result.effects,
            'notes': [{'time': note.time, 'code': note.code, 'message': note.message}
                      for note in result.notes]}
