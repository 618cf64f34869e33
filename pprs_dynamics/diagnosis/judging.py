"""Evidence for an effect beside others, with the noise refitted, and what completes it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pprs_dynamics.diagnosis.joint_fit import Active, Fitted, JointFit, Regression
from pprs_dynamics.diagnosis.library import Candidate, Library
from pprs_dynamics.diagnosis.noise import NoiseModel
from pprs_dynamics.diagnosis.parallel import each
from pprs_dynamics.diagnosis.regression import solve
from pprs_dynamics.diagnosis.scan import DRIVE_MARGIN, FINE, Scan

WHITE_ITERATIONS = 4  # of noise and effect in turn, from least squares on
MARGIN = 10.0  # beyond the penalty, for what slow noise looks like


@dataclass(frozen=True)
class Judged:
    """A candidate beside what is adopted, with the noise refitted.

    Parameters
    ----------
    candidate : Candidate
    fit : JointFit
        With it.
    evidence : float
        Gain less penalty and margin.
    """

    candidate: Candidate
    fit: JointFit
    evidence: float


def actives_of(adopted: Sequence[Judged]) -> tuple[Active, ...]:
    """Return the terms of several effects, in order."""
    return tuple(active for one in adopted for active in one.candidate.active)


class Judge:
    """Judges effects by the likelihood that they gain.

    Parameters
    ----------
    regression : Regression
    """

    def __init__(self, regression: Regression) -> None:
        self.regression = regression
        self.library = Library(regression)
        self.rich = dict(zip(regression.series, each(self._rich_noise, regression.series),
                             strict=True))

    def of(self, candidate: Candidate, without: JointFit,
           active: tuple[Active, ...]) -> Judged:
        """Return a candidate's evidence beside active terms, the noise refitted."""
        spans = candidate.drives is None or any(
            len(one.term.rows) > 1 for one in candidate.active)
        touched = list(self.regression.series) if spans else list(candidate.drives or ())
        starts = {**without.noises, **{d: self.rich[d] for d in touched}}
        fit = self.regression.fit((*active, *candidate.active), starts, touched)
        gain = without.deviance - fit.deviance
        if gain > candidate.penalty:
            gain = min(gain, self.regression.guarded_gain(fit, active))
        return Judged(candidate, fit, gain - candidate.penalty - MARGIN)

    def completed(self, one: Judged, without: JointFit, active: tuple[Active, ...]) -> Judged:
        """Return an effect with the coefficients or drives that pay once noise is refitted.

        Noise that swallowed most of an effect proposes too few of them.
        """
        first = one.candidate.active[0]
        prices = one.candidate.penalty - sum(map(self.library.penalty, one.candidate.active))
        if first.term.drive is None:
            wider: list[tuple[Active, ...]] = [
                (Active(first.term, variant),) for variant in first.term.effect.variants
                if set(variant) > set(first.variant)]
        else:
            more = self._further_drives(one, active)
            wider = [(*one.candidate.active, *more[:count])
                     for count in sorted({1, len(more)})] if more else []
        judged = [one]
        for every in wider:
            price = prices + sum(map(self.library.penalty, every))
            judged.append(self.of(Candidate(every, 0.0, price), without, active))
        return max(judged, key=lambda one: one.evidence)

    def _further_drives(self, one: Judged, active: tuple[Active, ...]) -> list[Active]:
        """Return an effect without shape on drives where it may pay beside others, best first."""
        taken = {(a.term.effect.name, a.term.drive) for a in (*active, *one.candidate.active)}
        taking_part = set(one.candidate.drives or ()) & set(one.fit.noises)
        noises = {**self.rich, **{d: one.fit.noises[d] for d in taking_part}}
        scan = Scan(self.library, (*active, *one.candidate.active), noises)
        found: list[tuple[float, Active]] = []
        for term in (term for terms in self.library.local.values() for term in terms):
            if term.effect is one.candidate.effect and not term.shape and (
                    term.effect.name, term.drive) not in taken:
                trials = [Active(term, variant) for variant in term.effect.variants]
                found.append(max(((scan.gain(trial) - self.library.penalty(trial), trial)
                                  for trial in trials), key=lambda pair: pair[0]))
        found.sort(key=lambda pair: -pair[0])
        return [further for score, further in found if score > DRIVE_MARGIN]

    def polished(self, winner: Judged, without: JointFit, active: tuple[Active, ...]) -> Judged:
        """Return a winner with shapes and noise as exact as they can be had, if that is better."""
        if any(one.term.shape for one in winner.candidate.active):
            scan = Scan(self.library, active, winner.fit.noises)
            exact = self.of(scan.refined(winner.candidate, FINE), without, active)
            winner = max(winner, exact, key=lambda one: one.evidence)
        # Noise and effect have more than one optimum: a slow noise that swallows part of the
        # effect is one. Least squares without any correlation starts at another.
        fit = self.from_least_squares(winner.fit.active)
        return replace(winner, fit=fit) if fit.deviance < winner.fit.deviance else winner

    def from_least_squares(self, active: Sequence[Fitted]) -> JointFit:
        """Return the fit that starts without any correlation of the noise."""
        white = {d: NoiseModel((), (0,), (np.zeros(0),), (noise.innovation,))
                 for d, noise in self.rich.items()}
        return self.regression.fit(active, white, iterations=WHITE_ITERATIONS)

    def _rich_noise(self, d: int) -> NoiseModel:
        """Noise of what a drive's regression on nearly all effects leaves."""
        series = self.regression.series[d]
        rows = [self.regression.base_rows[d]]
        rows += [term.rows[d][:, series.index] for term in self.library.structure
                 if d in term.rows]
        seen: dict[str, int] = {}
        for term in self.library.local[d]:
            name = term.effect.name
            seen[name] = seen.get(name, 0) + 1
            every = max(1, self.library.trials[name, d] // 3)
            if name != 'force_ripple' and not term.fixed and seen[name] % every == every // 2:
                rows.append(term.rows[d][:, series.index])
        stacked = np.concatenate(rows)
        stacked = stacked[np.any(stacked, axis=1)]
        rest = series.error - solve(stacked, series.error) @ stacked
        noise = series.fit_noise(rest)
        white = series.whiten(noise, np.concatenate((stacked, series.error[None])))
        return series.fit_noise(series.error - solve(white[:-1], white[-1]) @ stacked)
