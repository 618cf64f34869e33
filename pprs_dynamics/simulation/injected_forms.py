# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Injected forces on drives: equations, and how their parameters are drawn.

Sizes are drawn in units of each joint's largest effort and speed, to fit robots of any size.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import PprsError
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion

HALL = (18.0, 30.0)  # [degC]
WAVE, PERIOD = (5.0, 10.0), (20.0, 45.0)  # of the hall [K, s]
RISE, COOLING = (10.0, 30.0), (6.0, 20.0)  # by steady work at the usual speed [K], and back [s]
REFERENCE = (20.0, 45.0)  # at which numbers of a model were measured [degC]
STEP, RATE = 0.1, 10.0  # of a thermometer [K, Hz]
VOGEL_B, VOGEL_C = 900.0, 95.0  # of mineral oils [K]
LAG = 0.2  # by which it is late [s]


def draw_temperatures(rng: np.random.Generator, time: Array, velocity: Array) -> Array:
    """Return random temperatures of drives along a motion, (N, D) [degC].

    They begin at the temperature of the hall, and rise by a `RISE` at their mean speed.

    Parameters
    ----------
    rng : numpy.random.Generator
    time : (N,) array
        [s]
    velocity : (N, D) array
    """
    mean, wave, period, phase = (float(rng.uniform(*limits)) for limits in (
        HALL, WAVE, PERIOD, (0, 2 * np.pi)))
    rise, cooling = (rng.uniform(*bounds, velocity.shape[1]) for bounds in (RISE, COOLING))
    speed = np.abs(velocity)
    work = speed / np.maximum(speed.mean(axis=0), 1e-12)
    hall = mean + wave * np.sin(2 * np.pi * time / period + phase)
    found = np.full_like(velocity, mean + wave * np.sin(phase))
    for k, step in enumerate(np.diff(time)):
        found[k + 1] = found[k] + step * (hall[k] + rise * work[k] - found[k]) / cooling
    return found


def thinner(temperature: Array, reference: Array | float) -> Array:
    """Return by which share oil is more viscous than at a reference, by Vogel's law [degC]."""
    exponent = VOGEL_B / (temperature + VOGEL_C) - VOGEL_B / (np.asarray(reference) + VOGEL_C)
    found: Array = np.expm1(exponent)
    return found


def read_thermometers(time: Array, temperature: Array) -> Array:
    """Return temperatures of the drives, (N, D) [degC]; NaN between two readings."""
    step = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
    late, read = np.empty_like(temperature), np.full(temperature.shape, np.nan)
    late[0] = temperature[0]
    for k in range(1, len(late)):
        late[k] = late[k - 1] + min(step / LAG, 1.0) * (temperature[k] - late[k - 1])
    every = max(1, round(1 / (RATE * step)))
    read[::every] = STEP * np.round(late[::every] / STEP)
    return read


CROSSED = 0.02  # of a joint's top speed or load, within which a clearance is crossed
STEEPNESS = 0.005  # of a joint's top speed, within which injected dry friction turns over


class InjectedEffectError(PprsError, ValueError):
    """An injected effect that does not exist, or that a robot cannot have."""


def algebraic_sign(velocity: Array, width: float) -> Array:
    """Return v / sqrt(v^2 + w^2): another change of direction than the tanh of the model."""
    sign: Array = velocity / np.sqrt(velocity * velocity + width * width)
    return sign


def eyring(velocity: Array, thinning_velocity: float) -> Array:
    """Return v_1 asinh(v / v_1): the speed as grease shows it that thins with the shear rate."""
    felt: Array = thinning_velocity * np.arcsinh(velocity / thinning_velocity)
    return felt


@dataclass(frozen=True)
class JointMoment:
    """One joint along a motion, (N,) each, and its scales.

    Parameters
    ----------
    time, position, velocity, acceleration, load : (N,) arrays
        `load` is the effort without friction, with its sign.
    effort, speed : float
        Largest effort and speed of the motion.
    gear_ratio : float
    temperature : (N,) array
        [degC]
    pressed : (N,) array
        Load that friction follows: of a guide the force across it, else the size of `load`.
    next_velocity : (N,) array
        Velocity of the next drive.
    """

    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    load: Array
    effort: float
    speed: float
    gear_ratio: float
    temperature: Array
    pressed: Array
    next_velocity: Array

    @classmethod
    def along(cls, motion: JointMotion, joint: int, load: Array, effort: float, gear_ratio: float,
              temperature: Array, pressed: Array | None = None) -> JointMoment:
        """Return a joint along a motion, under loads (N,) and with a largest effort."""
        assert motion.time is not None
        velocity = motion.velocity[:, joint]
        return cls(motion.time, motion.position[:, joint], velocity,
                   motion.acceleration[:, joint], load, float(effort),
                   float(np.abs(velocity).max()), float(gear_ratio), temperature[:, joint],
                   np.abs(load) if pressed is None else pressed,
                   motion.velocity[:, (joint + 1) % motion.velocity.shape[1]])

    @property
    def sign(self) -> Array:
        """Direction v / sqrt(v^2 + w^2): another way to turn over than the model's tanh."""
        return algebraic_sign(self.velocity, STEEPNESS * self.speed)

    @property
    def driving(self) -> Array:
        """1 where the motor drives the load, 0 where the load drives the motor."""
        power = self.load * self.velocity
        return (1 + power / np.hypot(power, 0.01 * self.effort * self.speed)) / 2


