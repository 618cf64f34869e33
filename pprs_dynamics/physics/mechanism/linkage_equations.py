# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Equations of a tree of joints with loop closures, over tables, for one sample.

Every statement works on elements: on floats when compiled, and on arrays with one element per
sample in NumPy, where the samples are the last axis. Row 0 of all tables of joints is the base.

A closure is a joint cut open. Its rows r(q) = 0 hold translations along axes of frame A, and
angles between axes of A and of B. With passive coordinates p and drives a, J = dr/dq = [J_p J_a]:

    J_p v_p = -J_a v_a,   J_p a_p = -(J_a a_a + drift),   T = dv/dv_a = [-J_p^-1 J_a; 1]
    tau = T' RNEA(q, v, a),   J_p' lambda = tau_p

References
----------
R. Featherstone, Rigid Body Dynamics Algorithms, 2008, chapters 5 and 8.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from pprs_dynamics.physics.mechanism.arithmetic import (
    cos,
    everywhere,
    larger,
    largest,
    sin,
    solve,
    sqrt,
    tanh,
)

CLOSED = 1e-7  # [m, rad] of a row before the last Newton step, which squares it
MOST_STEPS = 25  # of Newton
LONGEST_STEP = 0.3  # [m, rad] of a coordinate in a Newton step
MOST_STRIDES = 400  # of the drives from where a motion was closed last
TRANSLATION, ANGLE = 0, 1  # kinds of rows


class Tables(NamedTuple):
    """A mechanism as tables; joints are 1 .. J, in an order in which parents come first.

    Parameters
    ----------
    parent, turns, coordinate : (J + 1,) int arrays
    place_R (J + 1, 3, 3), place_p, axis (J + 1, 3), ratio, offset (J + 1,) : arrays
        Frame at position 0 in the parent's, axis in the joint's; its position is
        ratio q[coordinate] + offset.
    passive, drives : int arrays
        Coordinates that closures determine, and those that are given.
    stride : (D,) array
        By which drives move between closings.
    loop_a, loop_b : (L,) int arrays
        Joints whose links a closure connects; a_R, a_p, b_R, b_p its frames there.
    row_loop, row_kind : (r,) int arrays
    row_axes : (r, 4) int array
        Translation along the first (axis of A). Angle: axis of A, axis of B, and a second pair.
    row_weights : (r, 2) array
        Of the two pairs.
    path_start : (L + 1,), path_joint, path_sign : int arrays
        Joints between a closure's two links, 1 on the side of B, -1 on that of A.
    row_unit, passive_unit : (r,) arrays
        The mechanism's size for lengths, 1 for angles: units in which conditioning is judged.
    """

    parent: Any
    turns: Any
    place_R: Any
    place_p: Any
    axis: Any
    coordinate: Any
    ratio: Any
    offset: Any
    passive: Any
    drives: Any
    stride: Any
    loop_a: Any
    loop_b: Any
    a_R: Any
    a_p: Any
    b_R: Any
    b_p: Any
    row_loop: Any
    row_kind: Any
    row_axes: Any
    row_weights: Any
    path_start: Any
    path_joint: Any
    path_sign: Any
    row_unit: Any
    passive_unit: Any


class Motion(NamedTuple):
    """Motion of joints and links; per sample, vectors in the base's frame.

    Parameters
    ----------
    q, v, a : (C,) arrays
        Of all coordinates.
    R (J + 1, 3, 3), p, z, w, u, wd, ud (J + 1, 3) : arrays
        Orientation, origin, axis, angular and linear velocity and acceleration of each joint's
        link, at its origin.
    A, B (L, 3, 3), pA, pB (L, 3) : arrays
        Frames of the closures.
    T : (C, D) array
    J, inverse : (r, r) arrays
        Scratch, and the inverse of J_p.
    rows : (r, D + 1) array
        Scratch.
    state : (3,) array
        Largest row before the last step; determinant and condition number of J_p.
    """

    q: Any
    v: Any
    a: Any
    R: Any
    p: Any
    z: Any
    w: Any
    u: Any
    wd: Any
    ud: Any
    A: Any
    B: Any
    pA: Any
    pB: Any
    T: Any
    J: Any
    inverse: Any
    rows: Any
    state: Any


