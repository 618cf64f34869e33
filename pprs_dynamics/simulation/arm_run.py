# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What a recording of a simulated arm holds: MuJoCo's inverse dynamics along a motion.

MuJoCo reads the URDF by a parser of its own; the model's numbers are put into its bodies. Friction
of the arm is that of the model file, hidden effects have forms of their own (`arm_forms`).
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.model.arm_model import ArmModel
from pprs_dynamics.physics.three_pprs.joint_series import JointSeries
from pprs_dynamics.simulation.arm_forms import FORMS, JointMoment, require_known, truth
from pprs_dynamics.simulation.engine_model import load_engine
from pprs_dynamics.simulation.hidden_effect import HiddenEffectError

RATE = 100.0  # [Hz]
HARMONICS = 8
FASTEST, WIDEST = 0.35, 1.5  # of the top speed; from the middle of the range [rad, m]
QUICKEST = 3.0  # [rad/s^2, m/s^2]
ENCODER = 2e-5  # [rad, m]
COLOURED, CORRELATION = 0.36, 0.95  # share of the noise's variance, and from sample to sample
COMPILER = {'fusestatic': 'true', 'balanceinertia': 'false'}
LEAST = 1e-9  # [kg, kg m^2], of bodies that another's inertia contains


@dataclass(frozen=True)
class ArmRun:
    """A simulated recording.

    Parameters
    ----------
    motion : JointMotion
    position, effort : (N, n) arrays
        As measured.
    effects : tuple of dict
        What was hidden.
    """

    motion: JointMotion
    position: Array
    effort: Array
    effects: tuple[dict[str, Any], ...]


class ArmEngine:
    """MuJoCo's model of an arm.

    Parameters
    ----------
    model : ArmModel
    """

    def __init__(self, model: ArmModel) -> None:
        self.engine = mujoco = load_engine('a simulated arm')
        self.model = mujoco.MjModel.from_xml_string(_bare(Path(model.values['arm.urdf'])))
        self.data = mujoco.MjData(self.model)
        self.joints = [self.model.joint(name) for name in model.drives]
        self.qpos = np.array([int(joint.qposadr[0]) for joint in self.joints])
        self.dofs = np.array([int(joint.dofadr[0]) for joint in self.joints])
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        # All that is fixed to a joint is in its inertial parameters: other bodies weigh nothing.
        self.model.body_mass[1:], self.model.body_inertia[1:] = LEAST, LEAST
        for joint, parameters in zip(self.joints, model.arm.inertial, strict=True):
            self._set_body(int(self.model.jnt_bodyid[joint.id]), parameters)
        mujoco.mj_setConst(self.model, self.data)
        self.gravity = np.asarray(model.arm.gravity, dtype=float)

    def _set_body(self, body: int, parameters: Array) -> None:
        mass = float(parameters[0])
        centre = parameters[1:4] / mass
        xx, xy, yy, xz, yz, zz = parameters[4:]
        about = (np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
                 - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre)))
        values, axes = np.linalg.eigh(about)
        axes[:, 0] *= np.linalg.det(axes)
        self.model.body_mass[body], self.model.body_ipos[body] = mass, centre
        self.model.body_inertia[body] = np.maximum(values, LEAST)
        quaternion = np.empty(4)
        self.engine.mju_mat2Quat(quaternion, axes.ravel())
        self.model.body_iquat[body] = quaternion

    def add_payload(self, model: ArmModel, mass: float, offset: Array) -> None:
        """Hang a point mass on the tool, `offset` from its origin in its axes [m]."""
        tree = model.arm.tree
        frame, joint = tree.model.frames[tree.tool], tree.carrier
        at = frame.placement.rotation @ offset + frame.placement.translation
        parameters = model.arm.inertial[joint].copy()
        parameters[0] += mass
        parameters[1:4] += mass * at
        x, y, z = at
        parameters[4:] += mass * np.array([y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z,
                                           x * x + y * y])
        self._set_body(int(self.model.jnt_bodyid[self.joints[joint].id]), parameters)
        self.engine.mj_setConst(self.model, self.data)

    def add_to_link(self, model: ArmModel, joint: int, mass: float) -> None:
        """Make what a joint moves up to the next denser by a mass [kg]."""
        parameters = model.arm.inertial[joint]
        self._set_body(int(self.model.jnt_bodyid[self.joints[joint].id]),
                       parameters * (1 + mass / parameters[0]))
        self.engine.mj_setConst(self.model, self.data)

    def torques(self, motion: JointMotion, gravity: Array | None = None) -> Array:
        """Return inverse dynamics along a motion, (N, n)."""
        self.model.opt.gravity[:] = self.gravity if gravity is None else gravity
        found = np.empty_like(motion.position)
        data = self.data
        for k in range(len(motion)):
            data.qpos[:], data.qvel[:], data.qacc[:] = 0.0, 0.0, 0.0
            data.qpos[self.qpos] = motion.position[k]
            data.qvel[self.dofs] = motion.velocity[k]
            data.qacc[self.dofs] = motion.acceleration[k]
            self.engine.mj_inverse(self.model, data)
            found[k] = data.qfrc_inverse[self.dofs]
        return found


