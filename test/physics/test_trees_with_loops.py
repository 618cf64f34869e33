# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Robots with loops: efforts against MuJoCo, friction against the 3-PPRS, power, refusals."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import robots_with_loops as robots
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from oracles.mujoco_loops import MujocoLoops
from random_states import random_motion, without_compiler
from scipy.spatial.transform import Rotation

from pprs_dynamics import DriveModel, JointMotion, PlatformMotion
from pprs_dynamics.errors import PprsError, SingularityError, WorkspaceError
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.effects.laws.drive_friction import DriveFriction
from pprs_dynamics.physics.effects.laws.joint_friction import (
    JointFrictionEffect,
    ModelJointFriction,
)
from pprs_dynamics.physics.mechanism.alike import proportional_joints
from pprs_dynamics.physics.mechanism.mechanism import Mechanism
from pprs_dynamics.physics.mechanism.tree_equations import solve

SAMPLES = 30
ROBOTS = {'hexapod': robots.hexapod, 'delta': robots.delta, 'five_bar': robots.five_bar}
SIZES = {'hexapod': (0.03, 0.4, 4.0), 'delta': (0.3, 3.0, 30.0), 'five_bar': (0.3, 3.0, 30.0)}


def states(model: DriveModel, size: tuple[float, float, float], samples: int = SAMPLES,
           seed: int = 0) -> JointMotion:
    """Return independent random states about home."""
    home = model.robot.structure.home[model.robot.structure.tables.drives]
    q, v, a = np.random.default_rng(seed).uniform(-1, 1, size=(3, samples, len(home)))
    return JointMotion(home + size[0] * q, size[1] * v, size[2] * a)


@pytest.mark.parametrize('name', ROBOTS)
def test_efforts_are_those_of_mujoco(tmp_path: Path, name: str) -> None:
    text = ROBOTS[name]()
    model = DriveModel.load(text.write(tmp_path))
    motion = states(model, SIZES[name])
    found = model.drive_forces(motion).total
    moved = model.mechanism(motion).links
    engine = MujocoLoops(text)
    expected = np.empty_like(found)
    for k in range(len(motion)):
        expected[k], opened = engine.efforts(*engine.state(moved, k))
        assert opened < 1e-10
    assert np.max(np.abs(found - expected)) < 1e-9 * np.max(np.abs(expected))


@pytest.mark.parametrize('name', ['hexapod', 'five_bar'])
def test_python_without_a_compiler_is_the_same(tmp_path: Path, name: str) -> None:
    structure = DriveModel.load(ROBOTS[name]().write(tmp_path)).robot.structure
    joints = {hinge: {'viscous': 0.1, 'coulomb': 0.1, 'radius': 0.01}
              for hinge in structure.friction_rows}
    model = DriveModel.load(ROBOTS[name]().write(tmp_path, {'joints': joints}))
    motion = states(model, SIZES[name])[:8]
    compiled = model.drive_forces(motion).parts
    plain = without_compiler(lambda: model.drive_forces(motion).parts)
    assert set(plain) == set(compiled)
    for part, values in compiled.items():
        assert plain[part] == pytest.approx(values, abs=1e-9), part


WANDER = {'hexapod': 0.05, 'delta': 0.6, 'five_bar': 0.9}
STEPS = 60


@settings(max_examples=5, deadline=None,
          suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2 ** 32 - 1))
@pytest.mark.parametrize('name', ['delta', 'five_bar'])
def test_efforts_do_not_depend_on_where_the_robot_was(tmp_path: Path, name: str, seed: int) -> None:
    """Poses anywhere and a little apart: with a state as without, wherever there is an answer."""
    random = np.random.default_rng(seed)
    model = DriveModel.load(ROBOTS[name]().write(tmp_path))
    home = model.robot.structure.home[model.robot.structure.tables.drives]
    state, q, answered = model.initial_state(), home, 0
    for _ in range(STEPS):
        jump = random.uniform() < 0.3
        q = (home + WANDER[name] * random.uniform(-1, 1, len(home)) if jump
             else q + 0.03 * WANDER[name] * random.normal(size=len(home)))
        v, a = random.normal(size=(2, 1, len(home)))
        motion = JointMotion(q[None], v, a)
        try:
            cold = model.mechanism(motion)
            expected, closed = model.drive_forces(motion).total, cold.closed
        except PprsError:
            q = home
            continue
        answered += 1
        found = model.drive_forces(motion, state).total
        assert state.closed[model.robot.structure] == pytest.approx(closed[0], abs=1e-9)
        assert found == pytest.approx(expected, abs=1e-9 * np.max(np.abs(expected)))
    assert answered > STEPS / 4


