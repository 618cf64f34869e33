# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The benchmark's page: a table of every entrant, and right answers against false ones."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from benchmarks.naming.scoring import (
    FIGURES,
    SINGLE,
    Judged,
    Rate,
    Scored,
    figures,
    seconds,
    set_size,
)

LIBRARIES = ('pprs_dynamics', 'numpy', 'scipy', 'scikit-learn', 'skglm', 'pysindy', 'mujoco')
BEGIN, END = '<!-- figures: made by make naming -->', '<!-- end of figures -->'
CONTROLS = ('silent', 'random')


def write_page(scored: Mapping[str, Scored], page: Path) -> None:
    """Put the figures into a page, between its marks, and the picture beside it."""
    picture = page.parent / 'images' / 'naming.png'
    picture.parent.mkdir(parents=True, exist_ok=True)
    draw(scored, picture)
    text = page.read_text() if page.exists() else f'# The naming benchmark\n\n{BEGIN}\n{END}\n'
    before, _, rest = text.partition(BEGIN)
    after = rest.partition(END)[2]
    page.write_text(f'{before}{BEGIN}\n{tables(scored)}\n![Right and wrong answers of every '
                    f'entrant](images/naming.png)\n\n{versions()}\n{END}{after}')


def tables(scored: Mapping[str, Scored]) -> str:
    """Return the tables in Markdown: every figure, and by robot, strength and noise."""
    names = [name for name, *_ in FIGURES]
    lines = ['| entrant | ' + ' | '.join((*names, 'intervals hold', 'sets', 's')) + ' |',
             '|---' * (len(names) + 4) + '|']
    for entrant in ordered(scored):
        found, size = figures(scored[entrant]), set_size(scored[entrant])
        lines.append(f'| {entrant} | ' + ' | '.join(
            (*(str(found[name]) for name in names), str(found['intervals hold']),
             f'{size:g}' if size else '-', f'{seconds(scored[entrant]):.1f}')) + ' |')
    lines += ['', 'Exact sets of one effect, by its strength:', '']
    strengths = sorted({t.snr for answers in scored.values() for t, _, _ in answers if t.snr})
    lines += ['| entrant | ' + ' | '.join(f'SNR {snr:g}' for snr in strengths) + ' |',
              '|---' * (len(strengths) + 1) + '|']
    for entrant in ordered(scored):
        lines.append(f'| {entrant} | ' + ' | '.join(str(Rate.of(
            j.exact for t, _, j in scored[entrant] if t.kind in SINGLE and t.snr == snr))
            for snr in strengths) + ' |')
    for what in ('robot', 'noise'):
        kinds = sorted({getattr(t, what) for answers in scored.values() for t, _, _ in answers})
        lines += ['', f'Right answers of all kinds, by {what}:', '',
                  '| entrant | ' + ' | '.join(kinds) + ' |', '|---' * (len(kinds) + 1) + '|']
        for entrant in ordered(scored):
            lines.append(f'| {entrant} | ' + ' | '.join(str(Rate.of(
                is_right(j) for t, _, j in scored[entrant] if getattr(t, what) == kind))
                for kind in kinds) + ' |')
    return '\n'.join(lines) + '\n'


def is_right(judged: Judged) -> bool:
    """Return whether an answer is what was hidden, be it nothing or something unknown."""
    if judged.false_alarm is not None:
        return not judged.false_alarm
    return bool(judged.unknown if judged.unknown is not None else judged.exact)


def ordered(scored: Mapping[str, Scored]) -> list[str]:
    """Return the entrants, the one with most right answers first, controls last."""
    return sorted(scored, key=lambda name: (
        name in CONTROLS, -Rate.of(is_right(j) for _, _, j in scored[name]).share))


def versions() -> str:
    """Return what was run."""
    found = []
    for library in LIBRARIES:
        try:
            found.append(f'{library} {version(library)}')
        except PackageNotFoundError:
            continue
    return f'Python {platform.python_version()}, ' + ', '.join(found) + '.\n'


def draw(scored: Mapping[str, Scored], picture: Path) -> None:
    """Draw named effects against false claims, an arrow from weak to strong effects."""
    import matplotlib as mpl

    mpl.use('Agg')
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(8.5, 5.2), layout='constrained')
    colours = plt.get_cmap('tab20')
    for k, entrant in enumerate(ordered(scored)):
        answers = scored[entrant]
        wrong = Rate.of(one for _, _, j in answers for one in (j.false_alarm, j.wrong_alone))
        weak, strong = (Rate.of(j.named for t, _, j in answers
                                if t.kind == 'single' and (t.snr > 1) is strong)
                        for strong in (False, True))
        colour = 'black' if k == 0 else colours(k % 20)
        x = 100 * wrong.share
        axes.plot([x, x], [100 * weak.share, 100 * strong.share], '-', color=colour, lw=1.5)
        axes.plot([x], [100 * weak.share], 'o', mfc='white', color=colour)
        axes.plot([x], [100 * strong.share], 'o', color=colour, label=entrant)
    axes.set(xlabel='claims that are wrong: false alarms and wrong effects told for sure [%]',
             ylabel='the hidden effect is named [%]', xlim=(-3, 103), ylim=(-3, 103),
             title='Naming one hidden effect: weak (open, SNR ≤ 1) and strong (filled)')
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, loc='center left', bbox_to_anchor=(1.0, 0.5))
    figure.savefig(picture, dpi=110)
    plt.close(figure)
