# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The paper's equations, sample by sample: kinematics, reactions, forces and friction.

In chain i, with unit vectors e_i (radial), n_i (revolute axis) and k (up):
C_i = R e_i + q_i n_i + q_(i+3) k and A_i = C_i + l d_i, d_i = -cos u_i e_i + sin u_i k.

Gravity enters as the acceleration that each body would need to feel weightless, f = a - g. The
equations are thus exact for any direction of gravity; with g = (0, 0, -9.81) they are the paper's.
A positive drive force is what the drive must apply along its positive coordinate.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from math import atan2, tanh
from typing import Any, NamedTuple, TypeVar, TypeVarTuple

from pprs_dynamics.arrays import Value
from pprs_dynamics.physics.mechanism.evaluation import reader_of
from pprs_dynamics.physics.mechanism.tree_equations import (
    DRIVE_FRICTION,
    EFFORTS,
    JOINT_EFFORT,
    LOAD,
    RIGID,
    TOTAL,
    TRANSMITTED,
)
from pprs_dynamics.physics.mechanism.vectors import (
    MotionSample,
    Vector,
    combine,
    dot,
    elements,
    minus,
    motion_sample,
    plus,
    product,
    sign_over_speed,
    sqrt,
    times,
    turned,
    turned_back,
)

CHAINS = 3
# Tables of results, (N, 6) each: efforts as of every mechanism, and the drives' motion.
POSITION, VELOCITY, ACCELERATION, RESULTS = EFFORTS, EFFORTS + 1, EFFORTS + 2, EFFORTS + 3
# First of three coordinates of the tree each: slides, place of o, yaw pitch roll, lifts, u_i.
SLIDES, PLACE, TURNS, LIFTS, RODS, COORDINATES = 0, 3, 6, 9, 12, 15

Ts = TypeVarTuple('Ts')
T = TypeVar('T')


def each_chain(function: Callable[[int, *Ts], T]) -> Callable[[*Ts], tuple[T, T, T]]:
    """Decorate a function of chain i, its first argument: the result gives those of all three.

    In Python as compiled. Tuples stay in registers: where a loop stores the motion of the chains
    in an array instead, the forces of a batch take 1.20 (1.18 to 1.24) times as long.
    """
    @wraps(function)
    def three(*arguments: *Ts) -> tuple[T, T, T]:
        return function(0, *arguments), function(1, *arguments), function(2, *arguments)

    return three


class Chain(NamedTuple):
    """Constants of one chain.

    `cos` and `sin` of delta_i; `x`, `y` of the spherical joint in `platform` [m]; masses of slide,
    lift and rod [kg]. With s_i, the speed of A_i along n_i, (v_x, v_y) = sum of (`left_x`,
    `left_y`) s_i. The sum of `balance` s_i is 0 for a platform that does not turn.
    """

    cos: Value
    sin: Value
    x: Value
    y: Value
    left_x: Value
    left_y: Value
    balance: Value
    slide: Value
    lift: Value
    rod: Value


class Joints(NamedTuple):
    """Friction of C_i and of A_i: c [N m s/rad], M [N m] at any load, and mu times radius [m].

    It turns over within `width` [rad/s].
    """

    width: Value
    c_r: Value = 0.0
    M_r: Value = 0.0
    lever_r: Value = 0.0
    c_s: Value = 0.0
    M_s: Value = 0.0
    lever_s: Value = 0.0


class DriveParameters(NamedTuple):
    """Friction of one drive: c [N s/m], mu and the reversal velocity [m/s]."""

    viscous: Value
    coulomb: Value
    reversal_velocity: Value


class Parameters(NamedTuple):
    """Parameters of `forces`.

    R, l and r [m], the sign of sin u_i, mass, centre and inertia of the platform with its payload,
    in `platform`, gravity in `base` [m/s^2]. `bound` is the square of the largest condition number,
    `drives` six of `DriveParameters`.
    """

    R: Value
    l: Any  # noqa: E741
    r: Value
    elbow: Value
    chains: tuple[Chain, Chain, Chain]
    mass: Value
    centre: Vector
    moments: Vector
    products: Vector
    gravity: Vector
    minimum_sine: Any
    bound: Any
    joints: Joints
    drives: tuple[DriveParameters, ...]


