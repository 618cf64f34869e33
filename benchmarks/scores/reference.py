# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Smallest reported change since a reference run, on an arm with forces of no catalogue.

    python -m benchmarks.scores.reference --seeds 5 --drift 0.05 --path 1

A made-up arm of two turning joints and a sliding one moves along a path, 20 s, with cables and
worn guides that pull as no effect of the catalogue does. Of each run they are otherwise by
`--drift` of themselves. One run, on path 0, is the reference; each other, on `--path`, has a
change, and noise of its own.
The table counts the runs in which the changed effect is first, is alone, and has an interval that
contains its value; and the other reported effects.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.hidden.motions import joint_motion
from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.fit.reference import Reference
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.model.drive_model import DriveModel

NOISE, DURATION = 0.2, 20.0
FORCES = np.array([2.0, 1.5, 2.5])  # [N m, N], of what no effect explains
LINK = ('<link name="{0}"><inertial><mass value="{1}"/><origin xyz="{2} 0.02 0.03"/><inertia '
        'ixx="{3}" iyy="{3}" izz="{3}" ixy="0" ixz="0" iyz="0"/></inertial></link>')
JOINT = ('<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><origin xyz="{4} 0 '
         '0.2"/><axis xyz="{5}"/><limit lower="-3" upper="3" velocity="4" effort="200"/></joint>')
URDF = ('<?xml version="1.0"?><robot name="made_up"><link name="stand"/>'
        + LINK.format('column', 6.0, 0.02, 0.08) + LINK.format('beam', 4.0, 0.2, 0.1)
        + LINK.format('slider', 1.5, 0.05, 0.01)
        + JOINT.format('turn', 'revolute', 'stand', 'column', 0.0, '0 0 1')
        + JOINT.format('swing', 'revolute', 'column', 'beam', 0.05, '0 1 0')
        + JOINT.format('reach', 'prismatic', 'beam', 'slider', 0.4, '1 0 0') + '</robot>')
MODEL = '''/**:
  ros__parameters:
    robot: {urdf: made_up.urdf, base: stand, tool: slider, drives: [turn, swing, reach]}
    friction: {viscous: [8.0, 5.0, 20.0], coulomb: [6.0, 4.0, 9.0], offset: [0.3, -0.2, 0.5]}
'''


@dataclass(frozen=True)
class Change:
    """A change of the machine: an effect with its values, and judgement of a diagnosis."""

    effect: str
    key: str
    value: float

    def model(self, base: DriveModel) -> DriveModel:
        """Return the machine after it."""
        if not self.effect:
            return base
        changed = DriveModel.from_parameters({**base.values, 'effects.active': [self.effect],
                               f'effects.{self.effect}.{self.key}': self.value}, base.source)
        return changed

    def told(self, found: Diagnosis) -> dict[str, bool]:
        """Return what is right about a diagnosis."""
        names = [effect.name for effect in found.effects]
        if not self.effect:
            return {'alone': not names and found.verdict == 'adequate'}
        first = found.effects[0] if names[:1] == [self.effect] else None
        said = first and first.parameters.get(self.key)
        return {'first': first is not None, 'alone': names == [self.effect],
                'holds': bool(said) and abs(said.value - self.value) <= 2 * said.std}


CHANGES = (Change('', '', 0.0),
           *(Change('coulomb_friction', 'swing.force', 4.0 * share)
             for share in (0.01, 0.02, 0.05, 0.1)),
           *(Change('viscous_friction', 'reach.coefficient', 20.0 * share)
             for share in (0.02, 0.05, 0.1, 0.3)),
           *(Change('payload_mass', 'mass', mass) for mass in (0.02, 0.05, 0.2)),
           *(Change('time_delay', 'turn.delay', delay) for delay in (0.0005, 0.001, 0.004)))


def unknown_forces(moved: JointMotion, drift: Array) -> Array:
    """Return what cables and worn guides do, by places and by directions at places, (N, 3)."""
    q, v = moved.position, np.tanh(moved.velocity / 0.05)
    force: Array = FORCES * ((1 + drift[0]) * np.tanh(3 * np.sin(4 * q + 1))
                             + 0.7 * (1 + drift[1]) * v * np.cos(5 * q))
    return force


def record(machine: DriveModel, seed: int, drift: float, path: int = 0) -> Recording:
    """Return a run of a machine on a path, its drift and noise of a seed."""
    moved, random = joint_motion(DURATION, seed=path), np.random.default_rng(seed)
    state = machine.initial_state(0.0)
    forces = machine.measured(machine.drive_forces(moved, state), state).total
    effort = (forces + unknown_forces(moved, drift * random.normal(size=(2, 3)))
              + NOISE * random.normal(size=forces.shape))
    assert moved.time is not None
    return Recording.from_arrays(f'run_{seed}', moved.time, moved.position, moved.velocity,
                                 effort, machine.drives)


def score(seeds: int, drift: float, path: int) -> list[dict[str, Any]]:
    """Return a row for each change: how often it is reported, and how surely."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / 'made_up.urdf').write_text(URDF)
        (Path(folder) / 'arm.yaml').write_text(MODEL)
        base = DriveModel.load(Path(folder) / 'arm.yaml')
        reference = Reference.of(base, [record(base, 0, drift)])
        rows = []
        for number, change in enumerate(CHANGES):
            counts: dict[str, float] = {}
            beside = 0
            for seed in range(seeds):
                run = record(change.model(base), 1 + number * seeds + seed, drift, path)
                found = diagnose(base, [run], reference=reference)
                for key, right in change.told(found).items():
                    counts[key] = counts.get(key, 0) + right
                beside += sum(effect.name != change.effect for effect in found.effects)
            rows.append({'change': change.effect or 'nothing', 'value': change.value,
                         **counts, 'beside': beside})
            print(' | '.join(str(value) for value in rows[-1].values()), flush=True)
        return rows


def main() -> None:
    """Run the score and print its table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seeds', type=int, default=5)
    parser.add_argument('--drift', type=float, default=0.05)
    parser.add_argument('--path', type=int, default=0)
    options = parser.parse_args(sys.argv[1:])
    print('change | value | first | alone | holds | beside')
    score(options.seeds, options.drift, options.path)


if __name__ == '__main__':
    main()
