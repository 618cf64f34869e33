# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The numbers that decide what a diagnosis says, in one table."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

from pprs_dynamics.inference.regression.design import LEAST_MOVING, TURNED
from pprs_dynamics.inference.regression.joint_fit import LEAST_SAMPLES
from pprs_dynamics.inference.regression.normal_equations import BEYOND_TOLERANCE
from pprs_dynamics.inference.regression.sensitivities import DEVIATIONS
from pprs_dynamics.inference.residuals.noise import CONTINUED_OCTAVES, SLOPE_OCTAVES


def _number(value: float, unit: str, decides: str, reason: str) -> float:
    found: float = field(default=value, metadata={
        'unit': unit, 'decides': decides, 'reason': reason})
    return found


@dataclass(frozen=True)
class Decisions:
    """Numbers that are chosen rather than computed."""

    effect_odds: float = _number(
        0.1, '1', 'prior odds that one more effect is missing, or a width of reversal another',
        'models are seldom wrong in many ways at once; the smaller, the fewer false claims')
    wrong_sign_odds: float = _number(
        0.01, '1', 'prior odds of friction, mass or stiffness with the wrong sign',
        'physically impossible as such, but a model may have too much of it')
    zero_odds: float = _number(
        0.1, '1', "prior odds that a drive's zero is not as stated",
        'zeros are set when a machine is put up, and lost with a count or a screw')
    gain_odds: float = _number(
        0.01, '1', "prior odds that a drive's gain is not as stated",
        'makers calibrate gains; a free one takes on inertia and friction that forms leave over')
    unknown_odds: float = _number(
        0.01, '1', 'prior odds of a form that is in no catalogue, against one that is',
        'a free curve imitates effects; it has to be much better to be believed')
    onset_odds: float = _number(
        7e-4, '1', 'prior odds that an effect begins, ends or grows within the recordings',
        'odds of 150 to 1 against it beside those of one more effect: many times and kinds of '
        'change are tried')
    form_share: float = _number(
        0.15, '1', 'share of the force of an idealised effect that its lack of fit may leave',
        'forms of friction and springs in the literature differ by 5 to 15 %')
    own_form_share: float = _number(
        0.02, '1', "the same for the input model's own friction, beside a further candidate",
        'load-dependent friction is computed from frictionless loads, 1 to 2 % off')
    exact_share: float = _number(
        0.02, '1', 'share of an idealised effect that its lack of fit may put into an exact one',
        'masses, gravity and sensors are exact: little else looks like them')
    left_ratio: float = _number(
        1.5, '1', 'error that a drive may keep over its noise, beside what forms of effects leave',
        'what stands out of the noise to the eye has to be told')
    most_left: float = _number(
        5.0, '1', 'residual of a drive over its noise, above which the verdict is unknown',
        'no form of an effect is off by so much')
    error_rise: float = _number(
        0.01, '1', 'relative rise of the error over its noise, up to which it does not rise',
        'reversals and slow noise are fitted but not part of the model')
    rival_margin: float = _number(
        10.0, 'deviance', 'how near a set must come to the best to be told as its rival',
        'odds of 150 to 1')
    suspect_margin: float = _number(
        5.0, 'deviance', 'how nearly an effect must pay to be told as a suspect',
        'odds of 12 to 1 against it: more noise of the same sort would turn them')
    level_ratio: float = _number(
        3.0, '1', "a drive's slow noise over its fast noise, against its peers', told as unknown",
        'robots have like drives; a factor of 3 in rms is an order of magnitude in power')
    line_periods: float = _number(
        3.0, '1', 'periods of a line within the longest stretch, below which it is a drift',
        'slow noise has bumps of one or two periods')
    scatter_ratio: float = _number(
        1.5, '1', 'ratio of variances in a range and elsewhere that is told as scatter',
        'less does not show in a plot')
    one_load: float = _number(
        0.05, '1', 'share by which friction by load may differ from friction that does not follow '
        'it, up to which a warning asks for another load',
        'dry friction varies by as much along a guide')
    stick_slip: float = _number(
        0.2, '1', 'share of the time in stick-slip, from which no other effect is claimed',
        'a fifth of the samples decides about any friction')
    reversal_share: float = _number(
        0.12, '1', 'share of the samples, the slowest, that a pattern of friction may leave out',
        'friction turns over there, in a width that nobody knows')
    statement_share: float = _number(
        0.01, '1', "share of a drive's squared error that a statement of compare must explain",
        'a tenth of the rms; less is no news')
    explained: float = _number(
        0.5, '1', "share of a drive's effort, below which that a model explains little comes first",
        'most of what the drive does is then not in the model, whatever noise is like')
    noise_seen: float = _number(
        0.5, '1', 'share of the noise beside all columns that they leave free, for it to be told',
        'else most of it is extrapolated from frequencies where there is less')
    negligible: float = _number(
        0.001, '1', "error over a drive's effort, below which compare looks for no places",
        'no drive is known, nor needed, to a thousandth')
    noise_accuracy: float = _number(
        0.1, '1', 'relative error of the noise, within which compare calls all of an error noise',
        'a spectrum of a dozen coefficients per octave is known to about that')
    good: float = _number(
        0.05, '1', 'unexplained error over the effort, up to which a model is good',
        'feedforward then leaves a twentieth to the controller')
    poor: float = _number(
        0.2, '1', 'unexplained error over the effort, above which a model is poor',
        'a fifth is more than friction in most robots')
    most_gain: float = _number(
        1.5, '1', 'factor of a gain beyond which it is no effect of a drive',
        'constants of drives are known to 10 %; beyond half as much it is another unit or motor')
    most_tilt: float = _number(
        0.35, 'rad', 'lean of a base beyond which it is no effect of how the machine was put up',
        'a base is levelled to a degree; what leans by 20 stands on a slope or a wall on purpose')
    sure: float = _number(
        2.0, 'deviations', 'by how much a number must have moved to be told as calibrated, and '
        'held-out data be predicted worse with an effect for it to be refuted',
        '95 %')
    edge_share: float = _number(
        0.02, '1', 'how near the edge of what was tried a shape is not to be trusted',
        'half a step of the finest grids')
    short: float = _number(
        8.0, 's', 'length of all recordings, below which a warning is given',
        'friction, springs and slow noise look alike within one or two strokes')
    few_samples: float = _number(
        60.0, '1', 'independent samples of a drive, below which a warning is given',
        'a mean is then known to an eighth of the noise')
    unexcited: float = _number(
        4.0, 'deviance', 'gain of an effect of a size that matters, below which it is unseen',
        'two standard deviations')
    one_way: float = _number(
        0.95, '1', 'share of the motion in one direction, above which a warning is given',
        'friction is then a constant but for a twentieth')
    filtered: float = _number(
        0.05, '1', 'fast part of an effort over that of white noise, below which it looks filtered',
        'any amplifier and converter leaves more')
    run_repeats: float = _number(
        0.6, '1', 'correlation, in two runs, of what repeats of the error of a reference, as '
        'expected before its parts tell it', 'between six pairs of runs of a UR10e it is 0.4 to '
        '0.8')
    run_repeats_spread: float = _number(
        0.2, '1', 'standard deviation of that expectation', 'the same')
    one_run_repeats: float = _number(
        0.99, '1', 'the most that it is where a single run is the reference',
        'a machine is not the same on two days: 14 % of what repeats is another')
    reference_path: float = _number(
        0.05, '1', 'distance in positions and velocities, over their standard deviations, within '
        'which a recording is on the path of a reference', 'controllers repeat a program to a '
        'hundredth; other paths seldom come as near in all drives at once')
    reference_known: float = _number(
        0.5, '1', 'share of the variance of what repeats, from which a state counts as covered '
        'by a reference', 'it says more of the force there than is left open')

    def table(self) -> list[tuple[str, float, str, str, str]]:
        """Return name, value, unit, what it decides and why, for the documentation."""
        return [*((one.name, getattr(self, one.name), one.metadata['unit'],
                   one.metadata['decides'], one.metadata['reason']) for one in fields(self)),
                *FIXED]


