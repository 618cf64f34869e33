# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`pprs`: reads the arguments, calls the subcommand, and turns errors into one line.

Exit status: 0 done; 1 refused or a check failed; 2 bad usage or unreadable input.
"""

from __future__ import annotations

import argparse
import ast
import io
import os
import re
import signal
import sys
import threading
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn

from pprs_dynamics import __version__
from pprs_dynamics.app.commands.arguments import DEFAULT_MODEL, JSON, check_files, output_file
from pprs_dynamics.errors import MisreadError, PprsError, suggestion
from pprs_dynamics.system.plain_text import PLAIN, displayed
from pprs_dynamics.system.threads import use_one_thread

# Each a module of this folder with a docstring, EXAMPLE, add_arguments and run.
COMMANDS = ('adopt', 'compare', 'diagnose', 'export', 'fit', 'history', 'info',
            'init', 'next-experiment', 'reproduce', 'simulate', 'survey', 'trend', 'workbench')
# Commands without --model (they name a model file or a store) and without --json.
WITHOUT_MODEL, WITHOUT_JSON = ('export', 'history', 'init', 'trend'), ('workbench',)
# Without --demo, which would do nothing: about the paper's robot anyway, or about a fleet.
WITHOUT_DEMO = ('reproduce', 'survey')
NO_MODEL = ('No --model is given: the model is that of the paper\'s robot, as with --demo.\n'
            '`pprs init ROBOT.urdf RECORDING` writes the model of your robot.')
EXAMPLES = """\
examples:
  pprs init ur10e.urdf run.csv --output robot.yaml
  pprs fit free.csv --model robot.yaml --output base.yaml
  pprs diagnose run.csv --model base.yaml --report why.html
  pprs simulate --demo --output run.mcap --effect stribeck_friction
  pprs COMMAND --help
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run `pprs` and return its exit status."""
    use_one_thread()
    given = sys.argv[1:] if arguments is None else list(arguments)
    if '_ARGCOMPLETE' in os.environ:
        _complete()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=PLAIN)
    with warnings.catch_warnings(), _cleaned_up():
        warnings.showwarning = _show_warning
        return _ended(given)


def _complete() -> None:
    """Answer a shell that completes a line, where argcomplete is installed; then end."""
    with suppress(ImportError):
        import argcomplete

        argcomplete.autocomplete(_parser(os.environ.get('COMP_LINE', '').split()))


@contextmanager
def _cleaned_up() -> Iterator[None]:
    """End on SIGTERM as on an error, so that incomplete files are removed."""
    if threading.current_thread() is not threading.main_thread():  # which alone gets signals
        yield
        return
    before = signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _ended(given: Sequence[str]) -> int:
    """Run the command; what ends it early is one sentence."""
    is_assumed = False
    try:
        # Importing a command takes long enough to be interrupted.
        parser = _parser(given)
        if not given:
            parser.print_help()
            return 0
        options = parser.parse_args(given)
        options.words = given  # for the record of a page
        is_assumed = _choose_model(options)
        check_files(options)
        status: int = _module(options.command).run(options)
        if is_assumed:
            print(NO_MODEL)
    except PprsError as error:
        # Messages of other packages and files may contain control characters.
        text = displayed(error)
        if is_assumed and '`pprs init ' in text:  # the recording is of another robot
            text += "; no --model is given, and --demo takes that of the paper's robot"
        _print_error(text, given)
        return 1 if isinstance(error, MisreadError) else 2
    except KeyboardInterrupt:
        _print_error('interrupted', given)
        return 130
    except MemoryError:
        _print_error('there is not enough memory for this', given)
        return 2
    except OSError as error:
        # A full disk, a folder without permission: the name and the system's own reason.
        name = f'{displayed(error.filename)}: ' if error.filename else ''
        _print_error(f'{name}{error.strerror or str(error) or type(error).__name__}', given)
        return 2
    return status


def _choose_model(options: argparse.Namespace) -> bool:
    """Take the paper's robot if no --model is given; return whether it is only assumed."""
    if options.command in WITHOUT_MODEL or options.model is not None:
        return False
    options.model = DEFAULT_MODEL
    return not getattr(options, 'demo', False) and bool(getattr(options, 'recordings', False))


def _print_error(sentence: str, given: Sequence[str]) -> None:
    command = next((f' {word}' for word in given if word in COMMANDS), '')
    print(f'pprs{command}: {sentence}', file=sys.stderr)


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    """Print a library's warning in one line, without its place in our code."""
    print(f'pprs: warning: {" ".join(str(message).split())}', file=sys.stderr)


class OneLineParser(argparse.ArgumentParser):
    """Parser whose errors are one line without the usage, with the likely correct name."""

    def error(self, message: str) -> NoReturn:
        """End with status 2."""
        unknown = re.match(r'unrecognized arguments: (--[^\s=]+)', message)
        hint = suggestion(unknown[1], self._options()) if unknown else ''
        self.exit(2, f'{self.prog}: {message}{hint}\n')

    def _options(self) -> list[str]:
        """Return the options of the command that was called, and of this parser."""
        called = [parser for action in self._actions if isinstance(action.choices, dict)
                  for parser in action.choices.values() if parser.epilog]
        return [name for parser in (self, *called) for action in parser._actions
                for name in action.option_strings]

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Refuse a word that is no choice, and name the one that is like it."""
        if action.choices is not None and value not in action.choices:
            known = [str(choice) for choice in action.choices]
            raise argparse.ArgumentError(action, f'unknown {action.metavar or "value"} {value!r}'
                                         f'{suggestion(str(value), known)}, must be one of '
                                         f'{", ".join(known)}')


def _module(command: str) -> ModuleType:
    return import_module(f'{__package__}.{command.replace("-", "_")}')


def _summary(command: str) -> str:
    """Return the first line of a command's module, which is not imported."""
    file = Path(__file__).with_name(f'{command.replace("-", "_")}.py')
    first = (ast.get_docstring(ast.parse(file.read_text(encoding='utf-8'))) or '').splitlines()[0]
    return first.split(': ', 1)[1]


def _parser(given: Sequence[str]) -> argparse.ArgumentParser:
    """Return the parser, with the arguments of the command that is called."""
    parser = OneLineParser(
        prog='pprs', description='Compare the dynamics of a robot with measurements, find the '
        'physical effect\nthat the model lacks, add it, and see the error fall.', epilog=EXAMPLES,
        formatter_class=partial(argparse.RawDescriptionHelpFormatter, max_help_position=21))
    parser.add_argument('--version', action='version', version=f'%(prog)s {__version__}')
    commands = parser.add_subparsers(dest='command', required=True, metavar='COMMAND')
    for name in COMMANDS:
        summary = _summary(name)
        command = commands.add_parser(name, help=summary.rstrip('.'),
                                      description=summary[:1].upper() + summary[1:])
        if name not in WITHOUT_MODEL:
            model = command.add_mutually_exclusive_group()
            model.add_argument('--model', metavar='FILE', help='model file of your robot, which '
                               'pprs init writes (default: the paper\'s robot)')
            if name not in WITHOUT_DEMO:
                model.add_argument('--demo', action='store_true', help='the paper\'s robot, '
                                   f'{DEFAULT_MODEL}, without a note that no model is given')
        if name not in WITHOUT_JSON:
            command.add_argument('--json', metavar='FILE.json', type=output_file(*JSON),
                                 help='also write the result as JSON')
        if name in given:
            # Only this one: importing all would take longer than most of them run.
            module = _module(name)
            module.add_arguments(command)
            command.epilog = f'example: {module.EXAMPLE}'
    return parser


if __name__ == '__main__':
    sys.exit(main())