def three_pprs() -> tuple[DriveModel, DriveModel]:
    """Return the paper's robot in closed form, and by the equations of its tree with loops.

    There friction of the drives is among that of the joints, whose loads it follows.
    """
    paper = DriveModel.from_parameters({
        **DriveModel.load().values, 'masses.inertia': (0.005, 0.006, 0.01, 0.0, 0.0, 0.0)})
    robot, friction = paper.robot, paper.friction
    blocks = {drive: {'viscous': c, 'coulomb': mu} for drive, c, mu in zip(
        paper.drives, friction.viscous, friction.coefficient, strict=True)}
    of_joints = next(e.blocks for e in paper.effects if isinstance(e, ModelJointFriction))
    for place in robot.passive_joints:
        blocks |= dict.fromkeys(place.joints, of_joints[place.name])
    tree = Mechanism(robot.structure, robot.bodies, robot.inertial, robot.armature, robot.gravity,
                     {name: block.get('radius', 0.0) for name, block in blocks.items()})
    return paper, replace(paper, robot=tree, effects=(
        DriveFriction(0.0, 0.0), ModelJointFriction(blocks)))


def test_the_3_pprs_with_loops_is_its_closed_form_in_1000_random_states() -> None:
    """Rigid body, friction of the drives with the load of their guides, and of passive joints."""
    paper, model = three_pprs()
    forces = paper.drive_forces(random_motion(np.random.default_rng(8), 1000))
    s = forces.mechanism
    found = model.drive_forces(JointMotion(s.position, s.velocity, s.acceleration)).parts
    assert found['rigid_body'] == pytest.approx(forces.parts['rigid_body'], abs=1e-10)
    active, passive = (forces.parts[f'{kind}_friction'] for kind in ('active', 'passive'))
    assert found['passive_friction'] == pytest.approx(active + passive, abs=1e-10)
    assert min(np.abs(part).max() for part in (active, passive)) > 1


HINGES, BALLS = ([f'{kind}_{n}' for n in (1, 2, 3)] for kind in ('hinge', 'ball'))
# Effects of the closed form, and the same of the tree with loops.
OF_BOTH = {
    'base_tilt': ({'x': 0.05, 'y': -0.03},) * 2,
    'joint_friction': (
        {'revolute.viscous': 0.03, 'revolute.torque': 0.02, 'revolute.coulomb': 0.3,
         'spherical.viscous': 0.01, 'spherical.torque': 0.04, 'spherical.coulomb': 0.2},
        {**{f'{hinge}.{key}': value for hinge in HINGES for key, value in (
            ('viscous', 0.03), ('torque', 0.02), ('coulomb', 0.3))},
         **{f'{ball}.{key}': value for ball in BALLS for key, value in (
             ('viscous', 0.01), ('torque', 0.04), ('coulomb', 0.2))}}),
    'joint_spring': (
        {'revolute.stiffness': 0.8, 'revolute.position': 1.3},
        {f'{hinge}.{key}': value for hinge in HINGES for key, value in (
            ('stiffness', 0.8), ('position', 1.3))}),
    'payload_mass': ({'mass': 0.4},) * 2,
    'payload_offset': ({'x': 0.02, 'y': -0.03, 'z': 0.05},) * 2,
    'platform_inertia': ({'xx': 0.004, 'yy': 0.005, 'zz': 0.006, 'xy': 0.001},) * 2,
    'external_wrench': ({'force_x': 15.0, 'force_y': -25.0, 'force_z': 50.0, 'moment_x': 0.4,
                         'moment_y': -0.9, 'moment_z': 0.6},) * 2,
    'tool_drag': ({'coefficient': 7.0, 'rotational': 0.05},) * 2}


@pytest.mark.parametrize('name', OF_BOTH)
def test_an_effect_is_the_same_in_both_kernels(name: str) -> None:
    """Its own force, and what loads that it adds bring of friction in joints and guides."""
    motion, found = random_motion(np.random.default_rng(4), 100), []
    for model, values in zip(three_pprs(), OF_BOTH[name], strict=True):
        effect = CATALOGUE[name].bound(model.robot).from_file(values)
        changed = replace(model, effects=(*model.effects, effect))
        if found:
            motion = JointMotion(*found[0].drive_motion)
        found.append(changed.drive_forces(motion))
    closed, tree = (forces.parts for forces in found)
    assert np.abs(closed[name]).max() > 0.05
    assert tree[name] == pytest.approx(closed[name], abs=1e-9)
    assert tree['passive_friction'] == pytest.approx(
        closed['active_friction'] + closed['passive_friction'], abs=1e-9)


