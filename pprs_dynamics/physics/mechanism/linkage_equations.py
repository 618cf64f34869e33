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
from pprs_dynamics.physics.mechanism.vectors import Vector, dot, minus, plus, product, times

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


def vector(table: Any, k: int) -> Vector:
    """Return row k of a table as a vector."""
    return Vector(table[k, 0], table[k, 1], table[k, 2])


def column(table: Any, k: int, c: int) -> Vector:
    """Return column c of matrix k of a table as a vector."""
    return Vector(table[k, 0, c], table[k, 1, c], table[k, 2, c])


def put(table: Any, k: int, v: Vector) -> None:
    """Write a vector to row k of a table."""
    table[k, 0], table[k, 1], table[k, 2] = v.x, v.y, v.z


def put_column(table: Any, k: int, c: int, v: Vector) -> None:
    """Write a vector to column c of matrix k of a table."""
    table[k, 0, c], table[k, 1, c], table[k, 2, c] = v.x, v.y, v.z


def increase(table: Any, k: int, v: Vector) -> None:
    """Add a vector to row k of a table."""
    table[k, 0] += v.x
    table[k, 1] += v.y
    table[k, 2] += v.z


def length(v: Vector) -> Any:
    """Return |v|."""
    return sqrt(dot(v, v))


def turned(R: Any, j: int, v: Vector) -> Vector:
    """Return R[j] times a vector."""
    return Vector(R[j, 0, 0] * v.x + R[j, 0, 1] * v.y + R[j, 0, 2] * v.z,
                  R[j, 1, 0] * v.x + R[j, 1, 1] * v.y + R[j, 1, 2] * v.z,
                  R[j, 2, 0] * v.x + R[j, 2, 1] * v.y + R[j, 2, 2] * v.z)


def turned_back(R: Any, j: int, v: Vector) -> Vector:
    """Return the transpose of R[j] times a vector."""
    return Vector(dot(column(R, j, 0), v), dot(column(R, j, 1), v), dot(column(R, j, 2), v))


def place(t: Tables, m: Motion) -> None:
    """Place joints and frames of closures for the coordinates."""
    for r in range(3):
        for c in range(3):
            m.R[0, r, c] = 1.0 if r == c else 0.0
        m.p[0, r] = 0.0
    for j in range(1, len(t.parent)):
        i = t.parent[j]
        s = t.ratio[j] * m.q[t.coordinate[j]] + t.offset[j]
        axis = vector(t.axis, j)
        origin = plus(vector(m.p, i), turned(m.R, i, vector(t.place_p, j)))
        z = turned(m.R, i, turned(t.place_R, j, axis))
        if t.turns[j]:
            _turn(t, m, i, j, axis, cos(s), sin(s))
        else:
            origin = plus(origin, times(s, z))
            for c in range(3):
                put_column(m.R, j, c, turned(m.R, i, column(t.place_R, j, c)))
        put(m.p, j, origin)
        put(m.z, j, z)
    for k in range(len(t.loop_a)):
        _place_frame(m, t.loop_a[k], t.a_R, t.a_p, k, m.A, m.pA)
        _place_frame(m, t.loop_b[k], t.b_R, t.b_p, k, m.B, m.pB)


def _turn(t: Tables, m: Motion, i: int, j: int, a: Vector, C: Any, S: Any) -> None:
    """Fill in the orientation of a joint's link after a turn about its axis."""
    e = times(1.0 - C, a)
    # Columns of the rotation about the axis, each taken to the base.
    x = Vector(C + e.x * a.x, e.y * a.x + S * a.z, e.z * a.x - S * a.y)
    y = Vector(e.x * a.y - S * a.z, C + e.y * a.y, e.z * a.y + S * a.x)
    z = Vector(e.x * a.z + S * a.y, e.y * a.z - S * a.x, C + e.z * a.z)
    put_column(m.R, j, 0, turned(m.R, i, turned(t.place_R, j, x)))
    put_column(m.R, j, 1, turned(m.R, i, turned(t.place_R, j, y)))
    put_column(m.R, j, 2, turned(m.R, i, turned(t.place_R, j, z)))


def _place_frame(m: Motion, j: int, frame_R: Any, frame_p: Any, k: int, placed: Any,
                 origin: Any) -> None:
    put(origin, k, plus(vector(m.p, j), turned(m.R, j, vector(frame_p, k))))
    for c in range(3):
        put_column(placed, k, c, turned(m.R, j, column(frame_R, k, c)))