def crossed(a_x: Any, a_y: Any, a_z: Any, b_x: Any, b_y: Any, b_z: Any) -> Any:
    """Return the cross product of two vectors."""
    return a_y * b_z - a_z * b_y, a_z * b_x - a_x * b_z, a_x * b_y - a_y * b_x


def turned(R: Any, j: int, x: Any, y: Any, z: Any) -> Any:
    """Return R[j] times a vector."""
    return (R[j, 0, 0] * x + R[j, 0, 1] * y + R[j, 0, 2] * z,
            R[j, 1, 0] * x + R[j, 1, 1] * y + R[j, 1, 2] * z,
            R[j, 2, 0] * x + R[j, 2, 1] * y + R[j, 2, 2] * z)


def turned_back(R: Any, j: int, x: Any, y: Any, z: Any) -> Any:
    """Return the transpose of R[j] times a vector."""
    return (R[j, 0, 0] * x + R[j, 1, 0] * y + R[j, 2, 0] * z,
            R[j, 0, 1] * x + R[j, 1, 1] * y + R[j, 2, 1] * z,
            R[j, 0, 2] * x + R[j, 1, 2] * y + R[j, 2, 2] * z)


def place(t: Tables, m: Motion) -> None:
    """Place joints and frames of closures for the coordinates."""
    for r in range(3):
        for c in range(3):
            m.R[0, r, c] = 1.0 if r == c else 0.0
        m.p[0, r] = 0.0
    for j in range(1, len(t.parent)):
        i = t.parent[j]
        s = t.ratio[j] * m.q[t.coordinate[j]] + t.offset[j]
        a_x, a_y, a_z = t.axis[j, 0], t.axis[j, 1], t.axis[j, 2]
        x, y, z = turned(m.R, i, t.place_p[j, 0], t.place_p[j, 1], t.place_p[j, 2])
        x, y, z = m.p[i, 0] + x, m.p[i, 1] + y, m.p[i, 2] + z
        d_x, d_y, d_z = turned(t.place_R, j, a_x, a_y, a_z)
        z_x, z_y, z_z = turned(m.R, i, d_x, d_y, d_z)
        m.z[j, 0], m.z[j, 1], m.z[j, 2] = z_x, z_y, z_z
        if t.turns[j]:
            C, S = cos(s), sin(s)
            V = 1.0 - C
            # Columns of the rotation about the axis, each taken to the base.
            for c in range(3):
                e_x, e_y, e_z = V * a_x, V * a_y, V * a_z
                if c == 0:
                    e_x, e_y, e_z = C + e_x * a_x, e_y * a_x + S * a_z, e_z * a_x - S * a_y
                elif c == 1:
                    e_x, e_y, e_z = e_x * a_y - S * a_z, C + e_y * a_y, e_z * a_y + S * a_x
                else:
                    e_x, e_y, e_z = e_x * a_z + S * a_y, e_y * a_z - S * a_x, C + e_z * a_z
                e_x, e_y, e_z = turned(t.place_R, j, e_x, e_y, e_z)
                e_x, e_y, e_z = turned(m.R, i, e_x, e_y, e_z)
                m.R[j, 0, c], m.R[j, 1, c], m.R[j, 2, c] = e_x, e_y, e_z
        else:
            x, y, z = x + s * z_x, y + s * z_y, z + s * z_z
            for c in range(3):
                e_x, e_y, e_z = turned(m.R, i, t.place_R[j, 0, c], t.place_R[j, 1, c],
                                       t.place_R[j, 2, c])
                m.R[j, 0, c], m.R[j, 1, c], m.R[j, 2, c] = e_x, e_y, e_z
        m.p[j, 0], m.p[j, 1], m.p[j, 2] = x, y, z
    for k in range(len(t.loop_a)):
        _place_frame(m.R, m.p, t.loop_a[k], t.a_R, t.a_p, k, m.A, m.pA)
        _place_frame(m.R, m.p, t.loop_b[k], t.b_R, t.b_p, k, m.B, m.pB)


def _place_frame(R: Any, p: Any, j: int, frame_R: Any, frame_p: Any, k: int, placed: Any,
                 origin: Any) -> None:
    x, y, z = turned(R, j, frame_p[k, 0], frame_p[k, 1], frame_p[k, 2])
    origin[k, 0], origin[k, 1], origin[k, 2] = p[j, 0] + x, p[j, 1] + y, p[j, 2] + z
    for c in range(3):
        x, y, z = turned(R, j, frame_R[k, 0, c], frame_R[k, 1, c], frame_R[k, 2, c])
        placed[k, 0, c], placed[k, 1, c], placed[k, 2, c] = x, y, z


