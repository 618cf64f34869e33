# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What a diagnosis found, in plain sentences; terminal and page only lay them out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isnan

from pprs_dynamics.arrays import root_mean_square
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis, SinceReference
from pprs_dynamics.inference.diagnosis.found_effects import (
    FittedEffect,
    FoundEffect,
    RankedEffect,
    RankedSet,
    RivalEffect,
)
from pprs_dynamics.inference.diagnosis.next_step import PLACEHOLDERS, GivenFiles, next_step
from pprs_dynamics.inference.diagnosis.quantities import (
    INTERVAL,
    as_fitted,
    change,
    in_fitting_unit,
    in_unit,
    listed,
    percent,
    plain,
    sentence,
    with_drives,
    with_uncertainty,
    word_little,
)
from pprs_dynamics.inference.diagnosis.statements import (
    Statement,
    describe_unexplained,
    place_of,
    place_on,
)
from pprs_dynamics.inference.search.candidates import SINCE
from pprs_dynamics.inference.search.cost_terms import CostTerms
from pprs_dynamics.inference.search.estimates import Calibration, Estimate
from pprs_dynamics.physics.effects.drive_effect import MeasurementEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect, Parameter
from pprs_dynamics.physics.effects.laws.asymmetric_friction import AsymmetricFriction

MOST_CHANGED = 4  # values of an effect of the model that a sentence sets against the recordings'
MOST_LISTED = 2  # drives whose parameters a sentence gives one by one
TOLD_COST = 0.05  # of a term of a cost, that one digit shows
VAGUE = 0.1  # of a mass, an uncertainty beyond which its first moment is told as well, if surer
MOSTLY = 0.95  # of a recording, from which on a reference knows its states
# Times the speed of a reference, or one over it, beyond which what lags shows: at half the speed a
# real arm is told delays of up to 70 ms that it has not; a program repeats its own to hundredths.
ALIKE_PACE = 1.25
# Of which one line says what would have been seen.
COMMON = ('payload_mass', 'coulomb_friction', 'viscous_friction')
AT_NOISE = 1.05  # an error up to this multiple of the noise is the noise