def gap(t: Tables, m: Motion, r: int) -> Any:
    """Return a row's value: by how much a closure is open [m, rad]."""
    k, i = t.row_loop[r], t.row_axes[r, 0]
    if t.row_kind[r] == TRANSLATION:
        return dot(column(m.A, k, i), minus(vector(m.pB, k), vector(m.pA, k)))
    j, g, h = t.row_axes[r, 1], t.row_axes[r, 2], t.row_axes[r, 3]
    return (t.row_weights[r, 0] * dot(column(m.A, k, i), column(m.B, k, j))
            + t.row_weights[r, 1] * dot(column(m.A, k, g), column(m.B, k, h)))


def row_axis(t: Tables, m: Motion, r: int) -> Vector:
    """Return what a row multiplies the relative velocity by: of points, or angular."""
    k, i = t.row_loop[r], t.row_axes[r, 0]
    if t.row_kind[r] == TRANSLATION:
        return column(m.A, k, i)
    j, g, h = t.row_axes[r, 1], t.row_axes[r, 2], t.row_axes[r, 3]
    return plus(times(t.row_weights[r, 0], product(column(m.B, k, j), column(m.A, k, i))),
                times(t.row_weights[r, 1], product(column(m.B, k, h), column(m.A, k, g))))


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
        e = row_axis(t, m, r)
        # Per rate of a joint on the side of B: e' (z x (p_B - p)), e' z, or nothing.
        moment = product(vector(pB, k), e)
        for n in range(start[k], start[k + 1]):
            j = joint[n]
            c = place_of[coordinate[j]]
            if c < 0 or not (of_points or turns[j]):
                continue
            factor = sign[n] * ratio[j]
            if of_points and turns[j]:
                J[r, c] += factor * dot(vector(z, j), minus(moment, product(vector(p, j), e)))
            else:
                J[r, c] += factor * dot(e, vector(z, j))


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
        w = vector(m.w, i)
        u = plus(vector(m.u, i), product(w, minus(vector(m.p, j), vector(m.p, i))))
        own = times(t.ratio[j] * m.v[t.coordinate[j]], vector(m.z, j))
        if t.turns[j]:
            w = plus(w, own)
        else:
            u = plus(u, own)
        put(m.w, j, w)
        put(m.u, j, u)


def accelerations(t: Tables, m: Motion) -> None:
    """Fill in the accelerations of the links."""
    for c in range(3):
        m.wd[0, c] = m.ud[0, c] = 0.0
    for j in range(1, len(t.parent)):
        i, z = t.parent[j], vector(m.z, j)
        w, wd = vector(m.w, i), vector(m.wd, i)
        arm = minus(vector(m.p, j), vector(m.p, i))
        ud = plus(plus(vector(m.ud, i), product(wd, arm)), product(w, product(w, arm)))
        own = times(t.ratio[j] * m.a[t.coordinate[j]], z)
        turning = product(w, times(t.ratio[j] * m.v[t.coordinate[j]], z))
        if t.turns[j]:
            wd = plus(plus(wd, own), turning)
        else:
            ud = plus(plus(ud, own), times(2.0, turning))
        put(m.wd, j, wd)
        put(m.ud, j, ud)


def _point(m: Motion, j: int, place: Vector) -> Any:
    """Return velocity and acceleration of a link's point at a place."""
    arm, w = minus(place, vector(m.p, j)), vector(m.w, j)
    v = product(w, arm)
    return (plus(vector(m.u, j), v),
            plus(plus(vector(m.ud, j), product(vector(m.wd, j), arm)), product(w, v)))


def _turning(m: Motion, j: int, direction: Vector) -> Any:
    """Return first and second derivative of a direction fixed in a link."""
    w = vector(m.w, j)
    v = product(w, direction)
    return v, plus(product(vector(m.wd, j), direction), product(w, v))


def row_acceleration(t: Tables, m: Motion, r: int) -> Any:
    """Return the second derivative of a row by time."""
    k, i = t.row_loop[r], t.row_axes[r, 0]
    if t.row_kind[r] == TRANSLATION:
        e, p_a, p_b = column(m.A, k, i), vector(m.pA, k), vector(m.pB, k)
        de, dde = _turning(m, t.loop_a[k], e)
        v_a, a_a = _point(m, t.loop_a[k], p_a)
        v_b, a_b = _point(m, t.loop_b[k], p_b)
        return (dot(e, minus(a_b, a_a)) + 2.0 * dot(de, minus(v_b, v_a))
                + dot(dde, minus(p_b, p_a)))
    total = t.row_weights[r, 0] * _angle_acceleration(t, m, k, i, t.row_axes[r, 1])
    return total + t.row_weights[r, 1] * _angle_acceleration(
        t, m, k, t.row_axes[r, 2], t.row_axes[r, 3])


