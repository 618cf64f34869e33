# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Arguments of commands with their checks; reading recordings, printing and writing results.

argparse turns the errors of checks into one line and status 2. Files are written whole or not.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
from collections.abc import Callable
from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from pprs_dynamics.app.report.terminal import console, shown, staged_bar
from pprs_dynamics.errors import PprsError, UnreadableFileError
from pprs_dynamics.system.files import writable_file, write_text
from pprs_dynamics.system.json_records import for_json
from pprs_dynamics.system.numbers import parse_number, parse_whole
from pprs_dynamics.system.plain_text import displayed

if TYPE_CHECKING:
    from pprs_dynamics.app.api.inputs import Inputs
    from pprs_dynamics.app.api.result import Result
    from pprs_dynamics.app.report.page import Page


JSON, PAGE, MODEL, POSES = ('.json',), ('.html',), ('.yaml', '.yml'), ('.csv',)
LARGEST_SEED = 2**63 - 1
MOST_SHOWN = 30  # characters of what is no number
# Options that name files, by what is done with them.
OUTPUTS = ('output', 'json', 'report', 'mcap', 'picture')
INPUTS = ('model', 'recordings', 'validate', 'reference', 'file', 'manifest', 'store', 'path')
NAMED = {'recordings': 'a recording', 'file': 'the model', 'model': 'the model',
         'store': 'the store'}

DEFAULT_MODEL = 'config/paper.yaml'


Number = TypeVar('Number', int, float)


class UsageError(PprsError, ValueError):
    """Arguments that contradict each other or the files."""


def number(lower: float, upper: float, unit: str = '', above: bool = False,
           ) -> Callable[[str], float]:
    """Return a reader of numbers from `lower`, or above it, to `upper`."""
    rule = (f'must be greater than {lower:g} and at most {upper:g}' if above
            else f'must lie between {lower:g} and {upper:g}') + f' {unit}' * bool(unit)
    return _reader(parse_number, lambda value: lower <= value <= upper and (
        not above or value > lower), rule)


def whole(lower: int, upper: int) -> Callable[[str], int]:
    """Return a reader of whole numbers from `lower` to `upper`."""
    return _reader(parse_whole, lambda value: lower <= value <= upper,
                   f'must be a whole number from {lower} to {upper}')


def _reader(parse: Callable[[str], Number], fits: Callable[[Number], bool], rule: str,
            ) -> Callable[[str], Number]:
    def read(text: str) -> Number:
        with suppress(ValueError):
            if fits(value := parse(text)):
                return value
        raise argparse.ArgumentTypeError(f'{text[:MOST_SHOWN]!r} {rule}')
    return read


seed = whole(0, LARGEST_SEED)


def output_file(*endings: str) -> Callable[[str], str]:
    """Return a reader of names of files that can be written, before minutes are spent on them.

    Parameters
    ----------
    endings : str
        Those that are known; '' where a name without an ending is a folder to be made.
    """
    *first, last = (ending or 'nothing, for a rosbag2 folder' for ending in endings)
    known = f'{", ".join(first)} or {last}' if first else last

    def read(text: str) -> str:
        path = Path(text)
        try:
            if path.suffix not in endings and not path.is_dir():
                raise argparse.ArgumentTypeError(f'{displayed(text)!r} must end in {known}')
            if '' in endings and not path.suffix and (path.is_dir() or path.is_file()):
                raise UnreadableFileError(
                    path, 'it exists already, and bags are never overwritten')
            writable_file(path)
        except UnreadableFileError as error:
            raise argparse.ArgumentTypeError(str(error)) from None
        except OSError as error:
            raise argparse.ArgumentTypeError(f'{displayed(text)}: {error.strerror}') from None
        return text
    return read


# Arguments of several commands.
SHARED: dict[str, dict[str, Any]] = {
    'recordings': {'metavar': 'RECORDING', 'help': 'bag (rosbag2 folder, .mcap, .db3, ROS 1) or '
                   'table (.csv, .csv.gz, .parquet, .mat, .npz, .json)'},
    'topic': {'metavar': 'NAME', 'help': 'topic of type sensor_msgs/JointState, if a bag has '
              'several'},
    'as-it-is': {'action': 'store_true', 'help': 'accept a recording whose units, signs or '
                 'efforts look wrong'},
    'validate': {'metavar': 'RECORDING', 'action': 'append', 'default': [],
                 'help': 'a recording that is not fitted: held-out errors are measured on it; may '
                 'be repeated'},
    'reference': {'metavar': 'RECORDING', 'nargs': '*', 'help': 'report what has changed since '
                  'these recordings of the healthy machine (none named: those that the model file '
                  'names)'},
    'report': {'metavar': 'FILE.html', 'type': output_file(*PAGE),
               'help': 'write a page with all figures'},
    'output': {'metavar': 'FILE.yaml', 'type': output_file(*MODEL), 'help': 'model file to write'},
}