def gap(t: Tables, m: Motion, r: int) -> Any:
    """Return a row's value: by how much a closure is open [m, rad]."""
    k, i = t.row_loop[r], t.row_axes[r, 0]
    if t.row_kind[r] == TRANSLATION:
        return (m.A[k, 0, i] * (m.pB[k, 0] - m.pA[k, 0])
                + m.A[k, 1, i] * (m.pB[k, 1] - m.pA[k, 1])
                + m.A[k, 2, i] * (m.pB[k, 2] - m.pA[k, 2]))
    j, g, h = t.row_axes[r, 1], t.row_axes[r, 2], t.row_axes[r, 3]
    return (t.row_weights[r, 0] * (m.A[k, 0, i] * m.B[k, 0, j] + m.A[k, 1, i] * m.B[k, 1, j]
                                   + m.A[k, 2, i] * m.B[k, 2, j])
            + t.row_weights[r, 1] * (m.A[k, 0, g] * m.B[k, 0, h] + m.A[k, 1, g] * m.B[k, 1, h]
                                     + m.A[k, 2, g] * m.B[k, 2, h]))


def row_axis(t: Tables, m: Motion, r: int) -> Any:
    """Return what a row multiplies the relative velocity by: of points, or angular."""
    k, i = t.row_loop[r], t.row_axes[r, 0]
    if t.row_kind[r] == TRANSLATION:
        return m.A[k, 0, i], m.A[k, 1, i], m.A[k, 2, i]
    j, g, h = t.row_axes[r, 1], t.row_axes[r, 2], t.row_axes[r, 3]
    x, y, z = crossed(m.B[k, 0, j], m.B[k, 1, j], m.B[k, 2, j],
                      m.A[k, 0, i], m.A[k, 1, i], m.A[k, 2, i])
    X, Y, Z = crossed(m.B[k, 0, h], m.B[k, 1, h], m.B[k, 2, h],
                      m.A[k, 0, g], m.A[k, 1, g], m.A[k, 2, g])
    f, s = t.row_weights[r, 0], t.row_weights[r, 1]
    return f * x + s * X, f * y + s * Y, f * z + s * Z


def gradients(t: Tables, m: Motion, place_of: Any, J: Any) -> None:
    """Add up the derivatives of the rows by coordinates; `place_of` has their columns, or -1."""
    # Arrays by names of their own: compiled code counts references to those of a tuple, at each
    # use within a loop.
    pB, p, z, turns = m.pB, m.p, m.z, t.turns
    start, joint, sign, coordinate, ratio = (t.path_start, t.path_joint, t.path_sign, t.coordinate,
                                             t.ratio)
    for r in range(len(t.row_loop)):
        for c in range(len(J[0])):
            J[r, c] = 0.0
        k, of_points = t.row_loop[r], t.row_kind[r] == TRANSLATION
        e_x, e_y, e_z = row_axis(t, m, r)
        # Per rate of a joint on the side of B: e' (z x (p_B - p)), e' z, or nothing.
        f_x, f_y, f_z = crossed(pB[k, 0], pB[k, 1], pB[k, 2], e_x, e_y, e_z)
        for n in range(start[k], start[k + 1]):
            j = joint[n]
            c = place_of[coordinate[j]]
            if c < 0 or not (of_points or turns[j]):
                continue
            factor = sign[n] * ratio[j]
            if of_points and turns[j]:
                x, y, z_ = crossed(p[j, 0], p[j, 1], p[j, 2], e_x, e_y, e_z)
                J[r, c] += factor * (z[j, 0] * (f_x - x) + z[j, 1] * (f_y - y)
                                     + z[j, 2] * (f_z - z_))
            else:
                J[r, c] += factor * (e_x * z[j, 0] + e_y * z[j, 1] + e_z * z[j, 2])