def _angle_acceleration(t: Tables, m: Motion, k: int, i: int, j: int) -> Any:
    a, b = column(m.A, k, i), column(m.B, k, j)
    da, dda = _turning(m, t.loop_a[k], a)
    db, ddb = _turning(m, t.loop_b[k], b)
    return dot(dda, b) + dot(a, ddb) + 2.0 * dot(da, db)


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
    """Add the forces that move the bodies, `inertial` (J + 1, 10), and fill in what follows.

    `o.f` and `o.n` hold what links apply to the world beside them.
    """
    g = Vector(gravity[0], gravity[1], gravity[2])
    for j in range(1, len(t.parent)):
        mass = inertial[j, 0]
        if mass == 0.0 and inertial[j, 4] == 0.0 and inertial[j, 1] == 0.0:
            continue
        h = turned(m.R, j, Vector(inertial[j, 1], inertial[j, 2], inertial[j, 3]))
        a, w, wd = minus(vector(m.ud, j), g), vector(m.w, j), vector(m.wd, j)
        increase(o.f, j, plus(plus(times(mass, a), product(wd, h)), product(w, product(w, h))))
        spin = plus(_inertia_times(m.R, j, inertial, wd),
                    product(w, _inertia_times(m.R, j, inertial, w)))
        increase(o.n, j, plus(spin, product(h, a)))
    transmit(t, m, o)


def _inertia_times(R: Any, j: int, inertial: Any, v: Vector) -> Vector:
    x, y, z = turned_back(R, j, v)
    xx, xy, yy = inertial[j, 4], inertial[j, 5], inertial[j, 6]
    xz, yz, zz = inertial[j, 7], inertial[j, 8], inertial[j, 9]
    return turned(R, j, Vector(xx * x + xy * y + xz * z, xy * x + yy * y + yz * z,
                               xz * x + yz * y + zz * z))


def transmit(t: Tables, m: Motion, o: Loads) -> None:
    """Add up what joints transmit from what their links need, and the efforts that follow."""
    for c in range(len(m.q)):
        o.coordinates[c] = 0.0
    for j in range(len(t.parent) - 1, 0, -1):
        i, z, f, n = t.parent[j], vector(m.z, j), vector(o.f, j), vector(o.n, j)
        along = dot(z, n) if t.turns[j] else dot(z, f)
        o.coordinates[t.coordinate[j]] += t.ratio[j] * along
        arm = minus(vector(m.p, j), vector(m.p, i))
        increase(o.f, i, f)
        increase(o.n, i, plus(n, product(arm, f)))
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
        if t.row_kind[r] == TRANSLATION:
            increase(o.F, k, times(x, row_axis(t, m, r)))
        else:
            increase(o.N, k, times(x, row_axis(t, m, r)))
    for k in range(len(t.loop_a)):
        F, N, p_b = vector(o.F, k), vector(o.N, k), vector(m.pB, k)
        for s in range(t.path_start[k], t.path_start[k + 1]):
            j, sign = t.path_joint[s], t.path_sign[s]
            arm = minus(p_b, vector(m.p, j))
            increase(o.f, j, times(-sign, F))
            increase(o.n, j, times(-sign, plus(N, product(arm, F))))


def twist(t: Tables, m: Motion, W: Any, U: Any) -> None:
    """Fill in angular and linear velocity of each link per rate of each drive, (J + 1, 3, D)."""
    T, turns, axis = m.T, t.turns, m.z
    drives = len(t.drives)
    for d in range(drives):
        for c in range(3):
            W[0, c, d] = U[0, c, d] = 0.0
    for j in range(1, len(t.parent)):
        i, k, ratio = t.parent[j], t.coordinate[j], t.ratio[j]
        arm, z = minus(vector(m.p, j), vector(m.p, i)), vector(axis, j)
        for d in range(drives):
            w = column(W, i, d)
            u = plus(column(U, i, d), product(w, arm))
            own = times(ratio * T[k, d], z)
            if turns[j]:
                w = plus(w, own)
            else:
                u = plus(u, own)
            put_column(W, j, d, w)
            put_column(U, j, d, u)


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
    return length(product(vector(o.f, j), vector(m.z, j)))


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
            relative = minus(vector(m.w, b), vector(m.w, a))
            speed = larger(length(relative), 1e-8 * s.width[k])
            dry = s.torque[k] + s.lever[k] * length(vector(o.F, g))
            f = s.viscous[k] + dry * tanh(speed / s.width[k]) / speed
            for d in range(len(t.drives)):
                efforts[d] += f * dot(relative, minus(column(W, b, d), column(W, a, d)))
