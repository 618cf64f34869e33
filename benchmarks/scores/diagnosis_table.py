# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What counts as right, and the table of how often it was."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import binomtest

from pprs_dynamics.drives import DRIVES

# Hidden effects whose form is the catalogue's.
SAME_FORM = ('effort_offset', 'effort_gain', 'homing_error', 'time_delay', 'drive_inertia',
             'payload_mass', 'payload_offset', 'platform_inertia', 'base_tilt')
COVERED = 1.96  # standard deviations of a 95 % interval
ALONE = 1.0  # SNR from which on an effect should be named alone
KEPT = 1.5  # of its true noise: an error that a drive keeps, and nobody was told of
SAME_FREQUENCY = 0.01  # relative error of a vibration's frequency

Outcome = Mapping[str, Any]


def judge(outcome: Outcome) -> dict[str, Any]:
    """Return what is right about an outcome; `good` is what its row of the table asks for."""
    truth, said, row = outcome['truth'], outcome['said'], outcome['row']
    true = [effect['name'] for effect in truth['effects']]
    adopted = [effect['name'] for effect in said['effects']]
    sets = [set(names) for names in said['indistinguishable'] if len(names) > 1]
    if row in ('nothing', 'width'):
        claimed = bool(adopted) or said['verdict'] != 'adequate'
        return {'claimed': claimed, 'good': not claimed}
    if row == 'vibration':
        frequency = next(iter(truth['effects'][0]['parameters'].values()))['frequency']
        told = [np.mean(line['range']) for line in said['depends_on']
                if line['variable'] == 'frequency']
        near = bool(told) and abs(told[0] / frequency - 1) <= SAME_FREQUENCY
        return {'good': said['verdict'] == 'unknown' and bool(near)}
    if row == 'unknown':
        found = said['verdict'] == 'unknown'
        right = [_is_right_variable(truth['effects'][0], line) for line in said['depends_on']]
        return {'unknown': found, 'variable_first': right[:1] == [True],
                'variable_told': any(right), 'named': adopted,
                'good': found and right[:1] == [True]}
    if row == 'pairs':
        exact = sorted(true) == sorted(adopted)
        matched = len(true) == len(adopted) and all(
            name in adopted or any(name in s and s & set(adopted) for s in sets)
            for name in true)
        return {'exact': exact, 'exact_or_set': matched, 'good': matched,
                'missed': sorted(set(true) - set(adopted)),
                'added': sorted(set(adopted) - set(true))}
    name = true[0]
    in_set = any(name in s for s in sets)
    first = adopted[:1] == [name]
    judged = {
        'first_or_set': first or in_set, 'alone_first': first and not in_set,
        'exact': adopted == [name] and said['verdict'] != 'unknown',
        'wrong_alone': bool(adopted) and name not in adopted and not in_set,
        'suspected': name in [suspect['name'] for suspect in said['suspects']],
        'set_size': max([len(s) for s in sets if name in s], default=1),
        'good': first or in_set}
    if adopted and name in SAME_FORM:
        judged['over_floor'] = said['effects'][-1]['error_after'] / truth['noise_floor']
    if name in adopted:
        found = said['effects'][adopted.index(name)]
        told = as_told(truth['effects'][0], found['drives'] or ())
        if told['drives'] is not None:
            judged['drives'] = set(found['drives']) == set(told['drives'])
        if name in SAME_FORM:
            judged['covered'] = _covered(told, found)
    best = best_fit_error(outcome)
    if best is not None and adopted:
        judged['over_best'] = said['effects'][-1]['error_after'] / best
    return judged


def as_told(true: Mapping[str, Any], drives: Sequence[str]) -> dict[str, Any]:
    """Return a true effect in the terms of an answer on some drives.

    A common shift of all three lifts' zeros moves the whole robot up and changes no force: the
    zeros of lifts can be separated only against each other, and an answer may name two of them.
    """
    silent = [lift for lift in DRIVES[3:] if lift not in drives]
    if true['name'] != 'homing_error' or not silent:
        return dict(true)
    shift = true['parameters'].get(silent[0], {}).get('zero', 0.0)
    zeros = {drive: true['parameters'].get(drive, {}).get('zero', 0.0)
             - (shift if drive in DRIVES[3:] else 0.0) for drive in DRIVES}
    return {**true, 'drives': [drive for drive in DRIVES if zeros[drive]],
            'parameters': {drive: {'zero': zero} for drive, zero in zeros.items() if zero}}


def _keeps_an_error(outcome: Outcome) -> bool:
    noise = outcome['truth']['noise_by_drive']
    return any(left > KEPT * own for left, own in zip(
        outcome['left'].values(), noise, strict=True))


def separable(outcome: Outcome) -> bool:
    """Return whether an oracle that knows drives and noise separates it from every rival."""
    return bool(outcome.get('oracle', {}).get('separable', True))


def best_fit_error(outcome: Outcome) -> float | None:
    """Return the error [N] of the best fit of the catalogue's form of the true effect, if known."""
    error = outcome.get('oracle', {}).get('best_error')
    return None if error is None else float(error)


