# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""One self-contained HTML page: text, tables and Plotly figures that need no network."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import cache
from html import escape
from importlib.resources import files
from os import PathLike
from pathlib import Path
from typing import Any

from pprs_dynamics.inference.diagnosis.quantities import measured
from pprs_dynamics.system.files import write_text
from pprs_dynamics.system.plain_text import PLAIN

HEIGHT = 320  # [px], of figures without a height
# plotly.js 4.1.1 with lines, bars and markers only: it starts four times as fast as the whole.
BASIC = 'plotly-basic.min.js.gz'
# uPlot 1.6.32, for the workbench.
CURVES, CURVES_STYLE = 'uplot.iife.min.js.gz', 'uplot.min.css'


@dataclass(frozen=True)
class ErrorRow:
    """One row of a table of errors with bars.

    Parameters
    ----------
    label : str
    before : float
        Root of the mean square [N].
    after : float, optional
        [N]
    noise : float, optional
        [N]
    """

    label: str
    before: float
    after: float | None = None
    noise: float | None = None


class Page:
    """Collects sections from top to bottom. Text from files is escaped here, and only here.

    Figures are drawn by the browser when they are scrolled to.

    Parameters
    ----------
    title : str
    """

    def __init__(self, title: str) -> None:
        self._title = title
        self._body: list[str] = []
        self._figures = 0
        self._menus = 0

    def heading(self, text: str) -> None:
        """Start a section."""
        self._body.append(f'<h2>{escape(text)}</h2>')

    def fold(self, title: str, is_open: bool = False) -> AbstractContextManager[None]:
        """Put the content of the block behind a title that opens it."""
        return self._around(f'<details{" open" * is_open}><summary>{escape(title)}</summary>',
                            '</details>')

    def columns(self) -> AbstractContextManager[None]:
        """Put the content of the block side by side on wide screens."""
        return self._around('<div class="columns">', '</div>')

    def block(self) -> AbstractContextManager[None]:
        """Put the content of the block into one column."""
        return self._around('<div>', '</div>')

    @contextmanager
    def _around(self, start: str, end: str) -> Iterator[None]:
        self._body.append(start)
        yield
        self._body.append(end)

    def text(self, text: str, kind: str = '') -> None:
        """Add a paragraph; `kind` is '', 'lead' or 'note'."""
        self._body.append(f'<p class="{kind}">{escape(text)}</p>')

    def sources(self, model: str, recordings: Iterable[str], held_out: Sequence[str] = ()) -> None:
        """Add the names of the model and of the recordings."""
        held = f' Held out: {", ".join(held_out)}.' if held_out else ''
        self.text(f'Model: {Path(model).name or "built in memory"}. Recordings: '
                  f'{", ".join(recordings)}.{held}', 'note')

    def command(self, text: str, command: str) -> None:
        """Add the next step, with a command that can be copied."""
        code = (f'<div class="command"><code>{escape(command)}</code>'
                '<button type="button">Copy</button></div>') if command else ''
        self._body.append(f'<section class="next" aria-label="Next step"><p><b>Next:</b> '
                          f'{escape(text)}{":" if command else "."}</p>{code}</section>')

    def record(self, lines: Iterable[tuple[str, str]]) -> None:
        """Add the record of the page: labelled lines behind a title."""
        self.heading('Record')
        with self.fold('Date, version, command and files'):
            self._body.append(f'<dl class="record">{_terms(lines)}</dl>')

    def bullets(self, lines: Iterable[str], numbered: bool = False) -> None:
        """Add a list."""
        tag = 'ol' if numbered else 'ul'
        items = ''.join(f'<li>{escape(line)}</li>' for line in lines)
        self._body.append(f'<{tag}>{items}</{tag}>')

    def folded_list(self, title: str, lines: Sequence[str], is_open: bool = False) -> None:
        """Add a list behind a title that opens it, if there is anything in it."""
        if lines:
            with self.fold(title, is_open):
                self.bullets(lines)

    def table(
        self, headings: Sequence[str], rows: Iterable[Sequence[str]],
        grades: Sequence[str] = (), caption: str = '',
    ) -> None:
        """Add a table; `grades` colour the rows' first cells, the last column is text."""
        body = []
        for number, row in enumerate(rows):
            grade = escape(grades[number]) if grades else ''
            cells = [f'<th scope="row" class="{grade}">{escape(row[0])}</th>',
                     *(f'<td>{escape(cell)}</td>' for cell in row[1:-1]),
                     f'<td class="text">{escape(row[-1])}</td>']
            body.append(f'<tr>{"".join(cells)}</tr>')
        self._table('', caption, headings, body)

    def _table(self, kind: str, caption: str, headings: Iterable[str], rows: Iterable[str]) -> None:
        head = ''.join(f'<th scope="col">{escape(heading)}</th>' for heading in headings)
        title = f'<caption><span>{escape(caption)}</span></caption>' if caption else ''
        self._body.append(f'<div class="scroll"><table{kind}>{title}<thead><tr>{head}</tr></thead>'
                          f'<tbody>{"".join(rows)}</tbody></table></div>')

    def errors(self, rows: Sequence[ErrorRow], caption: str,
               headings: tuple[str, str] = ('before', 'after')) -> None:
        """Add a table of errors [N], each with a bar to one scale."""
        largest = max((value for row in rows for value in (row.before, row.after, row.noise)
                       if value is not None and value == value), default=0.0) or 1.0
        names = ['error'] if all(row.after is None for row in rows) else [*headings]
        noisy = any(row.noise is not None for row in rows)
        body = []
        for row in rows:
            shown = [('before', row.before), *[('after', row.after)] * (len(names) > 1),
                     *[('noise', row.noise)] * noisy]
            cells = ''.join(f'<td>{_force(value)}</td>' for _, value in shown)
            bar = ''.join(_bar(kind, value / largest) for kind, value in shown
                          if value is not None and value == value)
            body.append(f'<tr><th scope="row">{escape(row.label)}</th>{cells}'
                        f'<td><span class="bar" aria-hidden="true">{bar}</span></td></tr>')
        self._table(' class="errors"', caption, ('', *names, *['noise'] * noisy, ''), body)

    def menu(self, label: str, names: Sequence[str], chosen: str) -> None:
        """Add a choice of the drive that figures show; all menus of a page go together.

        It rules traces whose `meta` is {'drive': NAME}.
        """
        self._menus += 1
        options = ''.join(f'<option{" selected" * (name == chosen)}>{escape(name)}</option>'
                          for name in names)
        self._body.append(f'<p><label for="menu-{self._menus}">{escape(label)}</label> '
                          f'<select data-menu id="menu-{self._menus}">{options}</select></p>')

    def figure(self, figure: Any, caption: str = '', over_time: bool = False) -> None:
        """Add a Plotly figure; those over time share the span shown and the cursor."""
        self._body.append(self._drawn(figure, caption, over_time))

    def card(self, lines: Iterable[tuple[str, str]], figures: Iterable[tuple[Any, str]] = (),
             ) -> None:
        """Add a framed finding: labelled lines, and figures with captions below them."""
        drawn = ''.join(self._drawn(figure, caption, False) for figure, caption in figures)
        self._body.append(f'<section class="card"><dl>{_terms(lines)}</dl>'
                          f'<div class="columns">{drawn}</div></section>')

    def _drawn(self, figure: Any, caption: str, over_time: bool) -> str:
        from plotly.utils import PlotlyJSONEncoder

        self._figures += 1
        name = f'figure-{self._figures}'
        content = figure.to_plotly_json()
        layout = content['layout']
        layout.pop('template', None)  # the page's own colours are set in the browser
        height = layout.get('height') or HEIGHT
        data = json.dumps({'data': content['data'], 'layout': layout}, cls=PlotlyJSONEncoder,
                          separators=(',', ':'))
        return (f'<figure><div class="plot" id="{name}" role="img" tabindex="0" '
                f'aria-label="{escape(caption or "Figure", quote=True)}" '
                f'style="height:{height}px"{" data-time" * over_time}></div>'
                + (f'<figcaption>{escape(caption)}</figcaption>' if caption else '')
                + f'{_data(f"{name}-data", data)}</figure>')

    def html(self) -> str:
        """Return the page as HTML with its styles, scripts and data."""
        library = ''
        if self._figures:
            packed = files('pprs_dynamics.app.report').joinpath(BASIC).read_bytes()
            letters = base64.b64encode(packed).decode()
            library = f'<script type="text/plain" id="plotly">{letters}</script>'
        return ('<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
                '<meta name="viewport" content="width=device-width, initial-scale=1">'
                f'<title>{escape(self._title)}</title><style>{asset("page.css")}</style>'
                f'</head><body><header><h1>{escape(self._title)}</h1></header>'
                f'<main>{"".join(self._body)}</main>'
                f'{library}<script>{asset("page.js")}</script></body></html>\n')

    def write(self, path: str | PathLike[str]) -> Path:
        """Write the page to a file, whole or not at all.

        Raises
        ------
        UnreadableFileError
            Where it cannot be written.
        """
        # Names of files may contain bytes that are no text.
        write_text(path, self.html().encode(errors=PLAIN).decode())
        return Path(path)


