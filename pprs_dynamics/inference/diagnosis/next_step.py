# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What to do after a diagnosis: in words, and as a command with the real names of files."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pprs_dynamics.inference.diagnosis.quantities import listed
from pprs_dynamics.physics.effects.catalogue import find_effect
from pprs_dynamics.physics.effects.laws.measured_curve import OF, OWN, MeasuredCurve
from pprs_dynamics.physics.model.reference_keys import reference_files

if TYPE_CHECKING:  # naming files needs no diagnosis
    from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
    from pprs_dynamics.inference.readings.findings import NoMeasurement
    from pprs_dynamics.physics.model.drive_model import DriveModel

OWN_FRICTION = ('friction.viscous', 'friction.coulomb')  # of an arm's model file
SECOND = 'SECOND_RECORDING'  # that is still to be made


@dataclass(frozen=True)
class GivenFiles:
    """Names of the files of a diagnosis, for commands that can be copied.

    Parameters
    ----------
    recordings, validate : tuple of str
    model : str
        '' for the default.
    topic : str
        '' where none was chosen.
    reference : tuple of str, optional
        Runs since which it is asked what has changed; none of them: those of the model file.
    """

    recordings: tuple[str, ...] = ('RECORDING',)
    validate: tuple[str, ...] = ()
    model: str = ''
    topic: str = ''
    reference: tuple[str, ...] | None = None

    def command(self, *words: str, held_out: bool = False) -> str:
        """Return a command of `pprs` on the recordings, then options; quoted for a shell.

        Parameters
        ----------
        words : str
            The command and its first arguments; from the first that starts with `--` on they
            stand behind the recordings.
        held_out : bool
            Whether it takes --validate.
        """
        first = next((k for k, word in enumerate(words) if word.startswith('--')), len(words))
        given = ['pprs', *words[:first], *self.recordings]
        if held_out:
            given += [part for name in self.validate for part in ('--validate', name)]
        if self.reference is not None and words[0] in ('adopt', 'diagnose'):
            given += ['--reference', *self.reference]
        for option, value in (('--model', self.model), ('--topic', self.topic)):
            given += [option, value] if value else []
        return shlex.join([*given, *words[first:]])

    def output(self, name: str) -> str:
        """Return the name of a model file to write, which may not be the one that is given.

        `with_NAME.yaml` after itself is `with_NAME_2.yaml`, and so on.
        """
        given, new = Path(self.model), Path(name)
        stem, _, number = given.stem.rpartition('_')
        if not self.model or given.absolute().parent != new.absolute().parent:
            return name
        if given.stem == new.stem:
            return f'{new.stem}_2{new.suffix}'
        if stem == new.stem and number.isdecimal():
            return f'{new.stem}_{int(number) + 1}{new.suffix}'
        return name


PLACEHOLDERS = GivenFiles()  # of a diagnosis that was made without files


def first_step(model: DriveModel, files: GivenFiles) -> tuple[str, str]:
    """Return what to do before anything else where a model explains little, and the command.

    A description alone, without friction and with the maker's masses, is fitted first.
    """
    if model.is_described:
        if _is_fitted(model):
            return ('Check columns, units, signs and zeros, and that the file describes this '
                    'machine: the model was fitted, and still explains little',
                    files.command('info'))
        words = ('The model has no friction yet. Fit inertia and friction first'
                 if _has_no_friction(model) else
                 'Check units, signs and zeros, and that the file describes this machine. Then '
                 'fit the model')
        return words, files.command('fit', '--output', files.output('base.yaml'))
    return ('Check units, signs and zeros, and that the file describes this machine',
            files.command('info'))


def _is_fitted(model: DriveModel) -> bool:
    return bool(reference_files(model.values, model.source))


def _has_no_friction(model: DriveModel) -> bool:
    return model.is_described and not _is_fitted(model) and not any(
        np.any(model.values[key]) for key in OWN_FRICTION)


def measure_first(findings: Sequence[NoMeasurement], files: GivenFiles) -> tuple[str, str]:
    """Return what to do where efforts are no measurement, and the command that goes on."""
    lines = dict.fromkeys(finding.line for finding in findings if finding.line)
    say = ('; where it is what it looks like, write '
           f'{listed(tuple(lines), "or")} into the model file' if lines else '')
    return (f'Record the effort that is measured{say}. Where it is measured all the same',
            files.command('diagnose', '--as-it-is'))