def make_table(outcomes: Sequence[Outcome]) -> str:
    """Return the table in Markdown: figures against goals, then the failures by effect."""
    failed = [outcome for outcome in outcomes if 'failed' in outcome]
    told = [outcome for outcome in outcomes if 'failed' not in outcome]
    effects = _of(told, 'effects')
    strong = [o for o in effects if _snr(o) >= ALONE]
    lines = ['| figure | goal | found |', '|---|---|---|']

    def line(text: str, goal: str, chosen: Iterable[Outcome], what: str | Callable[..., bool],
             ) -> None:
        known = [o for o in chosen if callable(what) or what in o['judged']]
        if known:
            hits = sum(bool(what(o) if callable(what) else o['judged'][what]) for o in known)
            lines.append(f'| {text} | {goal} | {share(hits, len(known))} |')

    line('true effect first or in the named set, SNR ≥ 1', '≥ 98 %', strong, 'first_or_set')
    line('the same, SNR 0.5', '≥ 90 %', [o for o in effects if _snr(o) == 0.5], 'first_or_set')
    line('the same, SNR 0.25', '', [o for o in effects if _snr(o) == 0.25], 'first_or_set')
    line('alone and first, SNR ≥ 1, separable', '≥ 90 %',
         [o for o in strong if separable(o)], 'alone_first')
    line('exactly the true effect, nothing added, SNR ≥ 1', '', strong, 'exact')
    line('a wrong effect alone, any SNR', '≤ 1 %', effects, 'wrong_alone')
    for noise in sorted({_case(o)['noise'] for o in _of(told, 'nothing')}, key=str):
        line(f'nothing missing, noise {noise}: claimed', '≤ 5 %',
             [o for o in _of(told, 'nothing') if _case(o)['noise'] == noise], 'claimed')
    for width in sorted({_case(o)['width'] for o in _of(told, 'width')}):
        line(f'nothing missing, reversal width {width:g} x: claimed', '≤ 5 %',
             [o for o in _of(told, 'width') if _case(o)['width'] == width], 'claimed')
    line('nothing missing, reversal width 0.2 to 5 x: claimed', '≤ 5 %', _of(told, 'width'),
         'claimed')
    for periodic, word in ((True, 'a periodic multisine'), (False, 'a random motion')):
        line(f'{word}, SNR ≥ 1: first or in the named set', '≥ 98 %',
             [o for o in strong if bool(o['truth']['motion']['period']) is periodic],
             'first_or_set')
    line('right drives, SNR ≥ 1', '≥ 95 %', strong, 'drives')
    for size, word, goal in ((2, 'two', '≥ 85 %'), (3, 'three', '≥ 75 %')):
        chosen = [o for o in _of(told, 'pairs') if len(o['truth']['effects']) == size]
        line(f'exact set for {word} effects, SNR ≥ 1 each', goal, chosen, 'exact')
        line(f'the same, named sets counted for {word} effects', '', chosen, 'exact_or_set')
    forms = _of(told, 'forms')
    line('form 5 to 15 % off, SNR 10: first or in the named set', '', forms, 'first_or_set')
    line('the same: exactly the true effect, nothing added', '≥ 80 %', forms, 'exact')
    line('the same: a wrong effect alone', '', forms, 'wrong_alone')
    line('not in the catalogue, SNR ≥ 1: unknown, right variable', '≥ 90 %',
         _of(told, 'unknown'), 'good')
    line('the same: unknown', '', _of(told, 'unknown'), 'unknown')
    line('vibration of 0.3 to 50 Hz, SNR ≥ 1: unknown, frequency within 1 %', '≥ 95 %',
         _of(told, 'vibration'), 'good')
    line('verdict effect or adequate while a drive keeps more than 1.5 times its true noise', '0',
         [o for o in told if 'left' in o and o['row'] != 'forms'
          and o['said']['verdict'] in ('effect', 'adequate')],
         _keeps_an_error)
    line("error after / best fit of the catalogue's form at most 1.02, SNR ≥ 1", '',
         [o for o in strong if 'over_best' in o['judged']],
         lambda o: o['judged']['over_best'] <= 1.02)
    for noise in sorted({_case(o)['noise'] for o in _of(told, 'slow')}):
        slow = [o for o in _of(told, 'slow') if _case(o)['noise'] == noise]
        line(f'noise {noise}, SNR ≥ 1: first or in the named set', '', slow, 'first_or_set')
        line(f'noise {noise}, SNR ≥ 1: first, in the set or a suspect', '', slow,
             lambda o: o['judged']['first_or_set'] or o['judged']['suspected'])
        line(f'noise {noise}, SNR ≥ 1: a wrong effect alone', '', slow, 'wrong_alone')
    lines += _ratios(strong)
    if told:
        seconds = [o['seconds'] for o in told]
        lines.append(f'| seconds per recording, median and largest | < 5 | '
                     f'{np.median(seconds):.1f}, {max(seconds):.1f} |')
    if failed:
        lines.append(f'| cases that ended in an error | 0 | {len(failed)} |')
    return '\n'.join(lines) + '\n' + _by_effect(told)


