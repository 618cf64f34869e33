# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`pprs init`: what it writes reads the recording as it was, whatever program wrote that.

Truth are the arrays that were written; nothing is told to the command but the files' names.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
import pytest
from documents import checked
from made_up_recordings import DYNAMIC, STORE, header, states_of, write_plain_bag
from scipy.io import savemat

from pprs_dynamics import ModelError, PprsError, UnreadableFileError
from pprs_dynamics.app.api.first_model import FirstModelError, first_model
from pprs_dynamics.app.commands.pprs import main
from pprs_dynamics.inference.readings.columns import GuessError
from pprs_dynamics.measurement.files.recording import Recording, read_recording
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.model.drive_model import DriveModel

JOINTS = ('shoulder_pan', 'shoulder_lift', 'elbow')
N, RATE = 800, 100.0
EPOCH = 1_700_000_000
TIME = np.arange(N) / RATE
WAVES = np.array([1.0, 1.3, 1.7])
Q = 0.9 * np.sin(TIME[:, None] * WAVES) + [0.3, -0.4, 0.1]
DQ = 0.9 * np.cos(TIME[:, None] * WAVES) * WAVES
DDQ = -0.9 * np.sin(TIME[:, None] * WAVES) * WAVES**2


def urdf(joints: tuple[str, ...] = JOINTS, before: str = '', more: str = '') -> str:
    """Return an arm of three joints with a camera and a flange beyond the last."""
    links = [f'{before}base', *(f'{before}link_{k}' for k in range(1, 4))]
    body = ('<inertial><mass value="2"/><origin xyz="0.1 0 0.1"/><inertia ixx="0.02" iyy="0.02" '
            'izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>')
    text = ''.join(f'<link name="{link}">{body}</link>' for link in links)
    text += ''.join(
        f'<joint name="{before}{joint}" type="revolute"><parent link="{links[k]}"/>'
        f'<child link="{links[k + 1]}"/><origin xyz="0.2 0 0.1"/><axis xyz="0 {k > 0:d} {k == 0:d}"'
        '/><limit lower="-3" upper="3" velocity="4" effort="100"/></joint>'
        for k, joint in enumerate(joints))
    for name in ('camera', 'flange'):
        text += (f'<link name="{before}{name}"/><joint name="{before}{name}_on" type="fixed">'
                 f'<parent link="{links[-1]}"/><child link="{before}{name}"/></joint>')
    return text + more