def _data(name: str, content: str) -> str:
    """Return JSON for a script element, with end tags escaped."""
    safe = content.replace('<', '\\u003c')
    return f'<script type="application/json" id="{name}">{safe}</script>'


def _terms(lines: Iterable[tuple[str, str]]) -> str:
    """Return labelled lines as a list of terms."""
    return ''.join(f'<dt>{escape(label)}</dt><dd>{escape(text)}</dd>' for label, text in lines)


def _bar(kind: str, share: float) -> str:
    place = 'left' if kind == 'noise' else 'width'
    return f'<i class="{kind}" style="{place}:{100 * share:.1f}%"></i>'


def _force(value: float | None) -> str:
    return '' if value is None or value != value else measured(value)


@cache
def assets() -> frozenset[str]:
    """Return the names of what `asset` has."""
    return frozenset(file.name for file in files('pprs_dynamics.app').joinpath('browser').iterdir())


@cache
def asset(name: str) -> str:
    """Return a style or a script of the package's pages."""
    return files('pprs_dynamics.app').joinpath('browser', name).read_text(encoding='utf-8')


@cache
def vendored(name: str) -> str:
    """Return a library's style or script."""
    content = files('pprs_dynamics.app.report').joinpath(name).read_bytes()
    return (gzip.decompress(content) if name.endswith('.gz') else content).decode()
