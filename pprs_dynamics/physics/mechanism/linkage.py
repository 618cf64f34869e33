# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Evaluation of a mechanism's equations at samples: compiled, or by NumPy for all at once.

NumPy walks to every sample from home, a compiled loop from the sample before: both end on the
branch that home is on.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism.evaluation import compiled_or_none
from pprs_dynamics.physics.mechanism.linkage_equations import (
    JointFriction,
    Loads,
    Motion,
    Tables,
    apply_bodies,
    gap,
    gradients,
    move,
    place,
    reach,
    react,
    rub,
    twist,
)

Integers = np.typing.NDArray[np.int_]


def follow_one(t: Tables, m: Motion, start: Any, v: Any, a: Any, passive_of: Any, drive_of: Any,
               ) -> bool:
    """Fill in the motion of one sample, whose drives' positions stand in `m.q`."""
    if len(t.row_loop) and not reach(t, m, start, passive_of):
        return False
    for c in range(len(m.q)):
        m.v[c] = 0.0
        m.a[c] = 0.0
    for d in range(len(t.drives)):
        m.v[t.drives[d]] = v[d]
        m.a[t.drives[d]] = a[d]
    move(t, m, passive_of, drive_of)
    return True


def motion_at(m: Motion, s: int) -> Motion:
    """Return one sample's motion, for compiled code."""
    return Motion(m.q[s], m.v[s], m.a[s], m.R[s], m.p[s], m.z[s], m.w[s], m.u[s], m.wd[s],
                  m.ud[s], m.A[s], m.B[s], m.pA[s], m.pB[s], m.T[s], m.J[s], m.inverse[s],
                  m.rows[s], m.state[s])


def loads_at(o: Loads, s: int) -> Loads:
    """Return one sample's loads, for compiled code."""
    return Loads(o.f[s], o.n[s], o.coordinates[s], o.efforts[s], o.F[s], o.N[s], o.rows[s])


def _follow(t: Tables, m: Motion, start: Any, home: Any, v: Any, a: Any, passive_of: Any,
            drive_of: Any) -> int:
    failed = -1
    for s in range(len(m.q)):
        one = motion_at(m, s)
        if not follow_one(t, one, start, v[s], a[s], passive_of, drive_of):
            for d in range(len(t.drives)):
                one.q[t.drives[d]] = one.v[t.drives[d]]
            if not follow_one(t, one, home, v[s], a[s], passive_of, drive_of):
                failed = s
                break
        for c in range(len(start)):
            start[c] = one.q[c]
        if s + 1 < len(m.q):
            predict(t, one, m.q[s + 1], start)
    return failed


def predict(t: Tables, one: Motion, goal: Any, start: Any) -> None:
    """Move coordinates near a sample to where its rates lead on the way to the next drives."""
    for d in range(len(t.drives)):
        if not abs(goal[t.drives[d]] - start[t.drives[d]]) < t.stride[d]:
            return
    for d in range(len(t.drives)):
        moved = goal[t.drives[d]] - start[t.drives[d]]
        start[t.drives[d]] = goal[t.drives[d]]
        for c in range(len(t.passive)):
            start[t.passive[c]] += one.T[t.passive[c], d] * moved


def _press(t: Tables, m: Motion, inertial: Any, gravity: Any, with_reactions: bool, o: Loads,
           ) -> None:
    for s in range(len(m.q)):
        apply_bodies(t, motion_at(m, s), inertial, gravity, loads_at(o, s))
        if with_reactions:
            react(t, motion_at(m, s), loads_at(o, s))


def _twist(t: Tables, m: Motion, W: Any, U: Any) -> None:
    for s in range(len(m.q)):
        twist(t, motion_at(m, s), W[s], U[s])


def _rub(t: Tables, m: Motion, o: Loads, friction: JointFriction, W: Any, efforts: Any) -> None:
    for s in range(len(m.q)):
        rub(t, motion_at(m, s), loads_at(o, s), friction, W[s], efforts[s])


def _openings(t: Tables, m: Motion, found: Any) -> None:
    for s in range(len(m.q)):
        one = motion_at(m, s)
        for r in range(len(t.row_loop)):
            found[s, r] = gap(t, one, r)


def _survey(t: Tables, m: Motion, column_of: Any, gaps: Any, J: Any) -> None:
    place(t, m)
    for r in range(len(t.row_loop)):
        gaps[r] = gap(t, m, r)
    gradients(t, m, column_of, J)


def samples_last(arrays: Any) -> Any:
    """Return views with the samples last, as NumPy takes the equations."""
    return type(arrays)(*(np.moveaxis(array, 0, -1) for array in arrays))


def new_motion(t: Tables, samples: int) -> Motion:
    """Return space for the motion of samples."""
    coordinates = int(t.coordinate.max()) + 1
    shapes = _shapes(len(t.row_loop), len(t.parent), len(t.loop_a), len(t.drives), coordinates)
    return Motion(*(np.zeros((samples, *shape)) for shape in shapes))


@cache
def _shapes(rows: int, joints: int, loops: int, drives: int, coordinates: int,
            ) -> tuple[tuple[int, ...], ...]:
    """Return the shapes of a motion's arrays, in their order."""
    shapes = dict.fromkeys(Motion._fields, (joints, 3)) | dict.fromkeys('qva', (coordinates,)) | {
        'R': (joints, 3, 3), 'A': (loops, 3, 3), 'B': (loops, 3, 3), 'pA': (loops, 3),
        'pB': (loops, 3), 'T': (coordinates, drives), 'J': (rows, rows),
        'inverse': (rows, rows), 'rows': (rows, drives + 1), 'state': (3,)}
    return tuple(shapes.values())


