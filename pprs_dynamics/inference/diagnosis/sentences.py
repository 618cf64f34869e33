# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A diagnosis in plain sentences; terminal and page only lay them out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isnan
from types import MappingProxyType

from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.inference.diagnosis.diagnosis import (
    Diagnosis,
    FoundEffect,
    RankedSet,
    RivalEffect,
    SinceReference,
)
from pprs_dynamics.inference.diagnosis.next_step import PLACEHOLDERS, GivenFiles, next_step
from pprs_dynamics.inference.diagnosis.quantities import (
    INTERVAL,
    as_fitted,
    change,
    in_fitting_unit,
    in_unit,
    listed,
    plain,
    sentence,
    with_drives,
    with_uncertainty,
    word_little,
)
from pprs_dynamics.inference.diagnosis.statements import (
    Statement,
    describe_unexplained,
    pattern_over,
    place_on,
)
from pprs_dynamics.inference.search.candidates import CostTerms
from pprs_dynamics.inference.search.estimates import Estimate, FittedNumber
from pprs_dynamics.physics.effects.catalogue import catalogue
from pprs_dynamics.physics.effects.drive_effect import MeasurementEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect

MOST_LISTED = 2  # drives whose values a sentence gives
LEAST_TERM = 0.05  # of a cost, that one digit shows
WHOLE = 20  # difference of costs from which it is rounded to a whole number
VAGUE = 0.1  # relative uncertainty of a mass, beyond which its first moment is given if surer
MOSTLY = 0.95  # of a recording, from which on a reference covers its states
HARDLY = 0.5  # of a recording, below which it covers too few of them to date an effect
# Ratio of speeds beyond which lags depend on the speed: at half the speed a real arm shows delays
# of up to 70 ms that it has not; a program repeats its own speeds to hundredths.
ALIKE_PACE = 1.25
COMMON = ('payload_mass', 'coulomb_friction', 'viscous_friction')  # named as detectable
LEAST_SHARE = 0.005  # of an error, which is printed as 1 %
MOST_PLACES = 2  # of an unexplained error in the headline
AT_NOISE = 1.05  # an error up to this multiple of the noise is the noise


@dataclass(frozen=True)
class Finding:
    """One finding in words.

    Parameters
    ----------
    title : str
    what, why, cause, confirm : str
        What is missing, the evidence, possible causes, how to confirm it.
    mark : str
        How it shows in the error.
    remarks : tuple of str
    """

    title: str
    what: str
    why: str
    cause: str
    confirm: str
    mark: str = ''
    remarks: tuple[str, ...] = ()


class Sentences:
    """A diagnosis in words.

    Parameters
    ----------
    diagnosis : Diagnosis
    files : GivenFiles, optional
        For the next command.
    rivals : sequence of RivalEffect, optional
        As `rival_effects` returns them.

    Attributes
    ----------
    headline : str
        The verdict, at most two sentences.
    effects, rivals, unexplained : tuple of Finding
        In the order of `Diagnosis.effects`, of the given rivals, and of `unexplained_groups`.
    suspects, refuted, calibrated : tuple of str
    following, command : str
        What to do next, in words and for a shell.
    reference : tuple of str
        What a reference run covers; none without one.
    """

    def __init__(self, diagnosis: Diagnosis, files: GivenFiles = PLACEHOLDERS,
                 rivals: Sequence[RivalEffect] = ()) -> None:
        self.headline, drives = _headline(diagnosis), diagnosis.residuals.drives
        if diagnosis.since and diagnosis.since.covered >= HARDLY:
            self.headline = (f'Since {listed(diagnosis.since.recordings)}: '
                             f'{self.headline[:1].lower()}{self.headline[1:]}')
        self.effects = tuple(_effect(diagnosis, effect) for effect in diagnosis.effects)
        self.rivals = tuple(_rival(diagnosis, rival) for rival in rivals)
        self.unexplained = tuple(Finding(*describe_unexplained(group))
                                 for group in unexplained_groups(diagnosis))
        self.suspects = tuple(
            f'{with_drives(suspect.name, suspect.drives, drives)}: possible, but it costs '
            f'{-suspect.evidence:.1f} more than it explains. A longer recording decides'
            for suspect in diagnosis.suspects)
        self.refuted = tuple(f'{_title(diagnosis, effect)}: not reported, because '
                             f'{effect.objection}' for effect in diagnosis.unconfirmed)
        self.calibrated = tuple(_calibrated(diagnosis, number) for number in diagnosis.calibrated)
        self.following, self.command = next_step(diagnosis, files)
        self.reference = word_reference(diagnosis.since)


