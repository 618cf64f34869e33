# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Effects injected into a robot along a motion: MuJoCo's inverse dynamics and sensor faults.

Friction is that of the model file. Injected effects have equations of their own
(`injected_forms`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import WorkspaceError, suggestion
from pprs_dynamics.physics.effects.laws.joint_friction import ModelJointFriction
from pprs_dynamics.physics.mechanism.description import body_at
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion, JointSeries
from pprs_dynamics.physics.mechanism.state import SLIDE
from pprs_dynamics.physics.mechanism.tree_equations import JointFriction
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.simulation.engine import MechanismEngine
from pprs_dynamics.simulation.injected_forms import (
    CROSSED,
    FORMS,
    REFERENCE,
    SIZE,
    STEEPNESS,
    UNKNOWN,
    InjectedEffectError,
    JointMoment,
    algebraic_sign,
    draw_form,
    draw_temperatures,
    eyring,
    read_thermometers,
)

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
PICK_UP_TIME = 0.2  # [s], in which the tool takes the weight of a payload
LEAST_SPEED = 1e-6  # [m/s] of a tool, below which it is on the axes of all joints
RANDOM = 'random'


@dataclass(frozen=True)
class MechanismRun:
    """A simulated recording.

    Parameters
    ----------
    motion : JointMotion
    position, effort : (N, n) arrays
        As measured.
    effects : tuple of dict
        What was injected.
    channels : mapping of str to (N, n) array
        Readings of thermometers, where temperature matters, and of second encoders.
    """

    motion: JointMotion
    position: Array
    effort: Array
    effects: tuple[dict[str, Any], ...]
    channels: Mapping[str, Array]


def draw_motion(model: DriveModel, duration: float, seed: int, rate: float = RATE) -> JointMotion:
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


# The truth about an injected effect: its drives, or None, and its parameters.
Injected = tuple[list[str] | None, dict[str, Any]]


@dataclass
class Choice:
    """An effect to inject.

    Parameters
    ----------
    name : str
    random : numpy.random.Generator
        Of its sizes.
    scale : float
        Multiplies these.
    drives : tuple of str
        Where given; else they are drawn.
    sizes : dict, optional
        Drawn by the first injection, for the motion there; later injections take the same.
    """

    name: str
    random: np.random.Generator
    scale: float = 1.0
    drives: tuple[str, ...] = ()
    sizes: dict[str, Any] | None = None

    def require(self, names: Sequence[str], drives: Sequence[str]) -> None:
        """Raise InjectedEffectError for a name that is not among some, or other drives."""
        if self.name not in names:
            raise InjectedEffectError(
                f'{self.name} cannot be injected here{suggestion(self.name, names)}, '
                f'must be one of {", ".join(names)}')
        wrong = [drive for drive in self.drives
                 if self.name in NOT_IN_DRIVES or drive not in drives]
        if wrong:
            raise InjectedEffectError(f'{self.name} does not act in {wrong[0]!r}')


class PlainRobot:
    """A robot along a motion without injected effects.

    Parameters
    ----------
    model : DriveModel
    motion : JointMotion
        Of the drives.
    rounds : int
        1: friction follows loads without friction, as in the model; more: with friction.

    Attributes
    ----------
    closed : EngineMotion
        The motion with closed loops.
    carried : Carried
        Inverse dynamics of the bodies.
    friction, effort : (N, D) arrays
        Efforts of friction, offset and armature; all efforts of the drives.
    """

    def __init__(self, model: DriveModel, motion: JointMotion, rounds: int = 1) -> None:
        self.model, self.motion, self.rounds = model, motion, rounds
        self.engine = MechanismEngine(model)
        self.closed = self.engine.closed(motion)
        self.carried = self.engine.carried(self.closed)
        self.friction = own_friction(model, self.engine, motion, rounds)
        self.effort = self.carried.efforts + self.friction


class Injecting:
    """A robot while one effect is injected into it.

    Attributes
    ----------
    model : DriveModel
    engine : MechanismEngine
    choice : Choice
        The effect.
    random : numpy.random.Generator
        Of its sizes.
    scale : float
        Multiplies these.
    """

    model: DriveModel
    engine: MechanismEngine
    choice: Choice
    random: np.random.Generator
    scale: float

    @property
    def given(self) -> list[int]:
        """Numbers of the drives that are given with the effect."""
        return [self.model.drives.index(name) for name in self.choice.drives]

    def sizes(self, draw: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """Return the sizes of the effect, drawn where it is injected for the first time."""
        if self.choice.sizes is None:
            self.choice.sizes = draw()
        return self.choice.sizes

    def size(self, low: float, high: float) -> float:
        """Return a random size, times the scale."""
        return self.scale * float(self.random.uniform(low, high))

    def inject_one(self, choice: Choice, effect: Callable[[Any], Injected]) -> dict[str, Any]:
        """Inject an effect and return its true parameters."""
        self.choice, self.random, self.scale = choice, choice.random, choice.scale
        drives, parameters = effect(self)
        return {'name': choice.name, 'drives': drives, 'parameters': parameters}


class Injection(Injecting):
    """A robot along a motion while effects are injected into it.

    Parameters
    ----------
    plain : PlainRobot
        Its motion is what the encoders measure.
    choices : sequence of Choice
    climate : numpy.random.Generator
        Of temperatures.
    progress : callable, optional
        Called with the share that is done.

    Attributes
    ----------
    motion : JointMotion
        Of the joints.
    bodies, efforts, temperature : (N, D) arrays
        Efforts without friction but with injected bodies; measured efforts without noise.
    windup, lead, shift : (N, D) or (D,) arrays
        By which encoders lead their links: under load, in a clearance, at the zero.
    largest : (D,) array
        Largest efforts.
    passive : (N, nv) array
        Efforts of the tree's joints against injected forces in passive joints.
    truths : list of dict
        What was injected.

    Raises
    ------
    InjectedEffectError
        For another name, or a robot that cannot have an effect.
    """

    def __init__(self, plain: PlainRobot, choices: Sequence[Choice], climate: np.random.Generator,
                 progress: Callable[[float], None] | None = None) -> None:
        assert plain.motion.time is not None
        self.plain, self.model, self.climate = plain, plain.model, climate
        self.motion, self.time = plain.motion, plain.motion.time
        self.engine = plain.engine
        self.engine.reset()  # of what was injected before
        self.windup, self.lead = (np.zeros_like(plain.motion.position) for _ in range(2))
        self.shift = np.zeros(len(self.model.drives))
        self.passive = np.zeros_like(plain.closed.velocity)
        self.picked: tuple[Array, Array] | None = None
        self.truths: list[dict[str, Any]] = []
        for choice in choices:
            choice.require(NAMES, self.model.drives)
        for share, (start, effects) in enumerate(STAGES, 1):
            start(self)
            # Forces of drives are drawn in the order in which they were named.
            for choice in sorted((drawn for drawn in choices if drawn.name in effects),
                                 key=lambda drawn: 0 if effects is FORCES
                                 else list(effects).index(drawn.name)):
                self.truths.append(self.inject_one(choice, effects[choice.name]))
            if progress is not None:
                progress(share / len(STAGES))

    def joint(self, least: int = 0) -> int:
        """Return the given drive, or a random one from a number on where there are others."""
        count = len(self.model.drives)
        drawn = int(self.random.integers(min(least, count - 1), count))
        return self.given[0] if self.given else drawn

    def shift_unit(self, joint: int) -> float:
        """Return the unit of a joint's zero errors and clearances [m/rad or 1]."""
        slides_in_loop = self.model.robot.structure.loops and not self.model.units[joint].turns
        return SHIFT_OF_SLIDE if slides_in_loop else 1.0

    def share_of_largest(self, rates: Array) -> float:
        """Return a force in the structure that a drive feels like an injected force on a drive.

        Parameters
        ----------
        rates : (N, D) array
            Motion of the structure per motion of each drive.
        """
        felt = np.abs(rates).max(axis=0)
        d = int(np.argmax(felt))
        rigid = self.plain.carried.efforts
        return self.scale * SIZE(self.random) * float(np.abs(rigid[:, d]).max()) / float(felt[d])

    def start_gears(self) -> None:
        """Compute the efforts with injected bodies."""
        self.carried = self.plain.carried if not self.truths else self.engine.carried(
            self.engine.closed(self.motion), self.passive)
        self.bodies = self.carried.efforts
        if self.picked is not None:
            share, parameters = self.picked
            self.engine.carry(self.model.robot.structure.tool, parameters)
            loaded = self.engine.torques(self.motion, self.passive)
            self.bodies = self.bodies + share[:, None] * (loaded - self.bodies)

    def start_efforts(self) -> None:
        """Compute the drives' efforts with the friction of the model, and temperatures."""
        motion, friction = self.motion, self.plain.friction
        if self.windup.any():
            wound = np.gradient(self.windup, self.time, axis=0)
            motion = replace(
                motion, velocity=motion.velocity + wound,
                acceleration=motion.acceleration + np.gradient(wound, self.time, axis=0))
        if self.truths:
            friction = own_friction(self.model, self.engine, motion, self.plain.rounds)
        self.efforts = self.bodies + friction
        self.largest = np.abs(self.efforts).max(axis=0)
        self.temperature = draw_temperatures(self.climate, self.time, self.motion.velocity)

    def moment(self, joint: int) -> JointMoment:
        """Return a joint along the motion."""
        name, pressed = self.model.drives[joint], None
        if name in guides(self.model):
            pressed = np.linalg.norm(self.engine.across([name], self.carried)[:, 0], axis=1)
        return JointMoment.along(self.motion, joint, self.bodies[:, joint], self.largest[joint],
                                 self.model.gear_ratios[joint], self.temperature, pressed)

    @property
    def beside(self) -> Array:
        """Lead of the encoders before their links, (N, D)."""
        return self.lead + self.shift + self.windup

    @property
    def position(self) -> Array:
        """Positions as encoders of any resolution measure them, (N, D)."""
        return self.plain.motion.position + self.beside


def simulate_mechanism(
    model: DriveModel, names: Sequence[str], seed: int, noise: float | None = None,
    duration: float = 40.0, path_seed: int = 0, progress: Callable[[float], None] | None = None,
    thermometers: bool = False, motion: JointMotion | None = None,
    nominal: JointMotion | None = None,
) -> MechanismRun:
    """Return a recording of a mechanism with injected effects.

    Parameters
    ----------
    model : DriveModel
        Its added effects are part of the model, not of the simulated robot.
    names : sequence of str
        Of `NAMES`, or 'random'. Drives may follow after a colon: 'coulomb_friction:a,b'.
    seed : int
        Of effects and noise.
    noise : float, optional
        Standard deviation of all efforts [N m, N]; by default half a percent of the largest.
    duration : float
        [s]
    path_seed : int
        Of the motion.
    progress : callable, optional
    thermometers : bool
        Whether they are recorded where no effect needs them.
    motion : JointMotion, optional
        In place of a random one.
    nominal : JointMotion, optional
        Motion whose efforts and speeds determine the sizes of the effects, by default the same.

    Raises
    ------
    InjectedEffectError
        For another name, or a robot that cannot have an effect.
    """
    random = np.random.default_rng(seed)
    read = draw_motion(model, duration, path_seed) if motion is None else motion
    choices = sorted((*(name for name in FORMS if able_joints(name, model, read)), 'payload_mass'))
    chosen = [str(random.choice(choices)) if name == RANDOM else name for name in names]
    effects = [named(name, random, 1.0) for name in chosen]
    # Generators of their own, so that no other draw depends on temperatures and second encoders.
    if nominal is not None and effects:
        Injection(PlainRobot(model, nominal), effects, np.random.default_rng((seed, CLIMATE)))
    run = Injection(PlainRobot(model, read), effects, np.random.default_rng((seed, CLIMATE)),
                    progress)
    sigma = np.full(len(run.largest), noise) if noise is not None else 0.005 * run.largest
    measured = run.efforts + noise_like(random, run.efforts.shape) * sigma
    channels = {}
    if thermometers or {*chosen} & {'friction_temperature', 'current_gain'}:
        channels['temperature'] = read_thermometers(run.time, run.temperature)
    if 'elastic_joint' in chosen:
        second = np.random.default_rng((seed, SECOND))  # mounted at another angle
        channels['link_position'] = (
            run.motion.position + run.lead + run.shift
            + second.normal(0, MOUNTED, len(run.shift))
            + ENCODER * second.uniform(-0.5, 0.5, run.lead.shape))
    position = run.position + ENCODER * random.uniform(-0.5, 0.5, run.lead.shape)
    return MechanismRun(run.motion, position, measured, tuple(run.truths), channels)


def named(words: str, random: np.random.Generator, scale: float) -> Choice:
    """Return the effect of a name, which drives may follow: 'coulomb_friction:a,b'."""
    name, _, drives = words.partition(':')
    return Choice(name, random, scale, tuple(drives.split(',')) if drives else ())


# ------------------------------------------------------------------------------ encoders, bodies


def _eccentric_encoder(run: Injection) -> Injected:
    """Inject an eccentric encoder, which the robot's control follows.

    Behind a reading q the drive is at q - atan(e sin(x) / (1 + e cos(x))) / n, x = n q + phi.
    """
    model, read, random = run.model, run.motion, run.random
    able = [j for j, unit in enumerate(model.units) if unit.turns or model.gear_ratios[j] > 1]
    if not able:
        raise InjectedEffectError('eccentric_encoder needs a joint that turns, or the gear_ratio '
                                  'of one that slides')

    def draw() -> dict[str, Any]:
        j = able[int(random.integers(len(able)))]
        ratio = model.gear_ratios[j]
        # On the motor, or on the joint behind its gear.
        if ratio == 1 or (model.units[j].turns and random.random() < 0.5):
            ratio = 1.0
        return {'j': j, 'ratio': ratio,
                'beside': run.size(*(ON_JOINT if ratio == 1 else ON_MOTOR)),
                'phase': float(random.uniform(-np.pi, np.pi))}

    j, ratio, beside, phase = run.sizes(draw).values()

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
    return [model.drives[j]], {model.drives[j]: {
        'amplitude': beside / ratio, 'phase': phase, 'pitch': 2 * np.pi / ratio}}


def _payload_mass(run: Injecting) -> Injected:
    """Hang a point of a share of the robot's mass 5 cm before the tool.

    On a 3-PPRS at the centre of mass of platform and payload, as the effect is defined there.
    """
    engine, robot = run.engine, run.engine.robot
    share = run.sizes(lambda: {'share': run.size(0.05, 0.12)})['share']
    mass, tool = share * float(robot.masses.sum()), engine.structure.tool
    centre = robot.centre_of(tool) if robot.tool_place.is_spread else (0.0, 0.0, 0.05)
    engine.carry(tool, body_at(mass, tuple(centre), np.zeros((3, 3))))
    return None, {'mass': mass}


def _link_mass(run: Injecting) -> Injected:
    """Add a share of its mass to a link at its centre, or to all links that are alike."""
    engine, robot = run.engine, run.engine.robot
    places = links_that_weigh(run.model)

    def draw() -> dict[str, Any]:
        name = str(run.random.choice([*places]))
        return {'name': name, 'share': run.scale * float(run.random.uniform(0.1, 0.3))}

    name, share = run.sizes(draw).values()
    for link in places[name]:
        mass = share * float(robot.masses[robot.body_names.index(link)])
        engine.carry(link, body_at(mass, tuple(robot.centre_of(link)), np.zeros((3, 3))))
    return None, {f'{name}.mass': mass}


def links_that_weigh(model: DriveModel) -> dict[str, tuple[str, ...]]:
    """Return the links whose mass can be injected, by name, or raise InjectedEffectError.

    What turns about an upright axis shows in no weight, and the last link is the payload's.
    """
    robot = model.robot
    able = {place.link: place.links for place in robot.link_places
            if robot.structure.loops or place.link != robot.body_names[0]}
    if not able:
        raise InjectedEffectError('link_mass needs a link between the first and the tool')
    return able


def _payload_offset(run: Injection) -> Injected:
    """Inject another centre of mass of what carries the tool."""
    offset = run.sizes(lambda: {
        axis: run.size(0.003, 0.015) * float(run.random.choice((-1.0, 1.0))) for axis in 'xyz'})
    run.engine.shift_tool(np.array([*offset.values()]))
    return None, offset


def _platform_inertia(run: Injection) -> Injected:
    """Inject a beam across the tool, of inertia I (E - a a^T), a = (cos beta, sin beta, 0)."""
    sizes = run.sizes(lambda: {
        'inertia': run.scale * float(np.exp(run.random.uniform(np.log(0.01), np.log(0.04)))),
        'angle': float(run.random.uniform(0.0, np.pi))})
    inertia, angle = sizes.values()
    along = np.array([np.cos(angle), np.sin(angle), 0.0])
    run.engine.carry(run.model.robot.structure.tool, body_at(
        0.0, (0.0,) * 3, inertia * (np.eye(3) - np.outer(along, along))))
    return None, sizes


def _payload_pick_up(run: Injection) -> Injected:
    """Hang a point 5 cm before the tool from a time on. Not in the catalogue."""
    require_tool(run.model, 'payload_pick_up')
    sizes = run.sizes(lambda: {
        'mass': run.size(0.05, 0.12) * float(run.engine.robot.masses.sum()),
        'time': float(np.quantile(run.time, run.random.uniform(0.1, 0.4)))})
    share = np.clip((run.time - sizes['time']) / PICK_UP_TIME, 0.0, 1.0)
    run.picked = share, body_at(sizes['mass'], (0.0, 0.0, 0.05), np.zeros((3, 3)))
    return None, sizes


def _passive_joints(run: Injection, effect: str, balls: bool) -> Mapping[str, tuple[str, ...]]:
    """Return passive joints with a position by name, and balls where several share their friction.

    Friction of a single ball is hard to distinguish from that of its neighbours.
    """
    found = {joint.name: joint.joints for joint in run.model.robot.passive_joints
             if joint.has_position or (balls and len(joint.joints) > 1)}
    if not found:
        raise InjectedEffectError(f'{effect} needs a passive joint')
    return found


def _joint_friction(run: Injection) -> Injected:
    """Inject T w / sqrt(w^2 + w_0^2) in a passive joint, or in all that are alike."""
    groups = _passive_joints(run, 'joint_friction', balls=True)
    closed = run.engine.closed(run.motion)

    def rows_of(name: str) -> Array:
        return run.engine.friction(run.model.robot.friction_table(
            {name: {}}, run.model.reversal), closed, run.plain.carried).rows

    def speed_of(rows: Array) -> Array:
        return np.linalg.norm(np.einsum('nkiv,nv->nki', rows, closed.velocity), axis=2)

    def draw() -> dict[str, Any]:
        name = str(run.random.choice(list(groups)))
        rows = rows_of(name)
        felt = np.linalg.norm(np.einsum('nkiv,nvd->nkid', rows, closed.rates), axis=2)
        return {'name': name, 'torque': run.share_of_largest(felt.max(axis=1)),
                'width': STEEPNESS * float(speed_of(rows).max())}

    name, torque, width = run.sizes(draw).values()
    rows = rows_of(name)
    run.passive += np.einsum('nk,nki,nkiv->nv', torque / np.hypot(speed_of(rows), width),
                             np.einsum('nkiv,nv->nki', rows, closed.velocity), rows)
    return None, {f'{name}.torque': torque}


def _joint_spring(run: Injection) -> Injected:
    """Inject k x (1 + (x / x_h)^2), x = u - u_0, in a passive joint, or in all that are alike."""
    groups = _passive_joints(run, 'joint_spring', balls=False)
    closed, state = run.engine.closed(run.motion), run.engine.state

    def angles_of(name: str) -> Array:
        return closed.position[:, [state.place(joint) for joint in groups[name]]]

    def draw() -> dict[str, Any]:
        name = str(run.random.choice(list(groups)))
        angle = angles_of(name)
        felt = np.abs(closed.rates[:, [state.dof(joint) for joint in groups[name]]])
        way = float(np.ptp(angle))
        return {'name': name, 'stiffness': 2 * run.share_of_largest(felt.max(axis=1)) / way,
                'rest': float(angle.mean()), 'way': way}

    name, stiffness, rest, way = run.sizes(draw).values()
    off = angles_of(name) - rest
    run.passive[:, [state.dof(joint) for joint in groups[name]]] += (
        stiffness * off * (1 + (off / way) ** 2))
    return None, {f'{name}.stiffness': stiffness, f'{name}.position': rest}


def _base_tilt(run: Injecting) -> Injected:
    """Tilt the base about its x axis."""
    require_tool(run.model, 'base_tilt')
    angle = run.sizes(lambda: {'x': run.size(0.01, 0.03)})['x']
    sine, cosine = np.sin(angle), np.cos(angle)
    run.engine.gravity = np.array(
        [[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]]) @ run.engine.gravity
    return None, {'x': angle, 'y': 0.0}


def _external_wrench(run: Injection) -> Injected:
    require_tool(run.model, 'external_wrench')
    force = run.sizes(lambda: {
        'force_z': run.scale * 0.05 * float(np.abs(run.plain.effort).max())})['force_z']
    run.engine.wrench = run.engine.wrench + np.array([0.0, 0.0, force, 0.0, 0.0, 0.0])
    return None, {'force_z': force}


def _tool_drag(run: Injection) -> Injected:
    """Let the tool move through a liquid: c v sqrt(1 + (|v| / v_1)^2)."""
    require_tool(run.model, 'tool_drag')
    velocity = run.engine.tool_velocity(run.engine.closed(run.motion))
    speed = np.linalg.norm(velocity, axis=1, keepdims=True)
    top = float(speed.max())
    if top < LEAST_SPEED:
        raise InjectedEffectError('tool_drag needs a tool that is off the axes of the joints')
    sizes = run.sizes(lambda: {'turbulent_velocity': 2 * top, 'coefficient': run.size(
        0.03, 0.1) * float(np.abs(run.plain.effort).max()) / top})
    turbulent, coefficient = sizes.values()
    drag = coefficient * np.hypot(1.0, speed / turbulent) * velocity
    run.engine.wrench = run.engine.wrench + np.concatenate((drag, np.zeros_like(drag)), axis=1)
    return None, sizes


def require_tool(model: DriveModel, name: str) -> None:
    """Raise InjectedEffectError for an axis, which a force across it does not move."""
    if model.kind == SLIDE:
        raise InjectedEffectError(f'{name} does not act along a single axis: choose effort_offset')


# ----------------------------------------------------------------------------------------- gears


def _elastic_joint(run: Injection) -> Injected:
    """Inject a gear that winds up under load.

    A harmonic drive that stiffens, tau / tau_0 = x + x^3 / 4 with x = w / w_0, and creeps: a share
    of it comes late, by a relaxation (a standard linear solid). It is in a joint that turns, where
    there is one behind the first: a slide that carries no weight would not feel it.
    """
    model, random = run.model, run.random
    later = range(min(1, len(model.drives) - 1), len(model.drives))

    def draw() -> dict[str, Any]:
        drawn = int(random.choice([j for j in later if model.units[j].turns] or later))
        joint = run.given[0] if run.given else drawn
        return {'joint': joint, 'largest': float(np.abs(run.bodies[:, joint]).max()),
                'span': run.size(0.02, 0.05) * run.shift_unit(joint),
                'late': float(random.uniform(0.05, 0.2)), 'time': float(random.uniform(0.02, 0.1))}

    joint, largest, span, late, time = run.sizes(draw).values()
    load = run.bodies[:, joint] / largest
    kept, crept = np.exp(-float(np.median(np.diff(run.time))) / time), load.copy()
    for k in range(1, len(load)):
        crept[k] = kept * crept[k - 1] + (1 - kept) * load[k]
    felt = (1 - late) * load + late * crept
    # The real root of x + x^3 / 4 = felt, x = w / span.
    x = 4 / np.sqrt(3) * np.sinh(np.arcsinh(0.75 * np.sqrt(3) * felt) / 3)
    run.windup[:, joint] = span * x
    return [model.drives[joint]], {model.drives[joint]: {
        'compliance': span / largest, 'loss': late * time}}


def _lost_motion(run: Injection) -> Injected:
    """Inject a clearance, crossed by the load on half of the joints whose load changes sign."""

    def draw() -> dict[str, Any]:
        joint = run.joint(1)
        span, load = run.size(0.01, 0.03) * run.shift_unit(joint), run.bodies[:, joint]
        # The link falls behind in its position alone, on which no force of an axis depends.
        by_load = bool(run.model.kind != SLIDE and load.min() < -CROSSED * load.max() < 0
                       and run.random.integers(2))
        driver = load if by_load else run.motion.velocity[:, joint]
        return {'joint': joint, 'span': span, 'by_load': by_load,
                'largest': float(np.abs(driver).max())}

    joint, span, by_load, largest = run.sizes(draw).values()
    driver = (run.bodies if by_load else run.motion.velocity)[:, joint]
    lead = np.zeros_like(run.bodies)
    # One of two flanks touches.
    lead[:, joint] = span / 2 * driver / np.hypot(driver, CROSSED * largest)
    if by_load:  # the motor moves as before, and the link falls behind it
        run.bodies = run.engine.torques(replace(
            run.motion, position=run.motion.position - lead), run.passive)
    else:
        run.lead = lead
    name = run.model.drives[joint]
    return [name], {name: {'backlash' if by_load else 'play': span}}


# --------------------------------------------------------------------------- drives, amplifiers


def _force(name: str, run: Injection) -> Injected:
    """Inject a force on one drive, or on all."""
    model, random, form = run.model, run.random, {**FORMS, **UNKNOWN}[name]

    def draw() -> dict[str, Any]:
        everywhere = bool(random.random() < 0.25)
        chosen = run.given or (able_joints(name, model, run.motion) if everywhere else
                               [one_able_joint(name, model, run.motion, random)])
        moments = {j: run.moment(j) for j in chosen}
        return {model.drives[j]: (m.effort, m.speed, draw_form(form, random, m, run.scale))
                for j, m in moments.items()}

    sizes = run.sizes(draw)
    for drive, (effort, speed, drawn) in sizes.items():
        j = model.drives.index(drive)
        run.efforts[:, j] += form.force(drawn, replace(run.moment(j), effort=effort, speed=speed))
    return [*sizes], {drive: drawn for drive, (_, _, drawn) in sizes.items()}


def _coupled_drives(run: Injection) -> Injected:
    """Inject friction of a motor that moves several joints.

    With v the speed of the motor: A' (F v / sqrt(v^2 + w^2) + c v_1 asinh(v / v_1)).
    """
    motors = run.model.robot.motors
    if not motors:
        raise InjectedEffectError('coupled_drives needs a motor that moves several joints: write '
                                  'friction: {motors: {MOTOR: {JOINT: 1.0, OTHER: 1.0}}}')

    def draw() -> dict[str, Any]:
        name = str(run.random.choice(sorted(motors)))
        row = np.array(motors[name])
        # As large on the joint that feels it most as an injected force on a drive is.
        felt = float(np.min(run.largest[row != 0] / np.abs(row[row != 0])))
        return {'name': name, 'top': float(np.abs(run.motion.velocity @ row).max()),
                'dry': run.scale * SIZE(run.random) * felt,
                'viscous': run.scale * SIZE(run.random) * felt}

    name, top, dry, viscous = run.sizes(draw).values()
    row = np.array(motors[name])
    speed = run.motion.velocity @ row
    friction = (dry * algebraic_sign(speed, STEEPNESS * top)
                + viscous * eyring(speed, 2 * top) / top)
    run.efforts += np.outer(friction, row)
    return None, {f'{name}.coulomb': dry, f'{name}.viscous': viscous / top}


def _effort_gain(run: Injection) -> Injected:
    joint, gain = run.sizes(lambda: {'joint': run.joint(), 'gain': run.size(0.04, 0.1)}).values()
    run.efforts[:, joint] *= 1 + gain
    return [run.model.drives[joint]], {'gain': gain}


def _current_gain(run: Injection) -> Injected:
    """Inject a torque constant that changes with the motor's temperature or angle."""
    model, random = run.model, run.random

    def draw() -> dict[str, Any]:
        j = run.joint()
        ratio = model.gear_ratios[j]
        if ratio > 1 and random.random() < 0.5:
            height, waves = run.size(0.03, 0.08), int(random.integers(1, 7))
            return {'j': j, 'parameters': {
                'ripple': height, 'phase': float(random.uniform(-np.pi, np.pi)),
                'pitch': 2 * np.pi / (waves * ratio)}}
        return {'j': j, 'parameters': {'temperature': run.size(0.0015, 0.003),
                                       'reference': float(random.uniform(*REFERENCE))}}

    j, p = run.sizes(draw).values()
    if 'ripple' in p:
        turn = 2 * np.pi / p['pitch'] * run.motion.position[:, j] + p['phase']
        constant = 1 + p['ripple'] * (np.sin(turn) + 0.2 * np.sin(3 * turn))
    else:
        warmer = run.temperature[:, j] - p['reference']
        constant = 1 - p['temperature'] * warmer * (1 + warmer / 300)
    run.efforts[:, j] /= constant
    return [model.drives[j]], {model.drives[j]: p}


def _time_delay(run: Injection) -> Injected:
    delay = run.sizes(lambda: {'delay': run.size(0.008, 0.03)})['delay']
    run.efforts = np.stack([np.interp(run.time - delay, run.time, column)
                            for column in run.efforts.T], axis=1)
    return list(run.model.drives), {'delay': delay}


def _effort_filter(run: Injection) -> Injected:
    """Inject a Butterworth low-pass of second order, T = sqrt(2) / (2 pi f_c)."""
    from scipy.signal import butter, lfilter, lfilter_zi

    time_constant = run.sizes(lambda: {'time_constant': run.size(0.01, 0.04)})['time_constant']
    rate = 1 / float(np.median(np.diff(run.time)))
    highest = 0.45 * rate  # no samples show what is faster
    b, a = butter(2, min(np.sqrt(2) / (2 * np.pi * time_constant), highest), fs=rate)
    run.efforts, _ = lfilter(b, a, run.efforts, axis=0,
                             zi=lfilter_zi(b, a)[:, None] * run.efforts[0])
    return list(run.model.drives), {'time_constant': time_constant}


def _homing_error(run: Injection) -> Injected:

    def draw() -> dict[str, Any]:
        joint = run.joint(1)
        return {'joint': joint, 'zero': run.size(0.01, 0.03) * run.shift_unit(joint)}

    joint, zero = run.sizes(draw).values()
    run.shift[joint] = zero
    name = run.model.drives[joint]
    return [name], {name: {'zero': zero}}


Effects = Mapping[str, Callable[[Injection], Injected]]
FORCES: Effects = {name: partial(_force, name) for name in (*FORMS, *UNKNOWN)}
BODIES: Effects = {
    'payload_mass': _payload_mass, 'payload_offset': _payload_offset,
    'platform_inertia': _platform_inertia, 'payload_pick_up': _payload_pick_up,
    'link_mass': _link_mass, 'joint_friction': _joint_friction, 'joint_spring': _joint_spring,
    'base_tilt': _base_tilt, 'external_wrench': _external_wrench, 'tool_drag': _tool_drag}
# What is computed before, and the effects that it does not contain yet.
STAGES: tuple[tuple[Callable[[Injection], None], Effects], ...] = (
    (lambda run: None, {'eccentric_encoder': _eccentric_encoder}),
    (lambda run: None, BODIES),
    (Injection.start_gears, {'elastic_joint': _elastic_joint, 'lost_motion': _lost_motion}),
    (Injection.start_efforts, FORCES),
    (lambda run: None, {
        'coupled_drives': _coupled_drives, 'effort_gain': _effort_gain,
        'current_gain': _current_gain, 'time_delay': _time_delay, 'effort_filter': _effort_filter,
        'homing_error': _homing_error}))
NAMES = tuple(sorted((name for _, effects in STAGES for name in effects),
                     key=lambda name: name not in FORCES))
NOT_IN_CATALOGUE = (*UNKNOWN, 'payload_pick_up')
"""Effects that no catalogue effect explains."""
NOT_IN_DRIVES = {*BODIES, 'coupled_drives', 'time_delay', 'effort_filter', 'eccentric_encoder'}


def guides(model: DriveModel) -> set[str]:
    """Return the drives whose friction follows the load across them."""
    following = {name for effect in model.effects if isinstance(effect, ModelJointFriction)
                 for name in effect.blocks if name in model.drives}
    return following | {drive for drive, mu in zip(
        model.drives, model.friction.coefficient, strict=True) if mu}


def own_joint_friction(model: DriveModel) -> JointFriction:
    """Return the friction of all joints, driven or not, that the model file has."""
    friction = model.friction
    of_drives = {drive: {'viscous': viscous, 'torque': torque, 'coulomb': coulomb}
                 for drive, viscous, torque, coulomb in zip(
                     model.drives, friction.viscous, friction.coulomb, friction.coefficient,
                     strict=True)}
    return JointFriction(*map(np.concatenate, zip(*(
        model.robot.friction_table(blocks, model.reversal) for blocks in (of_drives, *(
            effect.blocks for effect in model.effects if isinstance(effect, ModelJointFriction)))),
        strict=True)))


def own_friction(model: DriveModel, engine: MechanismEngine, motion: JointMotion,
                 rounds: int = 1) -> Array:
    """Return friction, offset and armature as the model file has them, under the true loads."""
    friction: Array = (model.robot.armature * motion.acceleration + model.offset + (
        engine.joint_friction(motion, own_joint_friction(model), rounds)))
    return friction


def able_joints(name: str, model: DriveModel, motion: JointMotion) -> list[int]:
    """Return the joints that an injected force can act in along a motion."""
    turn, stroke = {**FORMS, **UNKNOWN}[name].needs_turn, np.ptp(motion.position, axis=0)
    return [j for j, unit in enumerate(model.units)
            if not turn or (unit.turns and stroke[j] >= turn)]


def one_able_joint(name: str, model: DriveModel, motion: JointMotion,
                   random: np.random.Generator) -> int:
    """Return one of the joints that an injected force can act in along a motion."""
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
