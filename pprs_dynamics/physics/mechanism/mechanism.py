# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A mechanism with its bodies: an axis, a serial arm, or a tree whose loops are closed.

References
----------
R. Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 8.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import SingularityError, WorkspaceError
from pprs_dynamics.physics.mechanism.description import PARAMETERS, Frame, inertial_in
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.passive_joints import friction_table, passive_joints
from pprs_dynamics.physics.mechanism.places import BodyPlace, PassiveJoint
from pprs_dynamics.physics.mechanism.reversal import Reversal, smooth_sign
from pprs_dynamics.physics.mechanism.structure import Structure
from pprs_dynamics.physics.mechanism.structure_load import StructureLoad
from pprs_dynamics.physics.mechanism.tree_equations import (
    CONDITION,
    DETERMINANT,
    JOINT_EFFORT,
    KIND,
    LOOP,
    OPEN_IN_MOTION,
    TRANSLATION,
    TRANSMITTED,
    WORST_CONDITION,
    Data,
    JointFriction,
    Loads,
    residual,
)
from pprs_dynamics.physics.mechanism.tree_evaluation import (
    NO_FRICTION,
    InverseDynamicsResult,
    samples_last,
)
from pprs_dynamics.system.parallel import lazy


@dataclass(frozen=True, eq=False)
class Mechanism:
    """Bodies on a structure.

    Parameters
    ----------
    structure : Structure
    bodies : (B,) int array
        Joints whose links have mass or inertia.
    inertial : (B, 10) array
        Inertial parameters of what they move up to the next: m, m c, and the inertia xx xy yy xz
        yz zz about the joint's origin, in the joint's frame [kg, kg m, kg m^2].
    armature : (D,) array
        Inertia of the rotors, seen at the drives [kg m^2, kg].
    gravity : (3,) sequence
        In the base's frame [m/s^2].
    radii : mapping of str to float
        At which loads of joints rub [m], where known.
    motors : mapping of str to (D,) sequence
        Turns of motors per turn of each drive, of motors that move more than one.
    load_is_known : bool
        Whether what rubs in the drives is what they carry, and no preload.
    """

    structure: Structure
    bodies: np.typing.NDArray[np.int_]
    inertial: Array
    armature: Array
    gravity: tuple[float, float, float]
    radii: Mapping[str, float] = field(default_factory=dict)
    motors: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    load_is_known: bool = True

    @property
    def masses(self) -> Array:
        """Of the bodies [kg], (B,)."""
        return self.inertial[:, 0]

    @property
    def body_names(self) -> tuple[str, ...]:
        """Links that the bodies are of: the first on each joint."""
        return tuple(self.structure.moved_by[int(row)] for row in self.bodies)

    @property
    def body_joints(self) -> tuple[str, ...]:
        """Joints that move the bodies; of a floating joint the link."""
        joints = {row: name for name, row in self.structure.rows.items()}
        return tuple(joints.get(int(row), name)
                     for row, name in zip(self.bodies, self.body_names, strict=True))

    @property
    def carrier(self) -> int:
        """Number of the body that carries the tool, or -1 where that has no mass."""
        found = np.flatnonzero(self.bodies == self.structure.links[self.structure.tool][0])
        return int(found[0]) if len(found) else -1

    @cached_property
    def by_joint(self) -> Array:
        """Inertial parameters by joint, (J + 1, 10)."""
        table = np.zeros((len(self.structure.tables.parent), PARAMETERS))
        table[self.bodies] = self.inertial
        return table

    @cached_property
    def gravity_row(self) -> Array:
        """`gravity` as an array."""
        return np.array(self.gravity, dtype=float)

    @property
    def numbers(self) -> Array:
        """All numbers besides the structure that determine efforts, in one row."""
        return np.concatenate((self.inertial.ravel(), self.armature, self.gravity))

    @cached_property
    def passive_joints(self) -> tuple[PassiveJoint, ...]:
        """Joints and rotating loops without a drive."""
        return passive_joints(self.structure, self.radii)

    @property
    def tool_place(self) -> BodyPlace:
        """Where a payload is: at the origin of the tool."""
        carried = float(self.masses[self.carrier]) if self.carrier >= 0 else 0.0
        return BodyPlace(self.structure.tool, (0.0, 0.0, 0.0), carried)

    @property
    def link_places(self) -> tuple[BodyPlace, ...]:
        """The links with mass but that of the tool, each with its centre of mass."""
        found = []
        for k, name in enumerate(self.body_names):
            if k != self.carrier and self.masses[k] > 0:
                _, frame = self.structure.links[name]
                x, y, z = frame.inverse.of_point(self.inertial[k, 1:4] / self.inertial[k, 0])
                found.append(BodyPlace(name, (round(float(x), 6), round(float(y), 6),
                                              round(float(z), 6)), float(self.masses[k])))
        return tuple(found)

    @property
    def moved_mass(self) -> float:
        """Mass of all bodies [kg]."""
        return float(self.masses.sum())

    def friction_table(self, blocks: Mapping[str, Mapping[str, float]], reversal: Reversal,
                       ) -> JointFriction:
        """Return friction of joints as `MechanismState.against_friction` takes it."""
        return friction_table(self.structure, blocks, reversal)

    def with_body(self, link: str, parameters: Array) -> Mechanism:
        """Return the mechanism with a body more on a link.

        Parameters
        ----------
        link : str
        parameters : (10,) array
            In the link's frame; see `inertial`.
        """
        row, frame = self.structure.links[link]
        added = inertial_in(frame, parameters)
        at = np.flatnonzero(self.bodies == row)
        if len(at):
            inertial = self.inertial.copy()
            inertial[at[0]] += added
            return replace(self, inertial=inertial)
        return replace(self, bodies=np.append(self.bodies, row),
                       inertial=np.vstack((self.inertial, added)))

    def at(self, position: Array, velocity: Array, acceleration: Array) -> LinkMotion:
        """Return the motion of all links for that of the drives, (N, D) each.

        Raises
        ------
        WorkspaceError
            Where the loops do not close.
        SingularityError
            Where the drives do not determine the motion.
        """
        return LinkMotion.of(self.structure, position, velocity, acceleration)

    def torques(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        """Return the efforts of the drives that move the bodies, (N, D) [N m, N]."""
        return self.at(position, velocity, acceleration).efforts(self)

    def regressor(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        """Return the derivatives of the efforts by `inertial`, (N, D, 10 B)."""
        return self.at(position, velocity, acceleration).regressor(self)


@dataclass(frozen=True, eq=False)
class LinkMotion:
    """The motion of all links of a structure, at N samples.

    Parameters
    ----------
    structure : Structure
    rows : (N, K) array
        See `Evaluation.forward_kinematics`.
    drives : tuple of (N, D) arrays
        What it was computed for: position, velocity and acceleration.
    """

    structure: Structure
    rows: Array
    drives: tuple[Array, Array, Array]

    @classmethod
    def of(cls, structure: Structure, position: Array, velocity: Array, acceleration: Array,
           start: Array | None = None, nearby: Array | None = None) -> LinkMotion:
        """Return the motion, or raise as `Mechanism.at`; see `Evaluation.forward_kinematics`."""
        rows, failed = structure.evaluation.forward_kinematics(
            position, velocity, acceleration, start, nearby)
        if failed >= 0:
            raise WorkspaceError(failed, 'the loops do not close for the positions of the drives',
                                 'must be within reach, on the way from home')
        found = cls(structure, rows, (position, velocity, acceleration))
        if len(structure.tables.passive):
            found._require_regular()
        found._require_closed()
        return found

    @cached_property
    def motion(self) -> Data:
        """The motion by name."""
        return self.structure.evaluation.motion(self.rows)

    def is_of(self, position: Array, velocity: Array, acceleration: Array) -> bool:
        """Return whether it was computed for these very arrays."""
        return all(mine is other for mine, other in zip(
            self.drives, (position, velocity, acceleration), strict=True))

    @property
    def condition(self) -> Array:
        """Condition number of the loops over that at home, (N,); 0 without loops."""
        home = self.structure.evaluation.at_home[CONDITION]
        condition: Array = self.motion.solution[:, CONDITION] / (home or 1.0)
        return condition

    def _require_regular(self) -> None:
        home = self.structure.evaluation.at_home[DETERMINANT]
        lost = ~(self.motion.solution[:, DETERMINANT] * home > 0)
        if lost.any():
            raise SingularityError(
                int(np.argmax(lost)), 'the motion leaves the assembly of home through a '
                'singularity', 'the determinant of the loops must keep its sign')
        condition = self.condition
        poor = ~(condition < WORST_CONDITION)
        if poor.any():
            worst = int(np.argmax(poor))
            raise SingularityError(
                worst, f'the loops are {condition[worst]:.3g} times worse conditioned than at home',
                f'must be below {WORST_CONDITION:g}: the drives nearly lose hold')

    def _require_closed(self) -> None:
        """Raise WorkspaceError where rows that others implied at home no longer follow from them.

        At a home where joints are in line, others become dependent than elsewhere.
        """
        t = self.structure.tables
        implied = np.arange(len(t.passive), len(t.rows))
        if not len(implied):
            return
        m = samples_last(self.motion)
        residuals = np.stack([residual(t, m, int(r)) for r in implied], axis=-1)
        size = np.abs(residuals) / t.row_unit[implied]
        if np.all(size < OPEN_IN_MOTION):
            return
        sample = int(np.argmax(~np.all(size < OPEN_IN_MOTION, axis=1)))
        worst = int(np.argmax(size[sample]))
        row = implied[worst]
        by = abs(residuals[sample, worst])
        amount = (f'{1e3 * by:.3g} mm' if t.rows[row, KIND] == TRANSLATION
                  else f'{np.degrees(by):.3g} degrees')
        raise WorkspaceError(
            sample, f'the loop {self.structure.loops[t.rows[row, LOOP]].name} is open by {amount}',
            'must close as at home, where it follows from the other loops and joints alone: name a '
            'robot.home at which no links are in line')

    def frame_of(self, link: str) -> Frame:
        """Return the frames of a link in the base's, R (N, 3, 3) and p (N, 3)."""
        row, frame = self.structure.links[link]
        m = self.motion
        return Frame(m.R[:, row] @ frame.R, m.p[:, row] + m.R[:, row] @ frame.p)

    @cached_property
    def link_jacobians(self) -> tuple[Array, Array]:
        """Angular and linear velocity of links per rate of drives, (N, J + 1, 3, D)."""
        return self.structure.evaluation.link_jacobians(self.rows)

    def load_rows(self, mechanism: Mechanism,
                  wrenches: Mapping[int, tuple[Array, Array]] | None = None) -> Array:
        """Return the forces that move the bodies and apply wrenches; see `Evaluation.forces`."""
        return self.structure.evaluation.forces(
            self.rows, mechanism.by_joint, mechanism.gravity_row, wrenches)

    def loads(self, mechanism: Mechanism) -> Loads:
        """Return the forces that move the bodies, by name."""
        return self.structure.evaluation.loads(self.load_rows(mechanism))

    def efforts(self, mechanism: Mechanism) -> Array:
        """Return the efforts of the drives that move the bodies, (N, D)."""
        efforts: Array = self.loads(mechanism).efforts
        return efforts

    def wrenches_of(self, load: StructureLoad) -> dict[int, tuple[Array, Array]]:
        """Return a load as wrenches that links apply, by the joints that move them."""
        t, m = self.structure.tables, self.motion
        row, _ = self.structure.links[self.structure.tool]
        arm = self.frame_of(self.structure.tool).p - m.p[:, row]
        force, moment = load.wrench[:, :3], load.wrench[:, 3:]
        found = {row: (force, moment + np.cross(arm, force))}
        for name, torque in load.torques.items():
            row = self.structure.rows[name]
            along = torque[:, None] * m.z[:, row]
            none = np.zeros_like(along)
            # What the link of a joint applies, the one that it hangs on takes back.
            for one, sign in ((row, 1.0), (int(t.parent[row]), -1.0)):
                arm = m.p[:, row] - m.p[:, one]
                force, moment = (none, sign * along) if t.turns[row] else (
                    sign * along, sign * np.cross(arm, along))
                before = found.get(one, (none, none))
                found[one] = (before[0] + force, before[1] + moment)
        return found

    def regressor(self, mechanism: Mechanism) -> Array:
        """Return the derivatives of the efforts by the bodies' parameters, (N, D, 10 B)."""
        m, rows = self.motion, mechanism.bodies
        R = m.R[:, rows]

        def own(values: Array) -> Array:
            """Return vectors, or columns of vectors, in the axes of their bodies."""
            turned: Array = np.einsum('nbji,nbj...->nbi...', R, values)
            return turned

        W, U = (own(each[:, rows]) for each in self.link_jacobians)
        w, wd = own(m.w[:, rows])[..., None], own(m.wd[:, rows])[..., None]
        a = own(m.ud[:, rows] - np.asarray(mechanism.gravity))[..., None]

        def cross(x: Array, y: Array) -> Array:
            return np.stack([x[:, :, (i + 1) % 3] * y[:, :, (i + 2) % 3]
                             - x[:, :, (i + 2) % 3] * y[:, :, (i + 1) % 3] for i in range(3)],
                            axis=2)

        samples, drives = len(m.q), U.shape[-1]
        found = np.empty((samples, drives, len(rows), PARAMETERS))
        found[..., 0] = np.sum(U * a, axis=2).transpose(0, 2, 1)
        moment = (cross(U, wd) + w * np.sum(U * w, axis=2, keepdims=True)
                  - U * np.sum(w * w, axis=2, keepdims=True) + cross(a, W))
        found[..., 1:4] = moment.transpose(0, 3, 1, 2)
        c = cross(W, w)
        for k, (i, j) in enumerate(((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))):
            column = W[:, :, i] * wd[:, :, j] + c[:, :, i] * w[:, :, j]
            if i != j:
                column = column + W[:, :, j] * wd[:, :, i] + c[:, :, j] * w[:, :, i]
            found[..., 4 + k] = column.transpose(0, 2, 1)
        return found.reshape(samples, drives, -1)


@dataclass(frozen=True, eq=False)
class MechanismState(JointMotion):
    """A motion of a mechanism's drives with the quantities that effects take, (N, D) each.

    Efforts and the model's own friction of joints come from one pass that keeps nothing else; the
    motion of links and what joints transmit are computed when they are asked for.

    Parameters
    ----------
    robot : Mechanism
    reversal : Reversal
    load : StructureLoad, optional
    known : LinkMotion, optional
        The motion of all links, where it is there.
    friction : JointFriction
        The model's own, which is found with the efforts.
    start, nearby : (N, C) and (C,) arrays, optional
        See `Evaluation.forward_kinematics`.
    """

    robot: Mechanism = field(kw_only=True)
    reversal: Reversal = field(default_factory=Reversal, kw_only=True)
    load: StructureLoad | None = field(default=None, kw_only=True)
    known: LinkMotion | None = field(default=None, kw_only=True)
    friction: JointFriction = field(default=NO_FRICTION, kw_only=True)
    start: Array | None = field(default=None, kw_only=True)
    nearby: Array | None = field(default=None, kw_only=True)

    def __getitem__(self, samples: Any) -> Self:
        """Return the samples that a slice, a mask or indices select, with their load."""
        return replace(super().__getitem__(samples), known=None, start=None, nearby=None,
                       load=None if self.load is None else self.load.at(samples))

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of the drives."""
        return self.robot.structure.drives

    @lazy
    def inverse_dynamics(self) -> InverseDynamicsResult | None:
        """Closed coordinates, efforts and own friction in one pass; None where links are needed."""
        if self.known is not None or self.load is not None:
            return None
        robot = self.robot
        return robot.structure.evaluation.inverse_dynamics(
            (self.position, self.velocity, self.acceleration), robot.by_joint, robot.gravity_row,
            self.friction, None, self.start, self.nearby)

    @lazy
    def links(self) -> LinkMotion:
        """The motion of all links."""
        motion = self.position, self.velocity, self.acceleration
        if self.known is not None and self.known.is_of(*motion):
            return self.known
        found = vars(self).get('inverse_dynamics')
        start, nearby = (self.start, self.nearby) if found is None else (found.q, None)
        return LinkMotion.of(self.robot.structure, *motion, start, nearby)

    @property
    def closed(self) -> Array:
        """Closed coordinates, (N, C)."""
        return self.links.motion.q if self.inverse_dynamics is None else self.inverse_dynamics.q

    @lazy
    def direction(self) -> Array:
        """Sign of the velocity, sgn, turning over within the reversal velocity."""
        direction: Array = smooth_sign(self.velocity, np.asarray(self.reversal.velocity))
        return direction

    @lazy
    def rigid_force(self) -> Array:
        """Efforts without friction [N m, N]."""
        efforts: Array = self.transmitted + self.robot.armature * self.acceleration
        return efforts

    @property
    def transmitted(self) -> Array:
        """Efforts that the drives' gears pass on, without friction [N m, N].

        The motor accelerates its rotor on its own side of the gear.
        """
        efforts: Array = (self.reactions.efforts if self.inverse_dynamics is None
                          else self.inverse_dynamics.efforts[TRANSMITTED])
        return efforts

    @lazy
    def friction_load(self) -> Array:
        """What a drive's gear carries [N m, N]: the size of what it passes on; 0 if not known."""
        load: Array = np.abs(self.transmitted) * self.robot.load_is_known
        return load

    @lazy
    def _load_rows(self) -> Array:
        wrenches = None if self.load is None else self.links.wrenches_of(self.load)
        return self.links.load_rows(self.robot, wrenches)

    @lazy
    def reactions(self) -> Loads:
        """What joints and closures transmit without friction."""
        return self.robot.structure.evaluation.loads(self._load_rows)

    @property
    def tool_velocity(self) -> Array:
        """Linear velocity of the tool's origin and angular velocity, in `base`, (N, 6)."""
        links = self.links
        row, _ = links.structure.links[links.structure.tool]
        m = links.motion
        arm = links.frame_of(links.structure.tool).p - m.p[:, row]
        return np.concatenate((m.u[:, row] + np.cross(m.w[:, row], arm), m.w[:, row]), axis=1)

    def joint_position(self, joint: str) -> Array:
        """Return where a passive joint of the tree is, (N,) [rad, m]."""
        t, row = self.links.structure.tables, self.links.structure.rows[joint]
        position: Array = (t.ratio[row] * self.links.motion.q[:, t.coordinate[row]]
                           + t.offset[row])
        return position

    @property
    def position_step(self) -> float:
        """By which a drive is moved for derivatives [rad, m]."""
        return 1e-4

    def perturbed(self, drive: int, step: float) -> MechanismState:
        """Return the state with a drive at other positions, which moves as it did."""
        position = self.position.copy()
        position[:, drive] += step
        return replace(self, position=position, known=None)

    def accelerated(self, drive: int, change: float) -> MechanismState:
        """Return the state with another acceleration of a drive."""
        acceleration = self.acceleration.copy()
        acceleration[:, drive] += change
        return replace(self, acceleration=acceleration, known=None)

    def against_friction(self, friction: JointFriction) -> Array:
        """Return the drives' efforts against friction of joints, (N, D)."""
        if friction is self.friction and self.inverse_dynamics is not None:
            efforts: Array = self.inverse_dynamics.efforts[JOINT_EFFORT]
            return efforts
        return self.robot.structure.evaluation.friction(self.links.rows, self._load_rows,
                                                        friction)

    def with_smoothing(self, reversal: Reversal) -> MechanismState:
        """Return the state with a sgn of other widths; all else is computed once for both."""
        state = replace(self, reversal=reversal, known=self.links)
        vars(state)['_load_rows'] = self._load_rows
        return state

    def with_load(self, robot: Mechanism, load: StructureLoad | None = None) -> MechanismState:
        """Return a state of this motion with other bodies, and with an additional load."""
        if load is None:
            load = self.load
        elif self.load is not None:
            load = self.load + load
        return replace(self, robot=robot, load=load, known=self.links)
