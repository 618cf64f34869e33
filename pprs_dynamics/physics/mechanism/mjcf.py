# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Robot descriptions from MJCF, read by MuJoCo's own compiler.

Hinges, slides, balls and free joints make the tree; `connect`, `weld` and linear `joint`
constraints its loops and couplings. Several joints on one body are as many links without mass.
Positions are MuJoCo's, which stands at `ref` where a body is placed. What a mechanism cannot have
is refused by name.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import ModelError, UnreadableFileError, optional_library
from pprs_dynamics.physics.mechanism.description import (
    FIXED,
    FLOATING,
    PARAMETERS,
    PRISMATIC,
    REVOLUTE,
    Description,
    Frame,
    Joint,
    Loop,
    Mimic,
    body_at,
    rotation_about,
)
from pprs_dynamics.physics.mechanism.urdf import WORLD, read_content, ring
from pprs_dynamics.physics.mechanism.vectors import rotation_matrix

# Numbers of parts that a mechanism here has not got, and what they are.
FOREIGN_PARTS = {'ntendon': 'tendons', 'nflex': 'flexible bodies', 'nplugin': 'plugins'}


def read_mjcf(path: str) -> Description:
    """Return the description in an MJCF file, at its reference configuration.

    Raises
    ------
    MissingLibraryError
        Without MuJoCo.
    UnreadableFileError
        Where it cannot be compiled.
    ModelError
        For a constraint that is no loop and no linear coupling.
    """
    mujoco = optional_library('mujoco', 'mujoco', 'a model from MJCF', 'sim')
    content = read_content(path)
    model = readable_spec(mujoco, path).compile()
    return _Reader(mujoco, model, path).description(hashlib.sha256(content).hexdigest())


def readable_spec(mujoco: Any, path: str) -> Any:
    """Return MuJoCo's specification of an MJCF, which compiles; all bodies and joints have names.

    Files of meshes may be missing if no mass follows from them.

    Raises
    ------
    UnreadableFileError
        If it cannot be compiled.
    """
    try:
        spec = _named(mujoco.MjSpec.from_file(path))
        spec.compile()
        return spec
    except (ValueError, mujoco.FatalError) as error:
        reason = f'not MJCF that can be compiled: {" ".join(str(error).split())}'
    weighed: list[str] = []
    try:
        spec = _named(mujoco.MjSpec.from_file(path))
        weighed = _without_shapes(mujoco, spec)
        spec.compile()
        return spec
    except (ValueError, mujoco.FatalError):
        pass
    if weighed:
        reason += (f'; {", ".join(weighed)} have no <inertial>, so their mass follows from their '
                   'shapes: bring the file, or write <inertial>')
    raise UnreadableFileError(path, reason)


def _named(spec: Any) -> Any:
    for kind, parts in (('body', spec.bodies), ('joint', spec.joints)):
        for number, part in enumerate(parts):
            part.name = part.name or f'{kind}_{number}'
    return spec


def _without_shapes(mujoco: Any, spec: Any) -> list[str]:
    """Delete the shapes that do not determine a mass; return the bodies of the others."""
    of_shapes = spec.compiler.inertiafromgeom
    always = of_shapes == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    never = of_shapes == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    weighed = []
    for body in spec.bodies:
        if body.geoms and body.name != WORLD and (
                always or not (never or body.explicitinertial)):
            weighed.append(body.name)
            continue
        for geom in body.geoms:
            spec.delete(geom)
    needed = {geom.meshname for geom in spec.geoms}
    for part in (*spec.pairs, *spec.sensors, *spec.skins, *spec.hfields, *spec.materials,
                 *spec.textures, *(mesh for mesh in spec.meshes if mesh.name not in needed)):
        spec.delete(part)
    return weighed