@dataclass(frozen=True)
class JointForm:
    """An injected force on a joint.

    Parameters
    ----------
    draw : callable
        From a random generator and a moment: parameters, the size first.
    force : callable
        From parameters and a moment: the force, (N,).
    needs_turn : float
        Range of a turning joint that it needs [rad]; 0 where it acts in any.
    """

    draw: Callable[[np.random.Generator, JointMoment], dict[str, float]]
    force: Callable[[Mapping[str, float], JointMoment], Array]
    needs_turn: float = 0.0


def _share(low: float, high: float) -> Callable[[np.random.Generator], float]:
    return lambda rng: float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _slipping(position: Array, force: float, stroke: float) -> Array:
    """Return the force of a spring that slips once it is stretched by a stroke (Jenkins)."""
    found, stretched = np.empty_like(position), 0.0
    for k, moved in enumerate(np.diff(position, prepend=position[0])):
        stretched = min(max(stretched + moved, -stroke), stroke)
        found[k] = force * stretched / stroke
    return found


SIZE = _share(0.03, 0.1)  # of the largest effort


def _stop(m: JointMoment, side: float, reach: float, force: float) -> dict[str, float]:
    """Return a stop at a share of the stroke from its end, and the stiffness for a force there."""
    end, stroke = float((side * m.position).max()), float(np.ptp(m.position))
    return {'stiffness': force / (reach * stroke) ** 1.5, 'side': side,
            'position': side * (end - reach * stroke)}


def _accumulator(p: Mapping[str, float], m: JointMoment) -> Array:
    """Return the torque of a cylinder whose oil a bladder of nitrogen drives, by its two ends."""
    angle = m.position - p['position']
    ends = np.stack([1 - p['arm'] * np.cos(angle), p['arm'] * np.sin(angle)])
    length = np.hypot(*ends)
    # Drawn out, the piston drives oil into the bladder: its volume falls, adiabatically.
    volume = 1 - 0.35 * (length - 1 + p['arm']) / (2 * p['arm'])
    return p['force'] * volume ** -1.3 * p['arm'] * np.sin(angle) / length