class Data(NamedTuple):
    """Motions and results of samples; see `forces`."""

    motion: Any
    parts: Any
    q: Any


class Wrench(NamedTuple):
    """A force and its moment about o, in `base`."""

    force: Vector
    moment: Vector


class Twist(NamedTuple):
    """v of o and omega, in `base`."""

    v: Vector
    omega: Vector


class ChainMotion(NamedTuple):
    """One chain at one sample; slide and lift are drives.

    `arm` is rho_i = A_i - P. The unit reactions H_i along n_i and V_i along d_i are wrenches on
    the platform, the rows of [B].
    """

    arm: Vector
    cos_u: Value
    sin_u: Value
    u_dot: Value
    u_ddot: Value
    slide: Value
    lift: Value
    slide_velocity: Value
    lift_velocity: Value
    slide_acceleration: Value
    lift_acceleration: Value
    H: Wrench
    V: Wrench


class ChainForces(NamedTuple):
    """Forces of a chain's drives, loads of their guides and of the joints C_i and A_i [N]."""

    slide: Value
    lift: Value
    slide_load: Value
    lift_load: Value
    revolute_load: Value
    spherical_load: Value


ThreeChains = tuple[ChainMotion, ChainMotion, ChainMotion]
ThreeTwists = tuple[Twist, Twist, Twist]
_V, _DRIVES = Vector(0.0, 0.0, 0.0), (DriveParameters(0.0, 0.0, 1.0),) * 6
read_parameters = reader_of(Parameters(
    0.0, 0.0, 0.0, 0.0, (Chain(*(0.0,) * 10),) * 3, 0.0, _V, _V, _V, _V, 0.0, 0.0, Joints(1.0),
    _DRIVES))


def forces(parameters: Any, motion: Any, parts: Any, q: Any) -> int:
    """Fill tables of results from one of motions.

    Parameters
    ----------
    parameters : array
        `row_of` a `Parameters`.
    motion : (N, 19) array
        See `PlatformMotion.rows`.
    parts : (RESULTS, N, 6) array
    q : (N, COORDINATES) or (0, COORDINATES) array

    Returns
    -------
    int
        The first sample out of reach or too near a singularity, or -1.
    """
    p, t = read_parameters(parameters), elements(Data(motion, parts, q))
    first = -1
    for s in range(len(motion)):
        if not _is_regular(p, s, t.motion, t.parts) and first < 0:
            first = s
        if len(t.q):
            _write_coordinates(p, s, t.motion, t.q)
    return first


def _is_regular(p: Parameters, s: int, motion: Any, parts: Any) -> Any:
    """Fill in sample s and return whether it is within reach and far from a singularity."""
    m = motion_sample(motion, s)
    chains = chain_motions(p, m)
    slides, lifts = invert(p, chains)
    # Step 1: the rods about C_i. Step 2: the platform. [B]^-1 says which reaction answers to what.
    W = rod_reactions(p, chains)
    wrench = platform_wrench(p, m, chains, W)
    bodies = chain_forces(p, chains, W, wrench, slides, lifts)
    k = joint_resistances(p, chains, bodies, m.omega)
    r1, r2, r3 = resisting_wrenches(p, chains, k, m.omega)
    rubbing = Wrench(plus(r1.force, plus(r2.force, r3.force)),
                     plus(r1.moment, plus(r2.moment, r3.moment)))
    for i in range(CHAINS):
        c, f = chains[i], bodies[i]
        _write_forces(p, parts, s, i, f.slide, c.slide_velocity, f.slide_load,
                      power(rubbing, slides[i]))                               # Eq. (11)
        _write_forces(p, parts, s, CHAINS + i, f.lift, c.lift_velocity, f.lift_load,
                      c.sin_u * power(rubbing, lifts[i]))                      # Eq. (11)
        _write(parts, POSITION, s, i, c.slide, c.lift)
        _write(parts, VELOCITY, s, i, c.slide_velocity, c.lift_velocity)
        _write(parts, ACCELERATION, s, i, c.slide_acceleration, c.lift_acceleration)
    return is_within_bounds(p, chains, slides, lifts)


