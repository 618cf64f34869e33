# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The ledger of a model file: the effects added, when, from which data, and their gain.

A step stands under `history.step_NN` in values that ROS 2 parameter files accept, and keeps what
was there before, so that it can be taken back exactly.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import MISSING as NO_DEFAULT
from dataclasses import dataclass, field, fields, replace
from typing import Any

from pprs_dynamics.errors import MISSING, ModelError, UnknownNameError
from pprs_dynamics.physics.model.keys import ANY, Key, as_list, below, blocks_below
from pprs_dynamics.physics.model.parameter_file import flatten
from pprs_dynamics.system.json_records import JsonRecord

BLOCK = 'history'
_STEP = re.compile(r'step_\d\d+')
PREVIOUS = 'previous'
NOT_KNOWN = 1e300  # a standard deviation that is none; ROS 2 files have no better word


@dataclass(frozen=True)
class Step(JsonRecord):
    """One effect that was added to a model, set anew or taken out.

    Parameters
    ----------
    effect : str
        Its name.
    recordings, sha256 : tuple of str
        Fitted recordings, and the hashes of their files.
    spans : tuple of float
        First and last time of each recording [s].
    held_out_on : {'blocks', 'validation'}
        Held-out data: blocks of the recordings, or those of --validate.
    error_before, error_after, held_out_before, held_out_after, noise_floor : float
        RMS errors on fitted and on held-out data, and RMS of the noise [N].
    date, version : str
        Date, and version of the package.
    forced : bool
        Whether objections were overridden.
    parameters, values, std, units : tuples
        Names (drive.parameter, or parameter), values, standard deviations and units.
    drives : tuple of str
        Drives that it is on; none for effects in the structure.
    measured, drive_errors_before, drive_errors_after : tuples
        Drives that were measured, and the RMS error of each [N].
    validation, validation_sha256 : tuple of str
        Recordings that were not fitted, and the hashes of their files.
    reference : tuple of str
        Reference runs since which it is a change.
    objections, rivals, calibrated : tuple of str
        Overridden objections; effects that explain the data as well; numbers that moved.
    previous : mapping
        Earlier values of the keys that the step changed.
    added, removed : tuple of str
        Keys that the step added to the model file, and that it removed.
    """

    json_attributes = (('drives', 'on_drives'),)

    effect: str
    error_before: float
    error_after: float
    held_out_before: float
    held_out_after: float
    held_out_on: str
    noise_floor: float
    recordings: tuple[str, ...]
    sha256: tuple[str, ...]
    spans: tuple[float, ...]
    date: str
    version: str
    forced: bool
    drives: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()
    values: tuple[float, ...] = ()
    std: tuple[float, ...] = ()
    units: tuple[str, ...] = ()
    measured: tuple[str, ...] = ()
    drive_errors_before: tuple[float, ...] = ()
    drive_errors_after: tuple[float, ...] = ()
    validation: tuple[str, ...] = ()
    validation_sha256: tuple[str, ...] = ()
    reference: tuple[str, ...] = ()
    objections: tuple[str, ...] = ()
    rivals: tuple[str, ...] = ()
    calibrated: tuple[str, ...] = ()
    previous: Mapping[str, Any] = field(default_factory=dict)
    added: tuple[str, ...] = ()
    removed: tuple[str, ...] = ()

    @property
    def on_drives(self) -> tuple[str, ...] | None:
        """Drives that the effect is on; null: not on drives."""
        return self.drives or None

    def as_values(self, prefix: str) -> dict[str, Any]:
        """Return flat keys and values of a model file, empty lists left out."""
        return {key: as_list(value) for key, value in flatten(vars(self), f'{prefix}.')
                if value not in ((), {})}


