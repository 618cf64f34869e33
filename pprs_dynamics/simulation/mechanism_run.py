# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings of a simulated mechanism: MuJoCo's inverse dynamics along a motion.

Friction is that of the model file. Injected effects have equations of their own (`joint_forms`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import WorkspaceError
from pprs_dynamics.physics.effects.laws.joint_friction import ModelJointFriction
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.joint_series import JointSeries
from pprs_dynamics.physics.mechanism.passive_joints import friction_rows
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.simulation.injected_effect import InjectedEffectError, algebraic_sign, eyring
from pprs_dynamics.simulation.joint_forms import (
    CROSSED,
    FORMS,
    SIZE,
    STEEPNESS,
    JointMoment,
    ahead,
    draw_form,
    tilted,
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


def draw_motion(model: DriveModel, duration: float, seed: int, rate: float = RATE,
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


class Injected(NamedTuple):
    """The truth about an injected effect: its drives, or None; its parameters; its equation."""

    drives: list[str] | None
    parameters: dict[str, Any]
    form: str


class Injection:
    """A mechanism along a motion while effects are injected into it.

    Parameters
    ----------
    model : DriveModel
    read : JointMotion
        Motion that the encoders measure.
    random : numpy.random.Generator
        Of the sizes of effects.
    scale : float
        Multiplies these.
    climate : numpy.random.Generator
        Of temperatures.

    Attributes
    ----------
    motion : JointMotion
        Of the joints.
    rigid : (N, D) array
        Efforts without friction and before bodies are injected.
    bodies : (N, D) array
        The same with injected bodies.
    windup, lead, shift : (N, D) or (D,) arrays
        By which encoders lead their links: under load, in a clearance, at the zero.
    efforts, temperature : (N, D) arrays
    largest : (D,) array
        Largest efforts.
    passive : dict of str to (N,) array
        Efforts against injected friction of passive joints.
    truths : list of dict
        What was injected.
    """

    def __init__(self, model: DriveModel, read: JointMotion, random: np.random.Generator,
                 scale: float, climate: np.random.Generator) -> None:
        assert read.time is not None
        self.model, self.random, self.scale, self.climate = model, random, scale, climate
        self.engine, self.motion, self.time = MechanismEngine(model), read, read.time
        self.windup, self.lead = np.zeros_like(read.position), np.zeros_like(read.position)
        self.shift = np.zeros(len(model.drives))
        self.passive: dict[str, Array] = {}
        self.truths: list[dict[str, Any]] = []

    def size(self, low: float, high: float) -> float:
        """Return a random size, times the scale."""
        return self.scale * float(self.random.uniform(low, high))

    def joint_behind_first(self) -> int:
        """Return a random joint, not the first where there are others."""
        count = len(self.model.drives)
        return int(self.random.integers(min(1, count - 1), count))

    def shift_unit(self, joint: int) -> float:
        """Return the unit of a joint's zero errors and clearances [m/rad or 1]."""
        slides_in_loop = self.model.robot.structure.loops and not self.model.units[joint].turns
        return SHIFT_OF_SLIDE if slides_in_loop else 1.0

    def start_bodies(self) -> None:
        """Compute the efforts before bodies are injected."""
        self.rigid = self.engine.torques(self.motion)

    def start_gears(self) -> None:
        """Compute the efforts with injected bodies."""
        self.bodies = (self.engine.torques(self.motion, self.passive) if self.truths else
                       self.rigid)

    def start_efforts(self) -> None:
        """Compute the drives' efforts with the friction of the model, and temperatures."""
        wound = np.gradient(self.windup, self.time, axis=0)
        self.efforts = self.bodies + _own_friction(self.model, self.engine, replace(
            self.motion, velocity=self.motion.velocity + wound,
            acceleration=self.motion.acceleration + np.gradient(wound, self.time, axis=0)))
        self.largest = np.abs(self.efforts).max(axis=0)
        self.temperature = Climate.draw(self.climate, len(self.largest)).along(
            self.time, self.motion.velocity)


def simulate_mechanism(
    model: DriveModel, names: Sequence[str], seed: int, scale: float = 1.0,
    noise: float | None = None, duration: float = 40.0, path_seed: int = 0,
    progress: Callable[[float], None] | None = None, thermometers: bool = False,
    link_encoders: bool = False,
) -> MechanismRun:
    """Return a recording of a mechanism with injected effects.

    Parameters
    ----------
    model : DriveModel
        Its added effects are part of the model, not of the simulated robot.
    names : sequence of str
        Of `NAMES`, or 'random'.
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
        Whether they are recorded where no effect needs them.

    Raises
    ------
    InjectedEffectError
        For another name, or a robot that cannot have an effect.
    """
    random = np.random.default_rng(seed)
    read = draw_motion(model, duration, path_seed)
    choices = sorted((*(name for name in FORMS if able_joints(name, model, read)), 'payload_mass'))
    chosen = [str(random.choice(choices)) if name == 'random' else name for name in names]
    for name in chosen:
        if name not in NAMES:
            raise InjectedEffectError(f'{name} is no injected effect of such a robot, must be one '
                                      f'of {", ".join(NAMES)}')
    # Generators of their own, so that no other draw depends on temperatures and second encoders.
    run = Injection(model, read, random, scale, np.random.default_rng((seed, CLIMATE)))
    for share, (start, effects) in enumerate(STAGES, 1):
        start(run)
        # Forces of drives are drawn in the order in which they were named.
        for name in ([name for name in chosen if name in FORMS] if effects is FORCES else
                     [name for name in effects if name in chosen]):
            run.truths.append(truth(name, *effects[name](run)))
        if progress is not None:
            progress(share / len(STAGES))
    sigma = np.full(len(run.largest), noise) if noise is not None else 0.005 * run.largest
    beside = run.lead + run.shift
    measured = run.efforts + noise_like(random, run.efforts.shape) * sigma
    channels = {}
    if thermometers or {*chosen} & {'friction_temperature', 'current_gain'}:
        channels['temperature'] = read_thermometers(run.time, run.temperature)
    if link_encoders or 'elastic_joint' in chosen:
        second = np.random.default_rng((seed, SECOND))  # mounted at another angle
        channels['link_position'] = (
            run.motion.position + beside + second.normal(0, MOUNTED, len(run.shift))
            + ENCODER * second.uniform(-0.5, 0.5, beside.shape))
    position = read.position + beside + run.windup + ENCODER * random.uniform(
        -0.5, 0.5, beside.shape)
    return MechanismRun(run.motion, position, measured, tuple(run.truths), channels)


# ------------------------------------------------------------------------------ encoders, bodies


def _eccentric_encoder(run: Injection) -> Injected:
    """Inject an eccentric encoder, which the robot's control follows."""
    model, read, random = run.model, run.motion, run.random
    able = [j for j, unit in enumerate(model.units) if unit.turns or model.gear_ratios[j] > 1]
    if not able:
        raise InjectedEffectError('eccentric_encoder needs a joint that turns, or the gear_ratio '
                                  'of one that slides')
    j = able[int(random.integers(len(able)))]
    ratio = model.gear_ratios[j]
    # On the motor, or on the joint behind its gear.
    if ratio == 1 or (model.units[j].turns and random.random() < 0.5):
        ratio = 1.0
    beside = run.size(*(ON_JOINT if ratio == 1 else ON_MOTOR))
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
    run.motion = replace(read, position=position, velocity=velocity, acceleration=acceleration)
    return Injected([model.drives[j]], {model.drives[j]: {
        'amplitude': beside / ratio, 'phase': phase, 'pitch': 2 * np.pi / ratio}},
        'q - atan(e sin(x) / (1 + e cos(x))) / n, x = n q + phi, behind what is read as q')


def _payload_mass(run: Injection) -> Injected:
    return inject_payload(run.engine, run.size(0.05, 0.12), 0.05)


def _link_mass(run: Injection) -> Injected:
    links = links_that_weigh(run.model)
    if not links:
        raise InjectedEffectError('link_mass needs a link between the first and the tool')
    return inject_link_mass(run.engine, int(run.random.choice(links)), run.size(0.1, 0.3))


def _joint_friction(run: Injection) -> Injected:
    """Inject dry friction of a passive joint."""
    structure = run.model.robot.structure
    joints = [name for name, (row, _) in friction_rows(structure).items()
              if row >= 0 and name not in structure.drives]
    if not joints:
        raise InjectedEffectError('joint_friction needs a passive joint')
    name = str(run.random.choice(joints))
    closed, dof = run.engine.closed(run.motion), run.engine.state.dof(name)
    rate, felt = closed.velocity[:, dof], np.abs(closed.rates[:, dof]).max(axis=0)
    # As large on the drive that feels it most as an injected force on a drive is.
    d = int(np.argmax(felt))
    torque = run.scale * SIZE(run.random) * float(np.abs(run.rigid[:, d]).max()) / float(felt[d])
    run.passive[name] = torque * algebraic_sign(rate, STEEPNESS * float(np.abs(rate).max()))
    return Injected(None, {f'{name}.torque': torque}, 'T w / sqrt(w^2 + w_0^2)')


def _base_tilt(run: Injection) -> Injected:
    _require_tool(run.model, 'base_tilt')
    return inject_tilt(run.engine, run.size(0.01, 0.03))


def _external_wrench(run: Injection) -> Injected:
    _require_tool(run.model, 'external_wrench')
    friction = _own_friction(run.model, run.engine, run.motion)
    run.engine.wrench[2] = run.scale * 0.05 * float(np.abs(run.rigid + friction).max())
    return Injected(None, {'force_z': float(run.engine.wrench[2])}, 'at the tool')


def _require_tool(model: DriveModel, name: str) -> None:
    """Raise InjectedEffectError for an axis, which a force across it does not move."""
    if not model.is_described:
        raise InjectedEffectError(f'{name} does not act along a single axis: choose effort_offset')


def inject_payload(engine: MechanismEngine, share: float, ahead: float) -> Injected:
    """Hang a point of a share of the robot's mass on the tool, along its z axis [m]."""
    mass = share * float(engine.described.masses.sum())
    engine.add_payload(mass, np.array([0.0, 0.0, ahead]))
    return Injected(None, {'mass': mass}, f'a point {100 * ahead:g} cm before the tool'
                    if ahead else "a point at the tool's origin")


def inject_link_mass(engine: MechanismEngine, body: int, share: float) -> Injected:
    """Make a body heavier by a share of its mass."""
    mass = share * float(engine.described.masses[body])
    engine.add_to_link(body, mass)
    return Injected(None, {f'{engine.described.body_names[body]}.mass': mass},
                    'a point at its centre')


def inject_tilt(engine: MechanismEngine, angle: float) -> Injected:
    """Tilt the base about its x axis [rad]."""
    engine.gravity = tilted(engine.gravity, angle)
    return Injected(None, {'x': angle, 'y': 0.0}, 'about x')


# ----------------------------------------------------------------------------------------- gears


def _elastic_joint(run: Injection) -> Injected:
    """Inject a gear that winds up under load.

    A harmonic drive that stiffens, w + (w / w_1)^2 w = tau / k, and creeps: a share of it comes
    late, by a relaxation (a standard linear solid). It is in a joint that turns, where there is
    one behind the first: a slide that carries no weight would not feel it.
    """
    model, random = run.model, run.random
    later = range(min(1, len(model.drives) - 1), len(model.drives))
    joint = int(random.choice([j for j in later if model.units[j].turns] or later))
    largest = float(np.abs(run.bodies[:, joint]).max())
    span = run.size(0.02, 0.05) * run.shift_unit(joint)
    late, time = float(random.uniform(0.05, 0.2)), float(random.uniform(0.02, 0.1))
    load = run.bodies[:, joint] / largest
    kept, crept = np.exp(-float(np.median(np.diff(run.time))) / time), load.copy()
    for k in range(1, len(load)):
        crept[k] = kept * crept[k - 1] + (1 - kept) * load[k]
    felt = (1 - late) * load + late * crept
    # The real root of x + x^3 / 4 = felt, x = w / span.
    x = 4 / np.sqrt(3) * np.sinh(np.arcsinh(0.75 * np.sqrt(3) * felt) / 3)
    run.windup[:, joint] = span * x
    return Injected([model.drives[joint]], {model.drives[joint]: {
        'compliance': span / largest, 'loss': late * time}},
        'tau / tau_0 = x + x^3 / 4, x = w / w_0, a share of it late by a relaxation')


def _lost_motion(run: Injection) -> Injected:
    """Inject a clearance, crossed by the load on half of the joints whose load changes sign."""
    joint = run.joint_behind_first()
    span = run.size(0.01, 0.03) * run.shift_unit(joint)
    load = run.bodies[:, joint]
    # The link falls behind in its position alone, on which no force of an axis depends.
    by_load = bool(run.model.is_described and load.min() < -CROSSED * load.max() < 0
                   and run.random.integers(2))
    driver = load if by_load else run.motion.velocity[:, joint]
    lead = np.zeros_like(run.bodies)
    lead[:, joint] = ahead(span, driver, float(np.abs(driver).max()))
    if by_load:  # the motor moves as before, and the link falls behind it
        run.bodies = run.engine.torques(replace(
            run.motion, position=run.motion.position - lead), run.passive)
    else:
        run.lead = lead
    name = run.model.drives[joint]
    return Injected([name], {name: {'backlash' if by_load else 'play': span}},
                    'b / 2 x / sqrt(x^2 + (0.02 x_max)^2), x the load or the speed')


# --------------------------------------------------------------------------- drives, amplifiers


def _force(name: str, run: Injection) -> Injected:
    """Inject a force on one drive, or on all."""
    model, random, form = run.model, run.random, FORMS[name]
    everywhere = bool(random.random() < 0.25)
    chosen = (able_joints(name, model, run.motion) if everywhere else
              [one_able_joint(name, model, run.motion, random)])
    parameters = {}
    for j in chosen:
        moment = JointMoment.along(run.motion, j, run.bodies[:, j], run.largest[j],
                                   model.gear_ratios[j], run.temperature)
        drawn = parameters[model.drives[j]] = draw_form(name, random, moment, run.scale)
        run.efforts[:, j] += form.force(drawn, moment)
    return Injected([model.drives[j] for j in chosen], parameters, form.form)


def _coupled_drives(run: Injection) -> Injected:
    """Inject friction of a motor that moves several joints."""
    motors = run.model.robot.motors
    if not motors:
        raise InjectedEffectError('coupled_drives needs a motor that moves several joints: write '
                                  'friction: {motors: {MOTOR: {JOINT: 1.0, OTHER: 1.0}}}')
    name = str(run.random.choice(sorted(motors)))
    row = np.array(motors[name])
    speed = run.motion.velocity @ row
    top = float(np.abs(speed).max())
    # As large on the joint that feels it most as an injected force on a drive is.
    felt = float(np.min(run.largest[row != 0] / np.abs(row[row != 0])))
    dry, viscous = (run.scale * SIZE(run.random) * felt for _ in range(2))
    friction = (dry * algebraic_sign(speed, STEEPNESS * top)
                + viscous * eyring(speed, 2 * top) / top)
    run.efforts += np.outer(friction, row)
    return Injected(None, {f'{name}.coulomb': dry, f'{name}.viscous': viscous / top},
                    "A' (F v / sqrt(v^2 + w^2) + c v_1 asinh(v / v_1)), v the speed of the motor")


def _effort_gain(run: Injection) -> Injected:
    joint = int(run.random.integers(len(run.model.drives)))
    gain = run.size(0.04, 0.1)
    run.efforts[:, joint] *= 1 + gain
    return Injected([run.model.drives[joint]], {'gain': gain}, '1 + gain')


def _current_gain(run: Injection) -> Injected:
    """Inject a torque constant that changes with the motor's temperature or angle."""
    model, random = run.model, run.random
    j = int(random.integers(len(model.drives)))
    ratio = model.gear_ratios[j]
    if ratio > 1 and random.random() < 0.5:
        height, waves = run.size(0.03, 0.08), int(random.integers(1, 7))
        phase = float(random.uniform(-np.pi, np.pi))
        turn = waves * ratio * run.motion.position[:, j] + phase
        constant = 1 + height * (np.sin(turn) + 0.2 * np.sin(3 * turn))
        parameters = {'ripple': height, 'phase': phase, 'pitch': 2 * np.pi / (waves * ratio)}
        form = 'F / (1 + a (sin(x) + sin(3 x) / 5)), x = 2 pi q / p + phi'
    else:
        weaker = run.size(0.0015, 0.003)
        reference = float(random.uniform(*REFERENCE))
        warmer = run.temperature[:, j] - reference
        constant = 1 - weaker * warmer * (1 + warmer / 300)
        parameters = {'temperature': weaker, 'reference': reference}
        form = 'F / (1 - kappa (T - T_0) (1 + (T - T_0) / 300 K))'
    run.efforts[:, j] /= constant
    return Injected([model.drives[j]], {model.drives[j]: parameters}, form)


def _time_delay(run: Injection) -> Injected:
    delay = run.size(0.008, 0.03)
    run.efforts = np.stack([np.interp(run.time - delay, run.time, column)
                            for column in run.efforts.T], axis=1)
    return Injected(list(run.model.drives), {'delay': delay}, 'all efforts late')


def _effort_filter(run: Injection) -> Injected:
    time_constant = run.size(0.01, 0.04)
    run.efforts = ButterworthFilter(np.full(len(run.largest), time_constant), float(
        np.median(np.diff(run.time)))).samples(run.efforts)
    return Injected(list(run.model.drives), {'time_constant': time_constant}, EffortFilter.form)


def _homing_error(run: Injection) -> Injected:
    joint = run.joint_behind_first()
    run.shift[joint] = run.size(0.01, 0.03) * run.shift_unit(joint)
    name = run.model.drives[joint]
    return Injected([name], {name: {'zero': float(run.shift[joint])}}, 'positions shifted')


Effects = Mapping[str, Callable[[Injection], Injected]]
FORCES: Effects = {name: partial(_force, name) for name in FORMS}
# What is computed before, and the effects that it does not contain yet.
STAGES: tuple[tuple[Callable[[Injection], None], Effects], ...] = (
    (lambda run: None, {'eccentric_encoder': _eccentric_encoder}),
    (Injection.start_bodies, {
        'payload_mass': _payload_mass, 'link_mass': _link_mass, 'joint_friction': _joint_friction,
        'base_tilt': _base_tilt, 'external_wrench': _external_wrench}),
    (Injection.start_gears, {'elastic_joint': _elastic_joint, 'lost_motion': _lost_motion}),
    (Injection.start_efforts, FORCES),
    (lambda run: None, {
        'coupled_drives': _coupled_drives, 'effort_gain': _effort_gain,
        'current_gain': _current_gain, 'time_delay': _time_delay, 'effort_filter': _effort_filter,
        'homing_error': _homing_error}))
NAMES = tuple(sorted((name for _, effects in STAGES for name in effects),
                     key=lambda name: name not in FORMS))


def _own_friction(model: DriveModel, engine: MechanismEngine, motion: JointMotion) -> Array:
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


def links_that_weigh(model: DriveModel) -> list[int]:
    """Return the links whose mass can be hidden.

    What turns about an upright axis shows in no weight, and the last link is the payload's.
    """
    return [j for j in range(len(model.robot.bodies)) if j != model.robot.carrier
            and (j or model.robot.structure.loops)]


def able_joints(name: str, model: DriveModel, motion: JointMotion) -> list[int]:
    """Return the joints that a hidden force can act in along a motion."""
    turn, stroke = FORMS[name].needs_turn, np.ptp(motion.position, axis=0)
    return [j for j, unit in enumerate(model.units)
            if not turn or (unit.turns and stroke[j] >= turn)]


def one_able_joint(name: str, model: DriveModel, motion: JointMotion,
                   random: np.random.Generator) -> int:
    """Return one of the joints that a hidden force can act in along a motion."""
    able = able_joints(name, model, motion)
    if not able:
        raise InjectedEffectError(f'{name} needs a joint that turns by '
                                f'{FORMS[name].needs_turn:g} rad')
    return able[int(random.integers(len(able)))]


def noise_like(random: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Return noise of unit variance, part of it correlated from sample to sample."""
    from scipy.signal import lfilter

    white = random.normal(size=shape)
    slow: Array = lfilter([np.sqrt(1 - CORRELATION ** 2)], [1, -CORRELATION],
                          random.normal(size=shape), axis=0)
    return np.sqrt(1 - COLOURED) * white + np.sqrt(COLOURED) * slow