def _bare(path: Path) -> str:
    """Return a URDF without meshes, every link with some mass: it is set afterwards."""
    robot = ElementTree.parse(path).getroot()
    for link in robot.findall('link'):
        for part in (*link.findall('visual'), *link.findall('collision'),
                     *link.findall('inertial')):
            link.remove(part)
        inertial = ElementTree.SubElement(link, 'inertial')
        ElementTree.SubElement(inertial, 'mass', value='1')
        ElementTree.SubElement(inertial, 'inertia', ixx='1', iyy='1', izz='1', ixy='0', ixz='0',
                               iyz='0')
    ElementTree.SubElement(ElementTree.SubElement(robot, 'mujoco'), 'compiler', COMPILER)
    return ElementTree.tostring(robot, encoding='unicode')


def draw_motion(model: ArmModel, duration: float, seed: int) -> JointMotion:
    """Return a random Fourier series of all joints within the URDF's limits."""
    tree, random = model.arm.tree, np.random.default_rng(seed)
    lower, upper = np.maximum(tree.lower, -np.pi), np.minimum(tree.upper, np.pi)
    reach = np.minimum(0.9 * (upper - lower) / 2, WIDEST)
    shape = random.normal(size=(len(model.drives), JointSeries.size(HARMONICS)))
    time = np.arange(0.0, duration, 1 / RATE)
    raw = JointSeries(shape, (lower + upper) / 2, duration, HARMONICS)
    motion = raw.motion(time)
    top = np.where(np.isfinite(tree.speed), tree.speed, np.pi)
    uses = np.max([np.abs(values).max(axis=0) / bound for values, bound in (
        (motion.position - raw.middle, reach), (motion.velocity, FASTEST * top),
        (motion.acceleration, QUICKEST))], axis=0)
    return JointSeries(shape / uses[:, None], raw.middle, duration, HARMONICS).motion(time)


