# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The 3-PPRS with its geometry and bodies, evaluated by the paper's closed form."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import inf
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import COUNT, DRIVES
from pprs_dynamics.errors import ConvergenceError, ModelError, SingularityError, WorkspaceError
from pprs_dynamics.physics.mechanism import tree_equations as tree
from pprs_dynamics.physics.mechanism.description import (
    FLOATING,
    PARAMETERS,
    PRISMATIC,
    REVOLUTE,
    Description,
    Frame,
    Joint,
    Loop,
    about_centre,
    body_at,
)
from pprs_dynamics.physics.mechanism.evaluation import row_of, run
from pprs_dynamics.physics.mechanism.link_motion import LinkMotion
from pprs_dynamics.physics.mechanism.mechanism import Mechanism
from pprs_dynamics.physics.mechanism.motion import PlatformMotion, checked_matrix
from pprs_dynamics.physics.mechanism.state import (
    PLATFORM,
    BodyPlace,
    MechanismState,
    PassiveJoint,
    Reversal,
    StructureLoad,
)
from pprs_dynamics.physics.mechanism.structure import Structure, build_structure
from pprs_dynamics.physics.mechanism.vectors import Vector
from pprs_dynamics.physics.three_pprs import closed_form
from pprs_dynamics.physics.three_pprs.closed_form import FRICTIONLESS_JOINTS, Joints

HOME_HEIGHT = 0.5  # [m], of the platform at home
SPHERICAL = 'spherical'  # the joints A_i; C_i are REVOLUTE
HINGES, BALLS, RODS = (tuple(f'{part}_{n}' for n in (1, 2, 3)) for part in ('hinge', 'ball', 'rod'))
LINKS = (*DRIVES, *RODS, PLATFORM)  # that move, in the order of `ThreePprs.inertial`
OF_RODS = np.s_[6:9]  # in `LINKS`
ALIKE = {REVOLUTE: HINGES, SPHERICAL: BALLS}  # of the tree
POSITION_STEP = 3e-5  # of a rod's length, for derivatives by a drive's position
# The condition number of a long trajectory is computed at this many samples, evenly spread:
# neighbours hardly differ, and a singular value decomposition costs more than the model.
MOST_CONDITIONS = 64


@dataclass(frozen=True)
class Geometry:
    """Lengths and angles of the mechanism.

    Parameters
    ----------
    base_radius, platform_radius, rod_length : float
        R, r and l [m].
    chain_angles, platform_angles : 3 floats
        delta_i on the base and delta'_i on the platform [rad].
    elbow : {'up', 'down'}
        Branch of the inverse kinematics: 'up' has sin u_i > 0, the carriage below the platform.
    """

    base_radius: float
    platform_radius: float
    rod_length: float
    chain_angles: tuple[float, float, float]
    platform_angles: tuple[float, float, float]
    elbow: str = 'up'

    def __post_init__(self) -> None:
        for name in ('chain_angles', 'platform_angles'):
            angles = np.asarray(getattr(self, name), dtype=float)
            distance = np.abs(np.exp(1j * angles) - np.exp(1j * np.roll(angles, 1)))
            _require(f'geometry.{name}', getattr(self, name), bool(np.all(distance > 1e-6)),
                     'hold three different directions')
        turned = np.subtract(self.platform_angles, self.chain_angles)
        span = np.abs(self.base_radius - self.platform_radius * np.cos(turned)).max()
        _require('geometry.rod_length', self.rod_length, bool(span < self.rod_length),
                 f'be greater than {span:.6g} m, for the platform to stand unturned above the '
                 'base')

    @property
    def elbow_sign(self) -> float:
        """Sign of sin u_i."""
        return 1.0 if self.elbow == 'up' else -1.0


