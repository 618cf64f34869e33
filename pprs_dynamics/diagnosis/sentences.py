"""What a diagnosis found, in plain sentences; terminal and page only lay them out."""

from __future__ import annotations

from dataclasses import dataclass

from pprs_dynamics.diagnosis.diagnose import Diagnosis
from pprs_dynamics.diagnosis.found_effects import FoundEffect, RankedEffect, WithinModelError
from pprs_dynamics.diagnosis.quantities import (
    INTERVAL,
    listed,
    name_drives,
    newtons,
    sentence,
    with_uncertainty,
)
from pprs_dynamics.diagnosis.unknown_words import describe_unexplained, place_of
from pprs_dynamics.effects.asymmetric_friction import AsymmetricFriction
from pprs_dynamics.effects.catalogue import find_effect
from pprs_dynamics.effects.drive_effect import MeasurementEffect
from pprs_dynamics.effects.effect import Parameter
from pprs_dynamics.selection.estimates import Calibration, Estimate

MOST_LISTED = 2  # drives whose parameters a sentence gives one by one
AT_NOISE = 1.05  # an error up to this multiple of the noise is the noise
SEPARATE = 'pprs next-experiment RECORDING --output next.csv'


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
    """A fitted parameter as people read it; `drive` is '' for none."""

    effect: str
    drive: str
    parameter: Parameter
    text: str


@dataclass(frozen=True)
class Sentences:
    """A diagnosis in words.

    Parameters
    ----------
    headline : str
        The verdict.
    effects, unexplained : tuple of Finding
        In the order of `Diagnosis.effects` and `Diagnosis.depends_on`.
    suspects, within_model_error, calibrated, warnings : tuple of str
    following : str
        What to do next.
    """

    headline: str
    effects: tuple[Finding, ...]
    unexplained: tuple[Finding, ...]
    suspects: tuple[str, ...]
    within_model_error: tuple[str, ...]
    calibrated: tuple[str, ...]
    warnings: tuple[str, ...]
    following: str


def word_diagnosis(diagnosis: Diagnosis) -> Sentences:
    """Return a diagnosis in words."""
    return Sentences(
        _headline(diagnosis),
        tuple(_effect(diagnosis, one, k == 0) for k, one in enumerate(diagnosis.effects)),
        tuple(Finding(*describe_unexplained(one, bool(diagnosis.effects)))
              for one in diagnosis.depends_on),
        tuple(_suspect(diagnosis, one) for one in diagnosis.suspects),
        tuple(_within_model_error(diagnosis, one) for one in diagnosis.within_model_error),
        tuple(_calibrated(diagnosis, one) for one in diagnosis.calibrated),
        diagnosis.warnings,
        _following(diagnosis))


def fitted_values(diagnosis: Diagnosis) -> list[FittedValue]:
    """Return all that was fitted and not left at zero, in the order of adoption and of drives."""
    return [FittedValue(effect.name, drive, parameter,
                        with_uncertainty(one.value, one.std, one.unit))
            for effect in diagnosis.effects for drive, parameter, one in _fitted(diagnosis, effect)]


def with_drives(name: str, drives: tuple[str, ...] | None, every: tuple[str, ...]) -> str:
    """Return what it is and where it sits."""
    return name if drives is None else f'{name} on {name_drives(drives, every)}'


def _headline(diagnosis: Diagnosis) -> str:
    first, last = diagnosis.effects[:1], diagnosis.effects[-1:]
    named = listed([_or_rivals(diagnosis, one) for one in diagnosis.effects])
    fall = '' if not first else (
        f' With {"it" if len(diagnosis.effects) == 1 else "them"} the error falls from '
        f'{newtons(first[0].error_before)} to {newtons(last[0].error_after)}')
    noise = newtons(diagnosis.noise_floor)
    doubted = _doubted(diagnosis)
    doubt = (f' On what was held out it does not fall with {listed(doubted)}.' if doubted else '')
    if diagnosis.verdict == 'unknown':
        places = listed([f'on {one.drive}, {place_of(one.variable)}'
                         for one in diagnosis.depends_on[:2]])
        more = len(diagnosis.depends_on) - 2
        places += f' and in {more} more place{"s" * (more > 1)}' if more > 0 else ''
        beside = f' Beside it, the model lacks {named}.{fall}, not to the noise.' if first else ''
        return ('Something is missing that no effect of the catalogue explains: '
                f'{places}.{beside}{doubt}')
    if diagnosis.verdict == 'adequate':
        return (f'Nothing is missing beyond noise: what the model leaves, {noise} rms, depends on '
                'nothing known. Effects much weaker than that could still hide in it.')
    # Only the widths of reversals are fitted and yet not part of the model.
    level = (', which is the noise.' if last[0].error_after <= AT_NOISE * diagnosis.noise_floor
             else f'. The noise is {noise}; the rest lies near reversals, where friction '
             'turns over in another width than the model\'s.')
    if diagnosis.verdict == 'ambiguous':
        return f'The model lacks {named}: this data cannot tell which.{fall}{level}{doubt}'
    return f'The model lacks {named}.{fall}{level}{doubt}'