FORMS: dict[str, JointForm] = {
    # c v_1 asinh(v / v_1)
    'viscous_friction': JointForm(
        lambda rng, m: {'coefficient': SIZE(rng) * m.effort / m.speed,
                        'thinning_velocity': 2 * m.speed},
        lambda p, m: p['coefficient'] * eyring(m.velocity, p['thinning_velocity'])),
    # F v / sqrt(v^2 + w^2)
    'coulomb_friction': JointForm(
        lambda rng, m: {'force': SIZE(rng) * m.effort}, lambda p, m: p['force'] * m.sign),
    # c v for v > 0, else 0
    'asymmetric_friction': JointForm(
        lambda rng, m: {'coefficient': 2 * SIZE(rng) * m.effort / m.speed},
        lambda p, m: p['coefficient'] * np.maximum(m.velocity, 0.0)),
    # F exp(-|v| / v_s) v / sqrt(v^2 + w^2)
    'stribeck_friction': JointForm(
        lambda rng, m: {'force': 2 * SIZE(rng) * m.effort, 'velocity': 0.1 * m.speed},
        lambda p, m: p['force'] * np.exp(-np.abs(m.velocity) / p['velocity']) * m.sign),
    # c v |v|
    'quadratic_friction': JointForm(
        lambda rng, m: {'coefficient': 2 * SIZE(rng) * m.effort / m.speed ** 2},
        lambda p, m: p['coefficient'] * m.velocity * np.abs(m.velocity)),
    # dmu |N|^(2/3) tau_0^(1/3) v / sqrt(v^2 + w^2), N the effort, of guides the load across
    'load_friction': JointForm(
        lambda rng, m: {'coefficient': 2 * SIZE(rng), 'reference': m.effort},
        lambda p, m: p['coefficient'] * np.cbrt(m.pressed ** 2 * p['reference']) * m.sign),
    # mu tau_0 (|tau| / tau_0)^0.9 v / sqrt(v^2 + w^2), mu_b in the place of mu_d by the share (1 -
    # tau v / sqrt((tau v)^2 + (0.01 tau_0 v_0)^2)) / 2
    'gear_efficiency': JointForm(
        lambda rng, m: {'driving': 4 * SIZE(rng), 'driven_back': float(rng.uniform(0.0, 0.1)),
                        'reference': m.effort},
        lambda p, m: p['reference'] * (np.abs(m.load) / p['reference']) ** 0.9 * m.sign * (
            p['driven_back'] + (p['driving'] - p['driven_back']) * m.driving)),
    # three springs that slip one after the other, F / 3 each, in the place of F sgn(v)
    'hysteresis': JointForm(
        lambda rng, m: {'force': SIZE(rng) * m.effort, 'stroke': 0.02 * float(
            np.ptp(m.position))},
        lambda p, m: sum((_slipping(m.position, p['force'] / 3, share * p['stroke'])
                          for share in (0.2, 0.6, 1.0)), -p['force'] * m.sign)),
    # F exp(-t / T) v / sqrt(v^2 + w^2)
    'friction_drift': JointForm(
        lambda rng, m: {'force': 2 * SIZE(rng) * m.effort, 'time': 0.3 * float(m.time[-1])},
        lambda p, m: p['force'] * np.exp(-m.time / p['time']) * m.sign),
    # c (eta(T) / eta(T_0) - 1) v_1 asinh(v / v_1), ln eta = 900 K / (T + 95 K) (Vogel), T of the
    # grease, of which the thermometer is late
    'friction_temperature': JointForm(
        lambda rng, m: {'coefficient': 3 * SIZE(rng) * m.effort / m.speed,
                        'reference': float(rng.uniform(*REFERENCE)),
                        'thinning_velocity': 2 * m.speed},
        lambda p, m: p['coefficient'] * thinner(m.temperature, p['reference'])
        * eyring(m.velocity, p['thinning_velocity'])),
    # constant
    'effort_offset': JointForm(
        lambda rng, m: {'force': SIZE(rng) * m.effort},
        lambda p, m: np.full_like(m.time, p['force'])),
    # k (q - q_0)
    'drive_spring': JointForm(
        lambda rng, m: {'stiffness': SIZE(rng) * m.effort / float(
            np.ptp(m.position)) * 2, 'zero': float(np.mean(m.position))},
        lambda p, m: p['stiffness'] * (m.position - p['zero'])),
    # A sin(2 pi q / p + phi) + A / 4 sin(4 pi q / p)
    'force_ripple': JointForm(
        lambda rng, m: {'force': 0.5 * SIZE(rng) * m.effort, 'phase': float(rng.uniform(0, 6)),
                        'pitch': np.pi / m.gear_ratio if m.gear_ratio > 1 else float(
                            np.ptp(m.position)) / 12},
        lambda p, m: p['force'] * (np.sin(2 * np.pi * m.position / p['pitch'] + p['phase'])
                                   + 0.25 * np.sin(4 * np.pi * m.position / p['pitch']))),
    # k x^(3/2) (1 + v / (2 v_0)) beyond q_s on one side, x the way beyond it, v the speed into it
    'stop_contact': JointForm(
        lambda rng, m: _stop(m, float(rng.choice((-1.0, 1.0))), float(rng.uniform(0.05, 0.2)),
                             3 * SIZE(rng) * m.effort),
        lambda p, m: p['side'] * p['stiffness'] * np.maximum(
            p['side'] * (m.position - p['position']), 0.0) ** 1.5
        * (1 + p['side'] * m.velocity / (2 * m.speed))),
    # p A dl/dq, p = p_0 (V_0 / V)^1.3, V falls by a third as the cylinder is drawn out
    'counterbalance': JointForm(
        lambda rng, m: {'force': 5 * SIZE(rng) * m.effort, 'arm': float(rng.uniform(0.35, 0.75)),
                        'position': float(np.mean(m.position) + rng.uniform(-0.6, 0.6))},
        _accumulator, needs_turn=1.0),
    # m a
    'drive_inertia': JointForm(
        lambda rng, m: {'mass': 2 * SIZE(rng) * m.effort / float(
            np.abs(m.acceleration).max())},
        lambda p, m: p['mass'] * m.acceleration),
}
UNKNOWN: dict[str, JointForm] = {
    # F / (1 + ((q - q_0) / w)^4)
    'local_bump': JointForm(
        lambda rng, m: {'force': SIZE(rng) * m.effort, 'place': float(np.quantile(
            m.position, rng.uniform(0.3, 0.7))), 'width': 0.05 * float(np.ptp(m.position))},
        lambda p, m: p['force'] / (1 + ((m.position - p['place']) / p['width']) ** 4)),
    # A sin(2 pi f t + phi)
    'vibration': JointForm(
        lambda rng, m: {'force': SIZE(rng) * m.effort, 'frequency': 6 * 5 ** float(rng.random()),
                        'phase': float(rng.uniform(-np.pi, np.pi))},
        lambda p, m: p['force'] * np.sin(2 * np.pi * p['frequency'] * m.time + p['phase'])),
    # c v of the next drive
    'drive_coupling': JointForm(
        lambda rng, m: {'coefficient': 2 * SIZE(rng) * m.effort / m.speed},
        lambda p, m: p['coefficient'] * m.next_velocity),
}
"""Forces that no effect of the catalogue explains."""


def draw_form(form: JointForm, random: np.random.Generator, moment: JointMoment, scale: float,
              ) -> dict[str, float]:
    """Return the parameters of a form, its size times a scale."""
    drawn = form.draw(random, moment)
    drawn[next(iter(drawn))] *= scale
    return drawn
