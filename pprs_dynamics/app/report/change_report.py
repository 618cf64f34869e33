# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What changed between two recordings: in the terminal and as a page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pprs_dynamics.app.report.page import Page
from pprs_dynamics.app.report.terminal import escape, stacked, text_table
from pprs_dynamics.inference.diagnosis.changed_number import ChangedNumber
from pprs_dynamics.inference.diagnosis.quantities import in_unit, with_uncertainty

HEADINGS = ('what', 'on', 'parameter', 'before', 'after', 'how sure')
SURE = 'after ± two standard deviations of the difference'


def change_view(changes: Sequence[ChangedNumber], verdict: str, before: float, after: float,
                unit: str, details: Any = None) -> Any:
    """Return what the terminal shows."""
    parts = [escape(headline(changes, verdict, before, after, unit))]
    if changes:
        parts.append(text_table(HEADINGS, [tuple(map(escape, row)) for row in rows(changes)],
                                frame='head', title=SURE))
    return stacked(*parts, *(() if details is None else (details,)))


def change_page(changes: Sequence[ChangedNumber], verdict: str, before: float, after: float,
                unit: str, recordings: Sequence[str]) -> Page:
    """Return the page."""
    page = Page('What changed')
    page.text(headline(changes, verdict, before, after, unit), 'lead')
    page.text(f'Recordings, before and after: {", ".join(recordings)}.', 'note')
    if changes:
        page.table(HEADINGS, rows(changes), caption=SURE)
    return page


def headline(changes: Sequence[ChangedNumber], verdict: str, before: float, after: float,
             unit: str) -> str:
    """Return what changed in a sentence or two."""
    names = list(dict.fromkeys(one.name for one in changes))
    if not names:
        said = 'Nothing changed that these recordings can tell'
    else:
        said = f'{", ".join(names)} changed'
    fall = (f': the model of before leaves {in_unit(before, unit)} of the recording of after, '
            f'{in_unit(after, unit)} with what changed' if names else
            f': the model of before leaves {in_unit(before, unit)} of the recording of after')
    doubt = {'ambiguous': ' Other effects explain it as well: --details.',
             'unknown': ' Something is left that no effect of the catalogue explains: --details.'}
    return f'{said}{fall}.{doubt.get(verdict, "")}'


def rows(changes: Sequence[ChangedNumber]) -> list[tuple[str, ...]]:
    """Return what changed, for a table."""
    return [(one.name, ', '.join(one.drives) if one.drives else 'structure', one.parameter,
             'none' if one.before is None else in_unit(one.before, one.unit),
             with_uncertainty(one.after, one.std, one.unit), _odds(one)) for one in changes]


def _odds(one: ChangedNumber) -> str:
    if one.before is None or not one.std > 0:
        return ''
    return f'{abs(one.after - one.before) / one.std:.1f} standard deviations'