def four_bar(coupler: float) -> robots.RobotText:
    """Return a four-bar with light rods, in line at home where the coupler is 0.4 m long."""
    text = robots.RobotText('four_bar', tool='crank')
    text.link('base')
    text.link('crank', 1.0, (0.05, 0, 0), (0.001, 0.001, 0.001))
    text.link('rod')
    text.link('rocker')
    text.joint('turn', 'revolute', 'base', 'crank', axis=(0, 0, 1))
    text.joint('knee', 'continuous', 'crank', 'rod', (0.1, 0, 0), axis=(0, 0, 1))
    text.joint('foot', 'continuous', 'base', 'rocker', (0.3, 0, 0), axis=(0, 0, 1))
    text.drives = ['turn']
    text.home = {'knee': 0.7, 'foot': 1.4} if coupler < 0.4 else {}
    text.loops['tip'] = {'type': 'revolute', 'a': {'link': 'rod', 'xyz': [coupler, 0.0, 0.0]},
                         'b': {'link': 'rocker', 'xyz': [0.2, 0.0, 0.0]}}
    return text


def test_a_loop_that_opens_in_motion_is_refused_although_it_closed_at_home(tmp_path: Path) -> None:
    """With all links in line a joint seems free, a row seems implied; neither is, elsewhere."""
    model = DriveModel.load(four_bar(0.4).write(tmp_path))
    turn = np.linspace(0.0, 0.5, 50)[:, None]
    rest = np.zeros_like(turn)
    with pytest.raises(WorkspaceError, match=r'tip is open by .* mm.*robot\.home') as error:
        model.drive_forces(JointMotion(turn, rest, rest))
    assert 0 < error.value.sample < 50
    # A coupler that leaves the links out of line closes all the way, redundant rows and all.
    model = DriveModel.load(four_bar(0.3).write(tmp_path))
    moved = model.mechanism(JointMotion(turn, rest, rest)).links
    ends = [moved.frame_of(link) for link in ('rod', 'rocker')]
    tips = [end.p + end.R @ np.array([x, 0, 0]) for end, x in zip(ends, (0.3, 0.2), strict=True)]
    assert tips[0] == pytest.approx(tips[1], abs=1e-9)


def broken(name: str, change: Callable[[robots.RobotText], None], tmp_path: Path) -> str:
    """Return what is said of a robot that was changed."""
    text = ROBOTS[name]()
    change(text)
    with pytest.raises(PprsError) as error:
        DriveModel.load(text.write(tmp_path))
    assert '\n' not in str(error.value)
    return str(error.value)


def test_a_robot_that_cannot_be_is_one_sentence_with_numbers(tmp_path: Path) -> None:
    def too_few(text: robots.RobotText) -> None:
        text.drives = text.drives[:-1]

    def too_many(text: robots.RobotText) -> None:
        text.drives = [*text.drives, 'left_elbow']
        text.parts = [part.replace('name="left_elbow" type="continuous"',
                                   'name="left_elbow" type="revolute"') for part in text.parts]

    def far(text: robots.RobotText) -> None:
        text.loops['tip']['b']['xyz'] = [5.0, 0.0, 0.0]

    def unknown(text: robots.RobotText) -> None:
        text.loops['tip']['b']['link'] = 'right_rot'

    def another_kind(text: robots.RobotText) -> None:
        text.loops['tip']['type'] = 'screw'

    def no_mass(text: robots.RobotText) -> None:
        text.parts = [re.sub('(mass value|i[xyz]{2})="[^"]*"', r'\1="0"', part)
                      for part in text.parts]

    said = broken('hexapod', too_few, tmp_path)
    assert '6 degrees of freedom, 5 drives' in said
    assert 'leg_6' in said
    assert '2 degrees of freedom at home to 3 drives' in broken('five_bar', too_many, tmp_path)
    assert 'tip' in (said := broken('five_bar', far, tmp_path))
    assert 'mm' in said
    assert 'robot.loops.tip.b.link' in broken('five_bar', unknown, tmp_path)
    assert 'spherical, revolute' in broken('five_bar', another_kind, tmp_path)
    assert 'mass' in broken('five_bar', no_mass, tmp_path)