def unexplained_groups(diagnosis: Diagnosis) -> list[tuple[Statement, ...]]:
    """Return the unexplained statements in groups: one pattern on several drives each."""
    groups: dict[object, list[Statement]] = {}
    for statement in diagnosis.depends_on:
        key = (statement.variable, statement.kind, statement.range)
        groups.setdefault(key, []).append(statement)
    return [tuple(group) for group in groups.values()]


def word_values(effect: type[CatalogueEffect], parameters: Mapping[str, Estimate],
                moments: Mapping[str, Estimate], drives: Sequence[str],
                given: Mapping[str, float] = MappingProxyType({})) -> dict[str, str]:
    """Return the values of an effect that are not 0, by drive; '' for those of no drive.

    Parameters
    ----------
    effect : type of CatalogueEffect
    parameters, moments : mapping of str to Estimate
    drives : sequence of str
        All drives, in their order.
    given : mapping of str to float, optional
        Values of the input model that are compared with them.
    """
    known = {parameter.name: parameter for parameter in effect.parameters}
    order = ['', *drives]
    texts: dict[str, list[str]] = {}
    for key, estimate in parameters.items():
        drive, name = effect.place_and_parameter(key)
        before, parameter = given.get(key), known[name]
        if estimate.value or before:
            size = max(abs(estimate.value), abs(before or 0.0))
            text = as_fitted(estimate.value, estimate.std, estimate.unit, parameter.scale, size)
            if before is not None:
                text += f' (model: {with_uncertainty(before, 0.0, estimate.unit, size)})'
            texts.setdefault(drive, []).append(f'{parameter.symbol} {text}')
    texts.setdefault('', []).extend(
        f'{name} {with_uncertainty(moments[name].value, moments[name].std, moments[name].unit)}'
        for name in sure_moments(effect, parameters, moments))
    return {drive: ', '.join(texts[drive]) for drive in sorted(
        texts, key=lambda drive: order.index(drive) if drive in order else len(order))
        if texts[drive]}


def sure_moments(effect: type[CatalogueEffect], parameters: Mapping[str, Estimate],
                 moments: Mapping[str, Estimate]) -> list[str]:
    """Return first moments, and combinations with the mass, that are sure where a mass is not."""

    def is_vague(estimate: Estimate) -> bool:
        return INTERVAL * estimate.std > VAGUE * abs(estimate.value)

    known = {coefficient.name for coefficient in effect.coefficients}
    masses = {key: 'mass' if key not in known else f'{key.rpartition("moment_")[0]}mass'
              for key in moments}
    return [key for key, mass in masses.items() if mass in parameters
            and is_vague(parameters[mass]) and not is_vague(moments[key])]


