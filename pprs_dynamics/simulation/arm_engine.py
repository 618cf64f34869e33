# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""MuJoCo's model of a mechanism: its kinematics, inertia, gravity and reactions.

MuJoCo reads the URDF by a parser of its own; the model's numbers are put into its bodies.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism.description import Frame, body_at, principal_inertia
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.mechanism import Mechanism
from pprs_dynamics.physics.mechanism.tree_equations import JointFriction
from pprs_dynamics.physics.mechanism.urdf import expanded
from pprs_dynamics.physics.model.mechanism_model import MechanismModel
from pprs_dynamics.simulation.arm_forms import tilted, truth
from pprs_dynamics.simulation.engine_loops import ClosedMotion, EngineLoops, cross
from pprs_dynamics.simulation.engine_model import load_engine
from pprs_dynamics.simulation.engine_state import EngineState

COMPILER = {'fusestatic': 'true', 'balanceinertia': 'false'}
SLOWEST = 1e-9  # of the width in which friction turns over, below which tanh(x) / x is 1
LEAST = 1e-9  # [kg, kg m^2], of bodies that another's inertia contains


class ArmEngine:
    """MuJoCo's model of a mechanism.

    Its kinematics, inertia, gravity and reactions: of the model it has the numbers, and how the
    description is assembled.

    Parameters
    ----------
    model : MechanismModel
    """

    def __init__(self, model: MechanismModel) -> None:
        self.engine = mujoco = load_engine('a simulated robot')
        robot = self.robot = self.described = model.robot
        structure = self.structure = robot.structure
        path = Path(structure.description.path)
        if path.suffix == '.urdf' or model.values.get(f'{model.block}.urdf'):
            self.model = mujoco.MjModel.from_xml_string(_bare(path))
        else:
            self.model = mujoco.MjModel.from_xml_path(str(path))
        # MuJoCo's world is the root of the description, ours its base.
        hung = {joint.child for joint in structure.description.joints.values()}
        root = next(name for name in structure.description.links if name not in hung)
        self.root = structure.links[root][1]
        self.state = EngineState(mujoco, self.model, structure, self.root)
        self.data = self.state.data
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        self.model.dof_armature[:], self.model.dof_damping[:] = 0.0, 0.0
        self.model.dof_frictionloss[:], self.model.jnt_stiffness[:] = 0.0, 0.0
        # All that is fixed to a joint is in its inertial parameters: other bodies weigh nothing.
        self.model.body_mass[1:], self.model.body_inertia[1:] = LEAST, LEAST
        self.links = {row: int(self.model.body(structure.moved_by[row]).id)
                      for row in {0, *structure.rows.values(), *structure.tables.loop_a.tolist(),
                                  *structure.tables.loop_b.tolist(), *robot.bodies.tolist()} if row}
        self.links[0] = 0
        self._names = {row: name for name, row in structure.rows.items()}
        self.loops = EngineLoops(self.state, self.links)
        self._last: tuple[JointMotion, ClosedMotion] | None = None
        for row, parameters in zip(robot.bodies, robot.inertial, strict=True):
            self._set_body(self.links[int(row)], parameters)
        mujoco.mj_setConst(self.model, self.data)
        self.gravity = np.asarray(robot.gravity, dtype=float)
        self.wrench = np.zeros(6)  # that the tool applies at its origin, in the base's axes

    def _set_body(self, body: int, parameters: Array) -> None:
        mass, centre, moments, axes = principal_inertia(parameters)
        self.model.body_mass[body], self.model.body_ipos[body] = mass, centre
        self.model.body_inertia[body] = np.maximum(moments, LEAST)
        quaternion = np.empty(4)
        self.engine.mju_mat2Quat(quaternion, axes.ravel())
        self.model.body_iquat[body] = quaternion

    def _put(self, robot: Mechanism, row: int) -> None:
        self.robot = robot
        at = int(np.flatnonzero(robot.bodies == row)[0])
        self._set_body(self.links[row], robot.inertial[at])
        self.engine.mj_setConst(self.model, self.data)

    def add_payload(self, mass: float, offset: Array) -> None:
        """Hang a point mass on the tool, `offset` from its origin in its axes [m]."""
        x, y, z = offset
        tool = self.structure.tool
        point = mass * np.array([1, x, y, z, y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z,
                                 x * x + y * y])
        row = self.structure.links[tool][0]
        self.links.setdefault(row, int(self.model.body(self.structure.moved_by[row]).id))
        self._put(self.robot.with_body(tool, point), row)

    def add_to_link(self, body: int, mass: float) -> None:
        """Put a point mass at the centre of a body [kg]."""
        row = int(self.robot.bodies[body])
        parameters = self.robot.inertial[body]
        link = self.robot.body_names[body]
        _, frame = self.structure.links[link]
        centre = frame.inverse.of_point(parameters[1:4] / parameters[0])
        self._put(self.robot.with_body(link, body_at(mass, tuple(centre), np.zeros((3, 3)))), row)

    def hide_payload(self, random: np.random.Generator, scale: float, ahead: float,
                     ) -> dict[str, Any]:
        """Hang a point on the tool, so far along its z axis [m], and return what it is."""
        mass = scale * float(random.uniform(0.05, 0.12)) * float(self.described.masses.sum())
        self.add_payload(mass, np.array([0.0, 0.0, ahead]))
        return truth('payload_mass', None, {'mass': mass}, (
            f'a point {100 * ahead:g} cm before the tool' if ahead else
            'a point at the tool\'s origin'))

    def hide_link_mass(self, random: np.random.Generator, scale: float, links: Sequence[int],
                       ) -> dict[str, Any]:
        """Make one of some bodies heavier, and return what was done."""
        body = int(random.choice(links))
        mass = scale * float(random.uniform(0.1, 0.3)) * float(self.described.masses[body])
        self.add_to_link(body, mass)
        return truth('link_mass', None, {f'{self.described.body_names[body]}.mass': mass},
                     'a point at its centre')

    def hide_tilt(self, random: np.random.Generator, scale: float) -> dict[str, Any]:
        """Let the base lean, and return how."""
        angle = scale * float(random.uniform(0.01, 0.03))
        self.gravity = tilted(self.gravity, angle)
        return truth('base_tilt', None, {'x': angle, 'y': 0.0}, 'about x')

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
        row, frame = self.structure.links[self.structure.tool]
        if self.wrench.any():
            body = self.links[row]
            at = Frame(data.xmat[body].reshape(3, 3), data.xpos[body]).of_point(frame.p)
            force, moment = (self.root.R.T @ part for part in (self.wrench[:3], self.wrench[3:]))
            data.xfrc_applied[body, :3] -= force
            data.xfrc_applied[body, 3:] -= moment + np.cross(at - data.xipos[body], force)
        self.engine.mj_rnePostConstraint(self.model, data)
        data.xfrc_applied[:] = 0.0
        return forces

    def _of_wrench(self) -> Array:
        """Return the efforts of all joints with which the tool applies the wrench, (nv,)."""
        row, frame = self.structure.links[self.structure.tool]
        body, efforts = self.links[row], np.zeros(self.model.nv)
        at = Frame(self.data.xmat[body].reshape(3, 3), self.data.xpos[body]).of_point(frame.p)
        self.engine.mj_applyFT(self.model, self.data, self.root.R.T @ self.wrench[:3],
                               self.root.R.T @ self.wrench[3:], at, body, efforts)
        return efforts


def _bare(path: Path) -> str:
    """Return a URDF without meshes, every link with some mass: it is set afterwards."""
    robot = ElementTree.fromstring(expanded(str(path)))
    for link in robot.findall('link'):
        for part in (*link.findall('visual'), *link.findall('collision'),
                     *link.findall('inertial')):
            link.remove(part)
        inertial = ElementTree.SubElement(link, 'inertial')
        # Off the frame, else MuJoCo takes short cuts that hold for this inertia alone.
        ElementTree.SubElement(inertial, 'origin', xyz='0.1 0.2 0.3', rpy='0.1 0.2 0.3')
        ElementTree.SubElement(inertial, 'mass', value='1')
        ElementTree.SubElement(inertial, 'inertia', ixx='1', iyy='1.1', izz='1.2', ixy='0', ixz='0',
                               iyz='0')
    ElementTree.SubElement(ElementTree.SubElement(robot, 'mujoco'), 'compiler', COMPILER)
    return ElementTree.tostring(robot, encoding='unicode')