def simulate_arm(model: ArmModel, names: Sequence[str], seed: int, scale: float = 1.0,
                 noise: float | None = None, duration: float = 40.0, path_seed: int = 0,
                 progress: Callable[[float], None] | None = None) -> ArmRun:
    """Return a recording of an arm with hidden effects.

    Parameters
    ----------
    model : ArmModel
        Its added effects are part of the model, not of the arm.
    names : sequence of str
        Of `arm_forms.NAMES`, or 'random'.
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

    Raises
    ------
    HiddenEffectError
        For another name.
    """
    random = np.random.default_rng(seed)
    choices = sorted((*FORMS, 'payload_mass'))
    chosen = tuple(str(random.choice(choices)) if name == 'random' else name for name in names)
    require_known(chosen)
    motion = draw_motion(model, duration, path_seed)
    engine = ArmEngine(model)
    if progress is not None:
        progress(0.1)
    plain = engine.torques(motion)
    hidden: list[dict[str, Any]] = []
    gravity = None
    if 'payload_mass' in chosen:
        mass = scale * float(random.uniform(0.05, 0.12)) * float(model.arm.masses.sum())
        engine.add_payload(model, mass, np.array([0.0, 0.0, 0.05]))
        hidden.append(truth('payload_mass', None, {'mass': mass}, 'a point 5 cm before the tool'))
    if 'link_mass' in chosen:
        # What turns about an upright axis shows in no weight, and the last link is the payload's.
        links = [j for j in range(1, len(model.drives)) if j != model.arm.tree.carrier]
        if not links:
            raise HiddenEffectError('link_mass needs a link between the first and that of the tool')
        joint = int(random.choice(links))
        mass = scale * float(random.uniform(0.1, 0.3)) * float(model.arm.masses[joint])
        engine.add_to_link(model, joint, mass)
        hidden.append(truth('link_mass', None, {f'link_{joint + 1}': mass}, 'denser'))
    if 'base_tilt' in chosen:
        angle = scale * float(random.uniform(0.01, 0.03))
        gravity = 9.81 * np.array([0.0, np.sin(angle), -np.cos(angle)])
        hidden.append(truth('base_tilt', None, {'x': angle, 'y': 0.0}, 'about x'))
    bodies = engine.torques(motion, gravity) if hidden else plain
    if progress is not None:
        progress(0.8)
    efforts = bodies + _own_friction(model, motion)
    largest = np.abs(efforts).max(axis=0)
    if 'external_wrench' in chosen:
        force = scale * 0.05 * float(largest.max()) * np.array([0, 0, 1.0, 0, 0, 0])
        efforts += model.arm.wrench_torques(motion.position, np.tile(force, (len(motion), 1)))
        hidden.append(truth('external_wrench', None, {'force_z': force[2]}, 'at the tool'))
    for name in chosen:
        if name in FORMS:
            hidden.append(_add(name, model, motion, np.abs(bodies), largest, efforts, random,
                               scale))
    if 'effort_gain' in chosen:
        joint = int(random.integers(len(model.drives)))
        gain = scale * float(random.uniform(0.04, 0.1))
        efforts[:, joint] *= 1 + gain
        hidden.append(truth('effort_gain', [model.drives[joint]], {'gain': gain}, '1 + gain'))
    if 'time_delay' in chosen:
        assert motion.time is not None
        delay = scale * float(random.uniform(0.008, 0.03))
        efforts = np.stack([np.interp(motion.time - delay, motion.time, column)
                            for column in efforts.T], axis=1)
        hidden.append(truth('time_delay', list(model.drives), {'delay': delay}, 'all efforts late'))
    shift = np.zeros(len(largest))
    if 'homing_error' in chosen:
        joint = int(random.integers(1, len(model.drives)))
        shift[joint] = scale * float(random.uniform(0.01, 0.03))
        hidden.append(truth('homing_error', [model.drives[joint]], {
            model.drives[joint]: {'zero': float(shift[joint])}}, 'positions shifted'))
    sigma = np.full(len(largest), noise) if noise is not None else 0.005 * largest
    position = motion.position + shift + ENCODER * random.uniform(-0.5, 0.5, motion.position.shape)
    return ArmRun(motion, position, efforts + _noise(random, efforts.shape) * sigma,
                  tuple(hidden))


def _own_friction(model: ArmModel, motion: JointMotion) -> Array:
    """Return friction, offset and armature as the model file has them."""
    values, v = model.values, motion.velocity
    friction: Array = (
        np.array(values['arm.armature']) * motion.acceleration
        + np.array(values['friction.viscous']) * v
        + np.array(values['friction.coulomb']) * np.tanh(v / np.asarray(model.reversal.velocity))
        + np.array(values['friction.offset']))
    return friction


def _add(name: str, model: ArmModel, motion: JointMotion, load: Array, largest: Array,
         efforts: Array, random: np.random.Generator, scale: float) -> dict[str, Any]:
    """Add a hidden force on one joint, or on all, and return what it is."""
    form, drives = FORMS[name], model.drives
    everywhere = bool(random.random() < 0.25)
    chosen = range(len(drives)) if everywhere else [int(random.integers(len(drives)))]
    parameters = {}
    assert motion.time is not None
    for j in chosen:
        moment = JointMoment(
            motion.time, motion.position[:, j], motion.velocity[:, j], motion.acceleration[:, j],
            load[:, j], float(largest[j]), float(np.abs(motion.velocity[:, j]).max()),
            float(model.values['arm.gear_ratio'][j]))
        drawn = form.draw(random, moment)
        first = next(iter(drawn))
        drawn[first] *= scale
        efforts[:, j] += form.force(drawn, moment)
        parameters[drives[j]] = drawn
    return truth(name, [drives[j] for j in chosen], parameters, form.form)


def _noise(random: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Return noise of unit variance, part of it correlated from sample to sample."""
    from scipy.signal import lfilter

    white = random.normal(size=shape)
    slow: Array = lfilter([np.sqrt(1 - CORRELATION ** 2)], [1, -CORRELATION],
                          random.normal(size=shape), axis=0)
    noise: Array = np.sqrt(1 - COLOURED) * white + np.sqrt(COLOURED) * slow
    return noise
