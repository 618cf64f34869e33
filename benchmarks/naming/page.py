# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The benchmark's page: a table of every entrant, and right answers against false ones."""

from __future__ import annotations

import platform
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from benchmarks.naming.entrants import CONTROL, ENTRANTS, OURS, PART, PEER, PEERS
from benchmarks.naming.problems import Answer, Named, Truth
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
from benchmarks.results import write_results

LIBRARIES = ('pprs_dynamics', 'numpy', 'scipy', 'scikit-learn', 'skglm', 'pysindy', 'mujoco')
MAIN = ('right', 'first', 'named', 'exact', 'wrong alone', 'false alarms', 'unknown',
        'right drives', 'interval coverage')
ASKED_OF_SOME = ('right drives', 'interval coverage')  # of what an entrant names
MOST_PRINTED = 4  # entrants whose answers on real machines are printed
LESS_IS_BETTER = ('wrong alone', 'false alarms')
MARKERS = 'os^vDPX'
STRENGTHS = ((0.5, 1.0), (2.0,), (5.0, 20.0))  # of the three pictures
SHORT = {'pprs diagnose': 'pprs', 'adaptive group LASSO': 'group LASSO', 'Bayesian averaging, AR':
         'averaging', 'block cross-validation': 'block c.v.', 'held-out F-test (LISDD)': 'LISDD',
         'least squares (FIGAROH)': 'FIGAROH', 'stepwise BIC, AR': 'BIC, AR',
         'stepwise BIC, AR again': 'BIC, AR again',
         'stepwise BIC, white': 'BIC, white', 'spike and slab, AR': 'spike and slab'}


def write_page(scored: Mapping[str, Scored], real: Mapping[str, Scored], page: Path) -> None:
    """Write a page with all tables, and the picture next to it."""
    picture = page.parent / 'images' / 'naming.png'
    picture.parent.mkdir(parents=True, exist_ok=True)
    draw(scored, picture)
    write_results(page, 'The naming benchmark', 'make naming',
                  f'{tables(scored)}\n{of_real_machines(real)}\n{versions()}')


def tables(scored: Mapping[str, Scored]) -> str:
    """Return all tables in Markdown: the main one, and what it is made of, folded."""
    best = {name: scored[name] for name in best_of_settings(scored)}
    parts = alike({name: scored[name] for name in ordered(scored) if sort_of(name) in (OURS, PART)})
    most = max(len(answers) for answers in best.values())
    whole = {name: answers for name, answers in best.items() if len(answers) == most}
    lines = [*main_table(whole), '',
             *([] if len(whole) == len(best) else [
                 'On the problems that every entrant has answered:', '', *main_table(alike(best)),
                 '']), *better_than_ours(best), '',
             '![Right against false, weak, middle and strong effects](images/naming.png)', '',
             *(['This package without each of its parts:', '', *main_table(parts), '']
               if any(sort_of(name) == PART for name in parts) else []),
             *folded('Kinds of wrong answers', fails_table(best)),
             *folded('Every figure with counts, for default and tuned settings',
                     full_table(scored)),
             *folded('Exact sets of one effect, by its strength', split_table(
                 best, lambda t: f'SNR {t.snr:g}', lambda t, j: j.exact, of=SINGLE))]
    for what in ('kind', 'robot', 'noise'):
        lines += folded(f'Right answers, by {what}', split_table(
            best, lambda t, what=what: str(getattr(t, what)), lambda t, j: is_right(j)))
    return '\n'.join(lines) + '\n'


def alike(scored: Mapping[str, Scored]) -> dict[str, Scored]:
    """Return the answers to the problems that all have answered."""
    count = Counter(problem for answers in scored.values()
                    for problem in {truth.problem for truth, *_ in answers})
    return {name: [answer for answer in answers if count[answer[0].problem] == len(scored)]
            for name, answers in scored.items()}


def of_real_machines(scored: Mapping[str, Scored]) -> str:
    """Return their table in Markdown, and the first entrants' answers for each recording."""
    if not scored:
        return ''
    best = alike({name: scored[name] for name in best_of_settings(scored)})
    shown = [name for name in best if sort_of(name) != CONTROL][:MOST_PRINTED]
    lines = ['| machine | lacks | ' + ' | '.join(shown) + ' |', '|---' * (len(shown) + 2) + '|']
    for answers in zip(*(best[name] for name in shown), strict=True):
        truth = answers[0][0]
        lines.append(f'| {truth.robot} | {_named(truth.effects)} | '
                     + ' | '.join(_said(answer) for _, answer, _ in answers) + ' |')
    return '\n'.join(('## Real machines', '', *main_table(best), '', *better_than_ours(best), '',
                      *folded('Answers for each recording', lines)))


def _named(effects: Sequence[Named]) -> str:
    return ', '.join(effect.name + (f' on {" ".join(effect.drives)}' if effect.drives else '')
                     for effect in effects)