def _write_coordinates(p: Parameters, s: int, motion: Any, q: Any) -> None:
    """Write the coordinates of the tree."""
    m = motion_sample(motion, s)
    chains, (x, y, z) = chain_motions(p, m), m.rotation
    for i in range(CHAINS):
        c = chains[i]
        q[s, SLIDES + i], q[s, LIFTS + i] = c.slide, c.lift
        q[s, RODS + i] = atan2(c.sin_u, c.cos_u)
    q[s, PLACE], q[s, PLACE + 1], q[s, PLACE + 2] = m.position
    q[s, TURNS] = atan2(x.y, x.x)
    q[s, TURNS + 1] = atan2(-x.z, sqrt(y.z * y.z + z.z * z.z))
    q[s, TURNS + 2] = atan2(y.z, z.z)


def _write_forces(p: Parameters, parts: Any, s: int, drive: int, rigid_body: Any, velocity: Any,
                  load: Any, passive: Any) -> None:
    """Write the parts of a drive's force, and their sum."""
    c, mu, width = p.drives[drive]
    active = c * velocity + mu * load * tanh(velocity / width)                 # Eq. (15), (16)
    parts[TOTAL, s, drive] = rigid_body + active + passive                     # Eq. (14)
    parts[RIGID, s, drive] = parts[TRANSMITTED, s, drive] = rigid_body
    parts[DRIVE_FRICTION, s, drive], parts[LOAD, s, drive] = active, load
    parts[JOINT_EFFORT, s, drive] = passive


def _write(parts: Any, row: int, s: int, i: int, first: Any, second: Any) -> None:
    """Write two numbers of chain i."""
    parts[row, s, i], parts[row, s, CHAINS + i] = first, second


# --- kinematics ----------------------------------------------------------------------------------


def radial(chain: Any, v: Vector) -> Any:
    """Return e_i . v."""
    return v.x * chain.cos + v.y * chain.sin


def along_axis(chain: Any, v: Vector) -> Any:
    """Return n_i . v."""
    return v.y * chain.cos - v.x * chain.sin


def in_base(chain: Any, e: Any, n: Any, k: Any) -> Vector:
    """Return the vector of components along e_i, n_i and k."""
    return Vector(e * chain.cos - n * chain.sin, e * chain.sin + n * chain.cos, k)


def at_platform(arm: Vector, force: Vector) -> Wrench:
    """Return the wrench of a force at A_i."""
    return Wrench(force, product(arm, force))


def power(wrench: Wrench, twist: Twist) -> Any:
    """Return the power of a wrench on a twist."""
    return dot(wrench.force, twist.v) + dot(wrench.moment, twist.omega)


@each_chain
def chain_motions(i: int, p: Parameters, m: MotionSample) -> ChainMotion:
    """Return the motion of chain i that belongs to the platform's, Eq. (3) and (4)."""
    c, l = p.chains[i], p.l  # noqa: E741
    rho = turned(m.rotation, Vector(c.x, c.y, 0.0))
    A = plus(m.position, rho)
    cos_u = (p.R - radial(c, A)) / l
    sin_u = p.elbow * sqrt(1.0 - cos_u * cos_u)

    spin = product(m.omega, rho)
    v_A = plus(m.v, spin)
    u_dot = radial(c, v_A) / (l * sin_u)                                       # Eq. (10)

    a_A = plus(m.a, plus(product(m.epsilon, rho), product(m.omega, spin)))
    u_ddot = (radial(c, a_A) / l - cos_u * u_dot * u_dot) / sin_u
    return ChainMotion(
        rho, cos_u, sin_u, u_dot, u_ddot,
        along_axis(c, A), A.z - l * sin_u,                                     # Eq. (3)
        along_axis(c, v_A), v_A.z - l * cos_u * u_dot,                         # Eq. (4)
        along_axis(c, a_A), a_A.z - l * (cos_u * u_ddot - sin_u * u_dot * u_dot),
        at_platform(rho, in_base(c, 0.0, 1.0, 0.0)),                           # Eq. (4)
        at_platform(rho, in_base(c, -cos_u, 0.0, sin_u)))                      # Eq. (4)


