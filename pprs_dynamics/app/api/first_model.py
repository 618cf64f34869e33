# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A first model file of a robot, from its description and a recording."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from pprs_dynamics.drives import RecordedDrives
from pprs_dynamics.errors import PprsError, UnknownNameError, UnreadableFileError, meant
from pprs_dynamics.inference.readings.check import find_mistakes, shows_weight
from pprs_dynamics.inference.readings.columns import (
    AmbiguousColumns,
    Guess,
    GuessError,
    guess_columns,
)
from pprs_dynamics.inference.readings.findings import Mistake, OtherReading, lines_of, near
from pprs_dynamics.inference.readings.names import joint_in, words_of
from pprs_dynamics.inference.readings.table import (
    COMMANDS,
    CURRENT,
    EFFORT,
    POSITION,
    USUAL_RATES,
    WORDS,
)
from pprs_dynamics.measurement.files.array_files import is_lerobot
from pprs_dynamics.measurement.files.bag_storage import is_bag_folder, is_storage
from pprs_dynamics.measurement.files.contents import Contents, look_into
from pprs_dynamics.measurement.files.recording import read_recording
from pprs_dynamics.measurement.files.table_files import TIME_COLUMNS, TIME_LIKE
from pprs_dynamics.physics.mechanism.branches import Branch, as_likely, branch_to, root_of
from pprs_dynamics.physics.mechanism.description import FIXED, FLOATING, PRISMATIC, Description
from pprs_dynamics.physics.mechanism.urdf import read_urdf, urdf_content
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.parameter_file import parse_parameters
from pprs_dynamics.physics.model.recorded_names import (
    COMMANDED,
    EFFORT_KIND,
    EFFORT_KINDS,
    EXTERNAL,
    MEASURED,
)
from pprs_dynamics.physics.model.robot_block import coupled
from pprs_dynamics.system.plain_yaml import as_yaml

FILE_TIME = 'time'
NO_TIMES = 'there is no column of times: give --rate HZ, the samples per second'
SETTLED = ('position', 'velocity', 'effort', 'current')


# Mistakes of which a model file may have the line without a question.
SURE_KINDS = {'position_unit', 'effort_unit', 'effort_sign', 'effort_sign_bit', 'time_unit',
              'velocity'}


TEXT = '''\
# Model of {name}{read_with}. Lines with "guessed" or "not known" are to be checked.
/**:
  ros__parameters:
    robot:
      {format}: {place}  # from the folder of this file
      base: {base}  # the link that does not move
      tool: {tool}  # the link that carries the load
      drives: {drives}  # driven, in the order of all results
      effort_unit: {unit}  # not known from the files; A where recorded efforts are currents
      {mark}gain: [{ones}]  # not known: effort per ampere [{unit}/A], of recorded currents
      # gear_ratio: [{ones}]  # not known: turns of the motor per turn of the joint, for ripple
{loops}    effort_kind: {kind}  # not known from the files: what efforts are, one of {kinds}
    # `pprs fit` finds friction and masses, and writes them into a copy of this file.
'''


class FirstModelError(PprsError, ValueError):
    """A first model file cannot be written from the given files."""


