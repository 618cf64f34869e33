# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What an entrant is asked, what it answers, and what was true.

The protocol (README.md) fixes the files; these classes read and write them.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import PprsError

VERDICTS = ('none', 'effect', 'ambiguous', 'unknown')


class AnswerError(PprsError):
    """An answer that is not of the protocol's form."""


@dataclass(frozen=True)
class Column:
    """What one coefficient of one effect would add to the efforts.

    Parameters
    ----------
    effect, coefficient : str
    drive : str or None
        On which the effect sits; None for the structure, which several drives feel.
    shape : tuple of (str, float)
        What is not linear in it, at the value that this column has.
    """

    effect: str
    coefficient: str
    drive: str | None
    shape: tuple[tuple[str, float], ...] = ()

    @property
    def group(self) -> tuple[str, str | None, tuple[tuple[str, float], ...]]:
        """Columns of one effect at one place in one shape belong together."""
        return self.effect, self.drive, self.shape


@dataclass(frozen=True)
class Problem:
    """A recording as a regression: all that a method without dynamics needs.

    Parameters
    ----------
    drives : tuple of str
    time : (M,) array
        [s]; uneven where the recording has gaps.
    error : (M, D) array
        Measured effort minus that of the model [N, N m].
    base : (B, M, D) array
        What each number of the model that is not known exactly would change, per standard
        deviation of what is known of it; widths of reversal among them.
    columns : tuple of Column
    rows : (P, M, D) array
        The columns' [N, N m] per unit of the coefficient.
    folder : Path, optional
        Where recording and model lie.
    """

    drives: tuple[str, ...]
    time: Array
    error: Array
    base: Array
    columns: tuple[Column, ...]
    rows: Array
    folder: Path | None = None

    def write(self, folder: Path) -> None:
        """Write `columns.npz` and `columns.json`."""
        np.savez_compressed(folder / 'columns.npz', time=self.time, error=self.error,
                            base=self.base.astype(np.float32), rows=self.rows.astype(np.float32))
        (folder / 'columns.json').write_text(json.dumps({
            'drives': self.drives,
            'columns': [{'effect': c.effect, 'coefficient': c.coefficient, 'drive': c.drive,
                         'shape': dict(c.shape)} for c in self.columns]}, indent=0))

    @classmethod
    def read(cls, folder: Path) -> Problem:
        """Read what `write` wrote."""
        text = json.loads((folder / 'columns.json').read_text())
        with np.load(folder / 'columns.npz') as found:
            return cls(tuple(text['drives']), found['time'], found['error'],
                       found['base'].astype(float),
                       tuple(Column(column['effect'], column['coefficient'], column['drive'],
                                    tuple(sorted(column['shape'].items())))
                             for column in text['columns']),
                       found['rows'].astype(float), folder)


@dataclass(frozen=True)
class Named:
    """One effect of an answer.

    Parameters
    ----------
    name : str
    drives : tuple of str or None
        None for the structure.
    parameters : mapping of str to (value, standard deviation or None)
        `<drive>.<parameter>` on drives, `<parameter>` elsewhere.
    """

    name: str
    drives: tuple[str, ...] | None = None
    parameters: Mapping[str, tuple[float, float | None]] = field(default_factory=dict)


@dataclass(frozen=True)
class Answer:
    """What an entrant says of a problem.

    Parameters
    ----------
    verdict : {'none', 'effect', 'ambiguous', 'unknown'}
    sets : tuple of tuple of Named
        Sets of missing effects, the likeliest first; the strongest effect of each first.
        `none` has no set, `effect` one; in `unknown` the effects that are named in addition.
    seconds : float
        Processor time.
    error : str
        With which the entrant ended instead of answering, if it did: the verdict is then `none`.
    """

    verdict: str
    sets: tuple[tuple[Named, ...], ...] = ()
    seconds: float = 0.0
    error: str = ''

    def __post_init__(self) -> None:
        if self.verdict not in VERDICTS:
            raise AnswerError(f'verdict is {self.verdict!r}, must be one of {", ".join(VERDICTS)}')
        if self.verdict == 'none' and any(self.sets):
            raise AnswerError('verdict is none, and effects are named')
        if self.verdict in ('effect', 'ambiguous') and not (self.sets and self.sets[0]):
            raise AnswerError(f'verdict is {self.verdict}, and no effect is named')

    @classmethod
    def of(cls, effects: Sequence[Named]) -> Answer:
        """Return the answer of a method that knows one set and no doubt."""
        return cls('effect', (tuple(effects),)) if effects else cls('none')

    def to_dict(self) -> dict[str, Any]:
        """Return it as data for JSON."""
        return {'verdict': self.verdict, 'seconds': self.seconds, 'error': self.error, 'sets': [
            [{'name': effect.name, 'drives': effect.drives,
              'parameters': {key: {'value': value, 'std': std}
                             for key, (value, std) in effect.parameters.items()}}
             for effect in found] for found in self.sets]}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Answer:
        """Return an answer from JSON, or raise AnswerError saying what is wrong with it."""
        try:
            sets = tuple(tuple(Named(
                str(e['name']), None if e.get('drives') is None else tuple(e['drives']),
                {key: (float(value['value']),
                       None if value.get('std') is None else float(value['std']))
                 for key, value in e.get('parameters', {}).items()})
                for e in found) for found in data.get('sets', ()))
            return cls(str(data['verdict']), sets, float(data.get('seconds', 0.0)),
                       str(data.get('error', '')))
        except (KeyError, TypeError, AttributeError, ValueError) as error:
            raise AnswerError(f'the answer is not of the protocol\'s form: {error!r}') from error


@dataclass(frozen=True)
class Truth:
    """What was hidden.

    Parameters
    ----------
    problem, robot, kind, noise : str
        `kind`: single, two, three, form, unknown or nothing.
    snr : float
        0 where nothing is hidden.
    effects : tuple of Named
        Parameters only where the hidden form is the catalogue's, without deviations.
    """

    problem: str
    robot: str
    kind: str
    noise: str
    snr: float
    effects: tuple[Named, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Of the effects."""
        return tuple(effect.name for effect in self.effects)

    def to_dict(self) -> dict[str, Any]:
        """Return it as data for JSON."""
        return {'problem': self.problem, 'robot': self.robot, 'kind': self.kind,
                'noise': self.noise, 'snr': self.snr, 'effects': [
                    {'name': effect.name, 'drives': effect.drives,
                     'parameters': {key: value for key, (value, _) in effect.parameters.items()}}
                    for effect in self.effects]}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Truth:
        """Return what `to_dict` gave."""
        return cls(data['problem'], data['robot'], data['kind'], data['noise'], data['snr'], tuple(
            Named(effect['name'], None if effect['drives'] is None else tuple(effect['drives']),
                  {key: (value, None) for key, value in effect['parameters'].items()})
            for effect in data['effects']))
