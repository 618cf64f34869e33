# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Random parameters, valid or not, set on a feedforward node that is streaming.

    python -m benchmarks.node.reliability storm

Between any two sets the node must answer with the forces of the model that the accepted ones
make, computed here from scratch; and it must accept exactly what a model file may hold.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Float64MultiArray

from benchmarks.node.damage import valid_motion
from benchmarks.node.stream import feedforward, served
from pprs_dynamics.errors import PprsError
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.parameter_file import default_parameters
from pprs_dynamics.ros.messages.conversions import write_trajectory

EQUAL = 1e-9
KEPT_EVERY = 500  # sets
DRIVES = ('slide_1', 'lift_2')


def random_change(rng: np.random.Generator) -> dict[str, Any]:
    """Return one or more parameters to set at once; about half of them are not allowed."""
    draws: tuple[Callable[[], tuple[str, Any]], ...] = (
        lambda: ('masses.payload', float(rng.uniform(-1, 3))),
        lambda: ('masses.slides', rng.uniform(-0.2, 2, int(rng.choice([3, 3, 3, 2, 4]))).tolist()),
        lambda: ('friction.drives.coulomb', rng.uniform(-0.01, 0.2, 6).tolist()),
        lambda: ('friction.revolute.viscous', [0.01, 'much', -1.0, 0, True][int(rng.integers(5))]),
        lambda: ('friction.approach',
                 ['whole_mechanism', 'independent_chains', 'third'][int(rng.integers(3))]),
        lambda: ('friction.reversal_velocity', float(rng.choice([1e-3, 1e-2, 0.0, -1.0]))),
        lambda: ('equations', ['corrected', 'printed', ''][int(rng.integers(3))]),
        lambda: ('limits.effort', rng.uniform(-5, 200, 6).tolist()),
        lambda: ('limits.condition_number', float(rng.choice([20.0, 50.0, 0.5, np.nan, np.inf]))),
        lambda: ('gravity', [0.0, 0.0, float(rng.uniform(-12, 0))]),
        lambda: ('masses.paylod', 1.0),
        lambda: ('effects.active', [[], ['effort_offset'], ['effort_offset', 'viscous_friction'],
                                    ['effort_offset'] * 2, ['no_such_effect']][
                                        int(rng.integers(5))]),
        lambda: (f'effects.effort_offset.{DRIVES[int(rng.integers(2))]}.force',
                 float(rng.uniform(-2, 2))),
        lambda: (f'effects.viscous_friction.{DRIVES[int(rng.integers(2))]}.coefficient',
                 float(rng.uniform(0, 2))),
        lambda: ('effects.effort_offset.motor_1.force', 1.0),
        lambda: ('geometry.rod_length', float(rng.choice([0.3, 0.31, -0.3, 0.0]))),
    )
    count = int(rng.choice([1, 1, 1, 2, 4]))
    return dict(draws[int(rng.integers(len(draws)))]() for _ in range(count))


def expected_forces(values: dict[str, Any], motion: Any) -> np.ndarray | None:
    """Return the model's forces; None where it refuses the motion."""
    model = DriveModel.from_parameters(values)
    try:
        forces = model.drive_forces(motion)
        model.limits.check_strokes(forces.mechanism.position)
        model.limits.check_efforts(forces.total)
    except PprsError:
        return None
    return np.asarray(forces.total[0])


def is_model(values: dict[str, Any]) -> bool:
    """Return whether a model file may hold these values."""
    try:
        DriveModel.from_parameters(values)
    except PprsError:
        return False
    return True


def run(
    sets: int, seed: int = 0, domain: int | None = None,
    keep: Callable[[int, dict[str, Any]], None] = lambda count, found: None,
) -> dict[str, Any]:
    """Set parameters that often and return what came of it; `keep` gets it as it grows."""
    rng = np.random.default_rng(seed)
    motion = valid_motion(rng, 1)
    data = bytes(serialize_message(write_trajectory(motion, Time(), [0])))
    values, answers = default_parameters(), list[np.ndarray]()
    found = dict.fromkeys(('sets', 'accepted', 'answers', 'wrongly_accepted', 'wrongly_refused',
                           'refused_without_reason', 'wrong_answers'), 0)
    node = feedforward('command_timeout:=0.0', 'ramp_time:=0.0')
    with served(node, domain=domain) as (stream, process):
        stream.listen(Float64MultiArray, 'commands', lambda answer: answers.append(
            np.array(deserialize_message(answer, Float64MultiArray).data)))
        caller = Node('storm', context=stream.context)
        client = caller.create_client(
            SetParametersAtomically, '/feedforward/set_parameters_atomically')
        executor = SingleThreadedExecutor(context=stream.context)
        executor.add_node(caller)
        stream.connect()
        stream.wait_until(client.service_is_ready, 'the parameter service')
        old = older = expected_forces(values, motion)
        for _ in range(sets):
            change = random_change(rng)
            future = client.call_async(SetParametersAtomically.Request(parameters=[
                Parameter(name, value=value).to_parameter_msg()
                for name, value in change.items()]))
            # Messages keep coming while the node is at it: they get the old model or the new.
            answers.clear()
            stream.publish(data)
            while not future.done():
                executor.spin_once(timeout_sec=1.0)
            result, allowed = future.result().result, is_model({**values, **change})
            found['sets'] += 1
            found['accepted'] += result.successful
            found['wrongly_accepted'] += result.successful and not allowed
            found['wrongly_refused'] += allowed and not result.successful
            found['refused_without_reason'] += not (result.successful or result.reason)
            if result.successful:
                values = {**values, **change}
            new = expected_forces(values, motion) if result.successful else old
            if new is not None:
                stream.publish(data)
                certain = 1 + (old is not None)
                stream.wait_until(
                    lambda certain=certain, new=new: len(answers) >= certain
                    and _near(answers[-1], new), f'an answer by the model after {change}')
            found['answers'] += len(answers)
            # Where the last model refuses the pose, nothing tells when the answer by the one
            # before it has come.
            possible = (old, new, older if old is None else None)
            found['wrong_answers'] += sum(
                not any(_near(answer, forces) for forces in possible) for answer in answers)
            if old is not None:
                older = old
            old = new
            if found['sets'] % KEPT_EVERY == 0:
                keep(found['sets'], {**found, 'alive': process.poll() is None})
        executor.shutdown()
        caller.destroy_node()
        found['alive'] = process.poll() is None
    return found


def _near(answer: np.ndarray, forces: np.ndarray | None) -> bool:
    return forces is not None and bool(np.allclose(answer, forces, rtol=0, atol=EQUAL))


def passed(found: dict[str, Any]) -> bool:
    """Return whether nothing is wrong with what `run` found."""
    wrong = ('wrongly_accepted', 'wrongly_refused', 'refused_without_reason', 'wrong_answers')
    return bool(found['alive'] and found['answers'] and not any(found[key] for key in wrong))
