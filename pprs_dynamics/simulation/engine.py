# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""MuJoCo's model of a mechanism: its kinematics, inertia, gravity and reactions.

MuJoCo reads the description itself. Its masses, inertias, gravity and couplings are retained:
`MechanismEngine` raises where the model reads the description otherwise.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Container, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import ModelError, optional_library
from pprs_dynamics.physics.mechanism.description import inertial_in, principal_inertia
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.link_motion import LinkMotion
from pprs_dynamics.physics.mechanism.mjcf import inertial_of, readable_spec
from pprs_dynamics.physics.mechanism.tree_equations import JointFriction
from pprs_dynamics.physics.mechanism.urdf import WORLD, urdf_content
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.parameter_values import source_of_errors
from pprs_dynamics.physics.model.robot_block import described_gravity
from pprs_dynamics.simulation.engine_state import (
    TOOL,
    EngineMotion,
    EngineState,
    add_sites,
    quaternion,
)
from pprs_dynamics.simulation.export.exported_robot import MJCF, ExportedRobot, written

LEAST = 1e-12  # [kg, kg m^2], of bodies that another's inertia contains
COMPILER = {'fusestatic': 'false', 'balanceinertia': 'false', 'boundmass': str(LEAST),
            'boundinertia': str(LEAST)}
# What injected bodies change in MuJoCo's model.
CHANGED = ('body_mass', 'body_inertia', 'body_ipos', 'body_iquat')
SLOWEST = 1e-9  # of the width in which friction turns over, below which tanh(x) / x is 1
AGREEMENT = 1e-6  # of the largest effort
WIDEST, SPAN = 1.0, 0.3  # [rad, m] of a drive, and the share of it in which both are compared