@dataclass
class FirstModel:
    """A model file that is to be written.

    Parameters
    ----------
    robot, path : Path
        The description, and the model file.
    is_mjcf : bool
    description : Description
    base : str
    branch : Branch
    drives : tuple of str
    names : dict of str to str
        What the recording calls each joint of the description.
    recordings : list of Path
        As they are given to commands: of several files that make one, their folder or the first.
    notes : list of str
        What was guessed, and what could not be known.
    columns : dict
        Content of the key `columns`.
    guessed : list of str
        Comments on `columns`.
    questions : list of str
        Where a reading is not sure: lines, of which one is to be written.
    kinds : set of str
        Quantities that are recorded.
    is_read : bool
        Whether recordings can be read with it: not before it is decided what columns are.
    """

    robot: Path
    path: Path
    is_mjcf: bool
    description: Description
    base: str
    branch: Branch
    drives: tuple[str, ...]
    names: Mapping[str, str]
    recordings: list[Path]
    notes: list[str]
    columns: dict[str, Any] = field(default_factory=dict)
    guessed: list[str] = field(default_factory=list)
    questions: list[str] = field(default_factory=list)
    kinds: set[str] = field(default_factory=set)
    is_read: bool = True

    @property
    def has_efforts(self) -> bool:
        """Whether efforts of the drives are recorded."""
        return bool({EFFORT, CURRENT} & self.kinds) and EXTERNAL not in self.kinds

    @property
    def model(self) -> DriveModel:
        """The model of the file."""
        return DriveModel.from_parameters(parse_parameters(self.text, self.path),
                                          source=str(self.path))

    @property
    def text(self) -> str:
        """Content of the file."""
        slides = all(self.description.joints[name].kind == PRISMATIC for name in self.drives)
        is_current = CURRENT in self.kinds
        names = [recording.name for recording in self.recordings[:3]]
        lines = TEXT.format(
            name=self.robot.name, read_with=f', read with {", ".join(names)}' if names else '',
            format='mjcf' if self.is_mjcf else 'urdf', unit='N' if slides else 'N m',
            place=as_yaml(os.path.relpath(self.robot.resolve(), self.path.resolve().parent)),
            base=as_yaml(self.base), tool=as_yaml(self.branch.tool), drives=as_yaml([*self.drives]),
            mark='' if is_current else '# ', ones=', '.join(['1.0'] * len(self.drives)),
            loops=''.join(f'      # loop {loop.name}: {loop.kind}, {loop.a} to {loop.b}, from the '
                          'description\n' for loop in self.description.loops),
            kind=CURRENT if is_current else EXTERNAL if EXTERNAL in self.kinds else MEASURED,
            kinds=', '.join(EFFORT_KINDS)).splitlines()
        renamed = {drive: name for drive in self.drives
                   if (name := self.names.get(drive, drive)) != drive}
        if renamed:
            lines.append(f'    joint_map: {as_yaml(renamed)}  # what recordings call them')
        if self.columns:
            lines += ['    columns:  # of tables: names, or numbers from 1',
                      *(f'      # guessed: {note}' for note in self.guessed),
                      *(f'      {as_yaml(key)}: {as_yaml(value)}{_comment(key, value)}'
                        for key, value in self.columns.items())]
        lines += [f'    # not sure: {question}' for question in self.questions]
        return '\n'.join(lines) + '\n'