def close(t: Tables, m: Motion, passive_of: Any) -> Any:
    """Move the passive coordinates until the loops close; return the largest row before."""
    count = len(t.row_loop)
    size = 0.0 * m.q[0]
    for _ in range(MOST_STEPS):
        place(t, m)
        size = 0.0 * size
        for r in range(count):
            m.rows[r, 0] = gap(t, m, r)
            size = larger(size, abs(m.rows[r, 0]))
        gradients(t, m, passive_of, m.J)
        solve(m.J, m.rows, count, 1)
        step = 0.0 * size
        for r in range(count):
            step = larger(step, abs(m.rows[r, 0]))
        share = LONGEST_STEP / larger(step, LONGEST_STEP + 0.0 * step)
        for r in range(count):
            m.q[t.passive[r]] -= share * m.rows[r, 0]
        if everywhere(size < CLOSED):
            break
    return size


def reach(t: Tables, m: Motion, start: Any, passive_of: Any) -> bool:
    """Close the loops for the drives of `m.q`, walked from the closed coordinates `start`.

    Returns
    -------
    bool
        False where the loops do not close on the way.
    """
    need = 0.0 * m.q[0]
    for d in range(len(t.drives)):
        c = t.drives[d]
        m.v[c] = m.q[c]  # the goal, until velocities are filled in
        need = larger(need, abs(m.v[c] - start[c]) / t.stride[d])
    if not everywhere(need < MOST_STRIDES):
        m.state[0] = need + 1.0
        return False
    strides = largest(need)
    for c in range(len(m.q)):
        m.q[c] = start[c] + 0.0 * need
    size = 0.0 * need
    for k in range(1, strides + 1):
        for d in range(len(t.drives)):
            c = t.drives[d]
            m.q[c] = m.v[c] + (1.0 - k / strides) * (start[c] - m.v[c])
        size = larger(0.0 * size, close(t, m, passive_of))
        if not everywhere(size < CLOSED):
            break
    m.state[0] = size
    return everywhere(size < CLOSED)


def move(t: Tables, m: Motion, passive_of: Any, drive_of: Any) -> None:
    """Fill in all that follows from closed positions, and velocities and accelerations of drives.

    `m.v` and `m.a` hold those of the drives, and 0 elsewhere.
    """
    count, drives = len(t.row_loop), len(t.drives)
    T, inverse, rows, v, a = m.T, m.inverse, m.rows, m.v, m.a
    passive, driven = t.passive, t.drives
    zero = 0.0 * m.q[0]
    place(t, m)
    for c in range(len(v)):
        for d in range(drives):
            T[c, d] = 0.0
    for d in range(drives):
        T[driven[d], d] = 1.0
    if count:
        gradients(t, m, passive_of, m.J)
        there = size_in_units(m.J, t.row_unit, t.passive_unit)
        for r in range(count):
            for c in range(count):
                inverse[r, c] = 1.0 if r == c else 0.0
        m.state[1] = solve(m.J, inverse, count, count)
        m.state[2] = there * size_in_units(inverse, t.passive_unit, t.row_unit)
        gradients(t, m, drive_of, rows)
        # Drives innermost: their sums do not wait for one another.
        for c in range(count):
            k = passive[c]
            for r in range(count):
                for d in range(drives):
                    T[k, d] -= inverse[c, r] * rows[r, d]
        for c in range(count):
            x = zero
            for d in range(drives):
                x = x + T[passive[c], d] * v[driven[d]]
            v[passive[c]] = x
            a[passive[c]] = 0.0
    velocities(t, m)
    accelerations(t, m)
    if count:
        for r in range(count):
            rows[r, 0] = row_acceleration(t, m, r)
        for c in range(count):
            x = zero
            for r in range(count):
                x = x + inverse[c, r] * rows[r, 0]
            a[passive[c]] = -x
        accelerations(t, m)


def size_in_units(matrix: Any, of_rows: Any, of_columns: Any) -> Any:
    """Return Frobenius' norm of a matrix that takes what has units to what has others."""
    total = 0.0 * matrix[0, 0]
    for r in range(len(of_rows)):
        along = 0.0 * total
        for c in range(len(of_columns)):
            x = matrix[r, c] * of_columns[c]
            along = along + x * x
        total = total + along / (of_rows[r] * of_rows[r])
    return sqrt(total)


