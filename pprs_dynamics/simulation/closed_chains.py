# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The 3-PPRS as closed chains in MuJoCo: one evaluation of its equations of motion.

The engine holds four trees: three chains (slide, lift, rod) and the free platform. Its own mass
matrix M, bias forces b, constraint Jacobian J and joint accelerations are taken; the spherical
joints are closed here, exactly, and not by the engine's soft constraints. With y the six drive
velocities, v = T y are all joint velocities that keep the spherical joints together, and

    T'M T y_dot + T'(M g + b - f) = tau,          a = T y_dot + g,

where g is the acceleration at y_dot = 0 and f are forces on passive joints and platform. The
reactions in the spherical joints follow from the rows of the passive joints, J_d' lambda.

Nothing here comes from the package's model except the robot's numbers.

References
----------
E. Todorov, T. Erez, Y. Tassa, MuJoCo: A physics engine for model-based control, IROS 2012.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg.lapack import dgesv

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import SingularityError
from pprs_dynamics.simulation.engine_model import describe_trees, load_engine

# Order of MuJoCo's joint velocities: slide, lift, hinge of each chain, then v and the platform's
# angular velocity in `platform`.
DRIVE_DOFS = np.array([0, 3, 6, 1, 4, 7])
PASSIVE_DOFS = np.array([2, 5, 8, 9, 10, 11, 12, 13, 14])
DOFS = 15
# The engine wants positive masses; a part without mass gets this one [kg].
SMALLEST_MASS = 1e-9
CLOSURE_TOLERANCE = 1e-13  # [m], a few rounding errors of lengths below 1 m
CLOSURE_ITERATIONS = 20
# Largest Frobenius norm of the inverse of the passive joints' Jacobian [rad/m and 1]: beyond it
# the drives can hardly hold the platform, or a rod lies horizontally. At home it is about 15.
LARGEST_INVERSE = 1e4


@dataclass
class Equations:
    """The equations of motion at one state; drives in drive order.

    Parameters
    ----------
    T, T_d : (15, 6), (9, 6) arrays
        Joint velocities per drive velocity: of all joints, and of the passive ones.
    g : (15,) array
        Joint accelerations at zero drive acceleration.
    M : (15, 15) array
        The engine's mass matrix.
    bias : (15,) array
        The engine's Coriolis, centrifugal and gravity forces.
    J_d_inverse : (9, 9) array
        Inverse of the closure's Jacobian with respect to the passive joints.
    mass : (6, 6) array
        T'M T [kg].
    drive_bias : (6,) array
        T'(M g + b) [N].
    rates : (18, 6) array
        Relative velocities in the joints per drive velocity: the drives', the hinges', and
        those of the platform against the three rods, as vectors in `base`.
    axes : (9, 9) array
        The latter per velocity of the passive joints.
    """

    T: Array
    T_d: Array
    g: Array
    M: Array
    bias: Array
    J_d_inverse: Array
    mass: Array
    drive_bias: Array
    rates: Array
    axes: Array