def new_loads(t: Tables, m: Motion) -> Loads:
    """Return space for the forces of a motion."""
    samples, joints, loops = len(m.q), len(t.parent), len(t.loop_a)
    return Loads(np.zeros((samples, joints, 3)), np.zeros((samples, joints, 3)),
                 np.zeros(m.q.shape), np.zeros((samples, len(t.drives))),
                 np.zeros((samples, loops, 3)), np.zeros((samples, loops, 3)),
                 np.zeros((samples, len(t.row_loop))))


def columns_of(coordinates: Integers, count: int) -> Integers:
    """Return each coordinate's column among some coordinates, or -1."""
    column = np.full(count, -1)
    column[coordinates] = np.arange(len(coordinates))
    return column


def follow(t: Tables, home: Array, q: Array, v: Array, a: Array, start: Array | None = None,
           ) -> tuple[Motion, int]:
    """Return the motion of all links for positions, velocities and accelerations of the drives.

    Parameters
    ----------
    t : Tables
    home : (C,) array
        Closed coordinates.
    q, v, a : (N, D) arrays
    start : (C,) array, optional
        Closed coordinates near the first sample, instead of home.

    Returns
    -------
    motion : Motion
    failed : int
        The first sample at which the loops do not close, or -1.
    """
    m = new_motion(t, len(q))
    m.q[:] = home
    m.q[:, t.drives] = q
    passive_of, drive_of = (columns_of(which, len(home)) for which in (t.passive, t.drives))
    v, a = (np.ascontiguousarray(values, dtype=float) for values in (v, a))
    loop = compiled_or_none(_follow, len(q))
    if loop is not None:
        begin = np.array(home if start is None else start)
        return m, int(loop(t, m, begin, home, v, a, passive_of, drive_of))
    with np.errstate(all='ignore'):
        done = follow_one(t, samples_last(m), home, v.T, a.T, passive_of, drive_of)
    if done:
        return m, -1
    size = m.state[:, 0]
    return m, int(np.argmax(~(size < np.inf) | (size == np.max(size))))


def openings(t: Tables, m: Motion) -> Array:
    """Return by how much closures are open at samples of a motion, (N, r) [m, rad].

    The rows may be others than those that the motion was closed by.
    """
    found = np.zeros((len(m.q), len(t.row_loop)))
    loop = compiled_or_none(_openings, len(m.q))
    if loop is not None:
        loop(t, m, found)
    else:
        views = samples_last(m)
        for r in range(len(t.row_loop)):
            found[:, r] = gap(t, views, r)
    return found


def press(t: Tables, m: Motion, inertial: Array, gravity: Array, with_reactions: bool,
          wrenches: Mapping[int, tuple[Array, Array]] | None = None) -> Loads:
    """Return the forces that move bodies and apply wrenches.

    Parameters
    ----------
    t : Tables
    m : Motion
    inertial : (J + 1, 10) array
    gravity : (3,) array
    with_reactions : bool
        Whether those of closures are filled in.
    wrenches : mapping of int to (force, moment), (N, 3) each, optional
        That links apply to the world, by the joints that move them, in the base's frame, about
        the origins of these joints [N, N m].
    """
    o = new_loads(t, m)
    for joint, (force, moment) in (wrenches or {}).items():
        o.f[:, joint] += force
        o.n[:, joint] += moment
    loop = compiled_or_none(_press, len(m.q))
    if loop is not None:
        loop(t, m, inertial, gravity, with_reactions, o)
        return o
    views = samples_last(m), samples_last(o)
    apply_bodies(t, views[0], inertial, gravity, views[1])
    if with_reactions:
        react(t, *views)
    return o


def twists(t: Tables, m: Motion) -> tuple[Array, Array]:
    """Return angular and linear velocities of links per rate of drives, (N, J + 1, 3, D)."""
    shape = (len(m.q), len(t.parent), 3, len(t.drives))
    W, U = np.zeros(shape), np.zeros(shape)
    loop = compiled_or_none(_twist, len(m.q))
    if loop is not None:
        loop(t, m, W, U)
    else:
        twist(t, samples_last(m), np.moveaxis(W, 0, -1), np.moveaxis(U, 0, -1))
    return W, U


def friction_efforts(t: Tables, m: Motion, o: Loads, friction: JointFriction, W: Array) -> Array:
    """Return the drives' efforts against friction of passive joints, (N, D)."""
    efforts = np.zeros((len(m.q), len(t.drives)))
    loop = compiled_or_none(_rub, len(m.q))
    if loop is not None:
        loop(t, m, o, friction, W, efforts)
    else:
        rub(t, samples_last(m), samples_last(o), friction, np.moveaxis(W, 0, -1), efforts.T)
    return efforts


def survey(t: Tables, q: Array, columns: Integers) -> tuple[Array, Array, Motion]:
    """Return all rows and their derivatives by some coordinates, (r,) and (r, K), at one place."""
    m = new_motion(t, 1)
    m.q[0] = q
    column_of = columns_of(columns, len(q))
    gaps, J = np.zeros(len(t.row_loop)), np.zeros((len(t.row_loop), max(1, len(columns))))
    loop = compiled_or_none(_survey, 1)
    if loop is not None:
        loop(t, motion_at(m, 0), column_of, gaps, J)
    else:
        views = samples_last(m)
        _survey(t, views, column_of, gaps[:, None], J[..., None])
    return gaps, J[:, :len(columns)], m
