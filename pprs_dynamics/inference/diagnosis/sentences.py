# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A diagnosis in plain sentences; terminal and page only lay them out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isnan

from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.inference.diagnosis.diagnosis import (
    Diagnosis,
    Drives,
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
from pprs_dynamics.inference.search.estimates import Calibration, Estimate
from pprs_dynamics.physics.effects.catalogue import catalogue
from pprs_dynamics.physics.effects.drive_effect import MeasurementEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect, Parameter
from pprs_dynamics.physics.effects.laws.asymmetric_friction import AsymmetricFriction

MOST_CHANGED = 4  # values of an effect of the input model that a sentence compares
MOST_LISTED = 2  # drives whose parameters a sentence gives one by one
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
MOST_SHARED = 2  # effects that a set has in common with the reported one, and are named
LEAST_REFIT = 0.01  # share of the error by which refitted numbers matter
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


@dataclass(frozen=True)
class FittedValue:
    """A fitted parameter of an effect; `drive` may be '', `given` is the input model's value."""

    effect: str
    drive: str
    parameter: Parameter
    estimate: Estimate
    given: float | None = None

    @property
    def size(self) -> float:
        """The larger of both values, which decides their unit."""
        return max(abs(self.estimate.value), abs(self.given or 0.0))

    @property
    def text(self) -> str:
        """Value with uncertainty and unit."""
        return as_fitted(self.estimate.value, self.estimate.std, self.estimate.unit,
                         self.parameter.scale, self.size)


@dataclass(frozen=True)
class Sentences:
    """A diagnosis in words.

    Parameters
    ----------
    headline : str
        The verdict, at most two sentences.
    effects, rivals, unexplained : tuple of Finding
        In the order of `Diagnosis.effects`, of the given rivals, and of `unexplained_groups`.
    suspects, barred, calibrated, warnings : tuple of str
    following, command : str
        What to do next, in words and for a shell.
    reference : tuple of str
        What a reference run covers; none without one.
    """

    headline: str
    effects: tuple[Finding, ...]
    rivals: tuple[Finding, ...]
    unexplained: tuple[Finding, ...]
    suspects: tuple[str, ...]
    barred: tuple[str, ...]
    calibrated: tuple[str, ...]
    warnings: tuple[str, ...]
    following: str
    command: str
    reference: tuple[str, ...] = ()


def word_diagnosis(diagnosis: Diagnosis, files: GivenFiles = PLACEHOLDERS,
                   rivals: Sequence[RivalEffect] = ()) -> Sentences:
    """Return a diagnosis in words.

    Parameters
    ----------
    diagnosis : Diagnosis
    files : GivenFiles, optional
        For the next command.
    rivals : sequence of RivalEffect, optional
        As `rival_effects` returns them.
    """
    following, command = next_step(diagnosis, files)
    headline = _headline(diagnosis)
    if diagnosis.since and diagnosis.since.covered >= HARDLY:
        headline = (f'Since {listed(diagnosis.since.recordings)}: '
                    f'{headline[:1].lower()}{headline[1:]}')
    return Sentences(
        headline,
        tuple(_effect(diagnosis, effect) for effect in diagnosis.effects),
        tuple(_rival(diagnosis, rival) for rival in rivals),
        tuple(Finding(*describe_unexplained(group)) for group in unexplained_groups(diagnosis)),
        tuple(with_drives(suspect.name, suspect.drives, diagnosis.residuals.drives)
              + f': possible, but it costs {-suspect.evidence:.1f} more than it explains. A longer '
              'recording decides' for suspect in diagnosis.suspects),
        (*(f'{_title(diagnosis, effect)}: not reported, because {effect.objection}'
           for effect in diagnosis.unconfirmed),
         *(f'{_against_best(diagnosis, ranked)}: excluded, because {ranked.barred}. This set '
           f'{_cost(ranked)}' for ranked in diagnosis.barred)),
        tuple(_calibrated(diagnosis, number) for number in diagnosis.calibrated),
        diagnosis.warnings, following, command, word_reference(diagnosis.since))


def is_refit(diagnosis: Diagnosis) -> bool:
    """Return whether the refitted numbers of the model alone change the error visibly."""
    given = root_mean_square(diagnosis.residuals.error)
    return abs(diagnosis.refit - given) > LEAST_REFIT * given


def unexplained_groups(diagnosis: Diagnosis) -> list[tuple[Statement, ...]]:
    """Return the unexplained statements in groups, which a reader looks at together.

    One pattern on several drives, and patterns over one variable on the same drives.
    """
    patterns: dict[object, list[Statement]] = {}
    for statement in diagnosis.depends_on:
        key = (statement.variable, statement.kind, statement.range)
        patterns.setdefault(key, []).append(statement)
    groups: dict[object, list[Statement]] = {}
    for alike in patterns.values():
        drives = tuple(statement.drive for statement in alike)
        groups.setdefault((drives, alike[0].variable), []).extend(alike)
    return [tuple(group) for group in groups.values()]


def fitted_values(diagnosis: Diagnosis) -> list[FittedValue]:
    """Return all fitted parameters that are not 0, effect by effect, drive by drive."""
    return [value for effect in diagnosis.effects for value in _fitted(diagnosis, effect)]


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
    return _names(diagnosis, Counter(ranked.names)) or 'nothing missing'


def _names(diagnosis: Diagnosis, names: Counter[tuple[str, Drives]]) -> str:
    """Return effects and patterns with their drives; patterns over one variable are counted."""
    found = []
    for (name, drives), count in names.items():
        unknown, _, variable = name.partition(', ')
        found.append(with_drives(
            pattern_over(variable, count) if variable and unknown == 'unknown' else name,
            drives, diagnosis.residuals.drives))
    return ' + '.join(found)


def set_rows(diagnosis: Diagnosis) -> list[tuple[str, str, str]]:
    """Return the best sets of effects in words, each with its cost above the best, and terms.

    Of sets that differ in shapes only the cheapest.
    """
    rows: dict[str, tuple[str, str, str]] = {}
    for number, fitted in enumerate(diagnosis.sets):
        text = _against_best(diagnosis, fitted) if number else _set(diagnosis, fitted)
        rows.setdefault(text, (text, _rise(fitted.cost) if number else 'the best',
                               word_terms(fitted.terms)))
    return list(rows.values())


def _against_best(diagnosis: Diagnosis, ranked: RankedSet) -> str:
    """Return a set in words; one that is much like the reported set by its difference."""
    best = Counter(diagnosis.sets[0].names if diagnosis.sets else ())
    names = Counter(ranked.names)
    if (names & best).total() <= MOST_SHARED or names == best:
        return _set(diagnosis, ranked)
    less, more = _names(diagnosis, best - names), _names(diagnosis, names - best)
    return 'the reported set' + (f' without {less}' if less else '') + (
        f'{", but" if less else ""} with {more}' if more else '')


def word_terms(terms: CostTerms) -> str:
    """Return the visible terms of a difference of costs."""
    return ', '.join(f'{name} {_rise(value)}' for name, value in vars(terms).items()
                     if abs(value) >= LEAST_TERM)


def _rise(cost: float) -> str:
    """Return a difference of costs with its sign: a tenth matters where it is small."""
    return f'{cost:+.1f}' if abs(cost) < WHOLE else f'{cost:+.0f}'


def _cost(ranked: RankedSet) -> str:
    if abs(ranked.cost) < 0.5:
        return 'costs as much'
    return f'costs {_rise(ranked.cost)[1:]} {"less" if ranked.cost < 0 else "more"}'


def runner_up(diagnosis: Diagnosis) -> str:
    """Return the best set that differs from the reported one, and its cost; '' for none.

    A set that lacks a reported effect comes before a set that has one more.
    """
    best = set(diagnosis.sets[0].names) if diagnosis.sets else set()
    others = [ranked for ranked in diagnosis.sets[1:] if set(ranked.names) != best]
    others.sort(key=lambda ranked: best <= set(ranked.names))
    return (f'{_against_best(diagnosis, others[0])} {_cost(others[0])} (10 are odds of 150 to 1)'
            if others else '')


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
    return (*words, since.note) if since.note else tuple(words)


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
    lacking = _lacking(diagnosis)
    if diagnosis.unconfirmed and not effects and not diagnosis.depends_on:
        return 'No effect is supported by held-out data.' + ('' if is_noise else (
            f' The error, {in_unit(residual, unit)}, is more than the noise, {noise}.'))
    where = [place_on(group) for group in unexplained_groups(diagnosis)]
    places = where[:MOST_PLACES] or [f'the error of {drive} is {ratio:.1f} times its noise'
                                     for drive, ratio in diagnosis.above_noise.items()]
    if places:
        if more := len(where[MOST_PLACES:]):
            places.append(f'in {more} more place{"s" * (more > 1)}')
        return (f'An error remains that no effect of the catalogue explains: {listed(places)}.'
                + (f' In addition, {lacking}.' if effects else ''))
    unseen = (f'the recording does not show how much of the error of '
              f'{listed(diagnosis.unseen_noise)} is noise') if diagnosis.unseen_noise else ''
    if not effects:
        return f'No effect is reported: {unseen}.' if unseen and not diagnosis.since else (
            f'No effect {"has changed" if diagnosis.since else "is missing"}: the error is the '
            f'noise, {noise} rms. Effects much weaker than the noise cannot be seen.')
    level = (f'; {unseen}.' if unseen else ', which is the noise.' if is_noise
             else f'; the noise is {noise}.')
    begin = lacking[:1].upper() if lacking.startswith('the model') else lacking[:1]
    refitted = ' and refitted numbers of the model' * is_refit(diagnosis)
    fall = f'With {"it" if len(effects) == 1 else "them"}{refitted} the error ' + change(
        root_mean_square(diagnosis.residuals.error), residual, unit)
    return f'{begin}{lacking[1:]}. {fall}{level}'


def _lacking(diagnosis: Diagnosis) -> str:
    """Return the sentence on missing effects and on values that the data contradict."""
    new = []
    for effect in diagnosis.effects:
        if not effect.in_model:
            rivals = listed(_rivals(diagnosis, effect), 'or')
            new.append(_title(diagnosis, effect)
                       + (f' (or {rivals}: the data do not separate these)' if rivals else ''))
    return '; '.join([*([f'the model lacks {listed(new)}'] if new else []), *(
        _otherwise(diagnosis, effect) for effect in diagnosis.effects if effect.in_model)])


def _otherwise(diagnosis: Diagnosis, effect: FoundEffect) -> str:
    """Return the input model's values of an effect and those of the recordings."""
    fitted = [value for value in _fitted(diagnosis, effect) if value.given is not None]
    values = ', '.join(
        f'{value.parameter.symbol} '
        f'{with_uncertainty(value.given or 0.0, 0.0, value.estimate.unit, value.size)}'
        f'{f" on {value.drive}" if value.drive else ""} (this recording: {value.text})'
        for value in fitted[:MOST_CHANGED])
    rivals = _rivals(diagnosis, effect)
    other = f', or the model lacks {listed(rivals, "or")}' if rivals else ''
    return f'{_title(diagnosis, effect)} is in the model with {values}{other}'


# Findings


def _title(diagnosis: Diagnosis, effect: FoundEffect) -> str:
    """Return the effect and where it is; of links that move alike all."""
    places = listed([listed(names, 'or') for names in effect.places])
    return (f'{effect.name} on {places}' if places else
            with_drives(effect.name, effect.drives, diagnosis.residuals.drives)) + effect.when


def _rivals(diagnosis: Diagnosis, effect: FoundEffect) -> list[str]:
    return [name.replace(':', ' on ') for names in diagnosis.indistinguishable
            if names[0] == effect.name for name in names[1:]]


def _effect(diagnosis: Diagnosis, effect: FoundEffect) -> Finding:
    card = effect.effect.card
    title, is_validated = _title(diagnosis, effect), diagnosis.held_out_on == 'validation'
    what = (_otherwise(diagnosis, effect) if effect.in_model else
            f'The model lacks {title}: {_parameters(diagnosis, effect)}')
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
    return Finding(title, f'{what}.', why, sentence(card.causes), sentence(card.confirm),
                   sentence(card.looks_like), tuple(_remarks(diagnosis, effect)))


def _rival(diagnosis: Diagnosis, rival: RivalEffect) -> Finding:
    found = rival.found
    card, title = found.effect.card, _title(diagnosis, found)
    return Finding(
        f'or {title}', f'{title} explains the data about as well as {rival.of}: '
        f'{_parameters(diagnosis, found)}.',
        f'{_with_it(diagnosis, found, rival.remaining)}The set costs {plain(rival.cost, 2)} more '
        'than the best one.', sentence(card.causes), sentence(card.confirm),
        sentence(card.looks_like))


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


def _parameters(diagnosis: Diagnosis, effect: FoundEffect) -> str:
    """Return the fitted values; of more than two drives the least and the largest."""
    fitted = _fitted(diagnosis, effect)
    count = len({value.drive for value in fitted})
    phrases = []
    for parameter in dict.fromkeys(value.parameter for value in fitted):
        mine = [value for value in fitted if value.parameter == parameter]
        if count > MOST_LISTED and len(mine) > 1:
            mine.sort(key=lambda value: value.estimate.value)
            texts = ' to '.join(f'{value.text} ({value.drive})' for value in (mine[0], mine[-1]))
        else:
            texts = ', '.join(value.text + (f' on {value.drive}' if count > 1 else '')
                              for value in mine)
        phrases.append(f'{parameter.description} ({parameter.symbol}) {texts}')
    return ', '.join(phrases)


def _fitted(diagnosis: Diagnosis, effect: FoundEffect) -> list[FittedValue]:
    """Return the fitted parameters of an effect that are not 0, in the order of drives."""
    known = {parameter.name: parameter for parameter in effect.effect.parameters}
    order = ['', *diagnosis.residuals.drives]
    values = []
    for key, estimate in effect.parameters.items():
        drive, name = effect.effect.place_and_parameter(key)
        given = effect.in_model.get(key)
        if estimate.value or given:
            values.append(FittedValue(effect.name, drive, known[name], estimate, given))
    values += [FittedValue(effect.name, '', moment, effect.moments[moment.name])
               for moment in sure_moments(effect.effect, effect.parameters, effect.moments)]
    return sorted(values, key=lambda value: (value.drive not in order, (
        order.index(value.drive) if value.drive in order else 0)))


def sure_moments(effect: type[CatalogueEffect], parameters: Mapping[str, Estimate],
                 moments: Mapping[str, Estimate]) -> list[Parameter]:
    """Return first moments, and combinations with the mass, that are sure where a mass is not."""

    def is_vague(estimate: Estimate) -> bool:
        return INTERVAL * estimate.std > VAGUE * abs(estimate.value)

    known = {coefficient.name: coefficient for coefficient in effect.coefficients}
    found = []
    for key, moment in moments.items():
        name = 'mass' if key not in known else f'{key.rpartition("moment_")[0]}mass'
        if name in parameters and is_vague(parameters[name]) and not is_vague(moment):
            found.append(known.get(key) or replace(known[name], name=key))
    return found


def _remarks(diagnosis: Diagnosis, effect: FoundEffect) -> Iterator[str]:
    if rivals := _rivals(diagnosis, effect):
        yield f'The data do not separate {effect.name} from {listed(rivals, "or")}.'
    for value in _fitted(diagnosis, effect):
        if value.estimate.value < effect.effect.unphysical_below.get(
                value.parameter.name, -float('inf')):
            yield (f'{value.parameter.description} is negative'
                   f'{f" on {value.drive}" if value.drive else ""}, {value.text}. This is '
                   'impossible: the model has too much of it, or another effect looks like it.')
    for names in effect.places:
        if len(names) > 1:
            yield (f'No motion separates {names[0]} from {listed(names[1:], "or")}, because they '
                   'move alike.')
    if effect.effect is AsymmetricFriction:
        yield ('Its dry part equals coulomb_friction of the mean of both directions plus '
               'effort_offset of half their difference. Only a reading at rest separates them.')
    if effect.at_bound:
        yield (f'The value of {listed(effect.at_bound)} is at the limit of the values that were '
               'tried; the true one may be beyond.')


def _calibrated(diagnosis: Diagnosis, number: Calibration) -> str:
    moved = (f'{number.label}: {with_uncertainty(number.value, 0.0, number.unit)} becomes '
             f'{with_uncertainty(number.after, number.std, number.unit)}')
    tolerance = diagnosis.model.values.get(f'tolerances.{number.key}')
    if not tolerance:
        return moved
    is_within = (abs(number.after - number.value)
                 <= tolerance * abs(number.value) + INTERVAL * number.std)
    return (f'{moved} (tolerance {tolerance:.0%})' if is_within else
            f'{moved}, beyond its tolerance of {tolerance:.0%}: check it first')