def next_step(diagnosis: Diagnosis, files: GivenFiles) -> tuple[str, str]:
    """Return what to do next, and the command for it."""
    if diagnosis.effort_looks_like:
        return measure_first(list(diagnosis.effort_looks_like.values()), files)
    if diagnosis.stick_slip:
        return ('Record a motion that is faster than the stick-slip, and diagnose that; as long as '
                'the machine has to move so slowly, its cause comes first (grease, gains, a soft '
                'transmission)', replace(files, recordings=(SECOND,)).command('diagnose'))
    if diagnosis.little or (
            diagnosis.since is None and _has_no_friction(diagnosis.model)
            and (diagnosis.verdict == 'unknown' or len(diagnosis.effects) > 1)):
        # Of a model that lacks all friction several effects are what fits together, at best.
        return first_step(diagnosis.model, files)
    if changing := [f'{effect.name}{effect.when}' for effect in diagnosis.effects
                    if effect.course is not None]:
        # Fitted throughout it would be wrong at every moment.
        return (f'Find out what happened to the machine ({"; ".join(changing)}). Then record it as '
                'it is now, and diagnose that recording alone',
                replace(files, recordings=(SECOND,)).command('diagnose'))
    repeat = replace(files, recordings=(*files.recordings, SECOND)).command('diagnose')
    if diagnosis.depends_on:
        if diagnosis.since is None and (curve := _curve(diagnosis)) is not None:
            return ('Look at that place on the machine. A measured curve takes the error away '
                    'until the cause is known', files.command(
                        'adopt', curve, '--output', files.output('with_curve.yaml'), held_out=True))
        return ('Look at that place on the machine, and record the motion again: what comes back '
                'is the machine. Then diagnose both recordings', repeat)
    if diagnosis.verdict == 'ambiguous' and all(
            _need_another_load(names) for names in diagnosis.indistinguishable):
        return ('Repeat the motion with another load, or in a posture in which the drive carries '
                'more: only friction by load grows with it. Then diagnose that recording with the '
                'load in the model', replace(files, recordings=(SECOND,)).command('diagnose'))
    if diagnosis.verdict == 'ambiguous':
        return ('Record a motion that tells the candidates apart; this designs it',
                files.command('next-experiment', '--output', 'next.csv'))
    if diagnosis.unconfirmed and not diagnosis.effects:
        if diagnosis.since is None and diagnosis.model.is_described and any(
                effect.objection for effect in diagnosis.unconfirmed):
            # What no machine can have says that the model is of another: no motion mends that.
            return first_step(diagnosis.model, files)
        names = listed([effect.name for effect in diagnosis.unconfirmed])
        return (f'Do not add {names} on this evidence. Record another motion, and '
                'diagnose both recordings', repeat)
    if len(diagnosis.effects) == 1:
        found = diagnosis.effects[0]
        step = 'set it anew, or take it out' if found.in_model else 'add it'
        return (f'Confirm it on the machine, then {step}', files.command(
            'adopt', found.name, '--output',
            files.output(f'with_{found.name}.yaml'), held_out=True))
    if diagnosis.effects:
        return ('Confirm them on the machine, then add them', files.command(
            'diagnose', '--adopt-all', '--output', files.output('better.yaml'), held_out=True))
    if diagnosis.suspects:
        return ('Repeat the recording: what comes back is the machine, what does not was noise',
                repeat)
    return ('Nothing to add. Another motion may show what this one does not excite',
            replace(files, recordings=(SECOND,)).command('diagnose'))


def _need_another_load(names: Sequence[str]) -> bool:
    effect = find_effect(names[0])
    return effect is not None and list(names[1:]) == [effect.at_one_load]


def _curve(diagnosis: Diagnosis) -> str | None:
    """Return the curve that takes what no effect explains, as `adopt` takes it."""
    for statement in diagnosis.depends_on:
        name, _, other = statement.variable.partition(' of ')
        if name in (OF if other else OWN):
            return f'{MeasuredCurve.name}:{statement.drive}@{statement.variable}'
    return None