def invert(p: Parameters, chains: ThreeChains) -> tuple[ThreeTwists, ThreeTwists]:
    """Return [B]^-1 by its columns: the twists for unit right sides of slides and of lifts.

    Infinite or NaN where det [B] is 0.

    Notes
    -----
    Row i of the slides says n_i . v + m_i . omega = b_i, with m_i = rho_i x n_i. The n_i are
    horizontal and constant: two combinations of the three rows give v_x and v_y, and the third, in
    which the n_i add up to nothing, speaks of omega alone: m . omega = sum of balance_i b_i.
    Without v_x and v_y row i of the lifts says sin u_i v_z + g_i . omega = b_i. These four
    equations are solved by Cramer's rule. There is no pivot to choose, and nothing is divided by
    but their determinant, a constant times det [B].
    """
    k1, k2, k3 = p.chains
    m1, m2, m3 = chains[0].H.moment, chains[1].H.moment, chains[2].H.moment
    along_x = combine(k1.left_x, m1, k2.left_x, m2, k3.left_x, m3)
    along_y = combine(k1.left_y, m1, k2.left_y, m2, k3.left_y, m3)
    m = combine(k1.balance, m1, k2.balance, m2, k3.balance, m3)
    g1, g2, g3 = _reduced_moments(p, chains, along_x, along_y)
    s1, s2, s3 = chains[0].sin_u, chains[1].sin_u, chains[2].sin_u
    g23, g31, g12 = product(g2, g3), product(g3, g1), product(g1, g2)
    G = combine(s1, g23, s2, g31, s3, g12)
    share = 1.0 / dot(m, G)
    s1, s2, s3 = share * s1, share * s2, share * s3
    lifts = (
        _twist(along_x, along_y, share * dot(m, g23), product(m, _difference(s2, g3, s3, g2))),
        _twist(along_x, along_y, share * dot(m, g31), product(m, _difference(s3, g1, s1, g3))),
        _twist(along_x, along_y, share * dot(m, g12), product(m, _difference(s1, g2, s2, g1))))
    turning = _twist(along_x, along_y, -share * dot(g1, g23), times(share, G))
    return _slide_twists(p, chains, turning, lifts), lifts


def _twist(along_x: Vector, along_y: Vector, z: Any, omega: Vector) -> Twist:
    return Twist(Vector(-dot(along_x, omega), -dot(along_y, omega), z), omega)


def _difference(f: Any, a: Vector, g: Any, b: Vector) -> Vector:
    return minus(times(f, a), times(g, b))


@each_chain
def _reduced_moments(i: int, p: Parameters, chains: ThreeChains, along_x: Vector, along_y: Vector,
                     ) -> Vector:
    """Return g_i: the moment of V_i after elimination of v_x and v_y."""
    k, cos_u = p.chains[i], chains[i].cos_u
    return combine(1.0, chains[i].V.moment, cos_u * k.cos, along_x, cos_u * k.sin, along_y)


@each_chain
def _slide_twists(i: int, p: Parameters, chains: ThreeChains, turning: Twist, lifts: ThreeTwists,
                  ) -> Twist:
    """Return the twist that moves slide i alone."""
    k = p.chains[i]
    level = Vector(k.left_x, k.left_y, 0.0)
    f1, f2, f3 = _raised(p, chains, level)
    (a, u), (b, v), (c, w) = lifts
    return Twist(plus(plus(level, times(k.balance, turning.v)), combine(f1, a, f2, b, f3, c)),
                 plus(times(k.balance, turning.omega), combine(f1, u, f2, v, f3, w)))


@each_chain
def _raised(i: int, p: Parameters, chains: ThreeChains, level: Vector) -> Any:
    """Return the share of eliminated v_x and v_y in the right side of lift i."""
    return chains[i].cos_u * radial(p.chains[i], level)