class ClosedChains:
    """The mechanism in the engine; `qpos` and `qvel` are its state.

    Parameters
    ----------
    values : mapping
        Flat keys and values of a model file, e.g. `DriveModel.values`.

    Raises
    ------
    MissingLibraryError
        Where mujoco is not installed.
    """

    def __init__(self, values: Mapping[str, Any]) -> None:
        self.engine = load_engine()
        self.model = self.engine.MjModel.from_xml_string(describe_trees(values))
        self.data = self.engine.MjData(self.model)
        # Views of the engine's memory, which it keeps for good.
        self.qpos, self.qvel, self.qacc = self.data.qpos, self.data.qvel, self.data.qacc
        self.bodies = {self.model.body(i).name: i for i in range(self.model.nbody)}
        for i in range(3):
            self.set_mass(f'slide_{i + 1}', values['masses.slides'][i])
            self.set_mass(f'lift_{i + 1}', values['masses.lifts'][i])
            self.set_rod(i, values['masses.rods'][i], values['geometry.rod_length'])
        xx, yy, zz, xy, xz, yz = values['masses.inertia']
        self.set_platform(
            values['masses.platform'] + values['masses.payload'],
            np.array(values['masses.centre']),
            np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
        self.model.opt.gravity[:] = values['gravity']
        self._prepare()
        self.place_home(values)

    def _prepare(self) -> None:
        self.platform = self.bodies['platform']
        frames = self.model.body_quat[1:10:3]
        turns = 2 * np.arctan2(frames[:, 3], frames[:, 0])
        zero, one = np.zeros(3), np.ones(3)
        e = np.stack((np.cos(turns), np.sin(turns), zero), axis=1)
        n = np.stack((-np.sin(turns), np.cos(turns), zero), axis=1)
        k = np.stack((zero, zero, one), axis=1)
        self._frames = np.stack((e, n, k), axis=2)
        self._ones = np.ones(3)
        # Which squares make the guide loads of slides (e, k) and lifts (e, n), and the load
        # across C_i (e, k), out of (chain, body, component).
        across = np.zeros((9, 3, 3, 3))
        for i in range(3):
            across[i, i, 0, [0, 2]] = across[3 + i, i, 1, [0, 1]] = across[6 + i, i, 2, [0, 2]] = 1
        self._across = np.ascontiguousarray(across.reshape(9, 27).T)
        self._T = np.zeros((DOFS, 6))
        self._T[DRIVE_DOFS, np.arange(6)] = 1.0
        self._g = np.zeros(DOFS)
        self._M = np.zeros((DOFS, DOFS))
        self._eye9 = np.eye(9)
        self._move = np.zeros(DOFS)
        self._rates = np.zeros((18, 6))
        self._rates[:6] = np.eye(6)
        self._bias, self._accelerations = self.data.qfrc_bias, self.data.sensordata
        self._rotation = self.data.xmat[self.platform].reshape(3, 3)
        self._pushes = self.data.xfrc_applied[3:10:3, :3]
        self._forces = self.data.cfrc_int[1:10, 3:]
        self._axes = np.zeros((9, 9))
        for i in range(3):
            self._axes[3 * i:3 * i + 3, i] = -n[i]

    def set_mass(self, body: str, mass: float, centre: Array | None = None,
                 inertia: Array | None = None) -> None:
        """Give a body mass [kg], centre of mass [m] and inertia tensor about it [kg m^2]."""
        index = self.bodies[body]
        tensor = np.zeros((3, 3)) if inertia is None else inertia
        moments, axes = np.linalg.eigh(tensor)
        if np.linalg.det(axes) < 0:
            axes[:, 0] *= -1
        self.model.body_mass[index] = max(mass, SMALLEST_MASS)
        self.model.body_inertia[index] = np.maximum(moments, 0.0)
        self.model.body_ipos[index] = 0.0 if centre is None else centre
        self.engine.mju_mat2Quat(self.model.body_iquat[index], axes.ravel())
        # Frames of symmetric bodies are shortcuts that hold no longer.
        self.model.body_sameframe[index] = 0
        self._update_subtrees()

    def set_rod(self, chain: int, mass: float, length: float) -> None:
        """Give the rod of a chain (0..2) the inertia of a slender uniform rod."""
        across = mass * length ** 2 / 12
        self.set_mass(f'rod_{chain + 1}', mass, np.array([-length / 2, 0.0, 0.0]),
                      np.diag([0.0, across, across]))

    def set_platform(self, mass: float, centre: Array, inertia: Array) -> None:
        """Give the platform with its payload mass, centre of mass and inertia about it."""
        self.platform_mass, self.platform_centre, self.platform_inertia = mass, centre, inertia
        self.set_mass('platform', mass, centre, inertia)

    def _update_subtrees(self) -> None:
        # The engine's centres of subtrees, about which it computes, weigh bodies with these.
        model = self.model
        total = model.body_mass.copy()
        for index in range(model.nbody - 1, 0, -1):
            total[model.body_parentid[index]] += total[index]
        model.body_subtreemass[:] = total

    def place_home(self, values: Mapping[str, Any], height: float = 0.5) -> None:
        """Put the platform unturned above the base's centre."""
        R, r, l = (values[f'geometry.{name}'] for name in  # noqa: E741
                   ('base_radius', 'platform_radius', 'rod_length'))
        up = 1.0 if values['geometry.elbow'] == 'up' else -1.0
        for i in range(3):
            offset = values['geometry.platform_angles'][i] - values['geometry.chain_angles'][i]
            cos_u = (R - r * math.cos(offset)) / l
            if abs(cos_u) >= 1:
                raise SingularityError(0, f'the rod of chain {i + 1} does not reach at home',
                                       'the unturned platform must close above the base')
            u = up * math.acos(cos_u)
            self.qpos[3 * i:3 * i + 3] = (r * math.sin(offset), height - l * math.sin(u), u)
        self.qpos[9:16] = (0.0, 0.0, height, 1.0, 0.0, 0.0, 0.0)

    def place_drives(self, position: Array) -> None:
        """Move the drives to positions (6,) [m], the platform following its branch.

        Raises
        ------
        SingularityError
            Where the mechanism cannot follow.
        """
        start = self.qpos[DRIVE_DOFS].copy()
        moves = max(1, math.ceil(float(np.abs(position - start).max()) / 0.01))
        for move in range(1, moves + 1):
            self.qpos[DRIVE_DOFS] = start + (position - start) * (move / moves)
            self.close()

    def close(self) -> float:
        """Move passive joints and platform until the spherical joints meet; return the gap [m].

        Raises
        ------
        SingularityError
            Where they do not meet.
        """
        for _ in range(CLOSURE_ITERATIONS):
            self.engine.mj_fwdPosition(self.model, self.data)
            gap = float(np.abs(self.data.efc_pos).max())
            if gap <= CLOSURE_TOLERANCE:
                return gap
            J = self.data.efc_J.reshape(9, DOFS)
            _, _, step, failed = dgesv(J[:, PASSIVE_DOFS], self.data.efc_pos)
            size = float(np.abs(step).max())
            if failed or not size < 1.0:
                break
            self._move_passive(-step)
        raise SingularityError(0, 'the simulated mechanism does not close',
                               'its drives must stay where the platform can follow')

    def _move_passive(self, step: Array) -> None:
        self._move[PASSIVE_DOFS] = step
        self.engine.mj_integratePos(self.model, self.qpos, self._move, 1.0)

    def evaluate(self, velocity: Array) -> Equations:
        """Return the equations at `qpos` and drive velocities (6,).

        They hold until the next call, which overwrites them. A small gap in the spherical
        joints is closed on the way: `qpos` moves, and the equations are those of the pose
        before.

        Raises
        ------
        SingularityError
            Where the drives cannot hold the platform.
        """
        engine, model, data = self.engine, self.model, self.data
        engine.mj_fwdPosition(model, data)
        # The engine's solver never runs here; what its memory holds must not act on bodies.
        data.efc_force[:] = 0.0
        J = data.efc_J.reshape(9, DOFS)
        _, _, inverse, failed = dgesv(J.take(PASSIVE_DOFS, axis=1), self._eye9)
        if failed or not np.vdot(inverse, inverse) < LARGEST_INVERSE ** 2:
            raise SingularityError(0, 'the simulated mechanism is at a singular pose',
                                   'its drives must be able to hold the platform')
        T, T_d = self._T, inverse.dot(J.take(DRIVE_DOFS, axis=1))
        np.negative(T_d, out=T_d)
        T[PASSIVE_DOFS] = T_d

        np.dot(T, velocity, out=self.qvel)
        self.qacc.fill(0.0)
        engine.mj_fwdVelocity(model, data)
        engine.mj_rnePostConstraint(model, data)
        engine.mj_sensorAcc(model, data)
        g = self._g
        g[PASSIVE_DOFS] = inverse.dot(self._accelerations[9:] - self._accelerations[:9])

        M, bias, axes, rates = self._M, self._bias, self._axes, self._rates
        engine.mj_fullM(model, data, M)
        axes.reshape(3, 3, 9)[:, :, 6:] = self._rotation
        rates[6:9] = T_d[:3]
        np.dot(axes, T_d, out=rates[9:])
        MT = M.dot(T)
        equations = Equations(T, T_d, g, M, bias, inverse, MT.T.dot(T), g.dot(MT) + bias.dot(T),
                              rates, axes)
        self._move_passive(inverse.dot(-data.efc_pos))
        return equations

    def loads(self, equations: Equations, acceleration: Array, passive: Array) -> Array:
        """Return the forces in the joints by the engine's inverse dynamics [N], (12,).

        Normal forces on the guides of the drives (6), across the axes of C_i (3) and through
        A_i (3).

        Parameters
        ----------
        equations : Equations
            Of the last call of `evaluate`.
        acceleration : (15,) array
            Of all joints.
        passive : (9,) array
            Forces and torques on the passive joints and the platform, without the reactions.
        """
        needed = (equations.M.dot(acceleration) + equations.bias).take(PASSIVE_DOFS) - passive
        reactions = needed.dot(equations.J_d_inverse).reshape(3, 3)
        # Torques do not enter the forces further down, so that the point of attack is free.
        self._pushes[:] = reactions
        self.qacc[:] = acceleration
        self.engine.mj_rnePostConstraint(self.model, self.data)
        return self.joint_loads(self._forces.reshape(3, 3, 3), reactions)

    def joint_loads(self, forces: Array, reactions: Array) -> Array:
        """Return the loads of the joints from the forces in them [N], (..., 12).

        Parameters
        ----------
        forces : (..., 3, 3, 3) array
            On slide, lift and rod of each chain and all further out, in `base` [N].
        reactions : (..., 3, 3) array
            In A_i [N].
        """
        along = (forces @ self._frames).reshape(*forces.shape[:-3], 27)
        squares = (along * along).dot(self._across), (reactions * reactions).dot(self._ones)
        return np.sqrt(np.concatenate(squares, axis=-1))

    @property
    def warnings(self) -> int:
        """How often the engine has warned that it could not solve something."""
        return int(self.data.warning.number.sum())

    @property
    def rotation(self) -> Array:
        """From `platform` to `base` at the last evaluation, (3, 3); a view."""
        return self._rotation