@dataclass(frozen=True)
class Masses:
    """Masses and the inertia of the platform with its payload.

    Parameters
    ----------
    platform, payload : float
        M and m [kg].
    slides, lifts, rods : 3 floats each
        m_1..m_3, m_4..m_6 and m_b of each chain [kg].
    centre : 3 floats
        Centre of mass of platform and payload from o, in `platform` [m].
    inertia : 6 floats
        Elements xx, yy, zz, xy, xz, yz of the inertia tensor of both about that centre, in
        `platform` [kg m^2]; products as tensor elements (-integral of x y dm), as in a URDF.
    """

    platform: float
    payload: float
    slides: tuple[float, float, float]
    lifts: tuple[float, float, float]
    rods: tuple[float, float, float]
    centre: tuple[float, float, float]
    inertia: tuple[float, float, float, float, float, float]

    def __post_init__(self) -> None:
        _require('masses.platform', self.platform, self.total > 0,
                 'with masses.payload be greater than 0 kg')
        # A body's tensor has principal moments that satisfy the triangle inequality; a point
        # mass has none at all. Tolerance: a thin disc lies exactly on the border.
        moments = np.linalg.eigvalsh(self.inertia_tensor)
        slack = 1e-9 * max(float(moments[2]), 1e-300)
        _require('masses.inertia', self.inertia, bool(moments[0] >= -slack),
                 'be a positive semi-definite tensor')
        triangle = bool(moments[0] + moments[1] >= moments[2] - slack)
        _require('masses.inertia', self.inertia, triangle,
                 'have principal moments of which each two sum to at least the third')

    @property
    def total(self) -> float:
        """M + m [kg]."""
        return self.platform + self.payload

    @property
    def inertia_tensor(self) -> Array:
        """Inertia tensor about the centre of mass, in `platform`, (3, 3) [kg m^2]."""
        xx, yy, zz, xy, xz, yz = self.inertia
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _require(key: str, value: Any, condition: bool, rule: str) -> None:
    if not condition:
        raise ModelError(key, value, rule)


Limits = tuple[tuple[float, ...], ...]
UNLIMITED: Limits = ((-inf,) * COUNT, (inf,) * COUNT, (inf,) * COUNT)


@lru_cache
def structure_of(geometry: Geometry, limits: Limits = UNLIMITED) -> Structure:
    """Return the joints and closures of a 3-PPRS, whose platform is a free body.

    Parameters
    ----------
    geometry : Geometry
    limits : three tuples of 6 floats
        Lowest and highest position of each drive [m], and its largest force [N].

    Raises
    ------
    ModelError
        Where the drives do not determine the platform's motion at home.
    """
    R, r, l = geometry.base_radius, geometry.platform_radius, geometry.rod_length  # noqa: E741
    links = {name: np.zeros(PARAMETERS) for name in ('base', *LINKS)}
    joints: dict[str, Joint] = {}
    loops: list[Loop] = []
    home: dict[str, float] = {}
    e_x, e_y, e_z = np.eye(3)

    def hang(joint: str, joint_kind: str, parent: str, child: str, frame: Frame, axis: Array,
             ) -> None:
        joints[joint] = Joint(joint, joint_kind, parent, child, frame, axis)

    for i in range(3):
        delta, beta = geometry.chain_angles[i], geometry.platform_angles[i]
        n = i + 1
        foot = Frame.of((R * math.cos(delta), R * math.sin(delta), 0.0), (0.0, 0.0, delta))
        hang(f'slide_{n}', PRISMATIC, 'base', f'slide_{n}', foot, e_y)
        hang(f'lift_{n}', PRISMATIC, f'slide_{n}', f'lift_{n}', Frame(), e_z)
        hang(f'hinge_{n}', REVOLUTE, f'lift_{n}', f'rod_{n}', Frame(), e_y)
        cos_u = (R - r * math.cos(beta - delta)) / l
        u = geometry.elbow_sign * math.acos(cos_u)
        home |= {f'slide_{n}': r * math.sin(beta - delta),
                 f'lift_{n}': HOME_HEIGHT - l * math.sin(u), f'hinge_{n}': u}
        end = Frame(p=np.array([r * math.cos(beta), r * math.sin(beta), 0.0]))
        loops.append(Loop(f'ball_{n}', 'spherical', f'rod_{n}', Frame(p=np.array([-l, 0.0, 0.0])),
                          PLATFORM, end))
    hang(PLATFORM, FLOATING, 'base', PLATFORM, Frame(), e_x)
    poses = {PLATFORM: Frame(p=np.array([0.0, 0.0, HOME_HEIGHT]))}
    for drive, lower, upper, effort in zip(DRIVES, *limits, strict=True):
        joints[drive] = replace(joints[drive], lower=lower, upper=upper, effort=effort)
    return build_structure(Description('', links, joints, ''), 'base', PLATFORM, DRIVES,
                           tuple(loops), home, poses)


