# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A mechanism with its bodies: an axis, a serial arm, or a tree whose loops are closed.

References
----------
R. Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 8.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from pprs_dynamics.arrays import Array, Integers
from pprs_dynamics.errors import ModelError
from pprs_dynamics.physics.mechanism import tree_equations as tree
from pprs_dynamics.physics.mechanism.alike import alike_bodies, proportional_joints
from pprs_dynamics.physics.mechanism.description import (
    PARAMETERS,
    PRISMATIC,
    REVOLUTE,
    inertial_in,
)
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.link_motion import NO_GUIDES, LinkMotion, ToolPose
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.mechanism.state import (
    MECHANISM,
    SLIDE,
    BodyPlace,
    MechanismState,
    PassiveJoint,
    Reversal,
    StructureLoad,
)
from pprs_dynamics.physics.mechanism.structure import Structure


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
    """

    structure: Structure
    bodies: np.typing.NDArray[np.int_]
    inertial: Array
    armature: Array
    gravity: tuple[float, float, float]
    radii: Mapping[str, float] = field(default_factory=dict)
    motors: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    @property
    def masses(self) -> Array:
        """Masses of the bodies [kg], (B,)."""
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

    @cached_property
    def passive_joints(self) -> tuple[PassiveJoint, ...]:
        """Joints and rotating loops without a drive."""
        return tuple(PassiveJoint(name, self.radii.get(name, 0.0),
                                  row < 0 or bool(self.structure.tables.turns[row]), row >= 0,
                                  (name,))
                     for name, (row, _) in self.structure.friction_rows.items()
                     if name not in self.drives)

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
                x, y, z = (round(value, 6) for value in self.centre_of(name).tolist())
                found.append(BodyPlace(name, (x, y, z), float(self.masses[k]), links=(name,)))
        return tuple(found)

    @property
    def alike_links(self) -> tuple[tuple[str, ...], ...]:
        """Groups of links on which an added body does the same, that of the tool first."""
        names = self.body_names
        return tuple(tuple(names[k] for k in sorted(group, key=lambda k: k != self.carrier))
                     for group in alike_bodies(self.structure, tuple(self.bodies.tolist()),
                                               tuple(self.gravity)))

    @property
    def alike_joints(self) -> tuple[tuple[str, ...], ...]:
        """Groups of joints that do the same, a drive first."""
        return tuple(tuple(sorted(group, key=lambda name: name not in self.drives))
                     for group in proportional_joints(self.structure) if len(group) > 1)

    def centre_of(self, link: str) -> Array:
        """Return the centre of mass of a body in the frame of one of its links, (3,) [m]."""
        row, frame = self.structure.links[link]
        centre: Array = frame.R.T @ (self.by_joint[row, 1:4] / self.by_joint[row, 0] - frame.p)
        return centre

    @property
    def moved_mass(self) -> float:
        """Mass of all bodies [kg]."""
        return float(self.masses.sum())

    def joints_of(self, name: str) -> tuple[str, ...]:
        """Return the joints of the tree that have a name, or share one."""
        return next((joint.joints for joint in self.passive_joints if joint.name == name), (name,))

    def friction_table(self, blocks: Mapping[str, Mapping[str, float]], reversal: Reversal,
                       ) -> tree.JointFriction:
        """Return friction of joints as `MechanismState.friction_efforts` takes it.

        Parameters
        ----------
        blocks : mapping of str to mapping
            `viscous`, `torque`, `coulomb` and `radius` by joint, or by the name of several; 0
            where one is left out, but the radius of a slide, which is 1.
        reversal : Reversal
            In drives by their velocity, in all others by their rate, or that of slides.
        """
        structure = self.structure
        blocks = {joint: block for name, block in blocks.items() for joint in self.joints_of(name)}
        widths = dict(zip(structure.drives, reversal.widths(len(structure.drives)).tolist(),
                          strict=True))
        rows = structure.friction_rows
        joint, loop = (np.array([rows[name][side] for name in blocks], dtype=np.int64)
                       for side in (0, 1))
        viscous, torque, coulomb = (
            np.array([float(block.get(key, 0.0)) for block in blocks.values()])
            for key in ('viscous', 'torque', 'coulomb'))
        slides = [row >= 0 and not structure.tables.turns[row] for row in joint]
        radius = np.array([1.0 if slide else float(block.get('radius', 0.0))
                           for slide, block in zip(slides, blocks.values(), strict=True)])
        return tree.JointFriction(
            joint, loop, viscous, torque, coulomb * radius,
            np.array([widths.get(name, reversal.slide if slide else reversal.rate)
                      for name, slide in zip(blocks, slides, strict=True)]))

    def with_body(self, link: str, parameters: Array) -> Self:
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
        efforts: Array = self.at(position, velocity, acceleration).loads(
            self.by_joint, self.gravity_row).efforts
        return efforts

    def regressor(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        """Return the derivatives of the efforts by `inertial`, (N, D, 10 B)."""
        return self.at(position, velocity, acceleration).regressor(self.bodies, self.gravity_row)

    # --- motion and forces, as `MechanismState` and models take them -----------------------------

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of the drives."""
        return self.structure.drives

    @property
    def kind(self) -> str:
        """Whether it is one slide alone, or any other mechanism."""
        structure = self.structure
        return SLIDE if structure.kinds == (PRISMATIC,) and not structure.loops else MECHANISM

    # Whether drives rub under the load across their guides, else under that of their gears; and
    # whether motions are planned and commanded as poses of the platform, else as those of drives.
    has_guides: ClassVar[bool] = False
    plans_poses: ClassVar[bool] = False

    @cached_property
    def motions(self) -> tuple[type, ...]:
        """Kinds of motion that have forces: of the drives, and of the tool where it has loops."""
        return (JointMotion, PlatformMotion) if self.structure.loops else (JointMotion,)

    @property
    def turning(self) -> tuple[str, ...]:
        """Drives that turn."""
        return tuple(name for name, kind in zip(self.drives, self.structure.kinds, strict=True)
                     if kind == REVOLUTE)

    @cached_property
    def tool_pose(self) -> ToolPose:
        """The drives' motion from that of the tool.

        Raises
        ------
        ModelError
            Where the tool's pose does not determine the drives.
        """
        return ToolPose(self.structure)

    def drive_motion(self, motion: PlatformMotion, closed: dict[Any, Array] | None = None,
                     ) -> tuple[JointMotion, Array]:
        """Return the motion of the drives for that of the tool; see `ToolPose.drives`."""
        return self.tool_pose.drives(motion, closed)

    def at_home(self, samples: int) -> Any:
        """Return the drives at rest where the description has them, one sample a second."""
        position = np.tile(self.structure.home[self.structure.tables.drives], (samples, 1))
        still = np.zeros_like(position)
        return JointMotion(position, still, still, np.arange(samples, dtype=float))

    def state(self, motion: Any, reversal: Reversal, friction: Any = tree.NO_FRICTION,
              closed: dict[Any, Array] | None = None,
              found: tree.InverseDynamicsResult | None = None) -> MechanismState:
        """Return the state for a motion; `closed` as of `ModelState`, `found` as of `one_pass`."""
        closed = {} if closed is None else closed
        start, nearby = None, closed.get(self.structure)
        if isinstance(motion, PlatformMotion):
            # The assembly is that of the pose, whichever the same drives would find from home.
            nearby, (motion, start) = None, self.drive_motion(motion, closed)
        state = MechanismState(motion.position, motion.velocity, motion.acceleration, motion.time,
                               channels=motion.channels, robot=self, reversal=reversal,
                               known=(motion.kept or {}).get(self.structure), kept=motion.kept,
                               start=start, nearby=nearby, friction=friction)
        if found is not None:
            found = found if found.q is not None else found._replace(q=start)
            vars(state).update(inverse_dynamics=found, rigid_force=found.efforts[tree.RIGID])
        return state

    def remember(self, state: MechanismState, closed: dict[Any, Array]) -> None:
        """Store the coordinates of the last sample, near which the next loops close."""
        if len(state) and self.structure.loops:
            closed[self.structure] = state.closed[-1].copy()

    def kinematics(self, state: MechanismState) -> Any:
        """Return the motion of all links in a state."""
        found = vars(state).get('inverse_dynamics')
        start, nearby = (state.start, state.nearby) if found is None else (found.q, None)
        return LinkMotion.of(self.structure, state.position, state.velocity, state.acceleration,
                             start, nearby)

    def loads(self, links: Any, load: StructureLoad | None) -> Any:
        """Return the frictionless loads of joints and closures."""
        return links.loads(self.by_joint, self.gravity_row, load)

    def under_loads(self, state: MechanismState, others: Sequence[MechanismState],
                    ) -> Iterator[MechanismState]:
        """Yield states of the same motion with other bodies and loads, evaluated together.

        Efforts and the robot's own friction of joints are to first order in what differs.
        """
        links, added, bodies, applied, wrenches = state.links, [], [], [], []
        for k, other in enumerate(others):
            gravity = other.robot.gravity_row
            for table, moves, pull in (
                    (other.robot.by_joint - self.by_joint, True, -gravity),
                    (self.by_joint, False, self.gravity_row - gravity)):
                for row in np.flatnonzero(table.any(axis=1)) if moves or pull.any() else ():
                    added.append((k, row, tree.AS_LINK if moves else tree.STANDS))
                    bodies.append(np.append(table[row], pull))
            for sign, load in ((1, other.load), (-1, state.load)):
                if other.load is not state.load:
                    for row, wrench in links.wrenches(load):
                        applied.append((k, row))
                        wrenches.append(sign * wrench)
        efforts = np.empty((tree.EFFORTS, *state.position.shape))
        efforts[tree.TRANSMITTED], efforts[tree.JOINT_EFFORT], efforts[tree.LOAD] = (
            state.transmitted, state.friction_efforts(state.friction), state.friction_load)
        for other, change in zip(others, links.changes_by_loads(
                state.reactions, state.friction, self.guides, len(others), added, bodies, applied,
                wrenches, 3 if self.has_guides else 2), strict=True):
            found = replace(other, friction=state.friction)
            changed = efforts.copy()
            parts = [tree.TRANSMITTED, tree.JOINT_EFFORT, tree.LOAD][:change.shape[1]]
            changed[parts] += change.swapaxes(0, 1)
            if not self.has_guides:
                changed[tree.LOAD] = np.abs(changed[tree.TRANSMITTED])
            vars(found)['inverse_dynamics'] = tree.InverseDynamicsResult(
                links.motion.q, changed, (state.position, state.velocity, state.acceleration))
            yield found

    def inertia(self, state: MechanismState) -> Array:
        """Return the efforts per acceleration of each drive, (D, N, D) [kg, kg m^2, kg m]."""
        drives = range(len(self.drives))
        added = [(drive, row, tree.WITH_DRIVE + drive) for drive in drives for row in self.bodies]
        found = state.links.changes_by_loads(
            state.reactions, tree.NO_FRICTION, NO_GUIDES, len(drives), added,
            [np.append(self.by_joint[row], np.zeros(3)) for _, row, _ in added])
        inertia: Array = found[:, :, 0] + np.diag(self.armature)[:, None]
        return inertia

    def inverse_dynamics(self, state: MechanismState) -> tree.InverseDynamicsResult | None:
        """Return closed coordinates, efforts and own friction in one pass."""
        nearby = {} if state.nearby is None else {self.structure: state.nearby}
        return self.one_pass(state, self.friction_parameters(state.friction), nearby,
                             start=state.start)

    def friction_parameters(self, joints: Any, drives: Array | None = None) -> Any:
        """Return friction of joints, and of drives (OF_DRIVE, D) or none, for `one_pass`."""
        drives = np.array(self.structure.evaluation.no_actuators if drives is None else drives)
        if self.has_guides:
            drives[tree.GUIDE] = self.guides
        return np.array(joints), drives

    @cached_property
    def guides(self) -> Integers:
        """Joints of drives whose friction follows the force across them."""
        return np.array([self.structure.rows[name] for name in self.drives if self.has_guides],
                        dtype=np.int64)

    def one_pass(self, motion: Any, parameters: Any, closed: dict[Any, Array] | None,
                 start: Array | None = None) -> tree.InverseDynamicsResult | None:
        """Return the efforts for a motion of the drives, friction included.

        None for a motion of the tool, for one whose kinematics are kept, which one pass does not,
        and where a sample is out of reach or singular.

        Parameters
        ----------
        motion : JointMotion or PlatformMotion
        parameters : tuple
            See `friction_parameters`.
        closed : dict of Structure to array, optional
            See `ModelState`.
        start : (N, C) array, optional
            See `Evaluation.forward_kinematics`.
        """
        if not isinstance(motion, JointMotion) or motion.kept is not None:
            return None
        structure, moved = self.structure, (motion.position, motion.velocity, motion.acceleration)
        given = np.array(moved)
        q, efforts = np.empty((len(motion), len(structure.home))), np.empty(
            (tree.EFFORTS, *given.shape[1:]))
        failed = structure.evaluation.run(
            tree.MOTION | tree.FORCES, None, given, start,
            None if closed is None else closed.get(structure),
            (self.by_joint, self.gravity_row), None, (*parameters, q, efforts))
        if failed >= 0:
            return None
        if closed is not None and structure.loops and len(motion):
            closed[structure] = q[-1].copy()
        return tree.InverseDynamicsResult(q, efforts, moved)

    def friction_load(self, state: MechanismState) -> Array:
        """Return the loads of the drives' guides or gears [N m, N], (N, D)."""
        if state.inverse_dynamics is not None or not self.has_guides:
            return np.abs(state.transmitted) if state.inverse_dynamics is None else (
                state.inverse_dynamics.efforts[tree.LOAD])
        across = np.cross(state.reactions.f[:, self.guides], state.links.motion.z[:, self.guides])
        load: Array = np.linalg.norm(across, axis=2)
        return load

    def load_of_friction(self, state: MechanismState, joints: Any) -> StructureLoad | None:
        """Return None: what friction of passive joints adds to the loads is neglected."""
        return None

    def singularity_margin(self, state: MechanismState) -> float | None:
        """Return 1 minus the condition number of the closures over its limit; None without any."""
        if not self.structure.loops:
            return None
        return float(1 - state.links.condition.max() / tree.WORST_CONDITION)

    def variables(self, state: MechanismState) -> dict[str, Array]:
        """Return the loads of the gears."""
        return {'load': state.friction_load}

    def require_bodies(self, key: str, value: Any) -> None:
        """Raise ModelError, of a key and its value, for bodies that cannot be."""
        moments = self.inertial[:, 1:4].any(axis=1)
        if np.any((self.masses < 0) | (self.masses == 0) & moments):
            raise ModelError(key, value, 'leave masses greater than 0')