def _doubted(diagnosis: Diagnosis) -> list[str]:
    """Return effects that held-out data do not confirm."""
    return [one.name for one in diagnosis.effects if not _holds(one)]


def _holds(found: FoundEffect) -> bool:
    return found.held_out_after < found.held_out_before


def _or_rivals(diagnosis: Diagnosis, effect: FoundEffect) -> str:
    own = with_drives(effect.name, effect.drives, diagnosis.residuals.drives)
    return listed([own, *_rivals(diagnosis, effect)], 'or')


def _rivals(diagnosis: Diagnosis, effect: FoundEffect) -> list[str]:
    return [name for names in diagnosis.indistinguishable if names[0] == effect.name
            for name in names[1:]]


def _effect(diagnosis: Diagnosis, found: FoundEffect, is_first: bool) -> Finding:
    card = found.effect.card
    title = with_drives(found.name, found.drives, diagnosis.residuals.drives)
    what = f'The model lacks {title}: {_parameters(diagnosis, found)}'
    if issubclass(found.effect, MeasurementEffect):
        what += ('. This is what the sensor says, not what the drive must do: it enters '
                 'comparisons and the monitor, never a command')
    return Finding(
        title, f'{what}.', _why(diagnosis, found, is_first), sentence(card.causes),
        sentence(card.confirm), sentence(card.looks_like),
        (*_ambiguous(diagnosis, found), *_negative(diagnosis, found),
         *_two_in_one(diagnosis, found), *_bound(found)))


def _parameters(diagnosis: Diagnosis, found: FoundEffect) -> str:
    fitted = _fitted(diagnosis, found)
    drives = {drive for drive, _, _ in fitted}
    if len(drives) <= MOST_LISTED:
        return ', '.join(
            f'{parameter.description} ({parameter.symbol}) '
            + with_uncertainty(one.value, one.std, one.unit)
            + (f' on {drive}' if len(drives) > 1 else '') for drive, parameter, one in fitted)
    phrases = []
    for parameter in found.effect.parameters:
        mine = sorted(((one, drive) for drive, p, one in fitted if p is parameter),
                      key=lambda pair: pair[0].value)
        if not mine:
            continue
        ends = mine[:1] if len(mine) == 1 else [mine[0], mine[-1]]
        phrases.append(f'{parameter.description} ({parameter.symbol}) ' + ' to '.join(
            f'{with_uncertainty(one.value, one.std, one.unit)} ({drive})' for one, drive in ends))
    return ', '.join(phrases)


def _fitted(diagnosis: Diagnosis, found: FoundEffect) -> list[tuple[str, Parameter, Estimate]]:
    """Return drive ('' for none), parameter and estimate of what was not left at zero."""
    known = {parameter.name: parameter for parameter in found.effect.parameters}
    order = ['', *diagnosis.residuals.drives]
    rows = []
    for key, estimate in found.parameters.items():
        drive, _, name = key.rpartition('.')
        if estimate.value or estimate.std:
            rows.append((drive, known[name], estimate))
    return sorted(rows, key=lambda row: order.index(row[0]))


def _why(diagnosis: Diagnosis, found: FoundEffect, is_first: bool) -> str:
    change = f'{newtons(found.held_out_before)} to {newtons(found.held_out_after)}'
    fresh = diagnosis.held_out_on == 'validation'
    held_out = ('On the recordings given with --validate, which took no part in the fit, it ' if
                fresh else 'On blocks of the same recording, each predicted from the others, it ')
    held_out += (f'falls from {change}' if _holds(found) else
                 f'does not fall ({change}): do not adopt it')
    if not fresh:
        held_out += ('; that is the weaker evidence, a recording of another motion with '
                     '--validate is the stronger' if is_first else ' (the weaker evidence)')
    return (f'With it the error falls from {newtons(found.error_before)} to '
            f'{newtons(found.error_after)}. {held_out}. Evidence {found.evidence:.0f}, where 0 is '
            'the threshold.')


def _ambiguous(diagnosis: Diagnosis, found: FoundEffect) -> list[str]:
    rivals = _rivals(diagnosis, found)
    if not rivals:
        return []
    remark = (f'This data cannot tell {found.name} from {listed(rivals, "or")}, which would '
              f'explain it about as well. A motion that tells them apart: {SEPARATE}.')
    for name in rivals:
        effect = find_effect(name)
        if effect is not None:
            remark += f' {name} would be confirmed so: {effect.card.confirm}.'
    return [remark]


