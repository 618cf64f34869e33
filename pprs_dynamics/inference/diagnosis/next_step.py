# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The next step after a diagnosis, in words and as a command."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pprs_dynamics.inference.diagnosis.quantities import listed
from pprs_dynamics.physics.effects.laws.measured_curve import OF, OWN, MeasuredCurve
from pprs_dynamics.physics.model.parameter_file import DEFAULT_MODEL
from pprs_dynamics.physics.model.parameter_values import reference_files

if TYPE_CHECKING:  # naming files needs no diagnosis
    from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
    from pprs_dynamics.inference.readings.findings import Mistake
    from pprs_dynamics.physics.model.drive_model import DriveModel

OWN_FRICTION = ('friction.viscous', 'friction.coulomb')  # of an arm's model file
SECOND = 'SECOND_RECORDING'  # that is still to be made
CHECK = 'Check units, signs and zeros, and that the file describes this machine'
REPEAT = 'Repeat the motion and diagnose both recordings: an error that repeats is the machine'


@dataclass(frozen=True)
class GivenFiles:
    """Names of the files of a diagnosis, for commands that can be copied.

    Parameters
    ----------
    recordings, validate : tuple of str
    model : str
        Its file; `config/paper.yaml` for the paper's robot.
    topic : str
        '' where none was chosen.
    reference : tuple of str, optional
        Runs since which it is asked what has changed; none of them: those of the model file.
    """

    recordings: tuple[str, ...] = ('RECORDING',)
    validate: tuple[str, ...] = ()
    model: str = 'MODEL.yaml'
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
        given += ['--demo'] if self.model == DEFAULT_MODEL else ['--model', self.model]
        given += ['--topic', self.topic] if self.topic else []
        return shlex.join([*given, *words[first:]])

    def output(self, name: str) -> str:
        """Return the name of a model file to write, which may not be the one that is given."""
        given, new = Path(self.model), Path(name)
        return name if given.absolute() != new.absolute() else f'{new.stem}_2{new.suffix}'


PLACEHOLDERS = GivenFiles()  # of a diagnosis that was made from memory


def first_step(model: DriveModel, files: GivenFiles) -> tuple[str, str]:
    """Return the first step where a model explains little, and its command.

    A description alone, without friction and with the maker's masses, is fitted first.
    """
    if not model.has_links or reference_files(model.values, model.source):
        return CHECK, files.command('info')
    words = ('The model has no friction yet. Fit inertia and friction first'
             if _has_no_friction(model) else f'{CHECK}. Then fit the model')
    return words, files.command('fit', '--output', files.output('base.yaml'))


def _has_no_friction(model: DriveModel) -> bool:
    return model.has_links and not reference_files(model.values, model.source) and not any(
        np.any(model.values[key]) for key in OWN_FRICTION)


def measure_first(findings: Sequence[Mistake], files: GivenFiles) -> tuple[str, str]:
    """Return the next step where a recording has another reading, and the command to ignore it."""
    from pprs_dynamics.inference.readings.findings import OtherReading, lines_of

    lines = lines_of(dict.fromkeys(findings))
    if any(isinstance(finding, OtherReading) for finding in findings):
        return (f'Write {listed(lines)} into the model file. If all is as the model file says, '
                'continue with', files.command('diagnose', '--as-it-is'))
    say = f', or write {listed(lines, "or")} into the model file' if lines else ''
    return (f'Record the measured effort{say}. If it is measured, continue with',
            files.command('diagnose', '--as-it-is'))


def next_step(diagnosis: Diagnosis, files: GivenFiles) -> tuple[str, str]:
    """Return the next step, and its command."""
    other = replace(files, recordings=(SECOND,)).command('diagnose')
    both = replace(files, recordings=(*files.recordings, SECOND)).command('diagnose')
    effects, is_change = diagnosis.effects, diagnosis.since is not None
    if diagnosis.effort_looks_like:
        return measure_first(list(diagnosis.effort_looks_like.values()), files)
    if diagnosis.stick_slip:
        return ('Record a faster motion, without stick-slip, and diagnose it. If the machine must '
                'move so slowly, remove the cause first (grease, gains, a soft transmission)',
                other)
    if diagnosis.other_reading:
        return CHECK, files.command('info')
    if diagnosis.little or (
            not is_change and _has_no_friction(diagnosis.model)
            and (diagnosis.verdict == 'unknown' or len(effects) > 1)):
        # Several effects of a model without any friction are at best a common fit.
        return first_step(diagnosis.model, files)
    if changing := [f'{effect.name}{effect.when}' for effect in effects if effect.course]:
        return (f'Find out what happened to the machine ({"; ".join(changing)}). Then record it in '
                'its present state, and diagnose that recording alone', other)
    if diagnosis.depends_on and not is_change and (curve := _curve(diagnosis)) is not None:
        return ('Look at that place on the machine. A measured curve compensates the error until '
                'the cause is known', files.command(
                    'adopt', curve, '--output', files.output('with_curve.yaml'), held_out=True))
    if diagnosis.depends_on or diagnosis.above_noise:
        return REPEAT, both
    if diagnosis.verdict == 'ambiguous':
        return ('Record a motion that separates the candidates; this command designs it',
                files.command('next-experiment', '--output', 'next.csv'))
    if diagnosis.unconfirmed and not effects:
        return (f'Do not add {listed([effect.name for effect in diagnosis.unconfirmed])}. Record '
                'another motion, and diagnose both recordings', both)
    if len(effects) == 1:
        name = effects[0].name
        return 'Confirm it on the machine, then adopt it', files.command(
            'adopt', name, '--output', files.output(f'with_{name}.yaml'), held_out=True)
    if effects:
        return 'Confirm them on the machine, then adopt them', files.command(
            'diagnose', '--adopt-all', '--output', files.output('better.yaml'), held_out=True)
    if diagnosis.suspects:
        return REPEAT, both
    return 'Nothing to add. Another motion may excite other effects', other


def _curve(diagnosis: Diagnosis) -> str | None:
    """Return the request of `adopt` for a curve over what no effect explains; None for none."""
    for statement in diagnosis.depends_on:
        name, _, other = statement.variable.partition(' of ')
        # Such a curve has no direction of motion.
        if name in (OF if other else OWN) and not statement.kind.startswith('directed'):
            return f'{MeasuredCurve.name}:{statement.drive}@{statement.variable}'
    return None
