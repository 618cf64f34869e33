# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Drive forces: energy, statics, symmetry, reactions, friction and the sum over effects."""

from __future__ import annotations

import numpy as np
import pytest
import random_states as states
from model_recordings import with_effects
from numpy.testing import assert_allclose, assert_array_equal
from oracles.first_principles import UP, central_difference, chain_vectors, drive_motion, moved

from pprs_dynamics import DriveModel, JointMotion, PlatformMotion
from pprs_dynamics.errors import MotionError, PprsError, SingularityError
from pprs_dynamics.physics.mechanism.paths import HelicalPath

# Forces of some 40 N and powers of some 100 W, with the rounding errors of a few hundred
# operations; a wrong term shows at 1e-3 or more.
ROUNDING = 1e-11
# A fourth-order difference over 1e-3 s of motions of a few rad/s.
OBLIQUE = (3.0, -4.0, -8.0)
PRINTED = {'equations': 'printed'}
INDEPENDENT = {'friction.approach': 'independent_chains'}
HARD_SIGN = {'friction.reversal_velocity': 1e-9, 'friction.reversal_rate': 1e-9}
STATES = 300

every_elbow = pytest.mark.parametrize('elbow', states.ELBOWS)


@pytest.fixture(params=states.ELBOWS)
def robot(request):
    """Return a robot in which no two chains are equal, under oblique gravity."""
    return states.random_robot(np.random.default_rng(51), request.param, OBLIQUE)


@pytest.fixture
def motion(robot):
    """Random states of that robot."""
    return states.random_motion(np.random.default_rng(52), STATES, robot.geometry.elbow)


def loads_of_joints(robot, forces):
    """Return what the tree of the robot's joints and closures transmits."""
    s = forces.mechanism
    return robot.at(s.position, s.velocity, s.acceleration).loads(robot.by_joint, robot.gravity_row)


def rod_cosines(robot, motion):
    """Return cos u_i of all rods, (N, 3)."""
    return np.cos(robot.rods(states.model_of(robot).mechanism(motion).links)[0])


def reactions_on_platform(robot, forces):
    """Return the force of every rod on the platform, (N, 3, 3) [N]."""
    return loads_of_joints(robot, forces).F


# Reactions -----------------------------------------------------------------------------------

def test_reactions_and_loads_are_those_of_every_body_cut_free(robot, motion):
    forces = states.model_of(robot).drive_forces(motion)
    body = forces.mechanism
    u, u_dot, u_ddot = robot.rods(body.links)
    (e, n), g, l = chain_vectors(robot.geometry), np.asarray(robot.gravity), \
        robot.geometry.rod_length  # noqa: E741
    slides, lifts, rods = robot.masses[:-1].reshape(3, 3, 1)
    c, s = np.cos(u)[..., None], np.sin(u)[..., None]
    moment_of_rod, u_dot, u_ddot = u_ddot, u_dot[..., None], u_ddot[..., None]
    along, swing = -c * e + s * UP, s * e + c * UP
    q_ddot = body.acceleration
    a_slide = q_ddot[:, :3, None] * n
    a_lift = a_slide + q_ddot[:, 3:, None] * UP
    a_rod = a_lift + l / 2 * (u_ddot * swing - u_dot ** 2 * along)

    at_A = -reactions_on_platform(robot, forces)
    at_C = rods * (a_rod - g) - at_A  # from the lift on the rod
    moment = np.sum(n * np.cross(l / 2 * along, at_A - at_C), axis=-1)
    transverse = rods[:, 0] * l ** 2 / 12
    assert_allclose(moment, transverse * moment_of_rod, rtol=0, atol=ROUNDING)
    from_slide = at_C + lifts * (a_lift - g)
    from_base = from_slide + slides * (a_slide - g)

    # A drive pushes along its guide; the rest of the force is the guide's load.
    assert_allclose(body.rigid_force[:, :3], np.sum(from_base * n, axis=-1), rtol=0, atol=ROUNDING)
    assert_allclose(body.rigid_force[:, 3:], from_slide[..., 2], rtol=0, atol=ROUNDING)
    across_slide = from_base - np.sum(from_base * n, axis=-1, keepdims=True) * n
    assert_allclose(body.friction_load[:, :3], np.linalg.norm(across_slide, axis=-1), rtol=0,
                    atol=ROUNDING)
    assert_allclose(body.friction_load[:, 3:], np.linalg.norm(from_slide[..., :2], axis=-1),
                    rtol=0, atol=ROUNDING)