def rod(length: float, mass: float) -> Array:
    """Return the inertial parameters of a rod in its frame, (10,)."""
    across = mass * length ** 2 / 12
    return body_at(mass, (-length / 2, 0.0, 0.0), np.diag([0.0, across, across]))


class SingularityBounds(NamedTuple):
    """Distances that poses must keep from singularities.

    Parameters
    ----------
    rod_sine : float
        Smallest abs(sin u_i); at 0 a rod is horizontal and the inverse kinematics singular.
    condition_number : float
        Largest condition number of the drive Jacobian, rotations times r.
    rod_cosine : float
        Smallest abs(cos u_i); infinitely small unless chains are independent, Eq. (13).
    """

    rod_sine: float = 1e-6
    condition_number: float = inf
    rod_cosine: float = 0.0


UNBOUNDED = SingularityBounds()


class ClosedForm:
    """Kinematics, reactions and forces of a 3-PPRS at N samples, without friction of the drives.

    Parameters
    ----------
    robot : ThreePprs
    motion : PlatformMotion
    load : StructureLoad, optional
        In addition to bodies and gravity.
    joints : Joints
        Friction of the passive joints.
    table : (EVERYTHING, N, 6) array, optional
        The results, where they are known.
    """

    def __init__(self, robot: ThreePprs, motion: PlatformMotion,
                 load: StructureLoad | None = None, joints: Joints = FRICTIONLESS_JOINTS,
                 table: Array | None = None) -> None:
        self.robot, self.motion, self.load, self.joints = robot, motion, load, joints
        self.is_regular = True
        if table is None:
            loads = closed_form.NO_LOAD
            if load is not None:
                loads = np.zeros((len(motion), 9))
                loads[:, :6] = load.wrench
                loads[:, 6:] = load.torques.get(REVOLUTE, 0.0)
            table = np.empty((closed_form.EVERYTHING, len(motion), 6))
            self.is_regular = run(closed_form.forces, robot.friction_parameters(joints),
                                  motion.rows, loads, table) < 0
        self.table = table
        self.position, self.velocity, self.acceleration = (
            table[closed_form.POSITION:closed_form.ACCELERATION + 1])
        self.efforts, self.guide_load = table[tree.RIGID], table[closed_form.GUIDE_LOAD]
        self.cos_u, self.sin_u = np.split(table[closed_form.ANGLE], 2, axis=1)
        self.u_dot, self.u_ddot = np.split(table[closed_form.RATE], 2, axis=1)

    @property
    def rod_angle(self) -> Array:
        """u_i [rad], (N, 3)."""
        angle: Array = np.arctan2(self.sin_u, self.cos_u)
        return angle

    @property
    def J(self) -> Array:
        """[J], X_dot = J q_dot with X_dot = (v, omega) in `base`, (N, 6, 6)."""
        return self.table[closed_form.JACOBIAN:].transpose(1, 0, 2)

    @property
    def tool_velocity(self) -> Array:
        """Velocity of o and angular velocity of the platform, in `base`, (N, 6)."""
        return self.motion.rows[:, 7:13]

    def joint_position(self, joint: str) -> Array:
        """Return the angles u_i of the joints C_i, (N, 3) [rad]."""
        assert joint == REVOLUTE
        return self.rod_angle

    def resistances(self, joints: Joints) -> Sequence[Array]:
        """Return k_ri and k_si at the frictionless reactions, (N, 3) each, Eq. (9)."""
        return np.split(self._with(joints).table[closed_form.RESISTANCE], 2, axis=1)

    def friction(self, loads: ClosedForm, joints: Joints) -> Array:
        """Return the drive forces against friction of passive joints, (N, 6) [N].

        By virtual power: a virtual motion of a drive moves every passive joint, Eq. (12).
        """
        found: Array = loads._with(joints).table[tree.JOINT_EFFORT]
        return found

    def _with(self, joints: Joints) -> ClosedForm:
        return self if joints == self.joints else ClosedForm(
            self.robot, self.motion, self.load, joints)

    def require_regular(self) -> None:
        """Raise an error for poses out of reach, or nearer to a singularity than allowed.

        Raises
        ------
        WorkspaceError
            Where a rod is too short to reach: abs(R - A_i . e_i) > l.
        SingularityError
            Where a rod lies horizontally, the drives cannot hold the platform, or the drive
            Jacobian is conditioned poorly.
        """
        geometry, bounds = self.robot.geometry, self.robot.bounds
        beyond = ~(np.abs(self.cos_u) <= 1.0)
        if np.any(beyond):
            sample, chain = (int(i) for i in np.argwhere(beyond)[0])
            raise WorkspaceError(
                sample, f'the rod of chain {chain + 1} would have to span '
                f'{abs(self.cos_u[sample, chain]) * geometry.rod_length:.6g} m radially',
                f'its length is geometry.rod_length = {geometry.rod_length:g} m')
        flat = np.abs(self.sin_u) < bounds.rod_sine
        if np.any(flat):
            sample, chain = (int(i) for i in np.argwhere(flat)[0])
            raise SingularityError(
                sample, f'|sin u| of chain {chain + 1} is {abs(self.sin_u[sample, chain]):.3g} '
                '(its rod lies horizontally)',
                f'it must be at least {bounds.rod_sine:g} (limits.rod_sine)')
        singular = ~np.isfinite(self.J).all(axis=(1, 2))
        if np.any(singular):
            raise SingularityError(int(np.argmax(singular)), 'det [B] is 0',
                                   'the drives cannot hold the platform here')
        number = condition_number(geometry, self.J)
        over = ~(number <= bounds.condition_number)
        if np.any(over):
            worst = int(np.argmax(over))
            raise SingularityError(
                worst, f'the condition number of the drive Jacobian is {number[worst]:.4g}',
                f'limits.condition_number is {bounds.condition_number:g}')


