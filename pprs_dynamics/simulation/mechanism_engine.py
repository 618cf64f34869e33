# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""MuJoCo's model of a mechanism: its kinematics, inertia, gravity and reactions.

MuJoCo reads the description itself. Its masses, inertias, gravity and couplings are retained:
`MechanismEngine` raises where the model reads the description otherwise.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Container, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import ModelError
from pprs_dynamics.physics.mechanism.description import (
    PARAMETERS,
    Frame,
    body_at,
    inertial_in,
    principal_inertia,
)
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.mjcf import readable_spec
from pprs_dynamics.physics.mechanism.structure import Structure
from pprs_dynamics.physics.mechanism.tree_equations import JointFriction
from pprs_dynamics.physics.mechanism.urdf import WORLD, expanded
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.robot_block import described_gravity
from pprs_dynamics.simulation.engine_loops import ClosedMotion, EngineLoops, cross
from pprs_dynamics.simulation.engine_model import load_engine
from pprs_dynamics.simulation.engine_state import EngineState

CARRIER = '_added_to_'  # body of what is added to a joint
LEAST = 1e-12  # [kg, kg m^2], of bodies that another's inertia contains
COMPILER = {'fusestatic': 'false', 'balanceinertia': 'false', 'boundmass': str(LEAST),
            'boundinertia': str(LEAST)}
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
    """

    def __init__(self, model: DriveModel) -> None:
        self.engine = mujoco = load_engine('a simulated robot')
        robot = self.robot = self.described = model.robot
        structure = self.structure = robot.structure
        path = Path(structure.description.path)
        is_mjcf = bool(model.values.get('robot.mjcf'))
        reads_urdf = model.is_described and not is_mjcf
        refused = {name: parameters for name, parameters in structure.description.links.items()
                   if reads_urdf and structure.links[name][0] and not _is_body(parameters)}
        if not model.is_described:
            spec = _single_axis(mujoco, structure)
        elif is_mjcf:
            spec = readable_spec(mujoco, str(path))
        else:
            spec = mujoco.MjSpec.from_string(_bare(path, refused))
            spec.fuse_static()
        placed = {body.name: structure.links[body.name] for body in spec.bodies[1:]
                  if body.name in structure.links}
        self._frames = {0: Frame()}
        of_row: dict[int, str] = {}
        for name, (row, frame) in placed.items():
            if row and row not in of_row:
                of_row[row], self._frames[row] = name, frame
                self._add_carrier(spec.body(name), row)
        self.model = spec.compile()
        self.links = {0: 0} | {row: int(self.model.body(name).id) for row, name in of_row.items()}
        for name, row in structure.rows.items():  # of several joints on a body
            if row not in self.links:
                self.links[row] = int(self.model.jnt_bodyid[self.model.joint(name).id])
        self._added = {row: np.zeros(PARAMETERS) for row in of_row}
        # MuJoCo's world is the root of the description, ours its base.
        hung = {joint.child for joint in structure.description.joints.values()}
        root = next(name for name in structure.description.links if name not in hung)
        self.root = structure.links[root][1]
        self.state = EngineState(mujoco, self.model, structure, self.root)
        self.data = self.state.data
        self.model.dof_armature[:], self.model.dof_damping[:] = 0.0, 0.0
        self.model.dof_frictionloss[:], self.model.jnt_stiffness[:] = 0.0, 0.0
        self._names = {row: name for name, row in structure.rows.items()}
        self.loops = EngineLoops(self.state, self.links, self._frames)
        self._last: tuple[JointMotion, ClosedMotion] | None = None
        for name, parameters in refused.items():
            row, frame = structure.links[name]
            self._carry(row, inertial_in(frame, parameters))
        for row, parameters in zip(robot.bodies, robot.inertial, strict=True):
            if not np.array_equal(parameters, structure.inertial[row]):
                for name, (of, _) in placed.items():
                    if of == row:
                        body = self.model.body(name).id
                        self.model.body_mass[body] = self.model.body_inertia[body] = LEAST
                self._carry(int(row), parameters - self._added[int(row)])
        weightless = self.model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY
        own = np.zeros(3) if weightless else self.model.opt.gravity
        self.gravity = (self.root.R @ own if robot.gravity == described_gravity(structure)
                        else np.array(robot.gravity))
        self.model.opt.disableflags = mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        self.wrench = np.zeros(6)  # that the tool applies at its origin, in the base's axes
        mujoco.mj_setConst(self.model, self.data)
        self._require_agreement(model)

    def _add_carrier(self, body: Any, row: int) -> None:
        """Add a body to one of the description's, in the joint's frame, for what is added to it."""
        frame = self._frames[row].inverse
        carrier = body.add_body(name=f'{CARRIER}{row}', pos=frame.p, quat=self._quaternion(frame.R))
        # Off the frame, else MuJoCo takes short cuts that hold for this inertia alone.
        carrier.mass, carrier.ipos, carrier.iquat = LEAST, (0.1, 0.2, 0.3), (1.0, 0.1, 0.2, 0.3)
        carrier.inertia, carrier.explicitinertial = (LEAST, 1.1 * LEAST, 1.2 * LEAST), True

    def _quaternion(self, R: Array) -> Array:
        quaternion = np.empty(4)
        self.engine.mju_mat2Quat(quaternion, np.ascontiguousarray(R).ravel())
        return quaternion

    def _carry(self, row: int, parameters: Array) -> None:
        """Add inertial parameters (10,) to what a joint moves, in the joint's frame."""
        self._added[row] = self._added[row] + parameters
        body = self.model.body(f'{CARRIER}{row}').id
        mass, centre, moments, axes = principal_inertia(self._added[row])
        self.model.body_mass[body], self.model.body_ipos[body] = mass, centre
        self.model.body_inertia[body] = np.maximum(moments, LEAST)
        self.model.body_iquat[body] = self._quaternion(axes)
        self.engine.mj_setConst(self.model, self.data)

    def _require_agreement(self, model: DriveModel) -> None:
        """Raise ModelError where MuJoCo's efforts without friction are others than the model's."""
        structure, random = self.structure, np.random.default_rng(0)
        middle, way = structure.room(WIDEST)
        rates = random.uniform(-1.0, 1.0, (3, 2, len(middle)))
        rates[0] *= SPAN * way * (0.1 if structure.loops else 1.0)
        motion = JointMotion(middle + rates[0], rates[1], rates[2], np.arange(2.0))
        ours, theirs = model.mechanism(motion).transmitted, self.torques(motion)
        off = np.abs(ours - theirs)
        if np.max(off) <= AGREEMENT * max(float(np.abs(theirs).max()), 1.0):
            return
        k, drive = np.unravel_index(int(np.argmax(off)), off.shape)
        raise ModelError(
            "robot.mjcf" if model.values.get("robot.mjcf") else "robot.urdf",
            structure.description.path, f'give one effort of {structure.drives[drive]}, but at '
            f'{motion.position[k].round(4).tolist()} it is {ours[k, drive]:.6g} in the model and '
            f'{theirs[k, drive]:.6g} in MuJoCo: please report this file')

    def add_payload(self, mass: float, offset: Array) -> None:
        """Hang a point mass on the tool, `offset` from its origin in its axes [m]."""
        x, y, z = offset
        point = mass * np.array([1, x, y, z, y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z,
                                 x * x + y * y])
        row, frame = self.structure.links[self.structure.tool]
        self._carry(row, inertial_in(frame, point))
        self.robot = self.robot.with_body(self.structure.tool, point)

    def add_to_link(self, body: int, mass: float) -> None:
        """Put a point mass at the centre of a body [kg]."""
        row = int(self.robot.bodies[body])
        parameters = self.robot.inertial[body]
        link = self.robot.body_names[body]
        centre = parameters[1:4] / parameters[0]
        self._carry(row, body_at(mass, tuple(centre), np.zeros((3, 3))))
        at = self.structure.links[link][1].inverse.of_point(centre)
        self.robot = self.robot.with_body(link, body_at(mass, tuple(at), np.zeros((3, 3))))

    def inverse(self, position: Array, velocity: Array, acceleration: Array,
                ) -> tuple[Array, Array, Array]:
        """Return efforts of all joints of the tree, (nv,), its inertia, and rates (nv, D).

        For a motion of the drives, (D,) each, that goes on from where the engine is.
        """
        self.model.opt.gravity[:] = self.root.R.T @ self.gravity
        rates = self.loops.put(position, velocity, acceleration)
        self.engine.mj_inverse(self.model, self.data)
        inertia = np.empty((self.model.nv, self.model.nv))
        self.engine.mj_fullM(self.model, self.data, inertia)
        return self.data.qfrc_inverse, inertia, rates

    def home(self) -> None:
        """Put the engine where the description is assembled."""
        drives = self.structure.home[None, self.structure.tables.drives]
        rest = np.zeros_like(drives)
        self.state.put(self.robot.at(drives, rest, rest).motion, 0)
        self.loops.forget()

    def closed(self, motion: JointMotion) -> ClosedMotion:
        """Return the engine's own motion along one of the drives."""
        if self._last is None or self._last[0] is not motion:
            self.home()
            self._last = motion, self.loops.follow(motion)
        return self._last[1]

    def _needed(self, motion: JointMotion) -> Iterator[tuple[int, Array, Array]]:
        """Yield samples, efforts of all joints of the tree (nv,), and rates (nv, D) of a motion.

        The engine is there.
        """
        self.model.opt.gravity[:] = self.root.R.T @ self.gravity
        closed, data = self.closed(motion), self.data
        for k in range(len(motion)):
            data.qpos[:], data.qvel[:], data.qacc[:] = (
                closed.position[k], closed.velocity[k], closed.acceleration[k])
            self.engine.mj_inverse(self.model, data)
            yield k, data.qfrc_inverse + self._of_wrench(), closed.rates[k]

    def torques(self, motion: JointMotion, passive: Mapping[str, Array] | None = None) -> Array:
        """Return inverse dynamics along a motion, (N, D).

        Parameters
        ----------
        motion : JointMotion
        passive : mapping of str to (N,) array, optional
            Efforts against friction of passive joints, by joint.
        """
        found = np.empty_like(motion.position)
        for k, needed, rates in self._needed(motion):
            for name, effort in (passive or {}).items():
                needed[self.state.dof(name)] += effort[k]
            found[k] = rates.T @ needed
        return found

    def joint_friction(self, motion: JointMotion, joints: JointFriction) -> Array:
        """Return efforts against friction of passive joints along a motion, (N, D).

        Friction is c w + (T + mu r F) tanh(w / width), F what the joint transmits without it:
        across the axis of a hinge, and all of it in a closure.
        """
        found = np.empty_like(motion.position)
        for k, needed, rates in self._needed(motion):
            found[k] = rates.T @ self.rubbing(joints, needed, rates.T @ needed)
        return found

    def rubbing(self, joints: JointFriction, needed: Array, efforts: Array) -> Array:
        """Return efforts of the tree's joints against friction where the engine is, (nv,)."""
        rows, coefficients = self.friction_of(joints, needed, efforts)
        rates = rows @ self.data.qvel
        found: Array = np.einsum('k,ki,kin->n', coefficients(rates), rates, rows)
        return found

    def friction_of(self, joints: JointFriction, needed: Array, efforts: Array,
                    ) -> tuple[Array, Callable[[Array], Array]]:
        """Return relative velocities of rubbing joints by the engine's, (K, 3, nv), and a law.

        The law gives friction over rate, (K,), of rates (K, 3): a hinge's stand in the first.
        """
        loads, data = self.transmitted(needed, efforts), self.data
        turns = self.loops.relative(self.loops.frames()[1][1])[1]
        hinges, closures = np.flatnonzero(joints.joint >= 0), np.flatnonzero(joints.loop >= 0)
        names = [self._names[int(row)] for row in joints.joint[hinges]]
        rows = np.zeros((len(joints.joint), 3, self.model.nv))
        rows[hinges, 0, [self.state.dof(name) for name in names]] = 1.0
        rows[closures] = turns[joints.loop[closures]]
        force = np.empty((len(joints.joint), 3))
        bodies = [self.links[int(row)] for row in joints.joint[hinges]]
        force[hinges] = cross(data.cfrc_int[bodies, 3:],
                              data.xaxis[[self.state.number(name) for name in names]])
        force[closures] = loads[joints.loop[closures], :3]
        dry = joints.torque + joints.lever * np.sqrt(np.sum(force * force, axis=1))

        def coefficients(rates: Array) -> Array:
            x = np.maximum(np.linalg.norm(rates, axis=1) / joints.width, SLOWEST)
            found: Array = joints.viscous + dry * np.tanh(x) / (x * joints.width)
            return found

        return rows, coefficients

    def transmitted(self, needed: Array, efforts: Array) -> Array:
        """Return what closures transmit where the engine is, (L, 6), and have it find the rest."""
        data = self.data
        forces = self.loops.transmitted(needed, efforts)
        self.loops.apply(forces)
        if self.wrench.any():
            body, at = self._tool()
            force, moment = (self.root.R.T @ part for part in (self.wrench[:3], self.wrench[3:]))
            data.xfrc_applied[body, :3] -= force
            data.xfrc_applied[body, 3:] -= moment + np.cross(at - data.xipos[body], force)
        self.engine.mj_rnePostConstraint(self.model, data)
        data.xfrc_applied[:] = 0.0
        return forces

    def _tool(self) -> tuple[int, Array]:
        """Return the body that has the tool, and the tool's origin in the engine's world."""
        row, frame = self.structure.links[self.structure.tool]
        body, own = self.links[row], self._frames[row].inverse
        there = Frame(self.data.xmat[body].reshape(3, 3), self.data.xpos[body])
        return body, there.of_point(own.of_point(frame.p))

    def _of_wrench(self) -> Array:
        """Return the efforts of all joints with which the tool applies the wrench, (nv,)."""
        (body, at), efforts = self._tool(), np.zeros(self.model.nv)
        self.engine.mj_applyFT(self.model, self.data, self.root.R.T @ self.wrench[:3],
                               self.root.R.T @ self.wrench[3:], at, body, efforts)
        return efforts


def _single_axis(mujoco: Any, structure: Structure) -> Any:
    """Return a carriage on a slide; its mass follows from the model's."""
    spec, (joint,) = mujoco.MjSpec(), structure.description.joints.values()
    carriage = spec.worldbody.add_body(name=joint.child)
    carriage.mass, carriage.inertia, carriage.explicitinertial = LEAST, [LEAST] * 3, True
    carriage.add_joint(name=joint.name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=joint.axis)
    return spec


def _is_body(parameters: Array) -> bool:
    """Return whether MuJoCo takes a body: no moment of inertia above the sum of the others."""
    _, _, (low, middle, high), _ = principal_inertia(parameters)
    return bool(low >= 0 and high <= low + middle)


def _bare(path: Path, refused: Container[str]) -> str:
    """Return a URDF without shapes, and without the inertia of links that MuJoCo refuses."""
    robot = ElementTree.fromstring(expanded(str(path)))
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