def first_model(
    robot: str | os.PathLike[str], recordings: Sequence[str | os.PathLike[str]] = (),
    output: str | os.PathLike[str] = 'robot.yaml', *, tool: str = '',
    drives: Sequence[str] = (), rate: float | None = None, topic: str | None = None,
) -> FirstModel:
    """Return a first model file of a robot.

    Parameters
    ----------
    robot : path
        URDF or MJCF.
    recordings : sequence of path
        Of which the first says how its joints and columns are called; several files of one
        quantity each are one recording.
    output : path
        Of the model file.
    tool : str, optional
        Link that carries the load; without, the end of the longest chain.
    drives : sequence of str, optional
        Driven joints; without, those of the recording, or all up to the tool.
    rate : float, optional
        Samples per second of tables without times [Hz].
    topic : str, optional
        Of joint states, if a bag has several.

    Raises
    ------
    PprsError
        Where a file cannot be read, or joints and columns cannot be matched.
    """
    path = Path(robot)
    is_mjcf = _root_tag(path) == 'mujoco'
    description = _description(path, is_mjcf)
    given, files = _grouped([Path(recording) for recording in recordings])
    contents = look_into(files.get(POSITION, given[0])) if given else Contents()
    movable = [joint.name for joint in description.joints.values()
               if joint.kind not in (FIXED, FLOATING) and joint.mimic is None]
    names = {} if files else _names(contents, movable)
    recorded = {*names} | {place[0] for column in contents.series if (
        place := joint_in(words_of(column.title), movable))}
    branch, notes = _branch(description, tool, recorded)
    notes += description.remarks
    chosen = _drives(description, path, is_mjcf, branch, drives, recorded)
    shared = [name for gear in coupled(description) for name in gear.joints if name in chosen]
    if shared and not drives:
        chosen = tuple(name for name in chosen if name not in shared)
        notes.append(f'{" and ".join(shared)} share a transmission: they are not driven; '
                     'to drive them, list them with friction: {motors: …}')
    idle = [] if drives else [name for name in chosen if _moves_nothing(description, name)]
    if idle and len(idle) == len(chosen):
        raise FirstModelError(f'{path}: no link that moves has an <inertial> with a mass, must '
                              'have one: take a description of the robot with masses')
    if idle:
        chosen = tuple(name for name in chosen if name not in idle)
        notes.append(f'{", ".join(idle)}: no link with an inertia moves about it, so that it is '
                     'not driven')
    by_numbers = False
    if contents.joints and not names:
        names = _by_numbers(contents, chosen)
        by_numbers = not all(map(_is_short_for, names, names.values()))
        if not by_numbers:
            notes.append('joints are matched by the numbers in their names')
    draft = FirstModel(path, Path(output), is_mjcf, description, root_of(description), branch,
                       chosen, names, given, notes)
    if given:
        try:
            draft.columns, draft.guessed, draft.kinds = _columns(
                given[0], files, contents, names, [*description.joints], draft.model, rate,
                topic)
        except AmbiguousColumns as error:
            if rate is None and not (error.has_times or contents.joints):
                raise GuessError(f'{given[0]}: {NO_TIMES}') from None
            notes.append(str(error))
            draft.questions += error.lines
            draft.kinds, draft.is_read = {EFFORT}, False  # a line says which
        except GuessError as error:
            raise GuessError(f'{given[0]}: {error}') from None
        notes += draft.guessed
    if given and not draft.questions:
        notes += _correct(draft, given[0], rate, topic)
    if by_numbers:
        draft.questions.append(
            f'the joints of {given[0].name} are matched by their numbers alone: if it is a '
            f'recording of this robot, keep joint_map: {as_yaml(names)}')
    if CURRENT in draft.kinds:
        notes.append('efforts are currents [A]: they stay amperes until gain is given in '
                     f'{draft.path.name}')
    if given and not draft.has_efforts and EXTERNAL not in draft.kinds:
        notes.append('no efforts were found: compare, diagnose and fit need them')
    return draft


def _correct(draft: FirstModel, path: Path, rate: float | None, topic: str | None) -> list[str]:
    """Write what a recording surely is into a draft, and ask about the rest; return notes.

    A mistake of a drive that comes again after its correction is a question.
    """
    notes: list[str] = []
    corrected: set[tuple[str, str]] = set()
    while True:
        model = draft.model
        try:
            recording = read_recording(path, model.recorded, topic)
            mistakes = find_mistakes(model, recording, is_first=True)
        except PprsError as error:
            draft.questions.append(f'it was not checked how {path.name} is read: {error}')
            return notes + draft.questions
        readings = [mistake for mistake in mistakes if isinstance(mistake, OtherReading)]
        by_velocities = draft.columns.get('rate') if rate is None else None
        # Without weight any rate explains the efforts.
        if by_velocities and (any(reading.kind == 'rate' for reading in readings) or not (
                near(by_velocities, USUAL_RATES) or shows_weight(model, recording))):
            raise FirstModelError(
                f'{path}: there is no column of times, and the recorded velocities are not surely '
                f'in the unit of the positions, which would be {by_velocities:g} samples per '
                'second: give --rate HZ')
        sure = [reading for reading in readings if reading.scales and reading.kind in SURE_KINDS
                and corrected.isdisjoint((reading.kind, drive) for drive, _, _ in reading.scales)]
        if not sure:
            # Lines for efforts that are no measurement are questions as well.
            # What is written below `columns` is one line.
            groups = [[mistake for mistake in mistakes if isinstance(mistake, Mistake)
                       and mistake.scales]]
            groups += [[mistake] for mistake in mistakes if mistake not in groups[0] and (
                isinstance(mistake, OtherReading) or lines_of([mistake]))]
            draft.questions += [
                ' and '.join(mistake.what for mistake in group)
                + ''.join(f': if so, write {line}'
                          for line in lines_of(group, bool(draft.columns)))
                for group in groups if group]
            if not any(seen.kind.startswith(('effort', 'drive_constant')) for seen in readings):
                draft.questions += _questions_of_names(draft)
            return notes + draft.questions
        for reading in sure:
            corrected |= {(reading.kind, drive) for drive, _, _ in reading.scales}
            draft.guessed.append(reading.what)
            notes.append(reading.what)
            for drive, key, value in reading.scales:
                (draft.columns.setdefault(drive, {}) if drive else draft.columns)[key] = value