def test_a_rod_that_spins_between_two_balls_is_held(tmp_path: Path) -> None:
    text = robots.delta()
    # A third hinge along the rod: its upper end becomes a ball.
    for k, part in enumerate(text.parts):
        if 'name="swing_1l"' in part:
            text.parts[k] = part.replace('child link="rod_1l"', 'child link="yoke_1l"')
    text.link('yoke_1l')
    text.joint('spin_1l', 'continuous', 'yoke_1l', 'rod_1l')
    model = DriveModel.load(text.write(tmp_path))
    assert model.robot.structure.held == ('spin_1l',)
    assert model.robot.structure.mobility.freedoms == 4
    plain = DriveModel.load(robots.delta().write(tmp_path))
    motion = states(plain, SIZES['delta'])
    assert model.drive_forces(motion).total == pytest.approx(
        plain.drive_forces(motion).total, abs=1e-6)


def test_out_of_reach_and_singular_are_told_at_once(tmp_path: Path) -> None:
    legs = DriveModel.load(robots.hexapod().write(tmp_path))
    home = legs.robot.structure.home[legs.robot.structure.tables.drives]
    rest = np.zeros((2, 6))
    with pytest.raises(WorkspaceError) as error:
        legs.drive_forces(JointMotion(home + np.outer([0, 1.2], np.eye(6)[0]), rest, rest))
    assert error.value.sample == 1
    model = DriveModel.load(robots.five_bar().write(tmp_path))
    home = model.robot.structure.home[model.robot.structure.tables.drives]
    # Towards the pose at which both rods are in line.
    q = home + np.linspace(0, 1, 200)[:, None] * (np.array([3.1, 0.04]) - home)
    with pytest.raises((SingularityError, WorkspaceError)) as error:
        model.drive_forces(JointMotion(q, np.zeros_like(q), np.zeros_like(q)))
    assert 0 < error.value.sample < 200


def test_a_tools_poses_give_the_legs_that_geometry_gives(tmp_path: Path) -> None:
    """Of a 6-UPS leg_i = |x_i|, x_i from its universal joint to its ball."""
    model = DriveModel.load(robots.hexapod().write(tmp_path))
    s, rng, samples = model.robot.structure, np.random.default_rng(2), 20
    home = model.robot.at(*(np.tile(values, (1, 1)) for values in (
        s.home[s.tables.drives], np.zeros(6), np.zeros(6))))
    P, R = home.frame_of('platform').p[0], home.frame_of('platform').R[0]
    turned = Rotation.from_matrix(R) * Rotation.from_rotvec(rng.uniform(-0.2, 0.2, (samples, 3)))
    v, w, a, e = rng.normal(size=(4, samples, 3))
    motion = PlatformMotion(P + rng.uniform(-0.04, 0.04, (samples, 3)), turned.as_quat(), v, w, a,
                            e)
    moved = model.mechanism(motion)
    for d, name in enumerate(s.drives):
        n = name.removeprefix('leg_')
        foot = home.motion.p[0, s.rows[f'hinge_{n}']]
        ball = next(loop for loop in s.loops if loop.name == f'ball_{n}').frame_b.p
        arm = turned.apply(ball)
        x = motion.position + arm - foot
        x_dot = v + np.cross(w, arm)
        x_ddot = a + np.cross(e, arm) + np.cross(w, np.cross(w, arm))
        length = np.linalg.norm(x, axis=1)
        rate = np.sum(x * x_dot, axis=1) / length
        start = np.linalg.norm(P + R @ ball - foot)
        assert moved.position[:, d] - s.home[s.tables.drives[d]] == pytest.approx(
            length - start, abs=1e-12)
        assert moved.velocity[:, d] == pytest.approx(rate, abs=1e-11)
        assert moved.acceleration[:, d] == pytest.approx(
            (np.sum(x_dot ** 2 + x * x_ddot, axis=1) - rate ** 2) / length, abs=1e-10)


@pytest.mark.parametrize('samples', [1, 8])
def test_a_pose_past_a_singularity_is_not_answered_with_another_pose_of_the_same_legs(
        tmp_path: Path, samples: int) -> None:
    model = DriveModel.load(robots.hexapod().write(tmp_path))
    home = model.robot.tool_pose.home
    turned = (Rotation.from_matrix(home.R) * Rotation.from_rotvec([0.0, 0.0, 1.7])).as_quat()
    with pytest.raises(SingularityError):
        model.drive_forces(PlatformMotion.at_rest(np.tile(home.p, (samples, 1)),
                                                  np.tile(turned, (samples, 1))))