def efforts() -> np.ndarray:
    """Return what moves the arm, with friction: columns without names are read by that."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / 'arm.urdf'
        path.write_text(f'<robot name="arm">{urdf()}</robot>')
        forces = first_model(path, output=path.with_suffix('.yaml')).model.drive_forces(
            JointMotion(Q, DQ, DDQ, TIME)).total
    return forces + 0.4 * np.tanh(DQ / 0.02) + np.random.default_rng(1).normal(0, 0.05, (N, 3))


TAU = efforts()


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    path = tmp_path / 'arm.urdf'
    path.write_text(f'<robot name="arm">{urdf()}</robot>')
    return path


def read(robot: Path, *recordings: Path, **more: Any) -> Recording:
    """Write the model file that the command writes, and read the recording with it."""
    first = first_model(robot, recordings, robot.with_name('robot.yaml'), **more)
    first.path.write_text(first.text)
    model = DriveModel.load(first.path)
    assert model.drives == JOINTS
    assert first.has_efforts
    return read_recording(first.recordings[0], model.recorded)


def assert_read(recording: Recording, velocity: bool = True, tolerance: float = 1e-9) -> None:
    np.testing.assert_allclose(recording.time - recording.time[0], TIME, atol=1e-6)
    np.testing.assert_allclose(recording.position, Q, atol=tolerance)
    np.testing.assert_allclose(recording.effort, TAU, atol=tolerance)
    if velocity:
        assert recording.velocity is not None
        np.testing.assert_allclose(recording.velocity, DQ, atol=tolerance)


# ------------------------------------------------------------------------------------ tables


def columns(pattern: str, values: np.ndarray, start: int = 1) -> dict[str, np.ndarray]:
    return {pattern.format(joint=joint, k=k + start): values[:, k]
            for k, joint in enumerate(JOINTS)}


def tables() -> dict[str, dict[str, np.ndarray]]:
    """Return columns as programs name them."""
    before = '/joint_states/{joint}/'
    return {
        'plotjuggler': {
            '__time': EPOCH + TIME, '/battery/voltage': np.ones(N),
            **columns(before + 'position', Q), **columns(before + 'velocity', DQ),
            **columns(before + 'effort', TAU)},
        'numbered': {
            'timestamp_ms': 1e3 * TIME, **columns('q{k}', Q), **columns('dq{k}', DQ),
            **columns('ddq{k}', Q), **columns('tau{k}', TAU), **columns('tau_cmd{k}', 0 * TAU + 1),
            **columns('q_des{k}', 0 * Q)},
        'named': {
            'stamp': (EPOCH + TIME) * 1e3, **columns('{joint}_pos_deg', np.rad2deg(Q)),
            **columns('{joint}_vel', DQ), **columns('{joint}_torque', TAU),
            **columns('{joint}_temperature', Q)},
        'commands with unknown names': {
            't': TIME, **columns('q_a_{k}', np.roll(Q, -3, axis=0)), **columns('q_b_{k}', Q),
            **columns('tau_{k}', TAU)}}


def of_a_program(name: str) -> Callable[[Path], list[Path]]:
    def write(folder: Path) -> list[Path]:
        pd.DataFrame(tables()[name]).to_csv(folder / 'run.csv', index=False, sep=';')
        return [folder / 'run.csv']
    return write


def with_what_was_asked_for(folder: Path) -> list[Path]:
    # Of an arm's log: measured, then accelerations, then what was asked for; rows end in commas.
    rows = np.column_stack([1017.78 + TIME, Q, DQ, DDQ, Q + 1e-4, TAU, DQ, 0.9 * TAU])
    (folder / 'log.csv').write_text(''.join(
        ','.join(map(repr, row)) + ',\n' for row in rows.tolist()))
    return [folder / 'log.csv']


def structure(folder: Path) -> list[Path]:
    savemat(folder / 'run.mat', {'rec': {
        'time': TIME, 'act_pos_mot_deg': np.rad2deg(Q), 'act_vel_mot_deg': np.rad2deg(DQ),
        'act_trq': TAU, 'temperature': Q[:99]}})
    return [folder / 'run.mat']


def of_a_european_spreadsheet(folder: Path) -> list[Path]:
    rows = np.column_stack([TIME, np.rad2deg(Q), TAU])
    lines = ['Zeit;Winkel 1;Winkel 2;Winkel 3;Moment 1;Moment 2;Moment 3', 's;°;°;°;Nm;Nm;Nm',
             *(';'.join(f'{cell:.17g}'.replace('.', ',') for cell in row) for row in rows)]
    (folder / 'run.csv').write_bytes('\r\n'.join(lines).encode('cp1252'))
    return [folder / 'run.csv']


def joined_logs(folder: Path) -> list[Path]:
    lines = pd.DataFrame({'micros': np.round(1e6 * TIME), **columns('enc_{joint}', Q),
                          **columns('trq_{joint}', TAU)}).to_csv(index=False).splitlines()
    (folder / 'run.csv').write_text('\n'.join([*lines[:300], lines[0], *lines[300:]]))
    return [folder / 'run.csv']


def one_file_each(folder: Path) -> list[Path]:
    made = []
    for name, values in (('q', Q), ('dq', DQ), ('tau', TAU), ('t', TIME[:, None])):
        np.savetxt(folder / f'{name}.csv', values, delimiter=',', fmt='%.17g')
        made.append(folder / f'{name}.csv')
    return made


def lerobot(folder: Path) -> list[Path]:
    (folder / 'set' / 'meta').mkdir(parents=True)
    (folder / 'set' / 'data' / 'chunk-000').mkdir(parents=True)
    names = {'motors': [f'{joint}.pos' for joint in JOINTS] + ['gripper.pos']}
    lists = {f'observation.{name}': list(np.column_stack([values, np.zeros(N)]))
             for name, values in (('state', Q), ('velocity', DQ), ('effort', TAU))}
    (folder / 'set' / 'meta' / 'info.json').write_text(json.dumps({'features': {
        name: {'dtype': 'float32', 'names': names}
        for name in (*lists, 'action')}}))
    pd.DataFrame({**lists, 'action': lists['observation.state'], 'timestamp': TIME,
                  'frame_index': np.arange(N), 'episode_index': np.zeros(N, int),
                  }).to_parquet(folder / 'set' / 'data' / 'chunk-000' / 'episode_000000.parquet')
    return [folder / 'set']


# -------------------------------------------------------------------------------------- bags


def bag(folder: Path, names: tuple[str, ...] = JOINTS) -> list[Path]:
    order = np.argsort(names)  # as joint_state_broadcaster has them
    return [write_plain_bag(folder / 'bag', {'/joint_states': states_of(
        {'time': EPOCH + TIME, 'position': Q[:, order], 'velocity': DQ[:, order],
         'effort': TAU[:, order]}, tuple(names[j] for j in order))})]


def currents(folder: Path) -> list[Path]:
    value = STORE.types['control_msgs/msg/InterfaceValue']
    return [write_plain_bag(folder / 'bag', {'/dynamic_joint_states': [
        STORE.types[DYNAMIC](header(round((EPOCH + TIME[k]) * 1e9)), list(JOINTS), [
            value(['current', 'position', 'velocity'], np.array([TAU[k, j], Q[k, j], DQ[k, j]]))
            for j in range(3)]) for k in range(N)]})]


@pytest.mark.parametrize('write', [
    *map(of_a_program, tables()), with_what_was_asked_for, structure, of_a_european_spreadsheet,
    joined_logs, one_file_each, lerobot, bag, currents])
def test_what_init_writes_reads_the_recording_as_it_was(
    write: Callable[[Path], list[Path]], robot: Path, tmp_path: Path,
) -> None:
    recording = read(robot, *write(tmp_path))
    assert_read(recording, recording.velocity is not None)


def test_the_tool_is_the_flange_and_the_base_what_all_hangs_on(robot: Path) -> None:
    values = first_model(robot).model.values
    assert (values['robot.base'], values['robot.tool']) == ('base', 'flange')
    assert values['robot.drives'] == JOINTS
    values = first_model(robot, tool='camera', drives=('elbow',)).model.values
    assert (values['robot.tool'], values['robot.drives']) == ('camera', ('elbow',))
    with pytest.raises(ModelError, match=r'--tool: unknown link flnge .*flange'):
        first_model(robot, tool='flnge')


def test_what_is_commented_out_of_a_description_is_no_xacro(robot: Path) -> None:
    text = robot.read_text()
    robot.write_text(text.replace('</robot>', '<!-- <box size="${size} 1 1"/>\n<xacro:x/> -->'
                                  '</robot>'))
    assert first_model(robot).model.drives == JOINTS
    robot.write_text(text.replace('xyz="0.2 0 0.1"', 'xyz="${a} 0 0.1"'))
    with pytest.raises(PprsError, match='xacro'):
        first_model(robot)


def test_a_joint_that_was_not_recorded_is_given_no_column_of_another(tmp_path: Path) -> None:
    # A lift that was not recorded, then arm_1, arm_2, arm_3 that were, all but in order.
    joints = ('lift', 'arm_1_joint', 'arm_2_joint', 'arm_3_joint')
    text = ''.join(f'<link name="l{k}"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" '
                   'izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>' for k in range(5))
    text += ''.join(f'<joint name="{name}" type="revolute"><parent link="l{k}"/><child '
                    f'link="l{k + 1}"/><axis xyz="0 1 0"/></joint>'
                    for k, name in enumerate(joints))
    (tmp_path / 'x.urdf').write_text(f'<robot name="x">{text}</robot>')
    for name, values in (('position', Q), ('effort', TAU)):
        named = {f'- arm_{k + 1}_joint_{name}': values[:, k] for k in (2, 0, 1)}
        for run in ('run_1', 'run_2'):
            pd.DataFrame({'t': TIME, **named}).to_csv(tmp_path / f'{run}_{name}.csv', index=False)
    first = first_model(tmp_path / 'x.urdf', sorted(tmp_path.glob('run_1*')), tmp_path / 'r.yaml')
    assert first.model.drives == joints[1:]
    # The second run in the folder is read, too.
    assert_read(read_recording(tmp_path / 'run_2_effort.csv', first.model.recorded), velocity=False)


def test_what_cannot_be_told_is_refused_with_what_to_write(robot: Path, tmp_path: Path) -> None:
    np.savetxt(tmp_path / 'a.csv', np.column_stack([TIME, Q[:, :2]]), delimiter=',')
    with pytest.raises(GuessError, match='no blocks of 3 joints'):
        first_model(robot, [tmp_path / 'a.csv'])
    np.savetxt(tmp_path / 'b.csv', np.column_stack([Q, TAU]), delimiter=',', fmt='%.17g')
    with pytest.raises(FirstModelError, match='--rate HZ'):
        first_model(robot, [tmp_path / 'b.csv'])
    assert_read(read(robot, tmp_path / 'b.csv', rate=RATE), velocity=False)
    pd.DataFrame({'time': TIME, **columns('lorem{k}', Q), 'ipsum': TIME}).to_csv(tmp_path / 'c.csv')
    with pytest.raises(GuessError, match='lorem1'):
        first_model(robot, [tmp_path / 'c.csv'])
    with pytest.raises(FirstModelError, match='joint_map'):
        first_model(robot, bag(tmp_path, ('uno', 'due', 'tre')))
    np.savetxt(tmp_path / 'd.txt', Q.ravel())
    with pytest.raises(GuessError, match='`paste - - - < FILE > NEW` joins 3 lines'):
        first_model(robot, [tmp_path / 'd.txt'])
    for name, values in (('q', Q), ('tau', TAU)):
        np.savetxt(tmp_path / f'{name}.txt', values[:, :2])
    with pytest.raises(GuessError, match='give --drives shoulder_pan,shoulder_lift'):
        first_model(robot, [tmp_path / 'q.txt', tmp_path / 'tau.txt'])
    (tmp_path / 'x.urdf').write_text('<robot name="x"><link name="a"/></robot>')
    with pytest.raises(FirstModelError, match='no joint of it moves'):
        first_model(tmp_path / 'x.urdf')
    for text in ('words', '<sdf/>'):
        (tmp_path / 'x.urdf').write_text(text)
        with pytest.raises(UnreadableFileError):
            first_model(tmp_path / 'x.urdf')


@pytest.mark.parametrize(('joint', 'recorded', 'asked'), [('j', 'leg', True),
                                                          ('joint_', 'j', False)])
def test_joints_that_only_numbers_match_are_a_question_but_for_short_names(
    tmp_path: Path, joint: str, recorded: str, asked: bool,
) -> None:
    (tmp_path / 'arm.urdf').write_text(
        f'<robot name="arm">{urdf(tuple(f"{joint}{k}" for k in (1, 2, 3)))}</robot>')
    first = first_model(tmp_path / 'arm.urdf', bag(
        tmp_path, tuple(f'{recorded}{k}' for k in (1, 2, 3))), tmp_path / 'robot.yaml')
    assert ('matched by their numbers alone' in ' '.join(first.questions)) == asked
    assert (f'joint_map: {{{joint}1: {recorded}1' in ' '.join(first.questions)) == asked


def test_a_recording_in_place_of_the_description_is_named_as_such(tmp_path: Path) -> None:
    (tmp_path / 'run.csv').write_text('time,a/position\n0,0\n')
    with pytest.raises(UnreadableFileError, match='description of the robot first'):
        first_model(tmp_path / 'run.csv')


MJCF = '''<mujoco><worldbody><body name="crank"><joint name="motor" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 0.1" size="0.01"/>
<body name="coupler" pos="0 0 0.1"><joint name="knee" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.01"/></body></body>
<body name="rocker" pos="0.3 0 0"><joint name="hip" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 0.1" size="0.01"/></body></worldbody>
<equality><connect body1="coupler" body2="rocker" anchor="0.3 0 0"/></equality>
<actuator><motor joint="motor"/></actuator></mujoco>'''


def test_loops_and_actuators_of_an_mjcf_are_taken(tmp_path: Path) -> None:
    (tmp_path / 'four_bar.xml').write_text(MJCF)
    model = first_model(tmp_path / 'four_bar.xml', output=tmp_path / 'robot.yaml').model
    assert model.drives == ('motor',)
    (tmp_path / 'four_bar.xml').write_text(MJCF.replace('<motor joint="motor"/>', ''))
    with pytest.raises(FirstModelError, match='--drives'):
        first_model(tmp_path / 'four_bar.xml')
    pd.DataFrame({'time': TIME, 'motor_pos': Q[:, 0], 'motor_torque': TAU[:, 0]}).to_csv(
        tmp_path / 'run.csv', index=False)
    first = first_model(tmp_path / 'four_bar.xml', [tmp_path / 'run.csv'])
    assert first.model.drives == ('motor',)
    assert first.has_efforts


def test_the_command_writes_says_what_info_says_and_what_comes_next(
    robot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    described = first_model(robot, (), tmp_path / 'described.yaml')
    described.path.write_text(described.text)
    ddq = -(Q - [0.3, -0.4, 0.1]) * WAVES**2
    efforts = DriveModel.load(described.path).drive_forces(JointMotion(Q, DQ, ddq)).total
    np.savetxt('run.csv', np.column_stack([TIME, Q, DQ, efforts + 2 * np.tanh(20 * DQ)]),
               delimiter=',', fmt='%.17g')
    assert main(['init', 'arm.urdf', 'run.csv', '--json', 'x.json', '--picture', 'x.png']) == 0
    assert (tmp_path / 'x.png').read_bytes().startswith(b'\x89PNG')
    said = ' '.join(capsys.readouterr().out.split())
    assert '800 of 800 samples' in said
    assert 'pprs fit run.csv --model robot.yaml --output base.yaml' in said
    assert checked((tmp_path / 'x.json').read_text(), 'init')['drives'] == list(JOINTS)
    before = (tmp_path / 'robot.yaml').read_text()
    assert 'guessed: no header: positions are columns 2, 3, 4; ' in before
    assert main(['info', 'run.csv', '--model', 'robot.yaml']) == 0
    capsys.readouterr()
    (tmp_path / 'robot.yaml').unlink()
    assert main(['init', 'arm.urdf']) == 0
    assert 'pprs info RECORDING' in ' '.join(capsys.readouterr().out.split())