def _questions_of_names(draft: FirstModel) -> list[str]:
    """Return questions about commands."""
    chosen = [column for drive in draft.drives for kind in (POSITION, EFFORT) if isinstance(
        column := draft.columns.get(drive, {}).get(kind), str)]
    commands = [column for column in chosen if {*words_of(column)} & COMMANDS]
    if commands:
        return [f'{", ".join(commands)}: commands by their names, where the measured columns are '
                'not known. Write their names in place of these, or, if no effort was measured, '
                f'{EFFORT_KIND}: {COMMANDED}']
    return []


# ------------------------------------------------------------------------------ description


def _root_tag(path: Path) -> str:
    try:
        return ElementTree.fromstring(urdf_content(str(path))).tag
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise UnreadableFileError(
            path, 'no URDF or MJCF: name the description of the robot first, then recordings, as '
            f'in pprs init robot.urdf run.mcap (it is not XML: {error})') from None


def _description(path: Path, is_mjcf: bool) -> Description:
    if not is_mjcf:
        return read_urdf(str(path))
    from pprs_dynamics.physics.mechanism.mjcf import read_mjcf

    return read_mjcf(str(path))


def _branch(description: Description, tool: str, recorded: Collection[str],
            ) -> tuple[Branch, list[str]]:
    """Return the chain from base to tool, and notes on ambiguities."""
    if tool:
        if tool not in description.links:
            raise UnknownNameError('link', tool, description.links, '--tool')
        return branch_to(description, tool), []
    likely = as_likely(description, recorded)
    if not likely[0].joints:
        raise FirstModelError(f'{description.path}: no joint of it moves, must have one that does')
    if len(likely) == 1:
        return likely[0], []
    return likely[0], [f'the load may be on {" or ".join(branch.tool for branch in likely)}: '
                       f'{likely[0].tool} was taken, --tool LINK takes another']


def _drives(description: Description, path: Path, is_mjcf: bool, branch: Branch,
            given: Sequence[str], recorded: Collection[str]) -> tuple[str, ...]:
    if given:
        for name in given:
            if name not in description.joints:
                raise UnknownNameError('joint', name, description.joints, '--drives')
        return tuple(given)
    if not description.loops:
        return tuple(name for name in branch.names if name in recorded) or branch.names
    # What loops determine is not driven.
    driven = recorded or (_actuated(path) if is_mjcf else {
        joint for transmission in description.transmissions for joint in transmission.joints})
    found = tuple(name for name in description.joints if name in driven)
    if not found:
        raise FirstModelError(
            f'{path}: it has loops, so not every joint is driven: give a RECORDING that names '
            'those that are, or --drives JOINT,JOINT,…')
    return found


def _moves_nothing(description: Description, name: str) -> bool:
    """Return whether a joint moves no link that has an inertia about it."""
    joint = description.joints[name]
    below = [joint.child]
    for link in below:
        below += [child.child for child in description.joints.values() if child.parent == link]
    mass, *_, xx, xy, yy, xz, yz, zz = description.links[joint.child]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    found = mass if joint.kind == PRISMATIC else joint.axis @ inertia @ joint.axis
    return not (found + joint.armature > 0 or any(
        description.links[link][0] > 0 for link in below[1:]))