@dataclass(frozen=True)
class Finding:
    """One thing that was found.

    Parameters
    ----------
    title : str
    what, why, cause, confirm : str
        What is missing, why we think so, what could have caused it, how to confirm it.
    mark : str
        How it shows in the error.
    remarks : tuple of str
        What else must be known.
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
    """A fitted parameter of an effect; `drive` is '' for none, `given` what the model says."""

    effect: str
    drive: str
    parameter: Parameter
    estimate: Estimate
    given: float | None = None

    @property
    def size(self) -> float:
        """The larger of both values, which decides how they are read."""
        return max(abs(self.estimate.value), abs(self.given or 0.0))

    @property
    def text(self) -> str:
        """Value with uncertainty and unit as people read it; none where it may be anything."""
        return as_fitted(self.estimate.value, self.estimate.std, self.estimate.unit,
                         self.parameter.scale, self.size)


@dataclass(frozen=True)
class Sentences:
    """A diagnosis in words.

    Parameters
    ----------
    headline : str
        The verdict.
    effects : tuple of Finding
        In the order of `Diagnosis.effects`.
    rivals : tuple of Finding
        In the order of those given to `word_diagnosis`.
    unexplained : tuple of Finding
        In the order of `unexplained_groups`.
    suspects, barred, calibrated, warnings : tuple of str
    following, command : str
        What to do next, in words and for a shell.
    reference : tuple of str
        How far what has changed since a reference run can be told; none without one.
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
        For the command to go on with.
    rivals : sequence of RivalEffect, optional
        As `rival_effects` finds them.
    """
    following, command = next_step(diagnosis, files)
    return Sentences(
        _since(diagnosis) + _headline(diagnosis),
        tuple(_effect(diagnosis, effect, k == 0) for k, effect in enumerate(diagnosis.effects)),
        tuple(_rival(diagnosis, rival) for rival in rivals),
        tuple(Finding(*describe_unexplained(group, bool(diagnosis.effects)))
              for group in unexplained_groups(diagnosis)),
        tuple(_suspect(diagnosis, suspect) for suspect in diagnosis.suspects),
        tuple(f'{_set(diagnosis, ranked)} is excluded: {ranked.barred}. It '
              f'{_cost(ranked)}' for ranked in diagnosis.barred),
        tuple(_calibrated(diagnosis, number) for number in diagnosis.calibrated),
        diagnosis.warnings, following, command,
        word_reference(diagnosis.since))


def unexplained_groups(diagnosis: Diagnosis) -> list[tuple[Statement, ...]]:
    """Return the statements on what no effect explains, those of one pattern together."""
    groups: dict[object, list[Statement]] = {}
    for statement in diagnosis.depends_on:
        key = (statement.variable, statement.kind, statement.range)
        groups.setdefault(key, []).append(statement)
    return [tuple(group) for group in groups.values()]


def fitted_values(diagnosis: Diagnosis) -> list[FittedValue]:
    """Return all that was fitted and not left at zero, in the order of adoption and of drives."""
    return [value for effect in diagnosis.effects for value in _fitted(diagnosis, effect)]


def set_rows(diagnosis: Diagnosis) -> list[tuple[str, str, str]]:
    """Return the best sets of effects in words, each with its cost above the best, and of what."""
    return [(_set(diagnosis, fitted), f'{fitted.cost:+.1f}' if number else 'the best',
             word_terms(fitted.terms)) for number, fitted in enumerate(diagnosis.sets)]


def detectable_rows(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    """Return from which size on other effects would have been told, on any drive or joint."""
    rows: dict[tuple[type[CatalogueEffect], Parameter, str], list[float]] = {}
    for detectable in diagnosis.detectable:
        key = (detectable.effect, detectable.parameter, detectable.unit)
        rows.setdefault(key, []).append(detectable.size)
    return [(effect.name, (f'{parameter.name} ' if len(effect.linear) > 1 else '')
             + in_fitting_unit((min(sizes), max(sizes)), unit))
            for (effect, parameter, unit), sizes in rows.items()]


def word_detectable(diagnosis: Diagnosis) -> str:
    """Return the same of some common effects as one sentence; '' for none."""
    told = [f'{name} from {size}' for name, size in detectable_rows(diagnosis) if name in COMMON]
    return f'Smallest effects that would have been seen: {", ".join(told)}' if told else ''


def _set(diagnosis: Diagnosis, ranked: RankedSet) -> str:
    return ' and '.join(with_drives(_plain_name(name), drives, diagnosis.residuals.drives)
                        for name, drives in ranked.names) or 'nothing missing'


def word_terms(terms: CostTerms) -> str:
    """Return the terms of a difference of costs, those that can be seen."""
    return ', '.join(f'{name} {"-" if value < 0 else "+"} {abs(value):.1f}'
                     for name, value in terms.to_dict().items() if abs(value) >= TOLD_COST)


def _cost(ranked: RankedSet) -> str:
    """Return how much more a set costs, and of what."""
    why = word_terms(ranked.terms)
    return (f'costs {abs(ranked.cost):.1f} {"less" if ranked.cost < 0 else "more"}'
            + (f': {why}' if why else ''))


def runner_up(diagnosis: Diagnosis) -> str:
    """Return how the second best set differs from the best, and its costs; '' for none.

    Sets with other effects in place of the reported ones come before sets with more effects.
    """
    sets = [(fitted, set(fitted.names)) for fitted in diagnosis.sets]
    # What could stand instead says more than what could join.
    differing = [(one, names) for one, names in sets[1:] if names != sets[0][1]]
    following = next((pair for pair in differing if sets[0][1] - pair[1]),
                     differing[0] if differing else None)
    if following is None:
        return ''
    best, (second, others) = sets[0][1], following
    missing, instead = best - others, others - best
    moved = {name for name, _ in missing} & {name for name, _ in instead}
    if len(missing | instead) <= 2:
        moved = set()  # one on other drives: both are told
    left, put = (listed([with_drives(_plain_name(name), drives, diagnosis.residuals.drives)
                         for name, drives in one.names
                         if (name, drives) in apart and name not in moved])
                 for one, apart in ((diagnosis.sets[0], missing), (second, instead)))
    words = [f'{put} instead of {left}' if put and left else f'{put} as well' if put
             else f'without {left}' if left else '',
             f'{listed(sorted(moved))} on other drives' if moved else '']
    return f'{", ".join(filter(None, words))}: {_cost(second)}'


def _since(diagnosis: Diagnosis) -> str:
    """Return since when what follows has changed, for a headline; '' without a reference."""
    return f'Since {listed(diagnosis.since.recordings)}: ' if diagnosis.since else ''


def word_reference(since: SinceReference | None) -> tuple[str, ...]:
    """Return how far a reference run can tell what has changed; nothing without one."""
    if since is None:
        return ()
    shares = listed([f'{share:.0%} on {drive}' for drive, share in since.explained.items()])
    told: tuple[str, ...] = (
        f'{listed(since.recordings)} covers {since.covered:.0%} of the states of this recording'
        + ('' if since.covered > MOSTLY else '; elsewhere only the model is known')
        + f'. It explains this share of the squared error: {shares}',
        'a fault that was already in the reference cannot be seen')
    if not 1 / ALIKE_PACE < since.pace < ALIKE_PACE:
        told += (f'this recording moves at {since.pace:.2g} times the speed of the reference: '
                 'confirm a delay or a hysteresis with a reference of this speed',)
    return (*told, since.note) if since.note else told


def _headline(diagnosis: Diagnosis) -> str:
    held, unit = diagnosis.effects, diagnosis.residuals.unit
    if diagnosis.effort_looks_like:
        told = dict.fromkeys(looks.what for looks in diagnosis.effort_looks_like.values())
        return f'{" ".join(map(sentence, told))} No effect is reported.'
    if diagnosis.stick_slip:
        sticking = [f'{drive} at {slip.frequency:.3g} Hz'
                    for drive, slip in diagnosis.stick_slip.items()]
        return (f'Stick-slip on {listed(sticking)}. No missing effect can be identified in such a '
                'motion.')
    left = root_mean_square(diagnosis.remaining)
    fall = '' if not held else (
        f' With {"it" if len(held) == 1 else "them"} the error '
        f'{change(root_mean_square(diagnosis.residuals.error), left, unit)}')
    noise = in_unit(diagnosis.noise_floor, unit)
    if diagnosis.little:
        little = word_little(diagnosis.little, ' with the reported effects' if held else '')
        return (f'{little[:1].upper()}{little[1:]}. No effect of the catalogue explains the rest.')
    if not held and not diagnosis.depends_on and diagnosis.unconfirmed:
        above = (f' The error, {in_unit(left, unit)}, is more than the noise, {noise}.'
                 if left > AT_NOISE * diagnosis.noise_floor else '')
        return f'No effect is supported by held-out data.{above}'
    if any(effect.course is not None and effect.course.kind != SINCE for effect in held):
        return ('The error changes during the recording, most likely because '
                f'{_lacking(diagnosis)}.{fall}.')
    if diagnosis.verdict == 'unknown':
        groups = unexplained_groups(diagnosis)
        places = listed([place_on(group) for group in groups[:2]] or [
            f'the error of {drive} is {ratio:.1f} times its noise'
            for drive, ratio in diagnosis.above_noise.items()])
        more = len(groups) - 2
        places += f' and in {more} more place{"s" * (more > 1)}' if more > 0 else ''
        beside = f' In addition, {_lacking(diagnosis)}; w{fall.strip()[1:]}.' if held else ''
        return f'An error remains that no effect of the catalogue explains: {places}.{beside}'
    unseen = ('The recording does not show how much of the error of '
              f'{listed(diagnosis.unseen_noise)} is noise.') if diagnosis.unseen_noise else ''
    if diagnosis.verdict == 'adequate':
        if diagnosis.since:
            return (f'no effect has changed, the error is the noise, {noise} rms. Changes much '
                    'weaker than the noise cannot be seen.')
        if unseen:
            return f'No effect stands out. {unseen}'
        return (f'No effect is missing: the error is the noise, {noise} rms. Effects much weaker '
                'than the noise cannot be seen.')
    level = (f'. {unseen}' if unseen else ', which is the noise.'
             if left <= AT_NOISE * diagnosis.noise_floor
             else f'; the noise is {noise}.')
    which = ' (the data do not separate these)' if any(
        _rivals(diagnosis, effect) for effect in held) else ''
    missing = _lacking(diagnosis)
    begin = 'T' if missing.startswith('the model') else missing[:1]
    return f'{begin}{missing[1:]}{which}.{fall}{level}'


def _lacking(diagnosis: Diagnosis) -> str:
    """Return what the model lacks, and what it has that is not as the recordings say."""
    new = [_or_rivals(diagnosis, effect) for effect in diagnosis.effects if not effect.in_model]
    told = [f'the model lacks {listed(new)}'] if new else []
    return '; '.join([*told, *(_otherwise(diagnosis, effect)
                               for effect in diagnosis.effects if effect.in_model)])


def _otherwise(diagnosis: Diagnosis, effect: FoundEffect) -> str:
    """Return what the model says of an effect that it has, and what the recordings say."""
    fitted = [value for value in _fitted(diagnosis, effect) if value.given is not None]
    several = len({value.drive for value in fitted}) > 1

    def told(value: FittedValue, text: str) -> str:
        symbol = f'{value.parameter.symbol} ' if len(effect.effect.parameters) > 1 else ''
        return symbol + text + (f' on {value.drive}' if several else '')

    fitted = fitted[:MOST_CHANGED]
    given = ', '.join(
        told(value, with_uncertainty(value.given, 0.0, value.estimate.unit, value.size))
        for value in fitted if value.given is not None)
    recorded = ', '.join(told(value, value.text) for value in fitted)
    rivals = _rivals(diagnosis, effect)
    other = f' (or the model lacks {listed(rivals, "or")})' if rivals else ''
    return (f'{_title(diagnosis, effect)} is in the model with {given}, but this recording gives '
            f'{recorded}{other}')


def _or_rivals(diagnosis: Diagnosis, effect: FoundEffect) -> str:
    # One number for each, in the order of which they stand.
    several = f' ({percent(-effect.share)})' if len(diagnosis.effects) > 1 else ''
    title, rivals = _title(diagnosis, effect), _rivals(diagnosis, effect)
    if rivals and ' or ' in title:
        return f'{title}; or {listed(rivals, "or")}{several}'
    return listed([title, *rivals], 'or') + several


def _title(diagnosis: Diagnosis, effect: FittedEffect) -> str:
    """Return the effect and where it is, all links and joints that are alike among them."""
    places = listed([listed(names, 'or') for names in effect.places])
    return (f'{effect.name} on {places}' if places else
            with_drives(effect.name, effect.drives, diagnosis.residuals.drives)) + effect.when


def _rivals(diagnosis: Diagnosis, effect: FoundEffect) -> list[str]:
    return [name.replace(':', ' on ') for names in diagnosis.indistinguishable
            if names[0] == effect.name for name in names[1:]]


def _effect(diagnosis: Diagnosis, effect: FoundEffect, is_first: bool) -> Finding:
    card = effect.effect.card_in(diagnosis.model.kind)
    title = _title(diagnosis, effect)
    what = (_otherwise(diagnosis, effect) if effect.in_model else
            f'The model lacks {title}: {_parameters(diagnosis, effect)}')
    if issubclass(effect.effect, MeasurementEffect):
        what += ('. It describes the sensor: it is used in comparisons and by the monitor, never '
                 'in a command')
    return Finding(
        title, f'{what}.', _why(diagnosis, effect, is_first), sentence(card.causes),
        sentence(card.confirm), sentence(card.looks_like),
        tuple(_remarks(diagnosis, effect)))


def _rival(diagnosis: Diagnosis, rival: RivalEffect) -> Finding:
    card = rival.effect.card_in(diagnosis.model.kind)
    title = _title(diagnosis, rival)
    held_out = '' if isnan(rival.held_out_after) else (
        f', and {in_unit(rival.held_out_after, diagnosis.residuals.unit)} on held-out data')
    return Finding(
        f'or {title}', f'{title} explains the data about as well as {rival.of}: '
        f'{_parameters(diagnosis, rival)}.',
        f'With it the error is {in_unit(rival.error_after, diagnosis.residuals.unit)}{held_out}. '
        f'The set costs {plain(rival.cost, 2)} more than the best one.', sentence(card.causes),
        sentence(card.confirm), sentence(card.looks_like))


def _parameters(diagnosis: Diagnosis, effect: FittedEffect) -> str:
    fitted = _fitted(diagnosis, effect)
    drives = {value.drive for value in fitted}
    if len(drives) <= MOST_LISTED:
        return ', '.join(
            f'{value.parameter.description} ({value.parameter.symbol}) {value.text}'
            + (f' on {value.drive}' if len(drives) > 1 else '') for value in fitted)
    phrases = []
    for parameter in effect.effect.parameters:
        mine = sorted((value for value in fitted if value.parameter is parameter),
                      key=lambda one: one.estimate.value)
        if mine:
            ends = mine[:1] if len(mine) == 1 else [mine[0], mine[-1]]
            phrases.append(f'{parameter.description} ({parameter.symbol}) '
                           + ' to '.join(f'{one.text} ({one.drive})' for one in ends))
    return ', '.join(phrases)


def _fitted(diagnosis: Diagnosis, effect: FittedEffect) -> list[FittedValue]:
    """Return what was fitted of an effect and not left at zero, in the order of drives."""
    known = {parameter.name: parameter for parameter in effect.effect.parameters}
    order = ['', *diagnosis.residuals.drives]
    values = []
    for key, estimate in effect.parameters.items():
        drive, name = effect.effect.place_and_parameter(key)
        given = effect.in_model.get(key) if isinstance(effect, FoundEffect) else None
        if estimate.value or given:
            values.append(FittedValue(effect.name, drive, known[name], estimate, given))
    if isinstance(effect, FoundEffect):
        values += [FittedValue(effect.name, '', moment, effect.moments[moment.name])
                   for moment in sure_moments(effect.effect, effect.parameters, effect.moments)]
    return sorted(values, key=lambda one: order.index(one.drive))


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


def _why(diagnosis: Diagnosis, effect: FoundEffect, is_first: bool) -> str:
    fresh, unit = diagnosis.held_out_on == 'validation', diagnosis.residuals.unit
    held_out = ('On the --validate recordings it ' if fresh else
                'On held-out blocks of the same recording it ')
    held_out += change(effect.held_out_before, effect.held_out_after, unit)
    if not fresh and is_first:
        held_out += '; another motion with --validate is stronger evidence'
    return (f'Its force alone removes {percent(effect.share)} of the error, each drive in units of '
            'its noise. '
            f'With it the error {change(effect.error_before, effect.error_after, unit)}. '
            f'{held_out}. Evidence {effect.evidence:.0f} (threshold 0).'
            + ('' if effect.without is None else
               f' The best set without it, {_set(diagnosis, effect.without)}, '
               f'{_cost(effect.without)}.'))


def _remarks(diagnosis: Diagnosis, effect: FoundEffect) -> Iterator[str]:
    if rivals := _rivals(diagnosis, effect):
        yield f'The data do not separate {effect.name} from {listed(rivals, "or")}.'
    yield from _negative(diagnosis, effect)
    for names in effect.places:
        if len(names) > 1:
            yield (f'No motion separates {names[0]} from {listed(names[1:], "or")}, because they '
                   'move alike.')
    if effect.effect is AsymmetricFriction:
        yield from _two_in_one(diagnosis, effect)
    if effect.at_bound:
        yield (f'The value of {listed(effect.at_bound)} is at the limit of the values that were '
               'tried; the true one may be beyond.')


def _negative(diagnosis: Diagnosis, effect: FoundEffect) -> Iterator[str]:
    for one in _fitted(diagnosis, effect):
        value, what = one.estimate.value, one.parameter.description
        lowest = effect.effect.unphysical_below.get(one.parameter.name)
        if lowest is None or value >= lowest:
            continue
        place = f'{effect.name} on {one.drive}' if one.drive else effect.name
        kind = 'friction' if 'friction' in effect.name else what
        doubt = ('' if value + INTERVAL * one.estimate.std < lowest else
                 ', though zero is within its uncertainty')
        yield (f'{place}: {what} is negative, {one.text}{doubt}. Negative {kind} is impossible: '
               'the model has too much of it, or another effect looks like it.')


def _two_in_one(diagnosis: Diagnosis, effect: FoundEffect) -> Iterator[str]:
    """Tell how the dry part of asymmetric friction reads as two other effects."""
    forces: dict[str, dict[str, float]] = {}
    for value in _fitted(diagnosis, effect):
        if value.parameter.name.startswith('force_'):
            forces.setdefault(value.drive, {})[value.parameter.name] = value.estimate.value
    for drive, values in forces.items():
        unit = diagnosis.residuals.units_of(drive).effort
        forward, backward = (values.get(f'force_{way}', 0.0) for way in ('forward', 'backward'))
        yield (f'{drive}: the dry part is the same as coulomb_friction of '
               f'{in_unit((forward + backward) / 2, unit)} plus effort_offset of '
               f'{in_unit((forward - backward) / 2, unit)}; data of moving drives cannot tell the '
               'one from the two, a reading at rest can.')


def _suspect(diagnosis: Diagnosis, ranked: RankedEffect) -> str:
    return (f'{with_drives(ranked.name, ranked.drives, diagnosis.residuals.drives)}: possible, '
            f'but slow noise explains the data as well (evidence {ranked.evidence:.0f}, threshold '
            '0); repeat the recording')


def _rounded(after: float, before: float) -> float:
    """Return a width of reversal with two digits, or as many as show that it has moved.

    Widths come without an uncertainty: no more digits than they can have.
    """
    return next((value for digits in range(2, 7)
                 if (value := float(f'{after:.{digits}g}')) != before), after)


def _calibrated(diagnosis: Diagnosis, number: Calibration) -> str:
    after = with_uncertainty(number.after, number.std, number.unit) if number.std else (
        f'about {with_uncertainty(_rounded(number.after, number.before), 0.0, number.unit)}')
    moved = f'{number.label}: {with_uncertainty(number.before, 0.0, number.unit)} becomes {after}'
    tolerance = diagnosis.model.values.get(f'tolerances.{number.key}')
    if not tolerance:
        return f'{moved}: calibrated'
    change = abs(number.after - number.before)
    within = change <= tolerance * abs(number.before) + INTERVAL * number.std
    return (f'{moved}, within its tolerance of {tolerance:.2g} ({tolerance:.0%}): calibrated, not '
            'an effect' if within else
            f'{moved}, beyond its tolerance of {tolerance:.0%}: check that number first')


def _plain_name(name: str) -> str:
    unknown, comma, variable = name.partition(', ')
    return f'a pattern {place_of(variable)}' if comma and unknown == 'unknown' else name