def add_shared(parser: argparse.ArgumentParser, *names: str, required: bool = True, **texts: str,
               ) -> None:
    """Declare some of the shared arguments; `texts` replaces the help of an argument.

    `required` is about recordings and --output.
    """
    for name in names:
        settings = SHARED[name] | ({'help': texts[name]} if name in texts else {})
        if name == 'recordings':
            parser.add_argument(name, nargs='+' if required else '*', **settings)
        else:
            option = parser.add_argument(f'--{name}', **settings)
            option.required = required and name == 'output'


def require_output(options: argparse.Namespace, switch: str) -> None:
    """Refuse --output without the switch that writes it, and the switch without --output.

    Raises
    ------
    UsageError
    """
    is_given = getattr(options, switch.replace('-', '_'))
    if is_given and not options.output:
        raise UsageError(f'--{switch}: no --output FILE is given, must say where the new model '
                         'file goes')
    if options.output and not is_given:
        raise UsageError(f'--output: it is given without --{switch}, which alone writes a model '
                         'file; --json and --report write the answer')


def output_folder(text: str) -> str:
    """Read the name of a folder to write to, which may exist; not its address elsewhere."""
    path = Path(text)
    if '://' not in text and os.path.lexists(path) and not path.is_dir():
        raise argparse.ArgumentTypeError(f'{displayed(text)}: is no folder, must be one')
    return text


def check_files(options: argparse.Namespace) -> None:
    """Refuse outputs that are an input or another output, and recordings that exist.

    Raises
    ------
    UnreadableFileError
    """
    # Here, as --help needs no model.
    from pprs_dynamics.measurement.files.recording import ENDINGS
    from pprs_dynamics.physics.model.parameter_file import find_file

    seen: dict[str, str] = {}
    for option in (*INPUTS, *OUTPUTS):
        value = getattr(options, option, None)
        for name in [value] if isinstance(value, str) else value or ():
            path = find_file(name) if option == 'model' and name == DEFAULT_MODEL else Path(name)
            real = os.path.realpath(path)
            if option in OUTPUTS and real in seen:
                raise UnreadableFileError(
                    name, f'it is --{option} and {seen[real]} at once, must be another file')
            if option in OUTPUTS and path.suffix in ENDINGS and os.path.lexists(path):
                raise UnreadableFileError(name, 'it exists already, must be another name for '
                                          f'--{option}: recordings are never replaced')
            seen[real] = NAMED.get(option, f'--{option}')


def read_inputs(options: argparse.Namespace, screen: Any, whole: bool = False) -> Inputs:
    """Return model and recordings of the arguments; print faults of the recordings.

    Excerpts of what is too long for a fit, but where the `whole` is asked for.

    Raises
    ------
    PprsError
        As `Inputs.of`.
    """
    # Here, as what only writes needs no statistics.
    from pprs_dynamics.app.api.inputs import Inputs

    with staged_bar(screen) as progress:
        inputs = Inputs.of(options.model, options.recordings, getattr(options, 'validate', ()),
                           options.topic, progress, whole, getattr(options, 'as_it_is', False))
    for recording in (*inputs.fitted, *inputs.held_out):
        # That velocities are computed is no fault; `pprs info` says so.
        for finding in recording.findings:
            if finding.kind != 'missing_velocity':
                screen.print(f'[yellow]![/] {shown(f"{recording.name}: {finding.text}")}')
    return inputs


def answer(call: Callable[..., Any], options: argparse.Namespace, whole: bool = False,
           **settings: Any) -> tuple[Any, Any]:
    """Return the console, and the result of a call for the model and recordings of the arguments.

    Raises
    ------
    PprsError
        As `read_inputs` and the call.
    """
    screen = console()
    inputs = read_inputs(options, screen, whole)
    with staged_bar(screen) as progress:
        return screen, call(inputs.model, recordings=inputs, progress=progress, **settings)


def write_json(path: str | PathLike[str], content: Any) -> None:
    """Write JSON atomically; see `for_json`."""
    write_text(path, json.dumps(for_json(content), indent=2, ensure_ascii=False) + '\n')


def show(result: Result, options: argparse.Namespace, screen: Any,
         page: Callable[[], Page] | None = None, view: Any = None) -> None:
    """Print a result, and write what --json and --report ask for: its view and page by default."""
    if options.json:
        write_json(options.json, result)
    if getattr(options, 'report', None):
        with staged_bar(screen) as progress:
            progress('page', 0.0)
            made = (page or result.page)()
            made.record(result.record(shlex.join(['pprs', *getattr(options, 'words', ())])))
            made.write(options.report)
    # Last: a reader of the text that goes away, as `head` does, ends the command.
    screen.print(result.view() if view is None else view)
    if getattr(options, 'report', None):
        screen.print(f'page: {shown(options.report)}', soft_wrap=True)