def velocities(t: Tables, m: Motion) -> None:
    """Fill in the velocities of the links."""
    for c in range(3):
        m.w[0, c] = m.u[0, c] = 0.0
    for j in range(1, len(t.parent)):
        i = t.parent[j]
        s = t.ratio[j] * m.v[t.coordinate[j]]
        w_x, w_y, w_z = m.w[i, 0], m.w[i, 1], m.w[i, 2]
        x, y, z = crossed(w_x, w_y, w_z, m.p[j, 0] - m.p[i, 0], m.p[j, 1] - m.p[i, 1],
                          m.p[j, 2] - m.p[i, 2])
        x, y, z = m.u[i, 0] + x, m.u[i, 1] + y, m.u[i, 2] + z
        s_x, s_y, s_z = s * m.z[j, 0], s * m.z[j, 1], s * m.z[j, 2]
        if t.turns[j]:
            w_x, w_y, w_z = w_x + s_x, w_y + s_y, w_z + s_z
        else:
            x, y, z = x + s_x, y + s_y, z + s_z
        m.w[j, 0], m.w[j, 1], m.w[j, 2] = w_x, w_y, w_z
        m.u[j, 0], m.u[j, 1], m.u[j, 2] = x, y, z


def accelerations(t: Tables, m: Motion) -> None:
    """Fill in the accelerations of the links."""
    for c in range(3):
        m.wd[0, c] = m.ud[0, c] = 0.0
    for j in range(1, len(t.parent)):
        i = t.parent[j]
        rate = t.ratio[j] * m.v[t.coordinate[j]]
        s = t.ratio[j] * m.a[t.coordinate[j]]
        w_x, w_y, w_z = m.w[i, 0], m.w[i, 1], m.w[i, 2]
        a_x, a_y, a_z = m.wd[i, 0], m.wd[i, 1], m.wd[i, 2]
        d_x, d_y, d_z = m.p[j, 0] - m.p[i, 0], m.p[j, 1] - m.p[i, 1], m.p[j, 2] - m.p[i, 2]
        x, y, z = crossed(a_x, a_y, a_z, d_x, d_y, d_z)
        c_x, c_y, c_z = crossed(w_x, w_y, w_z, d_x, d_y, d_z)
        c_x, c_y, c_z = crossed(w_x, w_y, w_z, c_x, c_y, c_z)
        x, y, z = m.ud[i, 0] + x + c_x, m.ud[i, 1] + y + c_y, m.ud[i, 2] + z + c_z
        c_x, c_y, c_z = crossed(w_x, w_y, w_z, rate * m.z[j, 0], rate * m.z[j, 1],
                                rate * m.z[j, 2])
        s_x, s_y, s_z = s * m.z[j, 0], s * m.z[j, 1], s * m.z[j, 2]
        if t.turns[j]:
            a_x, a_y, a_z = a_x + s_x + c_x, a_y + s_y + c_y, a_z + s_z + c_z
        else:
            x, y, z = x + s_x + 2.0 * c_x, y + s_y + 2.0 * c_y, z + s_z + 2.0 * c_z
        m.wd[j, 0], m.wd[j, 1], m.wd[j, 2] = a_x, a_y, a_z
        m.ud[j, 0], m.ud[j, 1], m.ud[j, 2] = x, y, z


def _point(m: Motion, j: int, x: Any, y: Any, z: Any) -> Any:
    """Return velocity and acceleration of a link's point at a place."""
    d_x, d_y, d_z = x - m.p[j, 0], y - m.p[j, 1], z - m.p[j, 2]
    w_x, w_y, w_z = m.w[j, 0], m.w[j, 1], m.w[j, 2]
    v_x, v_y, v_z = crossed(w_x, w_y, w_z, d_x, d_y, d_z)
    a_x, a_y, a_z = crossed(m.wd[j, 0], m.wd[j, 1], m.wd[j, 2], d_x, d_y, d_z)
    c_x, c_y, c_z = crossed(w_x, w_y, w_z, v_x, v_y, v_z)
    return (m.u[j, 0] + v_x, m.u[j, 1] + v_y, m.u[j, 2] + v_z,
            m.ud[j, 0] + a_x + c_x, m.ud[j, 1] + a_y + c_y, m.ud[j, 2] + a_z + c_z)


def _turning(m: Motion, j: int, x: Any, y: Any, z: Any) -> Any:
    """Return first and second derivative of a direction fixed in a link."""
    w_x, w_y, w_z = m.w[j, 0], m.w[j, 1], m.w[j, 2]
    v_x, v_y, v_z = crossed(w_x, w_y, w_z, x, y, z)
    a_x, a_y, a_z = crossed(m.wd[j, 0], m.wd[j, 1], m.wd[j, 2], x, y, z)
    c_x, c_y, c_z = crossed(w_x, w_y, w_z, v_x, v_y, v_z)
    return v_x, v_y, v_z, a_x + c_x, a_y + c_y, a_z + c_z