class _Reader:
    """Reads a compiled model."""

    def __init__(self, mujoco: Any, model: Any, path: str) -> None:
        self.mujoco, self.model, self.path = mujoco, model, path
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        self.placed = [Frame(data.xmat[b].reshape(3, 3).copy(), data.xpos[b].copy())
                       for b in range(model.nbody)]
        self.bodies = [WORLD] + [model.body(b).name for b in range(1, model.nbody)]
        self.names = [model.joint(k).name for k in range(model.njnt)]

    def description(self, digest: str) -> Description:
        """Return the description."""
        self._require_known_forces()
        links: dict[str, Array] = {WORLD: np.zeros(PARAMETERS)}
        joints: dict[str, Joint] = {}
        for b in range(1, self.model.nbody):
            self._body(b, links, joints)
        loops = self._constraints(joints)
        x, y, z = np.zeros(3) if self._is_off('GRAVITY') else self.model.opt.gravity
        return Description(self.path, links, joints, digest, tuple(loops),
                           (float(x), float(y), float(z)), tuple(self._remarks()))

    def _is_off(self, *names: str) -> bool:
        """Return whether a flag of <option> disables something."""
        kinds = self.mujoco.mjtDisableBit
        return any(self.model.opt.disableflags & int(getattr(kinds, f'mjDSBL_{name}', 0))
                   for name in names)

    def _require_known_forces(self) -> None:
        """Raise ModelError for forces that a mechanism here cannot represent."""
        model = self.model
        for name, what in FOREIGN_PARTS.items():
            if getattr(model, name, 0):
                raise ModelError('robot.mjcf', self.path, f'have no {what}: they are not covered')
        for name in ('density', 'viscosity'):
            if value := float(getattr(model.opt, name)):
                raise ModelError('robot.mjcf', f'{name} {value:g}', 'have no medium about the '
                                 f'robot: take {name} off <option>, and let diagnose find the drag')
        for b in range(1, model.nbody):
            if value := float(model.body_gravcomp[b]):
                raise ModelError('robot.mjcf', self.bodies[b], 'weigh what it weighs: take '
                                 f'gravcomp="{value:g}" off')

    def _remarks(self) -> Iterator[str]:
        """Yield sentences on elements that are not used."""
        balls = [self.names[k] for k in range(self.model.njnt) if self.model.jnt_limited[k]
                 and self.model.jnt_type[k] == self.mujoco.mjtJoint.mjJNT_BALL]
        if balls:
            yield f'the range of {", ".join(balls)} is not used: a ball has no limits here'
        servos = [self.model.actuator(a).name or f'actuator_{a}' for a in range(self.model.nu)
                  if self.model.actuator_biasprm[a, 1:3].any()]
        if servos:
            yield (f'the gains (kp, kv) of {", ".join(servos)} are not used: they belong to a '
                   'controller, not to the robot')

    def _body(self, b: int, links: dict[str, Array], joints: dict[str, Joint]) -> None:
        model = self.model
        parent = self.bodies[int(model.body_parentid[b])]
        at = Frame(matrix_of(model.body_quat[b]), model.body_pos[b].copy())
        first, count = int(model.body_jntadr[b]), int(model.body_jntnum[b])
        name = self.bodies[b]
        links[name] = inertial_of(model, b)
        if not count:
            joints[f'{name}_fixed'] = Joint(f'{name}_fixed', FIXED, parent, name, at,
                                            np.array([1.0, 0, 0]))
        for k in range(first, first + count):
            kind = int(model.jnt_type[k])
            axes, kinds, place = [model.jnt_axis[k].copy()], [REVOLUTE], model.jnt_pos[k].copy()
            ref = float(model.qpos0[model.jnt_qposadr[k]])
            if kind in (self.mujoco.mjtJoint.mjJNT_FREE, self.mujoco.mjtJoint.mjJNT_BALL):
                self._require_bare(k)
            if kind == self.mujoco.mjtJoint.mjJNT_FREE:
                joints[self.names[k]] = Joint(self.names[k], FLOATING, parent, name, at,
                                              np.array([1.0, 0, 0]))
                return
            if kind == self.mujoco.mjtJoint.mjJNT_SLIDE:
                kinds, place = [PRISMATIC], np.zeros(3)
            elif kind == self.mujoco.mjtJoint.mjJNT_BALL:
                axes, kinds, ref = list(np.eye(3)), [REVOLUTE] * 3, 0.0
            for n, (axis, joint_type) in enumerate(zip(axes, kinds, strict=True)):
                own = self.names[k] if len(axes) == 1 else f'{self.names[k]}_{"xyz"[n]}'
                last = k == first + count - 1 and n == len(axes) - 1
                # About the joint's own place, which a link without mass stands for.
                child = f'{own}_link'
                links[child] = np.zeros(PARAMETERS)
                lower, upper = (model.jnt_range[k] if model.jnt_limited[k] and len(axes) == 1
                                else (-np.inf, np.inf))
                back = (Frame(p=-ref * axis) if joint_type == PRISMATIC
                        else Frame(rotation_about(axis, -ref)))
                joints[own] = Joint(
                    own, joint_type, parent, child, at @ Frame(np.eye(3), place) @ back, axis,
                    float(lower), float(upper), effort=self._effort(k), start=ref or None,
                    **({} if len(axes) > 1 else self._own_forces(k)))
                parent, at = child, Frame(np.eye(3), -place)
                if last:
                    joints[f'{name}_on'] = Joint(f'{name}_on', FIXED, parent, name, at, axis)

    def _own_forces(self, k: int) -> dict[str, Any]:
        """Return rotor, friction and spring of a hinge or slide."""
        model, d = self.model, int(self.model.jnt_dofadr[k])
        for name, of in (('dof_dampingpoly', d), ('jnt_stiffnesspoly', k)):
            if np.any(getattr(model, name, np.zeros((of + 1, 1)))[of]):
                raise ModelError('robot.mjcf', self.names[k], f'have no {name[4:]}: damping and '
                                 'stiffness are constants here')
        stiffness = float(model.jnt_stiffness[k])
        relaxed = float(model.qpos_spring[model.jnt_qposadr[k]])
        return {'armature': float(model.dof_armature[d]),
                'damping': 0.0 if self._is_off('DAMPER', 'PASSIVE') else float(
                    model.dof_damping[d]),
                'dry': 0.0 if self._is_off('FRICTIONLOSS', 'CONSTRAINT') else float(
                    model.dof_frictionloss[d]),
                'spring': (stiffness, relaxed) if stiffness and not self._is_off(
                    'SPRING', 'PASSIVE') else None}

    def _require_bare(self, k: int) -> None:
        """Raise ModelError for a ball or free joint with forces of its own."""
        model, d = self.model, int(self.model.jnt_dofadr[k])
        for name, value in (('armature', model.dof_armature[d]), ('damping', model.dof_damping[d]),
                            ('frictionloss', model.dof_frictionloss[d]),
                            ('stiffness', model.jnt_stiffness[k])):
            if value:
                raise ModelError('robot.mjcf', self.names[k], f'have no {name} ({value:g}): of '
                                 'joints, hinges and slides alone may; take it off')

    def _effort(self, k: int) -> float:
        """Return the largest effort of a joint: by its own range, and those of its motors."""
        model = self.model
        largest = float(np.min(np.abs(model.jnt_actfrcrange[k]))) if (
            model.jnt_actfrclimited[k]) else np.inf
        for a in range(model.nu):
            if (model.actuator_trntype[a] != self.mujoco.mjtTrn.mjTRN_JOINT
                    or model.actuator_trnid[a, 0] != k):
                continue
            gear = abs(float(model.actuator_gear[a, 0]))
            if model.actuator_forcelimited[a]:
                largest = min(largest, gear * float(np.min(np.abs(model.actuator_forcerange[a]))))
            # The control of a servo is a position or a velocity.
            is_motor = (model.actuator_gaintype[a] == self.mujoco.mjtGain.mjGAIN_FIXED
                        and model.actuator_biastype[a] == self.mujoco.mjtBias.mjBIAS_NONE)
            if is_motor and model.actuator_ctrllimited[a]:
                gain = abs(float(model.actuator_gainprm[a, 0]))
                largest = min(largest, gear * gain
                              * float(np.min(np.abs(model.actuator_ctrlrange[a]))))
        return largest

    def _constraints(self, joints: dict[str, Joint]) -> list[Loop]:
        model, kinds = self.model, self.mujoco.mjtEq
        loops: list[Loop] = []
        if self._is_off('EQUALITY', 'CONSTRAINT'):
            return loops
        set_by: dict[int, str] = {}
        for e in range(model.neq):
            if not model.eq_active0[e]:
                continue
            name = model.equality(e).name or f'equality_{e}'
            kind, a, b = int(model.eq_type[e]), int(model.eq_obj1id[e]), int(model.eq_obj2id[e])
            numbers = model.eq_data[e]
            if kind == kinds.mjEQ_JOINT:
                if a in set_by:
                    raise ModelError('robot.mjcf', self.names[a], 'follow one joint, but '
                                     f'{set_by[a]} and {name} each name one: delete one of them')
                set_by[a] = name
                self._couple(joints, name, a, b, numbers)
                continue
            if kind not in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
                raise ModelError('robot.mjcf', name, 'be a connect, weld or joint constraint')
            if model.eq_objtype[e] == self.mujoco.mjtObj.mjOBJ_SITE:
                frames = [Frame(matrix_of(model.site_quat[s]), model.site_pos[s].copy())
                          for s in (a, b)]
                a, b = (int(model.site_bodyid[s]) for s in (a, b))
            elif kind == kinds.mjEQ_CONNECT:
                frames = [Frame(np.eye(3), numbers[:3].copy()),
                          Frame(np.eye(3), numbers[3:6].copy())]
            else:
                # A point and the attitude of the second body in the first, and that point in it.
                frames = [Frame(matrix_of(numbers[6:10]), numbers[3:6].copy()),
                          Frame(p=numbers[:3].copy())]
            loops.append(Loop(name, 'spherical' if kind == kinds.mjEQ_CONNECT else 'fixed',
                              self.bodies[a], frames[0], self.bodies[b], frames[1]))
        if found := ring({name: joint.mimic.joint for name, joint in joints.items()
                          if joint.mimic is not None}):
            raise ModelError('robot.mjcf', ', '.join(found), 'follow no joint that follows them: '
                             'delete a <joint> of <equality>')
        return loops

    def _couple(self, joints: dict[str, Joint], name: str, a: int, b: int, numbers: Array) -> None:
        if np.any(numbers[2:5]) or b < 0:
            raise ModelError('robot.mjcf', name, 'be linear in another joint: position = c0 + c1 '
                             'times its position')
        # Both count from where their bodies are placed.
        y, x = (float(self.model.qpos0[self.model.jnt_qposadr[k]]) for k in (a, b))
        own, ratio = joints[self.names[a]], float(numbers[1])
        joints[own.name] = replace(own, mimic=Mimic(self.names[b], ratio,
                                                    y + float(numbers[0]) - ratio * x))


def inertial_of(model: Any, b: int) -> Array:
    """Return the inertial parameters of a body of a compiled model in its frame, (10,)."""
    R = matrix_of(model.body_iquat[b])
    return body_at(float(model.body_mass[b]), tuple(model.body_ipos[b]),
                   R @ np.diag(model.body_inertia[b]) @ R.T)


def matrix_of(quaternion: Array) -> Array:
    """Return the rotation of a quaternion w, x, y, z."""
    w, x, y, z = quaternion
    return rotation_matrix(x, y, z, w)
