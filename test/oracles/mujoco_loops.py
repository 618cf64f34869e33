# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Robots with loops in MuJoCo: its URDF parser, inertia, bias and equality constraints."""

from __future__ import annotations

import mujoco
import numpy as np

NOTHING = '<inertial><mass value="1e-13"/><inertia ixx="1e-13" iyy="1e-13" izz="1e-13" ixy="0" ' \
    'ixz="0" iyz="0"/></inertial>'
APART = 0.1  # [m] along a hinge, of the two points that make it


class MujocoLoops:
    """Inverse dynamics with closures as `connect` constraints, projected exactly.

    Parameters
    ----------
    robot : RobotText
        Closures spherical, or revolute about z of frames without rotation.
    """

    def __init__(self, robot) -> None:
        text = robot.urdf
        for part in robot.parts:
            if part.lstrip().startswith('<link') and part.rstrip().endswith('/>'):
                text = text.replace(part, part.replace('/>', f'>{NOTHING}</link>'))
        text = text.replace('</robot>', '<mujoco><compiler balanceinertia="false" '
                            'fusestatic="true" discardvisual="true"/></mujoco></robot>')
        spec = mujoco.MjSpec.from_string(text)
        spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        for name, loop in robot.loops.items():
            a, b = np.array(loop['a']['xyz']), np.array(loop['b']['xyz'])
            for k in range(1 + (loop['type'] == 'revolute')):
                along = APART * k * np.array([0, 0, 1.0])
                data = np.zeros(mujoco.mjNEQDATA)
                data[:3], data[3:6] = a + along, b + along
                spec.add_equality(name=f'{name}_{k}', type=mujoco.mjtEq.mjEQ_CONNECT,
                                  objtype=mujoco.mjtObj.mjOBJ_BODY, name1=loop['a']['link'],
                                  name2=loop['b']['link'], data=data)
        self.model = spec.compile()
        # The compiler places the second anchor where the first is at zero: loops are open there.
        for e in range(self.model.neq):
            name, _, k = self.model.equality(e).name.rpartition('_')
            along = APART * np.array([0, 0, 1.0]) * int(k)
            self.model.eq_data[e, 3:6] = np.array(robot.loops[name]['b']['xyz']) + along
        self.data = mujoco.MjData(self.model)
        self.drives = [int(self.model.joint(name).dofadr[0]) for name in robot.drives]

    def efforts(self, qpos, qvel, qacc) -> tuple[np.ndarray, float]:
        """Return the drives' efforts, and by how much MuJoCo's constraints are open."""
        model, data = self.model, self.data
        data.qpos[:], data.qvel[:] = qpos, qvel
        mujoco.mj_forward(model, data)
        M = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, M, data.qM) if not hasattr(data, 'M') else mujoco.mj_fullM(
            model, data, M)
        J = data.efc_J.reshape(-1, model.nv)
        needed = M @ qacc + data.qfrc_bias
        columns = np.zeros((model.nv, len(self.drives) + len(J)))
        columns[self.drives, np.arange(len(self.drives))] = 1.0
        columns[:, len(self.drives):] = J.T
        found, _, _, _ = np.linalg.lstsq(columns, needed, rcond=1e-11)
        assert np.max(np.abs(columns @ found - needed)) < 1e-9 * np.max(np.abs(needed))
        return found[:len(self.drives)], float(np.max(np.abs(data.efc_pos), initial=0.0))

    def state(self, links, k) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return MuJoCo's coordinates, velocities and accelerations at a sample of all links."""
        m, s = links.motion, links.structure
        q, v, a = np.zeros(self.model.nq), np.zeros(self.model.nv), np.zeros(self.model.nv)
        for j in range(self.model.njnt):
            at, dof = int(self.model.jnt_qposadr[j]), int(self.model.jnt_dofadr[j])
            if self.model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE:
                row = s.links[self.model.body(int(self.model.jnt_bodyid[j])).name][0]
                q[at:at + 3] = m.p[k, row]
                mujoco.mju_mat2Quat(q[at + 3:at + 7], m.R[k, row].ravel())
                v[dof:dof + 6] = (*m.u[k, row], *(m.R[k, row].T @ m.w[k, row]))
                a[dof:dof + 6] = (*m.ud[k, row], *(m.R[k, row].T @ m.wd[k, row]))
                continue
            c = s.tables.coordinate[s.rows[self.model.joint(j).name]]
            q[at], v[dof], a[dof] = m.q[k, c], m.v[k, c], m.a[k, c]
        return q, v, a