def test_inertia_is_the_change_of_forces_by_the_acceleration_of_a_drive(robot, motion):
    model = states.model_of(robot, NUMBERS)
    state = model.mechanism(motion)
    change = np.einsum('nij,j->ni', robot.jacobian(state.links), 0.7 * (np.arange(6) == 2))
    forces = model.drive_forces(PlatformMotion.from_rows(np.hstack((
        motion.rows[:, :13], motion.rows[:, 13:] + change))))
    assert_allclose(state.rigid_force + 0.7 * robot.inertia(state)[2], forces.parts['rigid_body'],
                    atol=ROUNDING)


# Friction in the joints ----------------------------------------------------------------------

def test_active_friction_is_viscous_plus_load_times_sign(robot, motion):
    viscous, coulomb = np.linspace(0.5, 3, 6), np.linspace(0.02, 0.2, 6)
    model = states.model_of(robot, {**HARD_SIGN, 'friction.drives.viscous': tuple(viscous),
                             'friction.drives.coulomb': tuple(coulomb)})
    forces = model.drive_forces(motion)
    q_dot = drive_motion(robot.geometry, motion)[1]
    expected = viscous * q_dot + coulomb * forces.mechanism.friction_load * np.sign(q_dot)
    assert_allclose(forces.parts['active_friction'], expected, rtol=0, atol=ROUNDING)


def joint_friction(robot, motion, forces, c_r, mu_r, d_r, c_s, mu_s, d_s):
    """Return friction moments on the rods by Eq. (9) with a hard sign, (N, 3, 3) each [N m].

    Opposed to the rod's velocity against the lift, and against the platform; also those
    velocities.
    """
    _, n = chain_vectors(robot.geometry)
    loads = loads_of_joints(robot, forces)
    at_C = loads.f[:, [robot.structure.rows[f'hinge_{i}'] for i in (1, 2, 3)]]
    rod = robot.rods(forces.mechanism.links)[1][..., None] * n
    relative = rod - motion.angular_velocity[:, None]
    moments = []
    for velocity, load, c, mu, d in (
            (rod, np.linalg.norm(np.cross(at_C, n), axis=-1), c_r, mu_r, d_r),
            (relative, np.linalg.norm(reactions_on_platform(robot, forces), axis=-1),
             c_s, mu_s, d_s)):
        speed = np.linalg.norm(velocity, axis=-1, keepdims=True)
        moments.append(-(c * velocity + mu * d / 2 * load[..., None] * velocity / speed))
    return *moments, rod, relative


NUMBERS = {'friction.revolute.viscous': 0.03, 'friction.revolute.coulomb': 0.4,
           'friction.revolute.diameter': 0.02, 'friction.spherical.viscous': 0.01,
           'friction.spherical.coulomb': 0.2, 'friction.spherical.diameter': 0.03}


def test_passive_friction_does_the_joints_virtual_work_for_every_drive(robot, motion):
    model = states.model_of(robot, {**HARD_SIGN, **NUMBERS})
    forces = model.drive_forces(motion)
    at_C, at_A, *_ = joint_friction(robot, motion, forces, *NUMBERS.values())
    _, n = chain_vectors(robot.geometry)
    # What each drive's unit velocity turns, from differences of positions alone.
    for sample in range(5):
        pose = motion[sample]
        turns = central_difference(
            lambda x, p=pose: drive_motion(robot.geometry, moved(p, x))[0][0], 6)
        platform = np.linalg.inv(turns)
        u = central_difference(
            lambda x, p=pose: robot.rods(model.mechanism(moved(p, x)).links)[0, 0], 6) @ platform
        virtual = np.zeros(6)
        for i in range(3):
            rod = n[i][:, None] * u[i]
            virtual -= at_C[sample, i] @ rod + at_A[sample, i] @ (rod - platform[3:])
        assert_allclose(forces.parts['passive_friction'][sample], virtual, rtol=0, atol=1e-7)


@pytest.mark.parametrize('changes', [{}, PRINTED, INDEPENDENT, {**INDEPENDENT, **PRINTED}],
                         ids=['whole', 'whole-printed', 'independent', 'independent-printed'])
