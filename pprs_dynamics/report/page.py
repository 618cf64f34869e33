"""One self-contained HTML page: text, tables and Plotly figures that need no network."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from os import PathLike
from pathlib import Path
from typing import Any

from pprs_dynamics.errors import MissingLibraryError
from pprs_dynamics.model.atomic_file import write_text
from pprs_dynamics.plain_text import PLAIN

_STYLE = '''
body { font: 16px/1.5 system-ui, sans-serif; color: #1a1a1a; margin: 0 auto; max-width: 1180px;
       padding: 1.5rem; }
h1 { font-size: 1.7rem; margin: 0 0 .3rem; } h2 { font-size: 1.25rem; margin: 2.2rem 0 .4rem; }
p { margin: .3rem 0; max-width: 60rem; } .note { color: #555; }
.lead { font-size: 1.1rem; } li { margin: .25rem 0; }
table { border-collapse: collapse; margin: .6rem 0; font-variant-numeric: tabular-nums; }
th, td { padding: .3rem .8rem; border-bottom: 1px solid #ddd; text-align: right; }
th:first-child, td:first-child, th:last-child { text-align: left; }
th { border-bottom: 2px solid #888; font-weight: 600; }
td.text { text-align: left; max-width: 34rem; } td.poor { background: #fbe3dc; }
.card { border: 1px solid #ddd; border-left: 4px solid #0072B2; border-radius: 4px;
        margin: 1rem 0; padding: .4rem 1rem; }
.card h3 { font-size: 1.05rem; margin: .3rem 0; }
dl { display: grid; grid-template-columns: 6.5rem 1fr; gap: .25rem .8rem; margin: .4rem 0; }
dt { font-weight: 600; color: #555; } dd { margin: 0; max-width: 54rem; }
td.fair { background: #fdf3d8; } td.good, td.noise { background: #e3f1e6; }
'''


def plotly_objects() -> Any:
    """Return plotly.graph_objects, or raise MissingLibraryError."""
    try:
        from plotly import graph_objects
    except ImportError:
        raise MissingLibraryError('plotly', 'the report', 'report') from None
    return graph_objects


class Page:
    """Collects sections from top to bottom. Text from files is escaped here, and only here.

    Parameters
    ----------
    title : str
    """

    def __init__(self, title: str) -> None:
        self._title = title
        self._body = [f'<h1>{escape(title)}</h1>']
        self._figures = 0

    def heading(self, text: str) -> None:
        """Start a section."""
        self._body.append(f'<h2>{escape(text)}</h2>')

    def text(self, text: str, kind: str = '') -> None:
        """Add a paragraph; `kind` is '', 'lead' or 'note'."""
        self._body.append(f'<p class="{kind}">{escape(text)}</p>')

    def bullets(self, lines: Iterable[str], numbered: bool = False) -> None:
        """Add a list."""
        tag = 'ol' if numbered else 'ul'
        items = ''.join(f'<li>{escape(line)}</li>' for line in lines)
        self._body.append(f'<{tag}>{items}</{tag}>')

    def table(
        self, headings: Sequence[str], rows: Iterable[Sequence[str]],
        grades: Sequence[str] = (),
    ) -> None:
        """Add a table; `grades` colour the rows' first cells, the last column is text."""
        head = ''.join(f'<th>{escape(heading)}</th>' for heading in headings)
        body = []
        for number, row in enumerate(rows):
            grade = escape(grades[number]) if grades else ''
            cells = [f'<td class="{grade}">{escape(row[0])}</td>',
                     *(f'<td>{escape(cell)}</td>' for cell in row[1:-1]),
                     f'<td class="text">{escape(row[-1])}</td>']
            body.append(f'<tr>{"".join(cells)}</tr>')
        self._body.append(f'<table><tr>{head}</tr>{"".join(body)}</table>')

    def figure(self, figure: Any) -> None:
        """Add a Plotly figure."""
        self._body.append(self._drawn(figure))

    def card(self, title: str, lines: Iterable[tuple[str, str]], figure: Any = None) -> None:
        """Add a framed finding: labelled lines, and a Plotly figure below them."""
        terms = ''.join(f'<dt>{escape(label)}</dt><dd>{escape(text)}</dd>'
                        for label, text in lines)
        picture = '' if figure is None else self._drawn(figure)
        self._body.append(f'<section class="card"><h3>{escape(title)}</h3><dl>{terms}</dl>'
                          f'{picture}</section>')

    def _drawn(self, figure: Any) -> str:
        self._figures += 1
        drawn: str = figure.to_html(
            full_html=False, include_plotlyjs=False, div_id=f'figure-{self._figures}',
            config={'displaylogo': False, 'responsive': True})
        return drawn

    def html(self) -> str:
        """Return the page."""
        from plotly.offline import get_plotlyjs

        return ('<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
                '<meta name="viewport" content="width=device-width, initial-scale=1">'
                f'<title>{escape(self._title)}</title><style>{_STYLE}</style>'
                f'<script>{get_plotlyjs()}</script></head><body>{"".join(self._body)}'
                '</body></html>\n')

    def write(self, path: str | PathLike[str]) -> Path:
        """Write the page to a file, whole or not at all.

        Raises
        ------
        UnreadableFileError
            Where it cannot be written.
        """
        # Names of files may hold bytes that are no text.
        write_text(path, self.html().encode(errors=PLAIN).decode())
        return Path(path)