class MechanismEngine:
    """MuJoCo's model of a mechanism.

    Numbers that the model file states in place of the description's replace MuJoCo's.

    Parameters
    ----------
    model : DriveModel

    Raises
    ------
    ModelError
        If MuJoCo computes other efforts from the description than the model.
    MissingLibraryError
        Where mujoco is not installed.
    """

    def __init__(self, model: DriveModel) -> None:
        self.engine = mujoco = load_engine()
        robot = self.robot = model.robot
        structure = self.structure = robot.structure
        path = Path(structure.description.path)
        is_mjcf = bool(model.values.get('robot.mjcf'))
        reads_urdf = 'robot.urdf' in model.values and not is_mjcf
        refused = {name: parameters for name, parameters in structure.description.links.items()
                   if reads_urdf and structure.links[name][0] and not _is_body(parameters)}
        if not structure.description.path:
            spec = mujoco.MjSpec.from_string(written(ExportedRobot(robot), MJCF))
        elif is_mjcf:
            spec = readable_spec(mujoco, str(path))
        else:
            spec = mujoco.MjSpec.from_string(_bare(path, refused))
            spec.fuse_static()
        placed = {body.name: structure.links[body.name] for body in spec.bodies[1:]
                  if body.name in structure.links}
        # MuJoCo's world is the root of the description, ours its base.
        self.root = structure.links[structure.description.root][1]
        self._frames = {0: self.root}
        of_row: dict[int, str] = {}
        for name, (row, frame) in placed.items():
            if row and row not in of_row:
                of_row[row], self._frames[row] = name, frame
                self._prevent_short_cuts(spec.body(name))
        add_sites(spec, structure, {0: (spec.worldbody, self.root)} | {
            row: (spec.body(name), self._frames[row]) for row, name in of_row.items()})
        self.model = spec.compile()
        self.links = {0: 0} | {row: int(self.model.body(name).id) for row, name in of_row.items()}
        for name, row in structure.rows.items():  # of several joints on a body
            if row not in self.links:
                self.links[row] = int(self.model.jnt_bodyid[self.model.joint(name).id])
        self.state = EngineState(mujoco, self.model, structure, self.root)
        self.data = self.state.data
        self.model.dof_armature[:], self.model.dof_damping[:] = 0.0, 0.0
        self.model.dof_frictionloss[:], self.model.jnt_stiffness[:] = 0.0, 0.0
        self.model.body_sameframe[:] = 0  # MuJoCo's short cut for a centre at the origin
        self._names = {row: name for name, row in structure.rows.items()}
        hangs = np.eye(self.model.nbody)
        for number in range(self.model.nbody - 1, 0, -1):
            hangs[self.model.body_parentid[number]] += hangs[number]
        a, b = ([self.links[int(row)] for row in rows] for rows in (
            structure.tables.loop_a, structure.tables.loop_b))
        # 1 where a closure's force on its second link acts through a body, -1 on its first.
        self._behind = hangs[:, b] - hangs[:, a]
        self._nearby: Array | None = None
        self._last: tuple[JointMotion, EngineMotion] | None = None
        for name, parameters in refused.items():
            self.carry(name, parameters)
        for row, parameters in zip(robot.bodies, robot.inertial, strict=True):
            if structure.description.path and not np.array_equal(
                    parameters, structure.inertial[row]):
                for name, (of, _) in placed.items():
                    if of == row:
                        self._set(int(self.model.body(name).id), np.zeros_like(parameters))
                self.carry(of_row[int(row)], inertial_in(self._frames[row].inverse, parameters))
        weightless = self.model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY
        own = np.zeros(3) if weightless else self.model.opt.gravity
        self.gravity = (self.root.R @ own if robot.gravity == described_gravity(structure)
                        else np.array(robot.gravity))
        self.model.opt.disableflags = mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        # That the tool applies at its origin, in the base's axes; of each sample, (N, 6), or all.
        self.wrench = np.zeros(6)
        mujoco.mj_setConst(self.model, self.data)
        with source_of_errors(model.source):
            self._require_agreement(model)
        self._described = self.gravity, {name: getattr(self.model, name).copy() for name in CHANGED}

    def reset(self) -> None:
        """Restore bodies, gravity and wrench of the description."""
        self.gravity, of_model = self._described
        self.wrench = np.zeros(6)
        for name, values in of_model.items():
            getattr(self.model, name)[:] = values
        self.engine.mj_setConst(self.model, self.data)

    def _prevent_short_cuts(self, body: Any) -> None:
        """Add something off a body's frame, else MuJoCo's mass matrix is for its inertia alone."""
        added = body.add_body(ipos=(0.1, 0.2, 0.3), iquat=(1.0, 0.1, 0.2, 0.3), mass=LEAST,
                              inertia=(LEAST, 1.1 * LEAST, 1.2 * LEAST))
        added.explicitinertial = True

    def _set(self, body: int, parameters: Array) -> None:
        """Give a body of MuJoCo inertial parameters (10,), in its frame."""
        model = self.model
        mass, model.body_ipos[body], moments, axes = principal_inertia(parameters)
        model.body_mass[body] = max(mass, LEAST)
        model.body_inertia[body] = np.maximum(moments, LEAST)
        model.body_iquat[body] = quaternion(axes)
        self.engine.mj_setConst(model, self.data)

    def _require_agreement(self, model: DriveModel) -> None:
        """Raise ModelError where MuJoCo's efforts without friction are others than the model's."""
        structure, random = self.structure, np.random.default_rng(0)
        middle, way = structure.room(WIDEST)
        rates = random.uniform(-1.0, 1.0, (3, 2, len(middle)))
        rates[0] *= SPAN * way * (0.1 if structure.loops else 1.0)
        motion = JointMotion(middle + rates[0], rates[1], rates[2], np.arange(2.0))
        ours, theirs = (model.robot.torques(motion.position, motion.velocity, motion.acceleration),
                        self.torques(motion))
        off = np.abs(ours - theirs)
        if np.max(off) <= AGREEMENT * max(float(np.abs(theirs).max()), 1.0):
            return
        for row, parameters in zip(model.robot.bodies, model.robot.inertial, strict=True):
            moments = principal_inertia(parameters)[2]
            if moments[0] < -AGREEMENT * np.abs(moments).max():
                raise ModelError('links.inertia', moments.tolist(), 'be moments of at least 0 '
                                 f'about the centre of mass of what {self._names[int(row)]} moves: '
                                 'correct links.mass, links.moment or links.inertia, or fit again')
        k, drive = np.unravel_index(int(np.argmax(off)), off.shape)
        raise ModelError(
            "robot.mjcf" if model.values.get("robot.mjcf") else "robot.urdf",
            structure.description.path, f'give one effort of {structure.drives[drive]}, but at '
            f'{motion.position[k].round(4).tolist()} it is {ours[k, drive]:.6g} in the model and '
            f'{theirs[k, drive]:.6g} in MuJoCo: please report this file')

    def carry(self, link: str, parameters: Array) -> None:
        """Add inertial parameters (10,) to a link, in the link's frame."""
        row, frame = self.structure.links[link]
        body = self.links[row]
        self._set(body, inertial_of(self.model, body) + inertial_in(
            self._frames[row].inverse @ frame, parameters))

    def shift_tool(self, offset: Array) -> None:
        """Move the centre of mass of what carries the tool by an offset in the tool's axes [m]."""
        row, frame = self.structure.links[self.structure.tool]
        self.model.body_ipos[self.links[row]] += self._frames[row].R.T @ frame.R @ offset
        self.engine.mj_setConst(self.model, self.data)

    def closed(self, motion: JointMotion) -> EngineMotion:
        """Return the engine's motion along one of the drives.

        Raises
        ------
        WorkspaceError
            Where the loops do not close.
        """
        if self._last is None or self._last[0] is not motion:
            links = LinkMotion.of(self.structure, motion.position, motion.velocity,
                                  motion.acceleration, nearby=self._nearby)
            self._nearby = links.motion.q[-1].copy()
            self._last = motion, self.state.closed(links)
        return self._last[1]

    def inertia(self) -> Array:
        """Return the inertia of the tree where the engine is, (nv, nv)."""
        found = np.empty((self.model.nv, self.model.nv))
        self.engine.mj_fullM(self.model, self.data, found)
        return found

    def carried(self, closed: EngineMotion, passive: Array | None = None) -> Carried:
        """Return inverse dynamics along a motion.

        Parameters
        ----------
        closed : EngineMotion
        passive : (N, nv) array, optional
            Efforts of the tree's joints besides, as against friction of passive joints.
        """
        model, data, engine = self.model, self.data, self.engine
        model.opt.gravity[:] = self.root.R.T @ self.gravity
        count = len(closed.position)
        needed = np.empty((count, model.nv))
        forces, axes = np.empty((count, model.nbody, 3)), np.empty((count, model.njnt, 3))
        wrench = np.broadcast_to(self.wrench, (count, 6)) if np.any(self.wrench) else None
        for k in range(count):
            data.qpos[:], data.qvel[:], data.qacc[:] = (
                closed.position[k], closed.velocity[k], closed.acceleration[k])
            engine.mj_inverse(model, data)
            needed[k] = data.qfrc_inverse
            if wrench is not None:
                needed[k] += self._pushed(wrench[k])
            engine.mj_rnePostConstraint(model, data)
            forces[k], axes[k] = data.cfrc_int[:, 3:], data.xaxis
        data.xfrc_applied[:] = 0.0
        if passive is not None:
            needed += passive
        reactions = np.einsum('nlij,nj->nli', closed.reactions, needed)
        forces -= np.einsum('bl,nli->nbi', self._behind, reactions)
        return Carried(np.einsum('nvd,nv->nd', closed.rates, needed), forces, axes, reactions)

    def torques(self, motion: JointMotion, passive: Array | None = None) -> Array:
        """Return inverse dynamics along a motion, (N, D); see `carried`."""
        return self.carried(self.closed(motion), passive).efforts

    def tool_velocity(self, closed: EngineMotion) -> Array:
        """Return the velocity of the tool's origin in the base, (N, 3) [m/s]."""
        found, jacobian = np.empty((len(closed.position), 3)), np.empty((3, self.model.nv))
        for k in range(len(found)):
            self.data.qpos[:] = closed.position[k]
            self.engine.mj_kinematics(self.model, self.data)
            self.engine.mj_comPos(self.model, self.data)
            self.engine.mj_jacSite(self.model, self.data, jacobian, None, self.state.sites[TOOL])
            found[k] = self.root.R @ jacobian @ closed.velocity[k]
        return found

    def friction(self, joints: JointFriction, closed: EngineMotion, carried: Carried) -> Rubbing:
        """Return the friction of joints along a motion.

        Friction is c w + (T + mu r F) tanh(w / width), F the force in the joint without friction:
        across the axis of a hinge or a slide, and all of it in a closure.
        """
        rows = np.zeros((len(closed.rates), len(joints.joint), 3, self.model.nv))
        force = np.empty((*rows.shape[:2], 3))
        driven, closures = np.flatnonzero(joints.joint >= 0), np.flatnonzero(joints.loop >= 0)
        names = [self._names[int(row)] for row in joints.joint[driven]]
        rows[:, driven, 0, [self.state.dof(name) for name in names]] = 1.0
        rows[:, closures] = closed.turns[:, joints.loop[closures]]
        force[:, driven] = self.across(names, carried)
        force[:, closures] = carried.reactions[:, joints.loop[closures]]
        return Rubbing(joints, rows, joints.torque + joints.lever * np.linalg.norm(force, axis=2))

    def across(self, names: Sequence[str], carried: Carried) -> Array:
        """Return the forces across the axes of joints, (N, K, 3)."""
        bodies = [self.links[self.structure.rows[name]] for name in names]
        return np.cross(carried.forces[:, bodies],
                        carried.axes[:, [self.state.numbers[name] for name in names]])

    def joint_friction(self, motion: JointMotion, joints: JointFriction, rounds: int = 1) -> Array:
        """Return efforts against friction of joints along a motion, (N, D); see `friction`.

        With more than one round the loads are those with friction of passive joints.
        """
        closed = self.closed(motion)
        effort: Array | None = None
        for _ in range(rounds):
            rubbing = self.friction(joints, closed, self.carried(closed, effort))
            effort = rubbing.efforts(closed.velocity)
            if rounds > 1:
                effort[:, self.state.drives] = 0.0  # a guide's friction loads no other joint
        return rubbing.of_drives(closed)

    def _pushed(self, wrench: Array) -> Array:
        """Let the tool apply a wrench (6,) in the base, and return the joints' efforts, (nv,)."""
        data, efforts, site = self.data, np.zeros(self.model.nv), self.state.sites[TOOL]
        body, at = int(self.model.site_bodyid[site]), data.site_xpos[site]
        force, moment = (self.root.R.T @ part for part in (wrench[:3], wrench[3:]))
        self.engine.mj_applyFT(self.model, data, force, moment, at, body, efforts)
        data.xfrc_applied[:] = 0.0
        data.xfrc_applied[body] = -np.concatenate(
            (force, moment + np.cross(at - data.xipos[body], force)))
        return efforts


