# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Write the table of commands and options in docs/commands.md: python docs/command_table.py."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

from page_block import replace_block

from pprs_dynamics.app.commands.pprs import COMMANDS

PAGE = Path(__file__).parent / 'commands.md'
BEGIN, END = '<!-- options: written by docs/command_table.py -->', '<!-- end of options -->'


def parser_of(command: str) -> argparse.ArgumentParser:
    """Return the parser of one command."""
    module = import_module(f'pprs_dynamics.app.commands.{command.replace("-", "_")}')
    parser = argparse.ArgumentParser(prog=f'pprs {command}', description=module.__doc__)
    module.add_arguments(parser)
    return parser


def rows(command: str) -> Iterator[str]:
    """Yield one row for each argument of a command."""
    for action in parser_of(command)._actions:
        if isinstance(action, argparse._HelpAction) or action.help == argparse.SUPPRESS:
            continue
        name = ', '.join(action.option_strings) or action.metavar or action.dest
        if action.option_strings and action.nargs != 0:
            name += f' {action.metavar or action.dest.upper()}'
        text = re.sub(r'\s+', ' ', action.help or '').replace('|', r'\|')
        yield f'| `{name}` | {text % vars(action)} |'


def table() -> str:
    """Return a section for each command, in Markdown."""
    sections = []
    for command in COMMANDS:
        first = (parser_of(command).description or '').partition('\n')[0].partition(': ')[2]
        sections.append('\n'.join([f'### pprs {command}', '',
                                   first[:1].upper() + first[1:], '',
                                   '| argument | meaning |', '|---|---|', *rows(command)]))
    return '\n\n'.join(sections)


if __name__ == '__main__':
    replace_block(PAGE, BEGIN, END, table())