def row_acceleration(t: Tables, m: Motion, r: int) -> Any:
    """Return the second derivative of a row by time."""
    k, i = t.row_loop[r], t.row_axes[r, 0]
    a, b = t.loop_a[k], t.loop_b[k]
    e_x, e_y, e_z = m.A[k, 0, i], m.A[k, 1, i], m.A[k, 2, i]
    if t.row_kind[r] == TRANSLATION:
        f_x, f_y, f_z, g_x, g_y, g_z = _turning(m, a, e_x, e_y, e_z)
        u_x, u_y, u_z, b_x, b_y, b_z = _point(m, b, m.pB[k, 0], m.pB[k, 1], m.pB[k, 2])
        v_x, v_y, v_z, a_x, a_y, a_z = _point(m, a, m.pA[k, 0], m.pA[k, 1], m.pA[k, 2])
        return (e_x * (b_x - a_x) + e_y * (b_y - a_y) + e_z * (b_z - a_z)
                + 2.0 * (f_x * (u_x - v_x) + f_y * (u_y - v_y) + f_z * (u_z - v_z))
                + g_x * (m.pB[k, 0] - m.pA[k, 0]) + g_y * (m.pB[k, 1] - m.pA[k, 1])
                + g_z * (m.pB[k, 2] - m.pA[k, 2]))
    total = t.row_weights[r, 0] * _angle_acceleration(t, m, k, i, t.row_axes[r, 1])
    return total + t.row_weights[r, 1] * _angle_acceleration(
        t, m, k, t.row_axes[r, 2], t.row_axes[r, 3])


def _angle_acceleration(t: Tables, m: Motion, k: int, i: int, j: int) -> Any:
    a_x, a_y, a_z = m.A[k, 0, i], m.A[k, 1, i], m.A[k, 2, i]
    b_x, b_y, b_z = m.B[k, 0, j], m.B[k, 1, j], m.B[k, 2, j]
    f_x, f_y, f_z, g_x, g_y, g_z = _turning(m, t.loop_a[k], a_x, a_y, a_z)
    u_x, u_y, u_z, h_x, h_y, h_z = _turning(m, t.loop_b[k], b_x, b_y, b_z)
    return (g_x * b_x + g_y * b_y + g_z * b_z + a_x * h_x + a_y * h_y + a_z * h_z
            + 2.0 * (f_x * u_x + f_y * u_y + f_z * u_z))


class Loads(NamedTuple):
    """Forces of N samples; per sample, in the base's frame.

    Parameters
    ----------
    f, n : (J + 1, 3) arrays
        What each joint transmits to its link: force, and moment about its origin.
    coordinates : (C,) array
        Efforts of the tree's coordinates.
    efforts : (D,) array
        Of the drives.
    F, N : (L, 3) arrays
        What the link of A does to that of B in each closure.
    rows : (r,) array
    """

    f: Any
    n: Any
    coordinates: Any
    efforts: Any
    F: Any
    N: Any
    rows: Any


def apply_bodies(t: Tables, m: Motion, inertial: Any, gravity: Any, o: Loads) -> None:
    """Fill in the forces that move the bodies, `inertial` (J + 1, 10)."""
    for j in range(len(t.parent)):
        for c in range(3):
            o.f[j, c] = o.n[j, c] = 0.0
    for j in range(1, len(t.parent)):
        mass = inertial[j, 0]
        if mass == 0.0 and inertial[j, 4] == 0.0 and inertial[j, 1] == 0.0:
            continue
        h_x, h_y, h_z = turned(m.R, j, inertial[j, 1], inertial[j, 2], inertial[j, 3])
        a_x, a_y, a_z = m.ud[j, 0] - gravity[0], m.ud[j, 1] - gravity[1], m.ud[j, 2] - gravity[2]
        w_x, w_y, w_z = m.w[j, 0], m.w[j, 1], m.w[j, 2]
        x, y, z = m.wd[j, 0], m.wd[j, 1], m.wd[j, 2]
        v_x, v_y, v_z = crossed(w_x, w_y, w_z, h_x, h_y, h_z)
        f_x, f_y, f_z = crossed(w_x, w_y, w_z, v_x, v_y, v_z)
        v_x, v_y, v_z = crossed(x, y, z, h_x, h_y, h_z)
        o.f[j, 0] = mass * a_x + v_x + f_x
        o.f[j, 1] = mass * a_y + v_y + f_y
        o.f[j, 2] = mass * a_z + v_z + f_z
        x, y, z = _inertia_times(m.R, j, inertial, x, y, z)
        v_x, v_y, v_z = _inertia_times(m.R, j, inertial, w_x, w_y, w_z)
        v_x, v_y, v_z = crossed(w_x, w_y, w_z, v_x, v_y, v_z)
        h_x, h_y, h_z = crossed(h_x, h_y, h_z, a_x, a_y, a_z)
        o.n[j, 0], o.n[j, 1], o.n[j, 2] = x + v_x + h_x, y + v_y + h_y, z + v_z + h_z
    transmit(t, m, o)