def detectable_rows(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    """Return each effect that is not reported, with the size from which it would have been."""
    rows: dict[tuple[str, str, str], list[float]] = {}
    for detectable in diagnosis.detectable:
        key = (detectable.name, detectable.parameter, detectable.unit)
        rows.setdefault(key, []).append(detectable.size)
    return [(name, (f'{parameter} ' if len(catalogue()[name].linear) > 1 else '')
             + in_fitting_unit((min(sizes), max(sizes)), unit))
            for (name, parameter, unit), sizes in rows.items()]


def word_detectable(diagnosis: Diagnosis) -> str:
    """Return the detectable sizes of some common effects as one sentence; '' for none."""
    sizes = [f'{name} from {size}' for name, size in detectable_rows(diagnosis) if name in COMMON]
    return f'Smallest effects that would have been seen: {", ".join(sizes)}' if sizes else ''


# Sets of effects


def _set(diagnosis: Diagnosis, ranked: RankedSet) -> str:
    """Return the effects and patterns of a set with their drives."""
    found = []
    for effect in ranked.effects:
        _, unknown, variable = effect.name.partition('unknown, ')
        found.append(with_drives(pattern_over(variable) if unknown else effect.name,
                                 effect.drives, diagnosis.residuals.drives))
    return ' + '.join(found) or 'nothing missing'


def set_rows(diagnosis: Diagnosis) -> list[tuple[str, str, str]]:
    """Return the best sets of effects in words, each with its cost above the best, and terms.

    Of sets that differ in shapes only the cheapest.
    """
    rows: dict[str, tuple[str, str, str]] = {}
    for number, ranked in enumerate(diagnosis.sets):
        text = _set(diagnosis, ranked)
        rows.setdefault(text, (text, _rise(ranked.cost) if number else 'the best',
                               word_terms(ranked.terms)))
    return list(rows.values())


def word_terms(terms: CostTerms) -> str:
    """Return the visible terms of a difference of costs."""
    return ', '.join(f'{name} {_rise(value)}' for name, value in vars(terms).items()
                     if abs(value) >= LEAST_TERM)


def _rise(cost: float) -> str:
    """Return a difference of costs with its sign: a tenth matters where it is small."""
    return f'{cost:+.1f}' if abs(cost) < WHOLE else f'{cost:+.0f}'


def runner_up(diagnosis: Diagnosis) -> str:
    """Return the best set that differs from the reported one, and its cost; '' for none.

    A set that lacks a reported effect comes before a set that has one more.
    """
    best = set(diagnosis.sets[0].effects) if diagnosis.sets else set()
    others = [ranked for ranked in diagnosis.sets[1:] if set(ranked.effects) != best]
    others.sort(key=lambda ranked: best <= set(ranked.effects))
    return (f'{_set(diagnosis, others[0])} costs {_rise(others[0].cost)[1:]} more '
            '(10 are odds of 150 to 1)' if others else '')


def word_reference(since: SinceReference | None) -> tuple[str, ...]:
    """Return the shares that a reference run covers and explains; nothing without one."""
    if since is None:
        return ()
    shares = listed([f'{share:.0%} on {drive}' for drive, share in since.explained.items()
                     if share >= LEAST_SHARE]) or 'nothing'
    words = [f'{listed(since.recordings)} covers {since.covered:.0%} of the states of this '
             'recording' + ('' if since.covered > MOSTLY else '; elsewhere only the model is known')
             + f'. Of the squared error it explains {shares}',
             'a fault that was already in the reference cannot be seen'
             if since.covered >= HARDLY else
             'what is reported may be older than the reference: repeat its motion to see a change']
    if not 1 / ALIKE_PACE < since.pace < ALIKE_PACE:
        words.append(f'this recording moves at {since.pace:.2g} times the speed of the reference: '
                     'confirm a delay or a hysteresis with a reference of this speed')
    return tuple(words)


# The headline


def _headline(diagnosis: Diagnosis) -> str:
    effects, unit = diagnosis.effects, diagnosis.residuals.unit
    if diagnosis.effort_looks_like:
        what = dict.fromkeys(looks.what for looks in diagnosis.effort_looks_like.values())
        return f'{sentence("; ".join(what))} No effect is reported.'
    if diagnosis.other_reading:
        return (sentence(diagnosis.other_reading)
                + ' If so, the listed effects come from the wrong reading.' * bool(effects))
    if diagnosis.stick_slip:
        drives = listed([f'{drive} at {slip.frequency:.2g} Hz'
                         for drive, slip in diagnosis.stick_slip.items()])
        return f'Stick-slip on {drives}. No missing effect can be identified in such a motion.'
    if diagnosis.little:
        little = word_little(diagnosis.little, ' with the reported effects' if effects else '')
        return f'{sentence(little)} No effect of the catalogue explains the rest.'
    residual, noise = root_mean_square(diagnosis.remaining), in_unit(diagnosis.noise_floor, unit)
    is_noise = residual <= AT_NOISE * diagnosis.noise_floor
    if diagnosis.unconfirmed and not effects and not diagnosis.depends_on:
        return 'No effect is supported by held-out data.' + ('' if is_noise else (
            f' The error, {in_unit(residual, unit)}, is more than the noise, {noise}.'))
    places = [place_on(group) for group in unexplained_groups(diagnosis)] or [
        f'the error of {drive} is {ratio:.1f} times its noise'
        for drive, ratio in diagnosis.above_noise.items()]
    if places:
        more = ', and more' * (len(places) > MOST_PLACES)
        return ('An error remains that no effect of the catalogue explains: '
                f'{listed(places[:MOST_PLACES])}{more}.'
                + (f' {_lacking(diagnosis)}.' if effects else ''))
    unseen = (f'the recording does not show how much of the error of '
              f'{listed(diagnosis.unseen_noise)} is noise') if diagnosis.unseen_noise else ''
    if effects:
        level = (f'; {unseen}' if unseen else ', which is the noise' if is_noise
                 else f'; the noise is {noise}')
        fall = change(root_mean_square(diagnosis.residuals.error), residual, unit)
        return (f'{_lacking(diagnosis)}. With {"it" if len(effects) == 1 else "them"} the error '
                f'{fall}{level}.')
    if unseen and not diagnosis.since:
        return f'No effect is reported: {unseen}.'
    return (f'No effect {"has changed" if diagnosis.since else "is missing"}: the error is the '
            f'noise, {noise} rms. Effects much weaker than the noise cannot be seen.')


def _lacking(diagnosis: Diagnosis) -> str:
    """Return the sentence on missing effects and on values that the data contradict."""
    new = [f'{_title(diagnosis, effect)}{_or_rivals(diagnosis, effect)}'
           for effect in diagnosis.effects if not effect.in_model]
    return '; '.join([*([f'The model lacks {listed(new)}'] if new else []), *(
        _otherwise(diagnosis, effect) for effect in diagnosis.effects if effect.in_model)])


def _otherwise(diagnosis: Diagnosis, effect: FoundEffect) -> str:
    """Return the values of an effect that the input model has, next to the model's."""
    return (f'{_title(diagnosis, effect)} is in the model with other values: '
            f'{"; ".join(_values(diagnosis, effect).values())}{_or_rivals(diagnosis, effect)}')


def _or_rivals(diagnosis: Diagnosis, effect: FoundEffect) -> str:
    rivals = listed([name.replace(':', ' on ') for names in diagnosis.indistinguishable
                     if names[0] == effect.name for name in names[1:]], 'or')
    return f' (or {rivals}: the data do not separate these)' if rivals else ''


# Findings


def _title(diagnosis: Diagnosis, effect: FoundEffect) -> str:
    """Return the effect and where it is; of links that move alike all."""
    places = listed([listed(names, 'or') for names in effect.places])
    return (f'{effect.name} on {places}' if places else
            with_drives(effect.name, effect.drives, diagnosis.residuals.drives)) + effect.when


def _values(diagnosis: Diagnosis, effect: FoundEffect) -> dict[str, str]:
    return word_values(effect.effect, effect.parameters, effect.moments,
                       diagnosis.residuals.drives, effect.in_model)


def _effect(diagnosis: Diagnosis, effect: FoundEffect) -> Finding:
    card, is_validated = effect.effect.card, diagnosis.held_out_on == 'validation'
    what = _otherwise(diagnosis, effect) if effect.in_model else (
        f'The model lacks {_with_values(diagnosis, effect)}{_or_rivals(diagnosis, effect)}')
    if issubclass(effect.effect, MeasurementEffect):
        what += '. It describes the sensor, and is never used in a command'
    data = 'the --validate recordings' if is_validated else 'held-out blocks of the recordings'
    why = _with_it(diagnosis, effect, diagnosis.remaining)
    if not isnan(gain := effect.held_out_certainty):
        why += (f'The model with it predicts {data} {"better" if gain > 0 else "worse"}, by '
                f'{plain(abs(gain), 2)} standard errors. ')
        why += '' if is_validated else 'Another motion (--validate) is stronger evidence. '
    why += f'Evidence {effect.evidence:.0f} (threshold 0)'
    why += '.' if effect.without is None else (
        f'; the best set without it: {_set(diagnosis, effect.without)}.')
    return Finding(_title(diagnosis, effect), f'{what}.', why, sentence(card.causes),
                   sentence(card.confirm), sentence(card.looks_like),
                   tuple(map(sentence, remarks_on(effect))))


def _rival(diagnosis: Diagnosis, rival: RivalEffect) -> Finding:
    card = rival.found.effect.card
    return Finding(
        f'or {_title(diagnosis, rival.found)}', f'{_with_values(diagnosis, rival.found)} explains '
        f'the data about as well as {rival.of}.',
        f'{_with_it(diagnosis, rival.found, rival.remaining)}The set costs '
        f'{plain(rival.cost, 2)} more than the best one.', sentence(card.causes),
        sentence(card.confirm), sentence(card.looks_like))


def _with_values(diagnosis: Diagnosis, effect: FoundEffect) -> str:
    """Return the title of an effect with its values; of many drives the table has these."""
    values = list(_values(diagnosis, effect).values())
    return _title(diagnosis, effect) + (
        f' ({"; ".join(values)})' if len(values) <= MOST_LISTED else '')


def _with_it(diagnosis: Diagnosis, effect: FoundEffect, remaining: Array) -> str:
    drive, before, after = largest_fall(diagnosis, remaining + effect.force, remaining)
    return (f'With it the error of {drive} '
            f'{change(before, after, diagnosis.residuals.units_of(drive).effort)}. ')


def largest_fall(diagnosis: Diagnosis, error: Array, less: Array) -> tuple[str, float, float]:
    """Return the drive on which the RMS error falls most in units of its noise, and both errors.

    Parameters
    ----------
    diagnosis : Diagnosis
    error, less : (M, D) arrays
    """
    falls = []
    for drive, noise in diagnosis.noise_floors.items():
        d = diagnosis.residuals.drives.index(drive)
        before, after = (root_mean_square(values[:, d]) for values in (error, less))
        falls.append(((before - after) / max(noise, 1e-300), drive, before, after))
    return max(falls)[1:]


def remarks_on(effect: FoundEffect) -> Iterator[str]:
    """Yield what is odd about the values of an effect."""
    for key, estimate in effect.parameters.items():
        drive, name = effect.effect.place_and_parameter(key)
        if estimate.value < effect.effect.unphysical_below.get(name, -inf):
            yield (f'{name}{f" on {drive}" if drive else ""} is negative. This is impossible: the '
                   'model has too much of it, or another effect looks like it')
    if effect.at_bound:
        yield (f'The value of {listed(effect.at_bound)} is at the limit of the values that were '
               'tried; the true one may be beyond')


def _calibrated(diagnosis: Diagnosis, number: FittedNumber) -> str:
    moved = (f'{number.key}: {with_uncertainty(number.before, 0.0, number.unit)} becomes '
             f'{with_uncertainty(number.after, number.std, number.unit)}')
    tolerance = diagnosis.model.values.get(f'tolerances.{number.key.partition("[")[0]}')
    if tolerance and abs(number.after - number.before) > (
            tolerance * abs(number.before) + INTERVAL * number.std):
        return f'{moved}, beyond its tolerance of {tolerance:.0%}: check it first'
    return moved