class Carried(NamedTuple):
    """Inverse dynamics along a motion, without friction.

    Parameters
    ----------
    efforts : (N, D) array
        Of the drives.
    forces : (N, bodies, 3) array
        On each body from the one that it hangs on, in the engine's world [N].
    axes : (N, joints, 3) array
        Of the joints, in the engine's world.
    reactions : (N, L, 3) array
        Force of each closure on its second link [N].
    """

    efforts: Array
    forces: Array
    axes: Array
    reactions: Array


class Rubbing(NamedTuple):
    """Friction of K joints along a motion.

    Parameters
    ----------
    joints : JointFriction
    rows : (N, K, 3, nv) array
        Relative velocities per velocity of the tree's joints; a hinge's are in the first row.
    dry : (N, K) array
        Dry friction [N m, N].
    """

    joints: JointFriction
    rows: Array
    dry: Array

    def coefficients(self, rates: Array) -> Array:
        """Return friction over rate, (N, K), of relative velocities (N, K, 3)."""
        width = self.joints.width
        x = np.maximum(np.sqrt(np.einsum('nki,nki->nk', rates, rates)) / width, SLOWEST)
        found: Array = self.joints.viscous + self.dry * np.tanh(x) / (x * width)
        return found

    def efforts(self, velocity: Array) -> Array:
        """Return the efforts of the tree's joints against it, (N, nv)."""
        rates = np.einsum('nkiv,nv->nki', self.rows, velocity)
        return np.einsum('nk,nki,nkiv->nv', self.coefficients(rates), rates, self.rows,
                         optimize=True)

    def of_drives(self, closed: EngineMotion) -> Array:
        """Return the efforts of the drives against it, (N, D)."""
        return np.einsum('nvd,nv->nd', closed.rates, self.efforts(closed.velocity))