def _actuated(path: Path) -> set[str]:
    """Return the joints that actuators of an MJCF drive."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(path))
    return {model.joint(int(model.actuator_trnid[k, 0])).name for k in range(model.nu)
            if int(model.actuator_trntype[k]) == mujoco.mjtTrn.mjTRN_JOINT}


# -------------------------------------------------------------------------------- recordings


def _grouped(recordings: Sequence[Path]) -> tuple[list[Path], dict[str, Path]]:
    """Return recordings, and the files by quantity where they are one recording."""
    folder = recordings[0] if len(recordings) == 1 else None
    if folder is not None and folder.is_dir() and not (
            is_lerobot(folder) or is_bag_folder(folder)):
        inside = sorted(file for file in folder.iterdir() if file.is_file())
        if not any(is_storage(file) for file in inside):
            files = _by_quantity(inside)
            if POSITION not in files:
                raise FirstModelError(
                    f'{folder}: its files ({", ".join(file.name for file in inside[:12])}) are no '
                    'bag, and none is called as positions are (position.csv, q.csv)')
            return [folder], files
    if len(recordings) > 1 and not any(is_storage(recording) for recording in recordings):
        files = _by_quantity(recordings)
        if len(files) == len(recordings) and POSITION in files:
            return [files[POSITION]], files
    return list(recordings), {}


def _by_quantity(files: Sequence[Path]) -> dict[str, Path]:
    """Return files by the quantity in their names, also time; the first of each."""
    found: dict[str, Path] = {}
    for file in files:
        words = {*words_of(file.name.split('.')[0])}
        kinds = [kind for kind in SETTLED if words & {*WORDS[kind]}]
        if words & {'time', *TIME_LIKE}:
            kinds.append(FILE_TIME)
        if kinds:
            found.setdefault(kinds[-1], file)
    return found


def _names(contents: Contents, joints: Sequence[str]) -> dict[str, str]:
    """Return the recorded name of each joint of a description.

    Names may differ in how words are divided, and in what stands before them in either.
    """
    known = dict.fromkeys(name for of in contents.joints.values() for name in of)
    known.update(dict.fromkeys(
        name.rpartition('/')[0].rpartition('/')[2] for name in (
            column.title for column in contents.series) if name.endswith(f'/{POSITION}')))
    if same := {joint: joint for joint in joints if joint in known}:
        return same
    found = {}
    for joint in joints:
        alike = ([name for name in known if ''.join(words_of(name)) == ''.join(words_of(joint))]
                 or [name for name in known if name.endswith(joint)
                     or joint.endswith(f'_{name}')])
        if len(alike) == 1:
            found[joint] = alike[0]
    return found


def _by_numbers(contents: Contents, drives: Sequence[str]) -> dict[str, str]:
    """Match as many joints by the numbers in their names, or refuse."""
    known = sorted({name for of in contents.joints.values() for name in of})

    def numbered(names: Sequence[str]) -> dict[int, str]:
        return {int(words[-1]): name for name in names
                if (words := [word for word in words_of(name) if word.isdigit()])}

    ours, theirs = numbered(drives), numbered(known)
    start = min(theirs, default=0) - min(ours, default=0)
    found = {joint: theirs[number + start] for number, joint in ours.items()
             if number + start in theirs}
    if len(found) < len(drives) or len(known) != len(drives):
        close = meant(drives[0], known)
        raise FirstModelError(
            f'joints of the recording ({", ".join(known[:12])}) are none of the description '
            f'({", ".join(drives[:12])})' + (f'; is {close} {drives[0]}?' if close else '')
            + ': write joint_map: {JOINT: NAME} or rename them')
    return found


def _is_short_for(first: str, other: str) -> bool:
    """Return whether one name abbreviates another, as j1 does joint_1."""
    first, other = (''.join(word for word in words_of(name) if not word.isdigit())
                    for name in (first, other))
    return first.startswith(other) or other.startswith(first)


def _columns(path: Path, files: Mapping[str, Path], contents: Contents, names: Mapping[str, str],
             movable: Sequence[str], model: DriveModel, rate: float | None, topic: str | None,
             ) -> tuple[dict[str, Any], list[str], set[str]]:
    """Return the content of `columns`, comments on guesses, and the recorded quantities."""
    kinds, drives = {*files}, model.drives
    found: dict[str, Any] = {}
    if files:
        guess = _guess_of_files(files, drives, rate, movable)
        pattern = {kind: file.name for kind, file in files.items()} if path.is_dir() else (
            _pattern(files))
        found['files'] = pattern
    else:
        joints = tuple(names.get(name, name) for name in drives)
        try:
            recording = read_recording(path, RecordedDrives(
                tuple(drives), joints, gain=(1.0,) * len(drives)), topic)
            known = bool(np.isfinite(recording.effort).any())
            return {}, [], {EFFORT if recording.gain is None else CURRENT} if known else set()
        except UnreadableFileError:
            # Positions of joint states may have their efforts in arrays; else it is a table.
            if contents.joints and not contents.series:
                raise
        guess = guess_columns(contents.series, drives, others=movable, rate=rate, model=model)
        kinds = {*(kind for _, kind in guess.columns), guess.effort_kind}
    for drive in ('', *drives):
        cells = {key: value for (of, key), value in guess.columns.items() if of == drive}
        found |= cells if not drive else {drive: cells} if cells else {}
    if found.get('time') in TIME_COLUMNS:
        del found['time']
    elif all(str(series.column).startswith('/') for series in contents.series):  # of a bag
        found.pop('rate', None)
    elif 'time' not in found and 'rate' not in found:
        raise FirstModelError(f'{path}: {NO_TIMES}')
    if contents.decimal != '.':
        found['decimal'] = contents.decimal
    return found, guess.notes, kinds


def _guess_of_files(files: Mapping[str, Path], drives: Sequence[str], rate: float | None,
                    movable: Sequence[str]) -> Guess:
    """Return the reading of columns in files of one quantity each."""
    inside = {kind: look_into(file) for kind, file in files.items()}
    # Where a file has the times no other one needs a rate.
    known = 1.0 if FILE_TIME in inside else rate
    guesses = {kind: guess_columns(file.series, drives, kind, movable, known)
               for kind, file in inside.items() if kind != FILE_TIME}
    columns = {key: value for kind, guess in guesses.items()
               for key, value in guess.columns.items() if key[0] or kind == POSITION}
    if FILE_TIME in inside:
        series = inside[FILE_TIME].series
        columns.pop(('', 'rate'), None)
        columns['', 'time'] = series[0].column if series else 1
    return Guess(columns, [f'{files[kind].name}: {note}' for kind, guess in guesses.items()
                           for note in guess.notes])


def _pattern(files: Mapping[str, Path]) -> dict[str, str]:
    """Return names of files with * for what they have in common: the name of the recording.

    It ends the names, or begins them where it has digits there alone, or they end in nothing alike.
    """
    stems = {kind: file.name.partition('.')[0] for kind, file in files.items()}
    parts = [re.findall('[A-Za-z]+|[0-9]+|.', stem) for stem in stems.values()]
    start, end = _common(parts), _common([part[::-1] for part in parts])[::-1]
    numbered = [any(map(str.isdigit, part)) for part in (start, end)]
    begins = bool(start) and (not end or numbered == [True, False])
    size = len(''.join(start).rstrip('_- ') if begins else ''.join(end).lstrip('_- '))
    found = {}
    for kind, stem in stems.items():
        named = f'*{stem[size:]}' if begins else f'{stem[:len(stem) - size]}*'
        found[kind] = named + files[kind].name.removeprefix(stem)
    return found


def _common(parts: Sequence[Sequence[str]]) -> list[str]:
    """Return what all begin with."""
    return [alike[0] for alike in takewhile(lambda alike: len(set(alike)) == 1,
                                            zip(*parts, strict=False))]


# -------------------------------------------------------------------------------------- text


def _comment(key: str, value: Any) -> str:
    comments = {'rate': 'samples per second [Hz]', 'time_scale': 'seconds per unit of time'}
    if key == 'files' and '*' in value[POSITION]:
        return '  # * is what recordings in one folder differ in'
    return f'  # {comments[key]}' if key in comments else ''