def condition_number(geometry: Geometry, J: Array) -> Array:
    """Return the condition number of the drive Jacobian, (N,).

    Rotations are multiplied by the platform's radius r as characteristic length, so that both
    halves of a twist are in m/s.

    References
    ----------
    J. Angeles, Fundamentals of Robotic Mechanical Systems, on the characteristic length.
    """
    r = geometry.platform_radius
    number: Array = np.linalg.cond(J * np.array([1.0, 1.0, 1.0, r, r, r])[:, None])
    return number


@dataclass(frozen=True, eq=False, kw_only=True)
class ThreePprs(Mechanism):
    """The 3-PPRS: a mechanism that the paper's closed form evaluates.

    Parameters
    ----------
    geometry : Geometry
    bounds : SingularityBounds
    printed : bool
        Take Eq. (7) to the letter.
    """

    geometry: Geometry
    bounds: SingularityBounds = UNBOUNDED
    printed: bool = False

    motions: ClassVar[tuple[type, ...]] = (PlatformMotion,)
    kind: ClassVar[str] = PLATFORM
    # Joints and links are three of a kind; no two kinds are alike.
    alike_joints: ClassVar[tuple[tuple[str, ...], ...]] = ()
    alike_links: ClassVar[tuple[tuple[str, ...], ...]] = ()
    tool_place: ClassVar[BodyPlace] = BodyPlace(PLATFORM, (0.0, 0.0, 0.0), inf, is_spread=True)
    link_places: ClassVar[tuple[BodyPlace, ...]] = (
        BodyPlace('rods', (0.0, 0.0, 0.0), inf, is_spread=True, links=RODS),)

    @classmethod
    def of(cls, geometry: Geometry, masses: Masses,
           gravity: tuple[float, float, float] = (0.0, 0.0, -9.81), limits: Limits = UNLIMITED,
           **more: Any) -> Self:
        """Return the robot with bodies of some masses; for `limits` see `structure_of`."""
        structure = structure_of(geometry, limits)
        inertial = np.array([
            *(body_at(mass, (0.0,) * 3, np.zeros((3, 3)))
              for mass in (*masses.slides, *masses.lifts)),
            *(rod(geometry.rod_length, mass) for mass in masses.rods),
            body_at(masses.total, masses.centre, masses.inertia_tensor)])
        return cls(structure=structure, bodies=np.array([
            structure.links[name][0] for name in LINKS]), inertial=inertial,
            armature=np.zeros(COUNT), gravity=gravity, geometry=geometry, **more)

    @property
    def passive_joints(self) -> tuple[PassiveJoint, ...]:
        """The joints C_i, and the joints A_i."""
        return tuple(PassiveJoint(name, self.radii.get(name, 0.0), has_position=name == REVOLUTE,
                                  joints=joints) for name, joints in ALIKE.items())

    @property
    def moved_mass(self) -> float:
        """Mass of the platform and its payload [kg]."""
        return float(self.masses[-1])

    @property
    def position_step(self) -> float:
        """Step of a drive for derivatives by its position [m]."""
        return POSITION_STEP * self.geometry.rod_length

    def friction_table(self, blocks: Mapping[str, Mapping[str, float]], reversal: Reversal,
                       is_own: bool = False) -> Joints:
        """Return friction of joints as `MechanismState.friction_efforts` takes it.

        Only the model's own may be printed.
        """
        return Joints(reversal.rate, float(is_own and self.printed), *(
            blocks.get(joint, {}).get(key, 0.0) for joint in (REVOLUTE, SPHERICAL)
            for key in ('viscous', 'torque', 'coulomb', 'radius')))

    def heavier(self, link: str, mass: float) -> Self:
        """Return the robot with a payload, or with rods, that weigh more [kg]."""
        added = np.zeros_like(self.inertial)
        if link == PLATFORM:
            added[-1] = body_at(mass, tuple(self.centre_of(link)), np.zeros((3, 3)))
        else:
            added[OF_RODS] = rod(self.geometry.rod_length, mass)
        return replace(self, inertial=self.inertial + added)

    @cached_property
    def _chains(self) -> tuple[closed_form.Chain, ...]:
        """Constants of the chains."""
        geometry, masses = self.geometry, self.masses[:-1].reshape(3, 3)
        delta = np.asarray(geometry.chain_angles)
        cos, sin = np.cos(delta), np.sin(delta)
        joints = geometry.platform_radius * np.exp(1j * np.asarray(geometry.platform_angles))
        left = np.linalg.pinv(np.stack((-sin, cos), axis=1))
        # The weights with which the three directions n_i add up to nothing.
        balance = np.sin(np.roll(delta, -2) - np.roll(delta, -1))
        constants = np.stack((cos, sin, joints.real, joints.imag, *left, balance, *masses), axis=1)
        return tuple(closed_form.Chain(*chain) for chain in constants.tolist())

    def friction_parameters(self, joints: Joints, drives: Array | None = None) -> Array:
        """Return the parameters of `closed_form.forces`, for `one_pass`.

        Parameters
        ----------
        joints : Joints
        drives : (OF_DRIVE, 6) array, optional
            Without it the drives have no friction.
        """
        geometry, bounds = self.geometry, self.bounds
        mass, centre, inertia = about_centre(self.inertial[-1])
        friction = closed_form.FRICTIONLESS_DRIVES if drives is None else tuple(
            closed_form.DriveParameters(*drive)
            for drive in drives[[tree.VISCOUS, tree.COEFFICIENT, tree.WIDTH]].T.tolist())
        first, second, third = self._chains
        return row_of(closed_form.Parameters(
            geometry.base_radius, geometry.rod_length, geometry.platform_radius,
            geometry.elbow_sign, (first, second, third), mass, Vector(*centre),
            Vector(*np.diag(inertia)), Vector(inertia[0, 1], inertia[0, 2], inertia[1, 2]),
            Vector(*self.gravity),
            float(self.printed), bounds.rod_sine, bounds.condition_number ** 2, joints, friction))

    def one_pass(self, motion: Any, parameters: Any, closed: object, has_state: bool = False,
                 start: object = None) -> tree.InverseDynamicsResult | None:
        """Return the forces for a motion, friction included; see `Mechanism.one_pass`."""
        # Memory is what limits long motions: the rows that only a state reads take 12 % longer.
        size = closed_form.EVERYTHING if has_state else closed_form.GUIDE_LOAD
        rows = motion.rows
        table = np.empty((size, len(rows), 6))
        if run(closed_form.forces, parameters, rows, closed_form.NO_LOAD, table) >= 0:
            return None
        return tree.InverseDynamicsResult(
            None, table, table[closed_form.POSITION:closed_form.GUIDE_LOAD])

    # --- motion --------------------------------------------------------------------------------

    def motion_of_drives(self, position: Array, velocity: Array, acceleration: Array,
                         closed: dict[Any, Array] | None = None) -> PlatformMotion:
        """Return the platform's motion that belongs to a continuous motion of the drives.

        Six drive positions belong to several poses. The closures of the tree are followed from the
        home pose, or from the last sample, and only poses are accepted whose determinant has the
        sign that it has at home.

        Parameters
        ----------
        position, velocity, acceleration : (N, 6) arrays
            q [m], q_dot [m/s], q_ddot [m/s^2] in drive order.
        closed : dict of Structure to array, optional
            Coordinates at the last sample of another motion, from which this one goes on; brought
            up to date.

        Raises
        ------
        MotionError
            For a wrong shape or a non-finite number.
        ConvergenceError
            Where no pose of the home pose's assembly mode is found.
        ModelError
            Where the geometry's home pose is itself singular.
        """
        q = checked_matrix('drive positions', position, COUNT)
        structure, closed = self.structure, {} if closed is None else closed
        try:
            links = LinkMotion.of(structure, q, np.asarray(velocity), np.asarray(acceleration),
                                  nearby=closed.get(structure))
        except WorkspaceError as error:
            raise ConvergenceError(
                error.sample, f'no pose found for drive positions {q[error.sample].tolist()} m',
                'they must close the mechanism in the assembly mode of the home pose') from None
        m, (row, _) = links.motion, structure.links[structure.tool]
        closed[structure] = m.q[-1].copy()
        return PlatformMotion(m.p[:, row], _orientation(*(m.q[:, structure.coordinates.index(
            f'platform.{angle}')] for angle in ('yaw', 'pitch', 'roll'))),
            m.u[:, row], m.w[:, row], m.ud[:, row], m.wd[:, row])

    def at_home(self, samples: int) -> PlatformMotion:
        """Return the platform at rest at its home pose."""
        return PlatformMotion.at_rest(np.tile([0.0, 0.0, HOME_HEIGHT], (samples, 1)))

    def state(self, motion: Any, reversal: Reversal, friction: Any = FRICTIONLESS_JOINTS,
              closed: object = None,
              found: tree.InverseDynamicsResult | None = None) -> MechanismState:
        """Return the state for a platform motion; `found` as of `one_pass`.

        Raises
        ------
        WorkspaceError
            For a pose out of reach.
        SingularityError
            For a pose nearer to a singularity than `bounds` allow.
        """
        # Very large numbers overflow; users of the result check that it is finite.
        with np.errstate(over='ignore', invalid='ignore', divide='ignore'):
            table = None if found is None or len(found.efforts) < closed_form.EVERYTHING else (
                found.efforts)
            links = ClosedForm(self, motion, joints=friction, table=table)
            if not links.is_regular:
                links.require_regular()
        return MechanismState(links.position, links.velocity, links.acceleration, motion.time,
                              channels=motion.channels, robot=self, reversal=reversal,
                              known=links, motion=motion, friction=friction)

    def remember(self, state: MechanismState, closed: object) -> None:
        """Store nothing: poses have a closed form."""

    def tree_motion(self, state: MechanismState) -> LinkMotion:
        """Return where the links of the tree are in a state, at rest."""
        still = np.zeros_like(state.position)
        return self.at(state.position, still, still)

    def kinematics(self, state: MechanismState) -> ClosedForm:
        """Return the kinematics of a state that lacks them."""
        return ClosedForm(self, state.motion, joints=state.friction)

    def loads(self, found: ClosedForm, load: StructureLoad | None) -> ClosedForm:
        """Return frictionless drive forces and reactions."""
        if load is found.load and self is found.robot:
            return found
        return ClosedForm(self, found.motion, load, found.joints)

    def under_loads(self, state: MechanismState, others: Sequence[MechanismState],
                    ) -> Iterator[MechanismState]:
        """Yield states, which have a closed form."""
        yield from others

    def inverse_dynamics(self, state: MechanismState) -> None:
        """Return None: the model evaluates its one pass itself."""

    def friction_load(self, state: MechanismState) -> Array:
        """Return the normal forces on the guides [N], (N, 6)."""
        load: Array = state.reactions.guide_load
        return load

    def load_of_friction(self, state: MechanismState, joints: Joints) -> StructureLoad:
        """Return friction of passive joints as a load on the platform and the rods, Eq. (9).

        The paper takes the reactions for friction without it, so that friction does not follow.
        """
        k_r, k_s = state.reactions.resistances(joints)
        delta, u_dot = np.asarray(self.geometry.chain_angles), state.links.u_dot
        axes = np.stack((-np.sin(delta), np.cos(delta), np.zeros(3)), axis=1)  # n_i
        omega = state.tool_velocity[:, 3:]
        moment = k_s.sum(axis=1)[:, None] * omega - (k_s * u_dot) @ axes
        return StructureLoad(np.hstack((np.zeros_like(moment), moment)), {
            REVOLUTE: k_r * u_dot + k_s * (u_dot - omega @ axes.T)})

    def perturbed(self, state: MechanismState, position: Array, acceleration: Array,
                  ) -> MechanismState:
        """Return the state at other positions and accelerations of the drives."""
        if position is state.position:
            motion = state.motion.accelerated(np.einsum(
                'nij,nj->ni', state.links.J, acceleration - state.acceleration))
        else:
            motion = self.motion_of_drives(position, state.velocity, acceleration)
            motion = motion.with_channels(state.channels)
            if state.time is not None:
                motion = motion.with_time(state.time)
        return replace(self.state(motion, state.reversal, state.friction),
                       robot=state.robot, load=state.load)

    # --- singularities ----------------------------------------------------------------------------

    def singularity_margin(self, state: MechanismState) -> float:
        """Return 1 minus the largest of three shares, 0 at the limit.

        Condition number over its limit, smallest sine of a rod angle over that of the rods, and,
        with independent chains, the ratio for the cosine.
        """
        bounds, found = self.bounds, state.links
        number = condition_number(self.geometry, found.J[::-(-len(found.J) // MOST_CONDITIONS)])
        return float(1 - max(number.max() / bounds.condition_number,
                             bounds.rod_sine / np.abs(found.sin_u).min(),
                             bounds.rod_cosine / np.abs(found.cos_u).min()))

    def variables(self, state: MechanismState) -> dict[str, Array]:
        """Return loads of the guides, rod angles, and where the platform is."""
        motion = state.motion
        x, y, z = motion.position.T
        return {'load': state.friction_load, 'rod_angle': np.tile(state.links.rod_angle, 2),
                'platform_x': x, 'platform_y': y, 'platform_z': z,
                'platform_tilt': motion.tilt, 'platform_turn': motion.turn}


def _orientation(yaw: Array, pitch: Array, roll: Array) -> Array:
    """Return the quaternions x, y, z, w of turns about z, then the new y, then the new x."""
    (z, y, x), (c_z, c_y, c_x) = ([turn(angle / 2) for angle in (yaw, pitch, roll)]
                                  for turn in (np.sin, np.cos))
    return np.column_stack((x * c_y * c_z - c_x * y * z, c_x * y * c_z + x * c_y * z,
                            c_x * c_y * z - x * y * c_z, c_x * c_y * c_z + x * y * z))