# What decides as well, but belongs to the criterion itself: fits of all kinds share it.
FIXED = (
    ('DEVIATIONS', DEVIATIONS, 'deviations', 'standard deviations within a tolerance',
     'a tolerance is a limit: one number in a hundred lies beyond'),
    ('BEYOND_TOLERANCE', BEYOND_TOLERANCE, '1', "steepness of a number's prior beyond tolerance",
     'it may be passed by a fifth where much speaks for it, and not more'),
    ('TURNED', TURNED, '1', "speed over the model's width of reversal, at which a drive moves",
     'friction has turned over to 96 %'),
    ('LEAST_MOVING', LEAST_MOVING, '1', 'share of the time in motion that friction needs, and of '
     'the motion that a beginning needs before and after it',
     'where a drive stands any constant force looks like friction'),
    ('LEAST_SAMPLES', float(LEAST_SAMPLES), '1', 'samples of a drive that takes part',
     'a spectrum has a dozen shapes'),
    ('SLOPE_OCTAVES', float(SLOPE_OCTAVES), 'octaves', 'that tell the noise of a constant',
     'of 360 drives of pure 1/f noise 4 % had a constant beyond three deviations'),
    ('CONTINUED_OCTAVES', float(CONTINUED_OCTAVES), 'octaves', 'by which they are continued',
     'the same'),
)
DECISIONS = Decisions()