def share(hits: int, count: int) -> str:
    """Return a share with its count and Wilson's 95 % interval."""
    low, high = binomtest(hits, count).proportion_ci(method='wilson')
    return f'{100 * hits / count:.1f} % ({hits}/{count}; {100 * low:.1f}-{100 * high:.1f} %)'


def _ratios(strong: Sequence[Outcome]) -> list[str]:
    lines = []
    for key, text, goal in (('over_best', "error after / best fit of the catalogue's form, "
                             'SNR ≥ 1: median, 95th percentile', '≤ 1.02'),
                            ('over_floor', "error after / noise floor, catalogue's form: median, "
                             '95th percentile', '≤ 1.05')):
        values = [o['judged'][key] for o in strong if key in o['judged']]
        if values:
            lines.append(f'| {text} | {goal} | {np.median(values):.3f}, '
                         f'{np.percentile(values, 95):.3f} |')
    covered = [flag for o in strong for flag in o['judged'].get('covered', ())]
    if covered:
        lines.append("| 95 % intervals that contain the truth, catalogue's form | 90-98 % | "
                     f'{share(sum(covered), len(covered))} |')
    return lines


def _by_effect(told: Sequence[Outcome]) -> str:
    """Return, per hidden effect, how often it was found and what was said instead."""
    text = []
    for row in ('effects', 'slow', 'unknown'):
        chosen = _of(told, row)
        levels = sorted({_snr(o) for o in chosen})
        if not chosen:
            continue
        names = list(dict.fromkeys(o['truth']['effects'][0]['name'] for o in chosen))
        text += ['', f'Found ({row}), per effect and SNR, and what was said instead:', '',
                 '| effect | ' + ' | '.join(f'{level:g}' for level in levels) + ' | instead |',
                 '|---' * (len(levels) + 2) + '|']
        for name in names:
            own = [o for o in chosen if o['truth']['effects'][0]['name'] == name]
            cells = []
            for level in levels:
                at = [o for o in own if _snr(o) == level]
                cells.append(f'{sum(o["judged"]["good"] for o in at)}/{len(at)}')
            text.append(f'| {name} | {" | ".join(cells)} | {_instead(own)} |')
    for row in ('nothing', 'width', 'pairs'):
        bad = [o for o in _of(told, row) if not o['judged']['good']]
        if bad:
            text += ['', f'Wrong ({row}): {_instead(bad)}']
    return '\n'.join(text) + '\n'


def _instead(chosen: Iterable[Outcome]) -> str:
    counts: dict[str, int] = {}
    for outcome in chosen:
        if not outcome['judged']['good']:
            said = outcome['said']
            words = ' + '.join(effect['name'] for effect in said['effects']) or said['verdict']
            if outcome['row'] == 'pairs':
                words = (' + '.join(e['name'] for e in outcome['truth']['effects'])
                         + f' as {words}')
            counts[words] = counts.get(words, 0) + 1
    ranked = sorted(counts.items(), key=lambda pair: -pair[1])
    return ', '.join(f'{words} {count} x' for words, count in ranked)


def _is_right_variable(effect: Mapping[str, Any], line: Mapping[str, Any]) -> bool:
    own = effect['drives'] is None or line['drive'] in effect['drives']
    parameters = effect['parameters']
    if effect['name'] == 'drive_coupling':
        sources = {DRIVES[int(parameters[drive]['source'])] for drive in effect['drives']}
        return own and line['variable'] in {f'velocity of {source}' for source in sources}
    variable = {'local_bump': 'position', 'vibration': 'frequency', 'payload_pick_up': 'time'}
    return own and line['variable'] == variable[effect['name']]


def _covered(true: Mapping[str, Any], found: Mapping[str, Any]) -> list[bool]:
    """Return, for each parameter that both know, whether its interval contains the truth."""
    return [bool(abs(estimate['value'] - value) <= COVERED * estimate['std'])
            for key, value in catalogue_parameters(true).items()
            for told, estimate in found['parameters'].items()
            if (told == key or told.endswith(f'.{key}')) and estimate['std'] is not None]


def catalogue_parameters(true: Mapping[str, Any]) -> dict[str, float]:
    """Return the true parameters of an effect of `SAME_FORM` as the catalogue calls them."""
    parameters = true['parameters']
    if true['name'] == 'platform_inertia':
        I, c, s = parameters['inertia'], np.cos(parameters['angle']), np.sin(parameters['angle'])  # noqa: E741
        return {'xx': I * s * s, 'yy': I * c * c, 'zz': I, 'xy': -I * c * s}
    if true['drives'] is None:
        return dict(parameters)
    return {f'{drive}.{key}': value for drive, own in parameters.items()
            for key, value in own.items()}


def _case(outcome: Outcome) -> Mapping[str, Any]:
    case: Mapping[str, Any] = outcome['truth']['case']
    return case


def _snr(outcome: Outcome) -> float:
    return float(_case(outcome)['snr'])


def _of(told: Iterable[Outcome], row: str) -> list[Outcome]:
    return [outcome for outcome in told if outcome['row'] == row]