def _said(answer: Answer) -> str:
    return ' or '.join(filter(None, (
        'unknown' if answer.verdict == 'unknown' else '',
        *(_named(effects) for effects in answer.sets[:2]),
        f'{len(answer.sets) - 2} more' if len(answer.sets) > 2 else ''))) or 'nothing'


def main_table(scored: Mapping[str, Scored]) -> list[str]:
    """Return the rows of the figures that matter most: per cent (Wilson's 95 % interval)."""
    every = {name: all_figures(answers) for name, answers in scored.items()}
    counts = {figure: {found[figure].count for found in every.values()} for figure in MAIN}
    shown = [figure for figure in MAIN if counts[figure] != {0}]
    heads = [f'{figure}, of {max(counts[figure])}' if figure not in ASKED_OF_SOME else figure
             for figure in shown]
    lines = ['| entrant | ' + ' | '.join((*heads, 's')) + ' |', '|---' * (len(shown) + 2) + '|']
    for name, found in every.items():
        lines.append(f'| {name} | ' + ' | '.join(
            (*(_cell(found[figure]) for figure in shown), f'{seconds(scored[name]):.1f}')) + ' |')
    return lines


def _cell(rate: Rate) -> str:
    if not rate.count:
        return '-'
    low, high = rate.interval
    return f'{100 * rate.share:.0f} ({100 * low:.0f}-{100 * high:.0f})'


def all_figures(answers: Scored) -> dict[str, Rate]:
    """Return every figure of an entrant, those that sum others up among them."""
    return {'right': Rate.of(is_right(j) for _, _, j in answers),
            'exact': Rate.of(j.exact for _, _, j in answers), **figures(answers)}


def better_than_ours(scored: Mapping[str, Scored]) -> list[str]:
    """Return a table of the figures in which a peer is ahead of this package."""
    ours = next((name for name in scored if sort_of(name) == OURS), None)
    if ours is None:
        return []
    mine = all_figures(scored[ours])
    lines = ['| figure | this package | better peers |', '|---|---|---|']
    pairs = {name: alike({ours: scored[ours], name: answers}) for name, answers in scored.items()
             if sort_of(name) == PEER}
    rates = {name: tuple(all_figures(pair[entrant]) for entrant in (name, ours))
             for name, pair in pairs.items()}
    for figure in mine:
        sign = -1 if figure in LESS_IS_BETTER else 1
        ahead = [f'{name} ({_cell(its[figure])})' for name, (its, own) in rates.items()
                 if its[figure].count and sign * (its[figure].share - own[figure].share) > 0]
        if ahead:
            lines.append(f'| {figure} | {_cell(mine[figure])} | {", ".join(ahead)} |')
    faster = [name for name in scored if sort_of(name) == PEER
              and seconds(scored[name]) < seconds(scored[ours])]
    if faster:
        lines.append(f'| time | {seconds(scored[ours]):.1f} s | {len(faster)} of '
                     f'{sum(sort_of(name) == PEER for name in scored)} |')
    return lines


def fails_table(scored: Mapping[str, Scored]) -> list[str]:
    """Return how often an answer is wrong in which way."""
    kinds = ('right', 'all effects and others', 'some effects', 'only other effects',
             'nothing reported', '`unknown`, but in the catalogue',
             'an effect, but not in the catalogue', 'an effect, but nothing is missing',
             'ended in an error')
    lines = ['| entrant | ' + ' | '.join(kinds) + ' |', '|---' * (len(kinds) + 1) + '|']
    for name, answers in scored.items():
        found = Counter(_fails(truth, answer, judged) for truth, answer, judged in answers)
        lines.append(f'| {name} | ' + ' | '.join(str(found[kind]) for kind in kinds) + ' |')
    return lines


def _fails(truth: Truth, answer: Answer, judged: Judged) -> str:
    if answer.error:
        return 'ended in an error'
    if is_right(judged):
        return 'right'
    if truth.kind == 'nothing':
        return 'an effect, but nothing is missing'
    if answer.verdict == 'none':
        return 'nothing reported'
    if truth.kind == 'unknown':
        return 'an effect, but not in the catalogue'
    if answer.verdict == 'unknown':
        return '`unknown`, but in the catalogue'
    named, true = {effect.name for effect in answer.sets[0]}, set(truth.names)
    return ('all effects and others' if named > true else 'some effects' if named & true
            else 'only other effects')


def full_table(scored: Mapping[str, Scored]) -> list[str]:
    """Return every figure of every entrant with counts."""
    names = [name for name, *_ in FIGURES]
    lines = ['| entrant | ' + ' | '.join((*names, 'interval coverage', 'sets', 's')) + ' |',
             '|---' * (len(names) + 4) + '|']
    for entrant in ordered(scored):
        found, size = figures(scored[entrant]), set_size(scored[entrant])
        lines.append(f'| {entrant} | ' + ' | '.join(
            (*(str(found[name]) for name in names), str(found['interval coverage']),
             f'{size:g}' if size else '-', f'{seconds(scored[entrant]):.1f}')) + ' |')
    return lines


