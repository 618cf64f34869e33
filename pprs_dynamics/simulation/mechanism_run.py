# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings of a simulated mechanism: MuJoCo's inverse dynamics along a motion.

Friction is that of the model file. Injected effects have equations of their own (`joint_forms`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import WorkspaceError
from pprs_dynamics.physics.effects.laws.joint_friction import ModelJointFriction
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.joint_series import JointSeries
from pprs_dynamics.physics.mechanism.passive_joints import friction_rows
from pprs_dynamics.physics.model.mechanism_model import MechanismModel
from pprs_dynamics.simulation.injected_effect import InjectedEffectError
from pprs_dynamics.simulation.joint_forms import (
    CROSSED,
    FORMS,
    SIZE,
    STEEPNESS,
    JointMoment,
    ahead,
    draw_form,
    require_known,
    truth,
)
from pprs_dynamics.simulation.mechanism_engine import MechanismEngine
from pprs_dynamics.simulation.sensors import ButterworthFilter, EffortFilter
from pprs_dynamics.simulation.temperatures import REFERENCE, Climate, read_thermometers

RATE = 100.0  # [Hz]
CLIMATE, SECOND = 45, 46  # second seeds: of temperatures, of second encoders
MOUNTED = 0.01  # [rad, m], by which second encoders have other zeros
HARMONICS = 8
FASTEST, WIDEST = 0.35, 1.5  # of the top speed; from the middle of the range [rad, m]
QUICKEST = 3.0  # [rad/s^2, m/s^2]
SHIFT_OF_SLIDE = 0.1  # [m/rad], zero errors of a robot's legs over those of turning joints
# Of an encoder's radius, beside its axis; and the step for derivatives [rad].
ON_JOINT, ON_MOTOR = (0.01, 0.03), (0.02, 0.08)
ANGLE_STEP = 1e-3
SHRINK, SHRINKS = 0.8, 20  # of a motion until its loops close throughout
ENCODER = 2e-5  # [rad, m]
COLOURED, CORRELATION = 0.36, 0.95  # share of the noise's variance, and from sample to sample


@dataclass(frozen=True)
class MechanismRun:
    """A simulated recording.

    Parameters
    ----------
    motion : JointMotion
    position, effort : (N, n) arrays
        As measured.
    effects : tuple of dict
        What was hidden.
    channels : mapping of str to (N, n) array
        What thermometers say, where temperature matters, and second encoders.
    """

    motion: JointMotion
    position: Array
    effort: Array
    effects: tuple[dict[str, Any], ...]
    channels: Mapping[str, Array]


def draw_motion(model: MechanismModel, duration: float, seed: int, rate: float = RATE,
                ) -> JointMotion:
    """Return a random Fourier series of all drives within their limits and the workspace.

    It begins and ends at rest, in the middle of the drives' room; see `Structure.room`.
    """
    structure, random = model.robot.structure, np.random.default_rng(seed)
    middle, room = structure.room(np.pi)
    reach = np.minimum(0.9 * room, WIDEST)
    shape = random.normal(size=(len(model.drives), JointSeries.size(HARMONICS)))
    time = np.arange(0.0, duration, 1 / rate)
    raw = JointSeries(shape, middle, duration, HARMONICS)
    motion = raw.motion(time)
    top = np.where(np.isfinite(structure.speed), structure.speed, np.pi)
    uses = np.max([np.abs(values).max(axis=0) / bound for values, bound in (
        (motion.position - raw.middle, reach), (motion.velocity, FASTEST * top),
        (motion.acceleration, QUICKEST))], axis=0)
    for _ in range(SHRINKS):
        motion = JointSeries(shape / uses[:, None], raw.middle, duration, HARMONICS).motion(time)
        try:
            model.robot.at(motion.position, motion.velocity, motion.acceleration)
        except WorkspaceError:
            uses = uses / SHRINK
        else:
            return motion
    raise InjectedEffectError('no motion about home stays within the workspace')


def simulate_mechanism(model: MechanismModel, names: Sequence[str], seed: int, scale: float = 1.0,
                 noise: float | None = None, duration: float = 40.0, path_seed: int = 0,
                 progress: Callable[[float], None] | None = None, thermometers: bool = False,
                 link_encoders: bool = False) -> MechanismRun:
    """Return a recording of an arm with hidden effects.

    Parameters
    ----------
    model : MechanismModel
        Its added effects are part of the model, not of the arm.
    names : sequence of str
        Of `joint_forms.NAMES`, or 'random'.
    seed : int
        Of effects and noise.
    scale : float
        Multiplies the size of effects.
    noise : float, optional
        Standard deviation of all efforts [N m, N]; by default half a percent of the largest.
    duration : float
        [s]
    path_seed : int
        Of the motion.
    progress : callable, optional
    thermometers, link_encoders : bool
        Whether they take part where no effect needs them.

    Raises
    ------
    InjectedEffectError
        For another name.
    """
    random = np.random.default_rng(seed)
    motion = read = draw_motion(model, duration, path_seed)
    choices = sorted((*(name for name in FORMS if able_joints(name, model, motion)),
                      'payload_mass'))
    chosen = tuple(str(random.choice(choices)) if name == 'random' else name for name in names)
    require_known(chosen)
    engine = MechanismEngine(model)
    if progress is not None:
        progress(0.1)
    hidden: list[dict[str, Any]] = []
    if 'eccentric_encoder' in chosen:
        motion, drawn = _behind_encoder(model, read, random, scale)
        hidden.append(drawn)
    plain = engine.torques(motion)
    if 'payload_mass' in chosen:
        hidden.append(engine.hide_payload(random, scale, 0.05))
    if 'link_mass' in chosen:
        links = links_that_weigh(model)
        if not links:
            raise InjectedEffectError('link_mass needs a link between the first and the tool')
        hidden.append(engine.hide_link_mass(random, scale, links))
    passive = {}
    if 'joint_friction' in chosen:
        name, effort, parameters = _hidden_joint(model, engine, motion, plain, random, scale)
        passive[name] = effort
        hidden.append(truth('joint_friction', None, {
            f'{name}.{key}': value for key, value in parameters.items()},
                            'T w / sqrt(w^2 + w_0^2)'))
    if 'base_tilt' in chosen:
        hidden.append(engine.hide_tilt(random, scale))
    largest = np.abs(plain + _own_friction(model, engine, motion)).max(axis=0)
    if 'external_wrench' in chosen:
        engine.wrench[2] = scale * 0.05 * float(largest.max())
        hidden.append(truth('external_wrench', None, {'force_z': float(engine.wrench[2])},
                            'at the tool'))
    bodies = engine.torques(motion, passive) if hidden else plain
    windup = np.zeros_like(bodies)
    if 'elastic_joint' in chosen:
        windup, drawn = _wind_up(model, motion, bodies, random, scale)
        hidden.append(drawn)
    lead = np.zeros_like(motion.position)
    if 'lost_motion' in chosen:
        by_load, lead, drawn = _lost_motion(model, motion, bodies, random, scale)
        hidden.append(drawn)
        if by_load:  # the motor goes on as before, and the link falls behind it
            bodies = engine.torques(replace(motion, position=motion.position - lead), passive)
            lead = np.zeros_like(lead)
    if progress is not None:
        progress(0.8)
    assert motion.time is not None
    wound = np.gradient(windup, motion.time, axis=0)
    efforts = bodies + _own_friction(model, engine, replace(
        motion, velocity=motion.velocity + wound,
        acceleration=motion.acceleration + np.gradient(wound, motion.time, axis=0)))
    largest = np.abs(efforts).max(axis=0)
    # Random numbers of its own, so that what else is drawn does not depend on the weather.
    temperature = Climate.draw(np.random.default_rng((seed, CLIMATE)), len(largest)).along(
        motion.time, motion.velocity)
    for name in chosen:
        if name in FORMS:
            hidden.append(_add(name, model, motion, bodies, largest, efforts, random,
                               scale, temperature))
    if 'coupled_drives' in chosen:
        hidden.append(_hide_motor_friction(model, motion, largest, efforts, random, scale))
    if 'effort_gain' in chosen:
        joint = int(random.integers(len(model.drives)))
        gain = scale * float(random.uniform(0.04, 0.1))
        efforts[:, joint] *= 1 + gain
        hidden.append(truth('effort_gain', [model.drives[joint]], {'gain': gain}, '1 + gain'))
    if 'current_gain' in chosen:
        hidden.append(_hide_current_gain(model, motion, temperature, efforts, random, scale))
    if 'time_delay' in chosen:
        assert motion.time is not None
        delay = scale * float(random.uniform(0.008, 0.03))
        efforts = np.stack([np.interp(motion.time - delay, motion.time, column)
                            for column in efforts.T], axis=1)
        hidden.append(truth('time_delay', list(model.drives), {'delay': delay}, 'all efforts late'))
    if 'effort_filter' in chosen:
        assert motion.time is not None
        time_constant = scale * float(random.uniform(0.01, 0.04))
        every = np.full(len(largest), time_constant)
        efforts = ButterworthFilter(every, float(np.median(np.diff(motion.time)))).samples(efforts)
        hidden.append(truth('effort_filter', list(model.drives), {'time_constant': time_constant},
                            EffortFilter.form))
    shift = np.zeros(len(largest))
    if 'homing_error' in chosen:
        joint = int(random.integers(1, len(model.drives)))
        slides_in_loop = model.robot.structure.loops and not model.units[joint].turns
        unit = SHIFT_OF_SLIDE if slides_in_loop else 1.0
        shift[joint] = scale * unit * float(random.uniform(0.01, 0.03))
        hidden.append(truth('homing_error', [model.drives[joint]], {
            model.drives[joint]: {'zero': float(shift[joint])}}, 'positions shifted'))
    sigma = np.full(len(largest), noise) if noise is not None else 0.005 * largest
    beside = lead + shift
    measured = efforts + noise_like(random, efforts.shape) * sigma
    channels = {}
    if thermometers or {*chosen} & {'friction_temperature', 'current_gain'}:
        channels['temperature'] = read_thermometers(motion.time, temperature)
    if link_encoders or 'elastic_joint' in chosen:
        second = np.random.default_rng((seed, SECOND))  # not mounted at quite the same angle
        channels['link_position'] = (
            motion.position + beside + second.normal(0, MOUNTED, len(largest))
            + ENCODER * second.uniform(-0.5, 0.5, beside.shape))
    position = read.position + beside + windup + ENCODER * random.uniform(
        -0.5, 0.5, beside.shape)
    return MechanismRun(motion, position, measured, tuple(hidden), channels)


def _wind_up(model: MechanismModel, motion: JointMotion, loads: Array, random: np.random.Generator,
             scale: float) -> tuple[Array, dict[str, Any]]:
    """Return by how much a motor leads its link because of its load, (N, D), and how.

    A harmonic drive that stiffens, w + (w / w_1)^2 w = tau / k, and creeps: a share of it comes
    late, by a relaxation (a standard linear solid). It is in a joint that turns, where there is
    one behind the first: a slide that carries no weight would not feel it.
    """
    later = range(1, len(model.drives))
    joint = int(random.choice([j for j in later if model.units[j].turns] or later))
    slides_in_loop = model.robot.structure.loops and not model.units[joint].turns
    largest = float(np.abs(loads[:, joint]).max())
    span = scale * float(random.uniform(0.02, 0.05)) * (SHIFT_OF_SLIDE if slides_in_loop else 1.0)
    late, time = float(random.uniform(0.05, 0.2)), float(random.uniform(0.02, 0.1))
    assert motion.time is not None
    step = float(np.median(np.diff(motion.time)))
    load = loads[:, joint] / largest
    kept, crept = np.exp(-step / time), load.copy()
    for k in range(1, len(load)):
        crept[k] = kept * crept[k - 1] + (1 - kept) * load[k]
    felt = (1 - late) * load + late * crept
    # The real root of x + x^3 / 4 = felt, x = w / span.
    x = 4 / np.sqrt(3) * np.sinh(np.arcsinh(0.75 * np.sqrt(3) * felt) / 3)
    windup = np.zeros_like(loads)
    windup[:, joint] = span * x
    return windup, truth(
        'elastic_joint', [model.drives[joint]], {model.drives[joint]: {
            'compliance': span / largest, 'loss': late * time}},
        'tau / tau_0 = x + x^3 / 4, x = w / w_0, a share of it late by a relaxation')


def _behind_encoder(model: MechanismModel, read: JointMotion, random: np.random.Generator,
                    scale: float) -> tuple[JointMotion, dict[str, Any]]:
    """Return the motion of an arm with one eccentric encoder, and the truth about it.

    Its control follows what the encoders say.
    """
    able = [j for j, unit in enumerate(model.units) if unit.turns or model.gear_ratios[j] > 1]
    if not able:
        raise InjectedEffectError('eccentric_encoder needs a joint that turns, or the gear_ratio '
                                  'of one that slides')
    j = able[int(random.integers(len(able)))]
    ratio = model.gear_ratios[j]
    # On the motor, or on the joint behind its gear.
    if ratio == 1 or (model.units[j].turns and random.random() < 0.5):
        ratio = 1.0
    beside = scale * float(random.uniform(*(ON_JOINT if ratio == 1 else ON_MOTOR)))
    phase = float(random.uniform(-np.pi, np.pi))

    def behind(q: Array) -> Array:
        """Return the angles of the disc, of radius 1, of which the head reads q."""
        x = ratio * q + phase
        found: Array = q - np.arctan2(beside * np.sin(x), 1 + beside * np.cos(x)) / ratio
        return found

    position, velocity, acceleration = (
        np.array(values) for values in (read.position, read.velocity, read.acceleration))
    q, v, step = read.position[:, j], read.velocity[:, j], ANGLE_STEP / ratio
    before, at, after = (behind(q + move) for move in (-step, 0.0, step))
    slope = (after - before) / (2 * step)
    position[:, j], velocity[:, j] = at, slope * v
    acceleration[:, j] = (slope * read.acceleration[:, j]
                          + (after - 2 * at + before) / step ** 2 * v ** 2)
    moved = replace(read, position=position, velocity=velocity, acceleration=acceleration)
    return moved, truth('eccentric_encoder', [model.drives[j]], {model.drives[j]: {
        'amplitude': beside / ratio, 'phase': phase, 'pitch': 2 * np.pi / ratio}},
        'q - atan(e sin(x) / (1 + e cos(x))) / n, x = n q + phi, behind what is read as q')


def _lost_motion(model: MechanismModel, motion: JointMotion, loads: Array,
                 random: np.random.Generator, scale: float) -> tuple[bool, Array, dict[str, Any]]:
    """Return whether loads drive a clearance, by how much its encoder leads (N, D), and how.

    They do on half of the joints of which the load changes sign.
    """
    joint = int(random.integers(1, len(model.drives)))
    slides_in_loop = model.robot.structure.loops and not model.units[joint].turns
    span = scale * float(random.uniform(0.01, 0.03)) * (SHIFT_OF_SLIDE if slides_in_loop else 1.0)
    load = loads[:, joint]
    by_load = bool(load.min() < -CROSSED * load.max() < 0) and bool(random.integers(2))
    driver = load if by_load else motion.velocity[:, joint]
    lead = np.zeros_like(loads)
    lead[:, joint] = ahead(span, driver, float(np.abs(driver).max()))
    return by_load, lead, truth(
        'lost_motion', [model.drives[joint]],
        {model.drives[joint]: {'backlash' if by_load else 'play': span}},
        'b / 2 x / sqrt(x^2 + (0.02 x_max)^2), x the load or the speed')


def _hidden_joint(model: MechanismModel, engine: MechanismEngine, motion: JointMotion, plain: Array,
                  random: np.random.Generator, scale: float,
                  ) -> tuple[str, Array, dict[str, float]]:
    """Return dry friction of a passive joint: its name, efforts against it (N,), and size."""
    structure = model.robot.structure
    joints = [name for name, (row, _) in friction_rows(structure).items()
              if row >= 0 and name not in structure.drives]
    if not joints:
        raise InjectedEffectError('joint_friction needs a passive joint')
    name = str(random.choice(joints))
    closed, dof = engine.closed(motion), engine.state.dof(name)
    rate, felt = closed.velocity[:, dof], np.abs(closed.rates[:, dof]).max(axis=0)
    # As large on the drive that feels it most as a hidden force on a drive is.
    d = int(np.argmax(felt))
    torque = scale * SIZE(random) * float(np.abs(plain[:, d]).max()) / float(felt[d])
    width = STEEPNESS * float(np.abs(rate).max())
    return name, torque * rate / np.sqrt(rate ** 2 + width ** 2), {'torque': torque}


def _hide_motor_friction(model: MechanismModel, motion: JointMotion, largest: Array, efforts: Array,
                         random: np.random.Generator, scale: float) -> dict[str, Any]:
    """Let a motor rub that moves several joints, and return how."""
    motors = model.robot.motors
    if not motors:
        raise InjectedEffectError('coupled_drives needs a motor that moves several joints: write '
                                'friction: {motors: {MOTOR: {JOINT: 1.0, OTHER: 1.0}}}')
    name = str(random.choice(sorted(motors)))
    row = np.array(motors[name])
    speed = motion.velocity @ row
    top = float(np.abs(speed).max())
    # As large on the joint that feels it most as a hidden force on a drive is.
    felt = float(np.min(largest[row != 0] / np.abs(row[row != 0])))
    dry, viscous = (scale * SIZE(random) * felt for _ in range(2))
    friction = (dry * speed / np.hypot(speed, STEEPNESS * top)
                + viscous * 2 * np.arcsinh(speed / (2 * top)))
    efforts += np.outer(friction, row)
    return truth('coupled_drives', None, {
        f'{name}.coulomb': dry, f'{name}.viscous': viscous / top},
        "A' (F v / sqrt(v^2 + w^2) + c v_1 asinh(v / v_1)), v the speed of the motor")


def _hide_current_gain(model: MechanismModel, motion: JointMotion, temperature: Array,
                       efforts: Array, random: np.random.Generator, scale: float) -> dict[str, Any]:
    """Let a motor's torque per current go with its temperature or its angle, and return how."""
    j = int(random.integers(len(model.drives)))
    ratio = model.gear_ratios[j]
    if ratio > 1 and random.random() < 0.5:
        height, waves = scale * float(random.uniform(0.03, 0.08)), int(random.integers(1, 7))
        phase = float(random.uniform(-np.pi, np.pi))
        turn = waves * ratio * motion.position[:, j] + phase
        constant = 1 + height * (np.sin(turn) + 0.2 * np.sin(3 * turn))
        parameters = {'ripple': height, 'phase': phase, 'pitch': 2 * np.pi / (waves * ratio)}
        form = 'F / (1 + a (sin(x) + sin(3 x) / 5)), x = 2 pi q / p + phi'
    else:
        weaker = scale * float(random.uniform(0.0015, 0.003))
        reference = float(random.uniform(*REFERENCE))
        warmer = temperature[:, j] - reference
        constant = 1 - weaker * warmer * (1 + warmer / 300)
        parameters = {'temperature': weaker, 'reference': reference}
        form = 'F / (1 - kappa (T - T_0) (1 + (T - T_0) / 300 K))'
    efforts[:, j] /= constant
    return truth('current_gain', [model.drives[j]], {model.drives[j]: parameters}, form)


def _own_friction(model: MechanismModel, engine: MechanismEngine, motion: JointMotion) -> Array:
    """Return friction, offset and armature as the model file has them, under the true loads."""
    v = motion.velocity
    friction: Array = (
        model.robot.armature * motion.acceleration + np.asarray(model.friction.viscous) * v
        + np.asarray(model.friction.coulomb) * np.tanh(v / np.asarray(model.reversal.velocity))
        + np.asarray(model.offset.value))
    for effect in model.effects:
        if isinstance(effect, ModelJointFriction):
            friction = friction + engine.joint_friction(
                motion, effect.table(model.robot, model.reversal))
    return friction


def links_that_weigh(model: MechanismModel) -> list[int]:
    """Return the links whose mass can be hidden.

    What turns about an upright axis shows in no weight, and the last link is the payload's.
    """
    return [j for j in range(len(model.robot.bodies)) if j != model.robot.carrier
            and (j or model.robot.structure.loops)]


def able_joints(name: str, model: MechanismModel, motion: JointMotion) -> list[int]:
    """Return the joints that a hidden force can act in along a motion."""
    turn, stroke = FORMS[name].needs_turn, np.ptp(motion.position, axis=0)
    return [j for j, unit in enumerate(model.units)
            if not turn or (unit.turns and stroke[j] >= turn)]


def one_able_joint(name: str, model: MechanismModel, motion: JointMotion,
                   random: np.random.Generator) -> int:
    """Return one of the joints that a hidden force can act in along a motion."""
    able = able_joints(name, model, motion)
    if not able:
        raise InjectedEffectError(f'{name} needs a joint that turns by '
                                f'{FORMS[name].needs_turn:g} rad')
    return able[int(random.integers(len(able)))]


def _add(name: str, model: MechanismModel, motion: JointMotion, load: Array, largest: Array,
         efforts: Array, random: np.random.Generator, scale: float, temperature: Array,
         ) -> dict[str, Any]:
    """Add a hidden force on one joint, or on all, and return what it is."""
    form, drives = FORMS[name], model.drives
    everywhere = bool(random.random() < 0.25)
    one = one_able_joint(name, model, motion, random) if not everywhere else None
    chosen = able_joints(name, model, motion) if one is None else [one]
    parameters = {}
    for j in chosen:
        moment = JointMoment.along(motion, j, load[:, j], largest[j], model.gear_ratios[j],
                                   temperature)
        drawn = draw_form(name, random, moment, scale)
        efforts[:, j] += form.force(drawn, moment)
        parameters[drives[j]] = drawn
    return truth(name, [drives[j] for j in chosen], parameters, form.form)


def noise_like(random: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Return noise of unit variance, part of it correlated from sample to sample."""
    from scipy.signal import lfilter

    white = random.normal(size=shape)
    slow: Array = lfilter([np.sqrt(1 - CORRELATION ** 2)], [1, -CORRELATION],
                          random.normal(size=shape), axis=0)
    return np.sqrt(1 - COLOURED) * white + np.sqrt(COLOURED) * slow