def test_zero_velocity_gives_zero_friction(robot, motion, changes):
    zero = np.zeros_like(motion.position)
    starting = PlatformMotion(motion.position, motion.orientation, zero, zero,
                              motion.linear_acceleration, motion.angular_acceleration)
    cos_u = rod_cosines(robot, starting)
    starting = starting[np.all(np.abs(cos_u) > 0.06, axis=1)]
    forces = states.model_of(robot, changes).drive_forces(starting)
    for part in ('active_friction', 'passive_friction'):
        assert not np.any(forces.parts[part]), part
    assert_array_equal(forces.total, forces.parts['rigid_body'])


# Corrected and printed -----------------------------------------------------------------------


def test_independent_chains_do_each_chains_virtual_work(robot, motion):
    cos_u = rod_cosines(robot, motion)
    defined = motion[np.all(np.abs(cos_u) >= 0.05, axis=1)]
    changes = {**INDEPENDENT, **HARD_SIGN, **NUMBERS}
    forces = states.model_of(robot, changes).drive_forces(defined)
    at_C, at_A, *_ = joint_friction(robot, defined, forces, *NUMBERS.values())
    _, n = chain_vectors(robot.geometry)
    lever = robot.geometry.rod_length * rod_cosines(robot, defined)
    slides = at_A[..., 2] / lever
    lifts = np.sum((at_A + at_C) * n, axis=-1) / lever
    assert_allclose(forces.parts['passive_friction'], np.concatenate((slides, lifts), axis=1),
                    rtol=1e-12, atol=ROUNDING)


@every_elbow
@pytest.mark.parametrize('equations', ['corrected', 'printed'])
@pytest.mark.parametrize(('cosine', 'refused'), [
    (-0.0501, False), (-0.0499, True), (0.0499, True)])
def test_independent_chains_refuse_where_a_rod_is_upright(elbow, equations, cosine, refused):
    # Chain 1 has cos u = (R - r - x) / l.
    model = states.paper_model({'geometry.elbow': elbow, **INDEPENDENT, 'equations': equations})
    x = 0.15 - 0.10 - 0.30 * cosine
    home = states.home_position(elbow)
    pose = PlatformMotion.at_rest([home, home + x * np.eye(3)[0]])
    if not refused:
        assert np.all(np.isfinite(model.drive_forces(pose).total))
        return
    with pytest.raises(SingularityError, match=r'cos u. of chain 1') as caught:
        model.drive_forces(pose)
    assert caught.value.sample == 1
    assert '0.05' in str(caught.value)
    whole = states.paper_model({'geometry.elbow': elbow, 'equations': equations})
    assert np.all(np.isfinite(whole.drive_forces(pose).total))


# Effects with memory -------------------------------------------------------------------------



@pytest.fixture
def remembering():
    """Return a model with hysteresis, and a motion with reversals."""
    model = with_effects(states.paper_model(states.OPEN_LIMITS), {'hysteresis': {
        f'{drive}.{key}': value for drive in ('slide_1', 'lift_2')
        for key, value in (('force', 0.8), ('distance', 0.01))}})
    return model, states.smooth_motion(np.linspace(0, 4, 800))


def test_a_copied_state_does_not_advance_the_original(remembering):
    model, motion = remembering
    state = model.initial_state()
    model.drive_forces(motion[:300], state=state)
    ahead = model.drive_forces(motion[300:500], state=state.copy()).total
    model.drive_forces(motion[600:], state=state.copy())
    assert_array_equal(model.drive_forces(motion[300:500], state=state).total, ahead)


def test_state_of_another_model_is_refused(remembering):
    model, motion = remembering
    with pytest.raises(PprsError, match='hysteresis'):
        model.drive_forces(motion, state=states.paper_model(states.OPEN_LIMITS).initial_state())


@pytest.mark.parametrize(('file', 'motion', 'rule'), [
    ('config/paper.yaml', JointMotion(*np.zeros((3, 4, 2))), r'must be \(N, 6\)'),
    ('config/paper.yaml', None, 'must be a JointMotion or a PlatformMotion for'),
    ('config/single_axis.yaml', HelicalPath().motion(np.arange(4.0)), 'must be a JointMotion for'),
    ('config/single_axis.yaml', JointMotion(*np.zeros((3, 4, 2))), r'must be \(N, 1\)'),
    ('config/delta.yaml', JointMotion(*np.zeros((3, 4, 2))), r'must be \(N, 3\)')])
def test_a_motion_of_another_machine_is_refused_in_a_sentence(file, motion, rule):
    with pytest.raises(MotionError, match=rule):
        DriveModel.load(file).drive_forces(motion)