def _inertia_times(R: Any, j: int, inertial: Any, x: Any, y: Any, z: Any) -> Any:
    x, y, z = turned_back(R, j, x, y, z)
    xx, xy, yy = inertial[j, 4], inertial[j, 5], inertial[j, 6]
    xz, yz, zz = inertial[j, 7], inertial[j, 8], inertial[j, 9]
    return turned(R, j, xx * x + xy * y + xz * z, xy * x + yy * y + yz * z,
                  xz * x + yz * y + zz * z)


def transmit(t: Tables, m: Motion, o: Loads) -> None:
    """Add up what joints transmit from what their links need, and the efforts that follow."""
    for c in range(len(m.q)):
        o.coordinates[c] = 0.0
    for j in range(len(t.parent) - 1, 0, -1):
        i = t.parent[j]
        f_x, f_y, f_z = o.f[j, 0], o.f[j, 1], o.f[j, 2]
        if t.turns[j]:
            along = m.z[j, 0] * o.n[j, 0] + m.z[j, 1] * o.n[j, 1] + m.z[j, 2] * o.n[j, 2]
        else:
            along = m.z[j, 0] * f_x + m.z[j, 1] * f_y + m.z[j, 2] * f_z
        o.coordinates[t.coordinate[j]] += t.ratio[j] * along
        x, y, z = crossed(m.p[j, 0] - m.p[i, 0], m.p[j, 1] - m.p[i, 1], m.p[j, 2] - m.p[i, 2],
                          f_x, f_y, f_z)
        o.f[i, 0] += f_x
        o.f[i, 1] += f_y
        o.f[i, 2] += f_z
        o.n[i, 0] += o.n[j, 0] + x
        o.n[i, 1] += o.n[j, 1] + y
        o.n[i, 2] += o.n[j, 2] + z
    T, of_tree, passive = m.T, o.coordinates, t.passive
    for d in range(len(t.drives)):
        x = of_tree[t.drives[d]] + 0.0
        for c in range(len(passive)):
            x = x + T[passive[c], d] * of_tree[passive[c]]
        o.efforts[d] = x


def react(t: Tables, m: Motion, o: Loads) -> None:
    """Fill in the reactions: what the closures transmit, and with them the joints."""
    count = len(t.row_loop)
    for k in range(len(t.loop_a)):
        for c in range(3):
            o.F[k, c] = o.N[k, c] = 0.0
    inverse, of_tree, passive = m.inverse, o.coordinates, t.passive
    for r in range(count):
        x = 0.0 * m.q[0]
        for c in range(count):
            x = x + inverse[c, r] * of_tree[passive[c]]
        o.rows[r] = x
        k = t.row_loop[r]
        e_x, e_y, e_z = row_axis(t, m, r)
        if t.row_kind[r] == TRANSLATION:
            o.F[k, 0] += x * e_x
            o.F[k, 1] += x * e_y
            o.F[k, 2] += x * e_z
        else:
            o.N[k, 0] += x * e_x
            o.N[k, 1] += x * e_y
            o.N[k, 2] += x * e_z
    for k in range(len(t.loop_a)):
        F_x, F_y, F_z = o.F[k, 0], o.F[k, 1], o.F[k, 2]
        for s in range(t.path_start[k], t.path_start[k + 1]):
            j, sign = t.path_joint[s], t.path_sign[s]
            x, y, z = crossed(m.pB[k, 0] - m.p[j, 0], m.pB[k, 1] - m.p[j, 1],
                              m.pB[k, 2] - m.p[j, 2], F_x, F_y, F_z)
            o.f[j, 0] -= sign * F_x
            o.f[j, 1] -= sign * F_y
            o.f[j, 2] -= sign * F_z
            o.n[j, 0] -= sign * (o.N[k, 0] + x)
            o.n[j, 1] -= sign * (o.N[k, 1] + y)
            o.n[j, 2] -= sign * (o.N[k, 2] + z)