def test_friction_of_passive_hinges_and_slides_turns_over_in_widths_of_their_own(
    tmp_path: Path,
) -> None:
    """A hinge at 0.02 rad/s and a slide at 2 mm/s, both driven by one crank of 0.1 m."""
    text = robots.RobotText('scotch_yoke', tool='yoke')
    text.link('base')
    text.link('crank', 1.0, (0.05, 0, 0), (0.001, 0.001, 0.001))
    text.link('block', 0.2, (0, 0, 0), (0.001, 0.001, 0.001))
    text.link('yoke', 1.0, (0, 0, 0), (0.01, 0.01, 0.01))
    text.joint('turn', 'revolute', 'base', 'crank', axis=(0, 0, 1))
    text.joint('pin', 'continuous', 'crank', 'block', (0.1, 0, 0), axis=(0, 0, 1))
    text.joint('guide', 'prismatic', 'base', 'yoke', (0.1, 0, 0), axis=(1, 0, 0))
    text.drives = ['turn']
    text.home = {'turn': 0.5}
    text.loop('slot', 'prismatic', 'yoke', (0, 0, 0), 'block', (0, 0, 0),
              rpy_a=(-np.pi / 2, 0, 0), rpy_b=(-np.pi / 2, 0, 0))
    path = text.write(tmp_path, {
        'reversal_rate': 0.02, 'reversal_slide': 0.002,
        'joints': {'pin': {'torque': 3.0}, 'guide': {'torque': 5.0}}})
    model = DriveModel.load(path)
    q, v = np.array([[0.8]]), np.array([[0.02]])
    found = model.drive_forces(JointMotion(q, v, 0 * v)).parts['passive_friction'][0, 0]
    # The block does not turn: the pin turns back as fast as the crank; x = 0.1 cos q.
    slide = -0.1 * np.sin(0.8)
    assert found == pytest.approx(3.0 * np.tanh(0.02 / 0.02) + 5.0 * slide * np.tanh(
        slide * 0.02 / 0.002), abs=1e-9)


# Elimination that passes over zeros, against LAPACK; pivots that vanish included.

SIZE, RIGHT_SIDES = 14, 3


def a_platform_on_legs(random: np.random.Generator) -> np.ndarray:
    """Return a matrix of four legs of 3 rows and 2 joints of their own, a platform, and a pair."""
    pattern = np.zeros((SIZE, SIZE), dtype=bool)
    for leg in range(4):
        pattern[3 * leg:3 * leg + 3, 2 * leg:2 * leg + 2] = True
        pattern[3 * leg:3 * leg + 3, 8:12] = True
    pattern[12:, 12:] = True
    shuffled = pattern[random.permutation(SIZE)][:, random.permutation(SIZE)]
    return random.normal(size=shuffled.shape) * shuffled


@pytest.mark.parametrize('seed', range(3))
def test_it_solves_what_lapack_solves(seed: int) -> None:
    random = np.random.default_rng(seed)
    for k in range(12):
        A = a_platform_on_legs(random)
        if 4 < k < 10:
            A[k, k] = A[0, 0] = 1e-13 * random.normal()
        elif k > 9:
            A[:3, :2] *= 1e-9
        B = random.normal(size=(SIZE, RIGHT_SIDES))
        table = np.hstack((A, B, B))
        determinant = solve(table, SIZE, SIZE + RIGHT_SIDES, SIZE + 2 * RIGHT_SIDES)
        assert determinant == pytest.approx(np.linalg.det(A), rel=1e-8)
        expected = np.linalg.solve(A, B)
        scale = np.linalg.cond(A) * np.abs(expected).max()
        assert np.abs(table[:, -RIGHT_SIDES:] - expected).max() < 1e-13 * scale
        assert np.array_equal(table[:, SIZE:-RIGHT_SIDES], B)


# Links and joints that no motion tells apart.

# A parallelogram in the vertical plane, and a pointer on its coupler: crank and follower turn
# alike about parallel pins, the coupler only translates.
LINK = ('<link name="{0}"><inertial><origin xyz="{1} 0 {2}"/><mass value="{3}"/><inertia '
        'ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>')