def read_steps(values: Mapping[str, Any]) -> list[Step]:
    """Return the steps of a model, oldest first.

    Raises
    ------
    ModelError
        For a ledger that holds what it must not.
    """
    rule = f'be under {BLOCK}.step_01, step_02, …'
    if values.get(BLOCK):
        raise ModelError(BLOCK, values[BLOCK], rule)
    blocks = blocks_below(values, f'{BLOCK}.')
    for step, block in blocks.items():
        if not _STEP.fullmatch(step) or '' in block:
            raise ModelError(f'{BLOCK}.{step}', block.get('', block), rule)
    ordered = sorted(blocks, key=lambda name: int(name.removeprefix('step_')))
    for number, name in enumerate(ordered, start=1):
        if name != step_name(number):
            raise ModelError(f'{BLOCK}.{step_name(number)}', MISSING,
                             f'be there before {BLOCK}.{name}')
    return [_read_step(f'{BLOCK}.{name}', blocks[name]) for name in ordered]


def step_name(number: int) -> str:
    """Return the name of the n-th step, counted from 1."""
    return f'step_{number:02d}'


def with_step(before: Mapping[str, Any], after: Mapping[str, Any], step: Step) -> dict[str, Any]:
    """Return the values `after` with a step that leads to them from the values `before`.

    The earlier steps are those of `before`: values that were fitted to an earlier model have none.
    """
    changed = {key for key in {*before, *after}
               if not key.startswith(f'{BLOCK}.') and as_list(before.get(key, MISSING)) != as_list(
                   after.get(key, MISSING))}
    kept = replace(step, previous={key: before[key] for key in before if key in changed},
                   added=tuple(key for key in after if key in changed - before.keys()),
                   removed=tuple(key for key in before if key in changed - after.keys()))
    number = len(read_steps(before)) + 1
    earlier = {key: value for key, value in before.items() if key.startswith(f'{BLOCK}.')}
    return {**after, **earlier, **kept.as_values(f'{BLOCK}.{step_name(number)}')}


def without_last_step(values: Mapping[str, Any]) -> tuple[dict[str, Any], Step]:
    """Return the values as they were before the last step, and that step.

    Raises
    ------
    ModelError
        Where there is none, or where what it added is not there any more.
    """
    steps = read_steps(values)
    if not steps:
        raise ModelError(BLOCK, MISSING, 'contain a step that can be taken back')
    last, prefix = steps[-1], f'{BLOCK}.{step_name(len(steps))}.'
    for key in (*last.added, *last.previous):
        if key not in values and key not in last.removed:
            raise ModelError(key, MISSING, f'be there: {prefix[:-1]} set it, and taking it back '
                             'would not give the model that was')
    kept = {key: value for key, value in values.items()
            if not key.startswith(prefix) and key not in last.added}
    return {**kept, **last.previous}, last


def values_before_changes(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values as they were before the first step that is a change since a reference."""
    before = dict(values)
    while any(step.reference for step in read_steps(before)):
        before, _ = without_last_step(before)
    return before


def original_values(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values with numbers of the robot as they were before the first step.

    Effects stay. What a fit may move within a tolerance is thus counted from what the file said
    at first, however many fits there were.
    """
    original = dict(values)
    for step in reversed(read_steps(values)):
        original.update((key, value) for key, value in step.previous.items()
                        if not key.startswith(('effects.', 'uncertainties.')))
    return original


def _read_step(prefix: str, block: Mapping[str, Any]) -> Step:
    known = {entry.name: entry for entry in fields(Step)}
    found: dict[str, Any] = {PREVIOUS: below(block, f'{PREVIOUS}.')}
    for name, value in block.items():
        if name.split('.')[0] == PREVIOUS:
            continue
        if name not in known:
            raise UnknownNameError('key', f'{prefix}.{name}', [f'{prefix}.{key}' for key in known])
        found[name] = _checked(f'{prefix}.{name}', value, str(known[name].type))
    for name, entry in known.items():
        if name not in found and entry.default is NO_DEFAULT:
            raise ModelError(f'{prefix}.{name}', MISSING, 'be given')
    return Step(**found)


def _checked(key: str, value: Any, kind: str) -> Any:
    """Return a value of a field of some type, or raise ModelError."""
    if kind == 'bool':
        if not isinstance(value, bool):
            raise ModelError(key, value, 'be true or false')
        return value
    return Key(key, 'of a step', size=ANY if kind.startswith('tuple') else None,
               is_text='str' in kind, may_be_empty=True).check(value)