def is_within_bounds(p: Parameters, chains: ThreeChains, slides: ThreeTwists, lifts: ThreeTwists,
                     ) -> Any:
    """Return whether all rods reach, none is too nearly horizontal, and [J] is well conditioned.

    False for NaN. The condition number is bounded by that of Frobenius, rotations times r.
    """
    n = 1.0 / p.r
    J, J_inverse = 0.0 * n, 0.0 * n
    for i in range(CHAINS):
        c = chains[i]
        sine = c.sin_u * c.sin_u
        J = J + _square(slides[i], p.r) + sine * _square(lifts[i], p.r)
        # The force of a unit reaction has length 1.
        J_inverse = (J_inverse + 1.0 + n * n * dot(c.H.moment, c.H.moment)
                     + (1.0 + n * n * dot(c.V.moment, c.V.moment)) / sine)
    return (abs(chains[0].sin_u) >= p.minimum_sine and abs(chains[1].sin_u) >= p.minimum_sine
            and abs(chains[2].sin_u) >= p.minimum_sine and J * J_inverse <= p.bound)


def _square(twist: Twist, r: Any) -> Any:
    """Return the squared length of a twist, rotations times r."""
    return dot(twist.v, twist.v) + r * r * dot(twist.omega, twist.omega)


# --- rigid bodies, in the paper's four steps -----------------------------------------------------


@each_chain
def rod_reactions(i: int, p: Parameters, chains: ThreeChains) -> Any:
    """Return W_i, from the moments about C_i of the rod."""
    k, c = p.chains[i], chains[i]
    f_e, f_k = -radial(k, p.gravity), c.lift_acceleration - p.gravity.z
    return (k.rod * (c.cos_u * f_k + c.sin_u * f_e) / 2.0
            + k.rod * p.l * c.u_ddot / 3.0)                                    # Eq. (5)


def platform_wrench(p: Parameters, m: MotionSample, chains: ThreeChains, W: Any) -> Wrench:
    """Return the wrench about o that H_i and V_i apply, in `base` [N, N m].

    Left side of Eq. (6) minus weight and W_i, with the centre of mass anywhere. With d, the vector
    from o to the centre:

        force = (M + m)(a_o + eps x d + omega x (omega x d) - g)
        moment = [I]eps + omega x [I]omega + d x force
    """
    d = turned(m.rotation, p.centre)
    a_centre = plus(m.a, plus(product(m.epsilon, d), product(m.omega, product(m.omega, d))))
    force = times(p.mass, minus(a_centre, p.gravity))                          # Eq. (6)
    # In `platform`, where [I] is constant.
    omega, epsilon = turned_back(m.rotation, m.omega), turned_back(m.rotation, m.epsilon)
    spin = plus(_momentum(p, epsilon), product(omega, _momentum(p, omega)))
    moment = plus(turned(m.rotation, spin), product(d, force))                 # Eq. (6)
    for i in range(CHAINS):
        c = chains[i]
        rod = at_platform(c.arm, in_base(p.chains[i], -c.sin_u, 0.0, -c.cos_u))
        force = minus(force, times(W[i], rod.force))
        moment = minus(moment, times(W[i], rod.moment))
    return Wrench(force, moment)


def _momentum(p: Parameters, omega: Vector) -> Vector:
    xx, yy, zz = p.moments
    xy, xz, yz = p.products
    return Vector(xx * omega.x + xy * omega.y + xz * omega.z,
                  xy * omega.x + yy * omega.y + yz * omega.z,
                  xz * omega.x + yz * omega.y + zz * omega.z)