JOINT = ('<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><origin '
         'xyz="{3} 0 {4}"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="50" '
         'velocity="5"/></joint>')
PARALLELOGRAM = '\n'.join([
    '<robot name="parallelogram"><link name="base"/>',
    LINK.format('crank', 0.01, 0.1, 1.0), JOINT.format('crank_pin', 'base', 'crank', 0, 0),
    LINK.format('coupler', 0.2, 0, 0.5), JOINT.format('knee', 'crank', 'coupler', 0, 0.3),
    LINK.format('follower', 0, -0.2, 0.7), JOINT.format('ankle', 'coupler', 'follower', 0.4, 0),
    LINK.format('pointer', 0, 0.1, 0.3), JOINT.format('pivot', 'coupler', 'pointer', 0.5, 0),
    '</robot>'])
PARALLELOGRAM_FILE = """
/**:
  ros__parameters:
    robot:
      urdf: parallelogram.urdf
      base: base
      tool: pointer
      drives: [crank_pin, pivot]
      loops:
        rear:
          type: revolute
          a: {link: follower, xyz: [0.0, 0.0, -0.3], rpy: [-1.5707963267949, 0.0, 0.0]}
          b: {link: base, xyz: [0.4, 0.0, 0.0], rpy: [-1.5707963267949, 0.0, 0.0]}
    friction: {viscous: [0.1, 0.1], coulomb: [0.2, 0.2], reversal_velocity: 0.01}
"""


@pytest.fixture(scope='module')
def parallelogram(tmp_path_factory: pytest.TempPathFactory) -> DriveModel:
    """Return its model."""
    folder: Path = tmp_path_factory.mktemp('parallelogram')
    (folder / 'parallelogram.urdf').write_text(PARALLELOGRAM)
    file = folder / 'model.yaml'
    file.write_text(PARALLELOGRAM_FILE)
    return DriveModel.load(file)


def test_links_that_turn_alike_are_grouped_and_no_others(parallelogram: DriveModel) -> None:
    assert parallelogram.robot.alike_links == (('crank', 'follower'), ('coupler',), ('pointer',))


def test_a_body_on_one_of_them_is_a_body_on_the_other(parallelogram: DriveModel) -> None:
    """At the same place relative to the pin that stands, whatever the motion."""
    rng = np.random.default_rng(3)
    q, v, a = rng.uniform(-0.5, 0.5, (3, 30, 2))
    body = np.array([0.4, 0.02, 0.0, 0.1, 0.03, 0.0, 0.03, 0.0, 0.0, 0.001])
    # The follower's origin is 0.3 m above its pin: m, m c and I about the pin, moved there.
    m, c, h = body[0], body[1:4] / body[0], 0.3
    shifted = c - [0, 0, h]
    inertia = np.array([[body[4], body[5], body[7]], [body[5], body[6], body[8]],
                        [body[7], body[8], body[9]]])
    about = inertia - m * ((c @ c) * np.eye(3) - np.outer(c, c))
    there = about + m * ((shifted @ shifted) * np.eye(3) - np.outer(shifted, shifted))
    same = np.array([m, *(m * shifted), there[0, 0], there[0, 1], there[1, 1], there[0, 2],
                     there[1, 2], there[2, 2]])
    robot = parallelogram.robot
    on_crank, on_follower = (robot.with_body(link, what).torques(q, v, a)
                             for link, what in (('crank', body), ('follower', same)))
    assert on_crank == pytest.approx(on_follower, abs=1e-9)
    assert np.abs(on_crank - robot.torques(q, v, a)).max() > 0.1


def test_friction_that_turns_with_a_drive_is_left_to_the_drive(parallelogram: DriveModel) -> None:
    groups = proportional_joints(parallelogram.robot.structure)
    assert groups == (('crank_pin', 'knee', 'ankle'), ('pivot',))
    offered = {names[0] for names in parallelogram.bound(JointFrictionEffect).variants}
    assert not offered & {'knee.viscous', 'ankle.torque'}
    assert 'rear.viscous' in offered  # loops are not looked at
    motion = JointMotion(*np.random.default_rng(1).uniform(-0.5, 0.5, (3, 20, 2)))
    knee = JointFrictionEffect.bound(parallelogram.robot).from_file({'knee.viscous': 0.3})
    forces = knee.force(parallelogram.mechanism(motion))
    assert forces[:, 0] == pytest.approx(0.3 * motion.velocity[:, 0], abs=1e-9)
