# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The numbers that decide what a diagnosis reports, in one table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from pprs_dynamics.inference.regression.base_columns import OWN_FORM

Decider = TypeVar('Decider', bound=Callable[..., object])
OUTSIDE_COST: dict[str, str] = {}
"""What changes an answer other than the cost: name of the function, and the rule."""


def outside_cost(rule: str) -> Callable[[Decider], Decider]:
    """Return a decorator that lists a function in `OUTSIDE_COST`."""
    def listed(function: Decider) -> Decider:
        OUTSIDE_COST[f'{function.__module__.rpartition(".")[2]}.{function.__qualname__}'] = rule
        return function
    return listed


@dataclass(frozen=True)
class Decisions:
    """Numbers that are chosen, with their unit and reason."""

    # Prior odds that one more effect is missing, or a width of reversal another. Models are
    # seldom wrong in many ways at once; the smaller, the fewer false claims.
    effect_odds: float = 0.1
    # Prior odds of friction, mass or stiffness with the wrong sign. Physically impossible, but a
    # model may have too much of it.
    wrong_sign_odds: float = 0.01
    # Prior odds that a drive's zero is not as stated. Zeros are set when a machine is put up, and
    # lost with a count or a screw.
    zero_odds: float = 0.1
    # Prior odds that a drive's gain is not as stated. Makers calibrate gains; a free gain absorbs
    # the form errors of inertia and friction.
    gain_odds: float = 0.01
    # Prior odds of a form that is in no catalogue, against one that is. A free curve imitates
    # effects; it has to be much better to be believed.
    unknown_odds: float = 0.01
    # Prior odds that an effect begins, ends or grows within the recordings. Odds of 150 to 1
    # against it in addition to `effect_odds`: many times and kinds of change are tried.
    onset_odds: float = 0.0007
    # Form error of an idealised effect as a share of its force. Forms of friction and springs in
    # the literature differ by 5 to 15 %.
    form_share: float = 0.15
    # Form error of the input model's friction as a share of its force. Load-dependent friction is
    # computed from frictionless loads, 1 to 2 % off.
    own_form_share: float = OWN_FORM
    # Share that 99 of 100 form errors do not exceed. Of four shapes (`form_error.SHAPES`), by chi
    # squared, it is 1.82 times the root of the mean square.
    most_form_share: float = 0.273
    # Residual of a drive over its noise, above which the verdict is unknown unless form errors
    # explain it. A reader sees a residual of 1.5 times the noise in a plot.
    left_ratio: float = 1.5
    # How near a set must come to the best to be listed as its rival [deviance]. Odds of 150 to 1.
    rival_margin: float = 10.0
    # How nearly an effect must pay to be listed as a suspect [deviance]. Odds of 12 to 1 against
    # it: more noise of the same sort would turn them.
    suspect_margin: float = 5.0
    # Periods of a line within the longest stretch, below which it is a drift. Slow noise has
    # bumps of one or two periods.
    line_periods: float = 3.0
    # Share of the time in stick-slip, from which no other effect is claimed. A fifth of the
    # samples decides about any friction.
    stick_slip: float = 0.2
    # Share of a drive's squared error that a statement of compare must explain. A tenth of the
    # rms; less is no news.
    statement_share: float = 0.01
    # Share of a drive's effort, below which that a model explains little comes first. Most of
    # what the drive does is then not in the model, whatever noise is like.
    explained: float = 0.5
    # Share of the noise power in the degrees of freedom that no column takes, from which a noise
    # level is reported. Below it most of the noise is extrapolated from other frequencies.
    noise_seen: float = 0.5
    # Error over a drive's effort, below which compare looks for no places. No drive is known, nor
    # needed, to a thousandth.
    negligible: float = 0.001
    # Relative error of the noise, within which compare calls all of an error noise. A spectrum of
    # a dozen coefficients per octave is known to about that.
    noise_accuracy: float = 0.1
    # Unexplained error over the effort, up to which a model is good. The controller then has to
    # supply a twentieth of the effort.
    good: float = 0.05
    # Unexplained error over the effort, above which a model is poor. A fifth is more than
    # friction in most robots.
    poor: float = 0.2
    # By how much a number must have moved to be reported as calibrated, and held-out data be
    # predicted worse with an effect for it to be refuted [deviations]. 95 %.
    sure: float = 2.0
    # How near the edge of what was tried a shape is not to be trusted. Half a step of the finest
    # grids.
    edge_share: float = 0.02
    # Length of all recordings, below which a warning is given [s]. Friction, springs and slow
    # noise look alike within one or two strokes.
    short: float = 8.0
    # Independent samples of a drive, below which a warning is given. A mean is then known to an
    # eighth of the noise.
    few_samples: float = 60.0
    # Gain of an effect of a size that matters, below which it is unseen [deviance]. Two standard
    # deviations.
    unexcited: float = 4.0
    # Share of the motion in one direction, above which a warning is given. Friction is then a
    # constant but for a twentieth.
    one_way: float = 0.95
    # Fast part of an effort over that of white noise, below which it looks filtered. Amplifiers
    # and converters add more fast noise.
    filtered: float = 0.05
    # Correlation, in two runs, of what repeats of the error of a reference, as expected before
    # its parts show it. Between six pairs of runs of a UR10e it is 0.4 to 0.8.
    run_repeats: float = 0.6
    # Standard deviation of that expectation. The same.
    run_repeats_spread: float = 0.2
    # The most that it is where a single run is the reference. A machine is not the same on two
    # days: 14 % of what repeats is another.
    one_run_repeats: float = 0.99
    # Share of the variance of the repeatable error that a reference explains in a state, from
    # which the state counts as covered. More of the force is then known than unknown.
    reference_known: float = 0.5


DECISIONS = Decisions()