@each_chain
def chain_forces(i: int, p: Parameters, chains: ThreeChains, W: Any, wrench: Wrench,
                 slides: ThreeTwists, lifts: ThreeTwists) -> ChainForces:
    """Return drive forces and loads of a chain.

    Reactions of the spherical joint on the platform are H along n_i, V along the rod from C_i to
    A_i, and W. The starred ones are the same force one joint further down, in C_i: H_star along
    n_i, V_star vertical, W_star radial.
    """
    k, c, l = p.chains[i], chains[i], p.l  # noqa: E741
    g_e, g_n, g_k = radial(k, p.gravity), along_axis(k, p.gravity), p.gravity.z
    f_e, f_n, f_k = -g_e, c.slide_acceleration - g_n, c.lift_acceleration - g_k  # of C_i
    H, V = power(wrench, slides[i]), power(wrench, lifts[i])                   # Eq. (6)
    # Acceleration of the rod's middle relative to C_i.
    rise = l * (c.u_ddot * c.cos_u - c.u_dot * c.u_dot * c.sin_u) / 2.0
    lean = l * (c.u_ddot * c.sin_u + c.u_dot * c.u_dot * c.cos_u) / 2.0
    H_star = H + k.rod * f_n                                                   # Eq. (9)
    V_star = V * c.sin_u - W[i] * c.cos_u + k.rod * rise + k.rod * f_k         # Eq. (9)
    W_star = V * c.cos_u + W[i] * c.sin_u - k.rod * lean - k.rod * f_e         # Eq. (9)

    # Steps 3 and 4: the chain down to the lift, then down to the slide.
    Q_lift = ((k.lift + k.rod) * f_k + k.rod * rise + V * c.sin_u
              - W[i] * c.cos_u)                                                # Eq. (7)
    Q_slide = (k.slide + k.lift + k.rod) * f_n + H                             # Eq. (8)

    lift_radial = W_star - k.lift * f_e
    return ChainForces(
        Q_slide, Q_lift,
        _length(lift_radial - k.slide * f_e, V_star + k.lift * f_k - k.slide * g_k),  # Eq. (15)
        _length(H_star + k.lift * f_n, lift_radial),                           # Eq. (16)
        _length(V_star, W_star), sqrt(H * H + V * V + W[i] * W[i]))


def _length(a: Any, b: Any) -> Any:
    return sqrt(a * a + b * b)


# --- friction in the passive joints --------------------------------------------------------------


def relative_rate(chain: Any, u_dot: Any, omega: Vector) -> Vector:
    """Return omega_n = u_dot_i n_i - omega, of the rod relative to the platform [rad/s]."""
    return minus(in_base(chain, 0.0, u_dot, 0.0), omega)                       # Eq. (9)


@each_chain
def joint_resistances(i: int, p: Parameters, chains: ThreeChains, bodies: Any, omega: Vector,
                      ) -> Any:
    """Return k_ri and k_si, friction over speed in C_i and A_i [N m s/rad]."""
    j, c, f = p.joints, chains[i], bodies[i]
    rate = relative_rate(p.chains[i], c.u_dot, omega)
    dry_r = j.M_r + j.lever_r * f.revolute_load                                # Eq. (1)
    dry_s = j.M_s + j.lever_s * f.spherical_load                               # Eq. (1)
    return (j.c_r + dry_r * sign_over_speed(abs(c.u_dot), j.width),            # Eq. (2), (9)
            j.c_s + dry_s * sign_over_speed(sqrt(dot(rate, rate)), j.width))   # Eq. (2), (9)


@each_chain
def resisting_wrenches(i: int, p: Parameters, chains: ThreeChains, k: Any, omega: Vector) -> Wrench:
    """Return the wrench on the platform that overcomes the friction in the joints of chain i.

    What acts about u_i is brought there by the rod's row, which gives [J_u] with [J].

    Notes
    -----
    The corrected form is exact: k_si acts on u_dot_i n_i - omega of its own chain. For the printed
    form see `PrintedFriction`.
    """
    c, chain = chains[i], p.chains[i]
    k_r, k_s = k[i]
    about_u = (k_r + k_s) * c.u_dot - k_s * along_axis(chain, omega)           # Eq. (12)
    against = relative_rate(chain, c.u_dot, omega)
    rod = at_platform(c.arm, in_base(chain, about_u / (p.l * c.sin_u), 0.0, 0.0))  # Eq. (10)
    return Wrench(rod.force, minus(rod.moment, times(k_s, against)))           # Eq. (12)