def split_table(scored: Mapping[str, Scored], by: Callable[[Truth], str],
                asked: Callable[[Truth, Judged], bool | None], of: Sequence[str] = (),
                ) -> list[str]:
    """Return a rate for each sort of problem."""
    truths = [t for t, _, _ in next(iter(scored.values())) if not of or t.kind in of]
    sorts = sorted({by(t) for t in truths}, key=lambda label: (
        float(label.split()[-1]) if label.startswith('SNR') else 0.0, label))
    lines = ['| entrant | ' + ' | '.join(sorts) + ' |', '|---' * (len(sorts) + 1) + '|']
    for name, answers in scored.items():
        lines.append(f'| {name} | ' + ' | '.join(_cell(Rate.of(
            asked(t, j) for t, _, j in answers if by(t) == sort and (not of or t.kind in of)))
            for sort in sorts) + ' |')
    return lines


def folded(title: str, lines: Iterable[str]) -> list[str]:
    """Return lines that a reader opens."""
    return [f'<details><summary>{title}</summary>', '', *lines, '', '</details>', '']


def is_right(judged: Judged) -> bool:
    """Return whether an answer is what was hidden, be it nothing or something unknown."""
    if judged.false_alarm is not None:
        return not judged.false_alarm
    return bool(judged.unknown if judged.unknown is not None else judged.exact)


def sort_of(name: str) -> str:
    """Return what an entrant is; answers that came as files are of a peer."""
    return ENTRANTS[name].sort if name in ENTRANTS else PEER


def ordered(scored: Mapping[str, Scored]) -> list[str]:
    """Return the entrants, the one with most right answers first, controls last."""
    return sorted(scored, key=lambda name: (
        sort_of(name) == CONTROL, -Rate.of(is_right(j) for _, _, j in scored[name]).share))


def best_of_settings(scored: Mapping[str, Scored]) -> list[str]:
    """Return the entrants in order, of each peer the setting with more right answers."""
    found: dict[str, str] = {}
    for name in ordered(scored):
        if sort_of(name) != PART:
            found.setdefault(_peer(name), name)
    return list(found.values())


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
    """Draw exact answers against wrong claims, for weak, middle and strong effects."""
    import matplotlib as mpl

    mpl.use('Agg')
    import matplotlib.pyplot as plt

    scored = alike({name: scored[name] for name in best_of_settings(scored)})
    names = [name for name in scored if sort_of(name) != CONTROL]
    there = {truth.snr for answers in scored.values() for truth, *_ in answers
             if truth.kind == 'single'}
    shown = [strength for strength in STRENGTHS if there & set(strength)] or STRENGTHS
    figure, panels = plt.subplots(1, len(shown), figsize=(12, 4.8), layout='constrained',
                                  sharex=True, sharey=True, squeeze=False)
    colours = plt.get_cmap('tab10')
    for axes, strengths in zip(panels[0], shown, strict=True):
        for k, name in enumerate(names):
            answers = scored[name]
            here = [(t, j) for t, _, j in answers if t.kind == 'single' and t.snr in strengths]
            wrong = Rate.of([*(j.false_alarm for _, _, j in answers),
                             *(j.wrong_alone for _, j in here)])
            right = Rate.of(j.exact for _, j in here)
            ours = sort_of(name) == OURS
            colour = 'black' if ours else colours(k % 10)
            (left, up), (low, high) = ((100 * x for x in rate.interval) for rate in (wrong, right))
            x, y = 100 * wrong.share, 100 * right.share
            axes.plot([left, up], [y, y], '-', color=colour, lw=0.6, alpha=0.35)
            axes.plot([x, x], [low, high], '-', color=colour, lw=0.6, alpha=0.35)
            axes.plot([x], [y], '*' if ours else MARKERS[k % len(MARKERS)], color=colour,
                      ms=13 if ours else 7, alpha=0.85, mec='white', mew=0.5,
                      label=SHORT.get(_peer(name), _peer(name)))
        axes.set(title='SNR ' + ', '.join(f'{snr:g}' for snr in strengths), xlim=(-3, 103),
                 ylim=(-3, 103), xlabel='claims that are wrong [%]')
        axes.grid(alpha=0.25)
    panels[0, 0].set_ylabel('one hidden effect, named exactly [%]')
    panels[0, -1].legend(fontsize=8, loc='center left', bbox_to_anchor=(1.0, 0.5), frameon=False)
    figure.savefig(picture, dpi=100)
    plt.close(figure)


def _peer(name: str) -> str:
    return next((peer for peer in PEERS if name.startswith(f'{peer}, ')), name)