def load_engine(purpose: str = 'the simulated robot') -> Any:
    """Return the module mujoco.

    Parameters
    ----------
    purpose : str
        Feature that needs it, for the message.

    Raises
    ------
    MissingLibraryError
        If it is not installed.
    """
    mujoco = optional_library('mujoco', 'mujoco', purpose, 'sim')
    if mujoco.get_mju_user_warning() is None:
        # By default it writes MUJOCO_LOG.TXT into the user's folder; warnings are counted anyway.
        mujoco.set_mju_user_warning(lambda message: None)
    return mujoco


def _is_body(parameters: Array) -> bool:
    """Return whether MuJoCo takes a body: no moment of inertia above the sum of the others."""
    _, _, (low, middle, high), _ = principal_inertia(parameters)
    return bool(low >= 0 and high <= low + middle)


def _bare(path: Path, refused: Container[str]) -> str:
    """Return a URDF without shapes, and without the inertia of links that MuJoCo refuses."""
    robot = ElementTree.fromstring(urdf_content(str(path)))
    for link in robot.findall('link'):
        inertia = link.findall('inertial') if link.get('name', '') in refused else []
        for part in (*link.findall('visual'), *link.findall('collision'), *inertia):
            link.remove(part)
    names = {link.get('name') for link in robot.findall('link')}
    if WORLD not in names and any(
            parent.get('link') == WORLD for parent in robot.findall('joint/parent')):
        ElementTree.SubElement(robot, 'link', name=WORLD)
    for other in robot.findall('mujoco'):
        robot.remove(other)
    ElementTree.SubElement(ElementTree.SubElement(robot, 'mujoco'), 'compiler', COMPILER)
    return ElementTree.tostring(robot, encoding='unicode')
