# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Pages of the API: one for each folder of the package, its modules by autodoc."""

from __future__ import annotations

import ast
import inspect
from pathlib import Path

import pprs_dynamics

PACKAGE = Path(__file__).parents[1] / 'pprs_dynamics'


def modules(folder: Path) -> list[str]:
    """Return the modules right in a folder of the package, by their full names."""
    files = (file for file in sorted(folder.glob('*.py')) if file.stem != '__init__')
    return ['.'.join(file.relative_to(PACKAGE.parent).with_suffix('').parts) for file in files]


def page(folder: Path) -> str:
    """Return the page of a folder: its docstring, then every module with its members."""
    name = '.'.join(folder.relative_to(PACKAGE.parent).parts)
    what = ast.get_docstring(ast.parse((folder / '__init__.py').read_text(encoding='utf-8')))
    title = name.removeprefix('pprs_dynamics.')
    lines = [f'# {title}', '', what or '', '']
    for module in modules(folder):
        lines += [f'## {module.rsplit(".", 1)[1]}', '', '```{eval-rst}',
                  f'.. automodule:: {module}', '```', '']
    return '\n'.join(lines)


def front_page() -> str:
    """Return the page of what is imported from `pprs_dynamics` itself."""
    lines = ['# pprs_dynamics', '', pprs_dynamics.__doc__ or '', '']
    for name in pprs_dynamics.__all__:
        thing = getattr(pprs_dynamics, name)
        if not str(getattr(thing, '__module__', '')).startswith(pprs_dynamics.__name__):
            # An alias of another library's type, whose page is theirs.
            lines += [f'## {name}', '', f'`{thing}`', '']
            continue
        kind = 'autoclass' if inspect.isclass(thing) else (
            'autofunction' if callable(thing) else 'autodata')
        lines += [f'## {name}', '', '```{eval-rst}', f'.. {kind}:: pprs_dynamics.{name}',
                  '   :no-index:', '```', '']
    return '\n'.join(lines)


def write(target: Path) -> None:
    """Write the pages into a folder; pages of folders that are gone are removed."""
    target.mkdir(parents=True, exist_ok=True)
    folders = sorted(file.parent for file in PACKAGE.rglob('__init__.py')
                     if file.parent != PACKAGE and modules(file.parent))
    pages = {target / f'{".".join(folder.relative_to(PACKAGE).parts)}.md': page(folder)
             for folder in folders}
    pages[target / '_pprs_dynamics.md'] = front_page()
    for left in set(target.glob('*.md')) - pages.keys():
        left.unlink()
    for file, text in pages.items():
        # Sphinx reads again what is newer than what it made of it.
        if not file.is_file() or file.read_text(encoding='utf-8') != text:
            file.write_text(text, encoding='utf-8')