def twist(t: Tables, m: Motion, W: Any, U: Any) -> None:
    """Fill in angular and linear velocity of each link per rate of each drive, (J + 1, 3, D)."""
    T, turns, axis = m.T, t.turns, m.z
    drives = len(t.drives)
    for d in range(drives):
        for c in range(3):
            W[0, c, d] = U[0, c, d] = 0.0
    for j in range(1, len(t.parent)):
        i, k, ratio = t.parent[j], t.coordinate[j], t.ratio[j]
        x, y, z = m.p[j, 0] - m.p[i, 0], m.p[j, 1] - m.p[i, 1], m.p[j, 2] - m.p[i, 2]
        z_x, z_y, z_z = axis[j, 0], axis[j, 1], axis[j, 2]
        for d in range(drives):
            s = ratio * T[k, d]
            w_x, w_y, w_z = W[i, 0, d], W[i, 1, d], W[i, 2, d]
            u_x, u_y, u_z = crossed(w_x, w_y, w_z, x, y, z)
            u_x, u_y, u_z = U[i, 0, d] + u_x, U[i, 1, d] + u_y, U[i, 2, d] + u_z
            if turns[j]:
                w_x, w_y, w_z = w_x + s * z_x, w_y + s * z_y, w_z + s * z_z
            else:
                u_x, u_y, u_z = u_x + s * z_x, u_y + s * z_y, u_z + s * z_z
            W[j, 0, d], W[j, 1, d], W[j, 2, d] = w_x, w_y, w_z
            U[j, 0, d], U[j, 1, d], U[j, 2, d] = u_x, u_y, u_z


class JointFriction(NamedTuple):
    """Friction of passive joints and closures, each (F,).

    joint, loop : int arrays
        One of both; the other is -1.
    viscous [N m s/rad, N s/m], torque [N m, N], lever [m, 1] : arrays
        Dry friction is torque + lever load.
    width : array
        In which sgn turns over [rad/s, m/s].
    """

    joint: Any
    loop: Any
    viscous: Any
    torque: Any
    lever: Any
    width: Any


def load_across(t: Tables, m: Motion, o: Loads, j: int) -> Any:
    """Return the force that a joint transmits across its axis [N]."""
    f_x, f_y, f_z = crossed(o.f[j, 0], o.f[j, 1], o.f[j, 2], m.z[j, 0], m.z[j, 1], m.z[j, 2])
    return sqrt(f_x * f_x + f_y * f_y + f_z * f_z)


def rub(t: Tables, m: Motion, o: Loads, s: JointFriction, W: Any, efforts: Any) -> None:
    """Add the drives' efforts against friction of passive joints, with their loads."""
    for k in range(len(s.joint)):
        j = s.joint[k]
        if j >= 0:
            c = t.coordinate[j]
            rate = t.ratio[j] * m.v[c]
            dry = s.torque[k] + s.lever[k] * load_across(t, m, o, j)
            x = t.ratio[j] * (s.viscous[k] * rate + dry * tanh(rate / s.width[k]))
            for d in range(len(t.drives)):
                efforts[d] += m.T[c, d] * x
        else:
            g = s.loop[k]
            a, b = t.loop_a[g], t.loop_b[g]
            x, y, z = m.w[b, 0] - m.w[a, 0], m.w[b, 1] - m.w[a, 1], m.w[b, 2] - m.w[a, 2]
            load = sqrt(o.F[g, 0] * o.F[g, 0] + o.F[g, 1] * o.F[g, 1] + o.F[g, 2] * o.F[g, 2])
            speed = larger(sqrt(x * x + y * y + z * z), 1e-8 * s.width[k])
            dry = s.torque[k] + s.lever[k] * load
            f = s.viscous[k] + dry * tanh(speed / s.width[k]) / speed
            for d in range(len(t.drives)):
                efforts[d] += f * (x * (W[b, 0, d] - W[a, 0, d]) + y * (W[b, 1, d] - W[a, 1, d])
                                   + z * (W[b, 2, d] - W[a, 2, d]))