def _negative(diagnosis: Diagnosis, found: FoundEffect) -> list[str]:
    remarks = []
    for drive, parameter, one in _fitted(diagnosis, found):
        lowest = found.effect.unphysical_below.get(parameter.name)
        if lowest is None or one.value >= lowest:
            continue
        place = f'{found.name}{f" on {drive}" if drive else ""}'
        value = with_uncertainty(one.value, one.std, one.unit)
        kind = 'friction' if 'friction' in found.name else parameter.description
        sure = one.value + INTERVAL * one.std < lowest
        remarks.append(
            f'{place}: {parameter.description} is negative, {value}'
            + ('' if sure else ', though zero is within its uncertainty')
            + f'. There is no negative {kind}: either the model has too much of it already, or '
            'something else looks like it.')
    return remarks


def _two_in_one(diagnosis: Diagnosis, found: FoundEffect) -> list[str]:
    """Return how the dry part of asymmetric friction reads as two other effects."""
    if found.effect is not AsymmetricFriction:
        return []
    forces: dict[str, dict[str, Estimate]] = {}
    for drive, parameter, one in _fitted(diagnosis, found):
        if parameter.name.startswith('force_'):
            forces.setdefault(drive, {})[parameter.name] = one
    remarks = []
    for drive, both in forces.items():
        forward, backward = (both[key].value if key in both else 0.0
                             for key in ('force_forward', 'force_backward'))
        remarks.append(
            f'{drive}: the dry part is the same as coulomb_friction of '
            f'{newtons((forward + backward) / 2)} plus effort_offset of '
            f'{newtons((forward - backward) / 2)}; data of moving drives cannot tell the one from '
            'the two, a reading at rest can.')
    return remarks


def _bound(found: FoundEffect) -> list[str]:
    if not found.at_bound:
        return []
    return [f'{listed(found.at_bound)} stand{"s" * (len(found.at_bound) == 1)} at the edge of what '
            'was tried: not to be trusted.']


def _suspect(diagnosis: Diagnosis, one: RankedEffect) -> str:
    return (f'{with_drives(one.name, one.drives, diagnosis.residuals.drives)}: may be there, but '
            f'slow noise would explain the same (evidence {one.evidence:.0f}, where 0 is the '
            'threshold); repeat the recording')


def _within_model_error(diagnosis: Diagnosis, one: WithinModelError) -> str:
    return (f'{with_drives(one.name, one.drives, diagnosis.residuals.drives)}, '
            f'{newtons(one.rms)} rms, is within the model error of {listed(one.of)}: a real '
            'machine is only nearly of the form that the catalogue gives it. Not adopted')


def _calibrated(diagnosis: Diagnosis, one: Calibration) -> str:
    after = with_uncertainty(one.after, one.std, one.unit)
    moved = f'{one.label}: {with_uncertainty(one.before, 0.0, one.unit)} becomes {after}'
    tolerance = diagnosis.model.values.get(f'tolerances.{one.key}')
    if not tolerance:
        return f'{moved}: calibrated'
    change = abs(one.after - one.before)
    within = change <= tolerance * abs(one.before) + INTERVAL * one.std
    return (f'{moved}, within its tolerance of {tolerance:.2g} ({tolerance:.0%}): calibrated, not '
            'an effect' if within else
            f'{moved}, beyond its tolerance of {tolerance:.0%}: check that number first')


def _following(diagnosis: Diagnosis) -> str:
    if diagnosis.verdict == 'unknown':
        return ('Look at the curve of what remains (--report), look at that place on the machine, '
                'and repeat the recording: what comes back is the machine. A form of your own can '
                'join the catalogue as one file.')
    if diagnosis.verdict == 'ambiguous':
        return f'Record a motion that tells the candidates apart: {SEPARATE}'
    if doubted := _doubted(diagnosis):
        return (f'Do not add {listed(doubted)} on this evidence: what was held out speaks against '
                'it. Record another motion, and fit both')
    if diagnosis.verdict == 'effect':
        name = diagnosis.effects[0].name
        if len(diagnosis.effects) > 1:
            return ('Confirm them on the machine, then add them one by one (pprs adopt) or all: '
                    'pprs diagnose RECORDING --validate ANOTHER --adopt-all --output new.yaml')
        return (f'Confirm it on the machine, then add it: pprs adopt {name} RECORDING --output '
                'new.yaml --validate ANOTHER')
    if diagnosis.suspects:
        return 'Repeat the recording: what comes back is the machine, what does not was noise'
    return 'Nothing to add. Another motion may show what this one does not excite'
