"""An effect tried on recordings: fitted with all that the model has, whoever proposes it."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pprs_dynamics.diagnosis.adoption import Calibration, Estimate, calibrations, estimate_all
from pprs_dynamics.diagnosis.adoption import fitted_model as model_of
from pprs_dynamics.diagnosis.joint_fit import JointFit, Regression
from pprs_dynamics.diagnosis.judging import Judged
from pprs_dynamics.diagnosis.library import Candidate
from pprs_dynamics.diagnosis.reversal_widths import estimate_widths
from pprs_dynamics.diagnosis.scan import Scan
from pprs_dynamics.diagnosis.selection import Selector
from pprs_dynamics.diagnosis.stages import NOT_LINEAR
from pprs_dynamics.effects.catalogue import catalogue, find_effect
from pprs_dynamics.effects.drive_effect import DriveEffect
from pprs_dynamics.effects.effect import CatalogueEffect
from pprs_dynamics.errors import PprsError
from pprs_dynamics.measurement.recording import Recording
from pprs_dynamics.mechanism.robot import DRIVES
from pprs_dynamics.model.force_model import ForceModel
from pprs_dynamics.model.keys import set_number
from pprs_dynamics.model.model_file import build_model
from pprs_dynamics.regression.design import Design

LEAST_MOVE = 0.02  # of a number's deviation; less is left as the file has it


class OfferError(PprsError, ValueError):
    """An effect or drive that does not exist."""


class StandingError(PprsError, ValueError):
    """Friction that is to be fitted on drives that stand."""


@dataclass(frozen=True)
class Offer:
    """An effect that somebody wants in the model.

    Parameters
    ----------
    effect : type of CatalogueEffect
    drives : tuple of str or None
        On which; None: where the recordings call for it.
    """

    effect: type[CatalogueEffect]
    drives: tuple[str, ...] | None = None

    @classmethod
    def of(cls, text: str, known: tuple[str, ...] = DRIVES) -> Offer:
        """Read EFFECT or EFFECT:drive,drive, of the drives that are known.

        Raises
        ------
        OfferError
            For an effect or a drive that does not exist.
        """
        name, colon, listed = text.partition(':')
        effect = find_effect(name)
        if effect is None:
            close = difflib.get_close_matches(name, list(catalogue()), 1)
            raise OfferError(f'{name!r} is no effect{f" (did you mean {close[0]}?)" * len(close)}, '
                             f'but it must be one of {", ".join(catalogue())}')
        if not colon:
            return cls(effect)
        drives = tuple(dict.fromkeys(drive.strip() for drive in listed.split(',')))
        if not issubclass(effect, DriveEffect):
            raise OfferError(f'{text!r} names drives, but {name} is in the structure and must '
                             f'stand alone')
        for drive in drives:
            if drive not in known:
                raise OfferError(f'{drive!r} is no drive, but it must be one of '
                                 f'{", ".join(known)}')
        return cls(effect, tuple(sorted(drives, key=known.index)))

    def require_place(self, model: ForceModel) -> None:
        """Raise OfferError where the effect cannot act in what the model is of."""
        if not model.offers(self.effect):
            offered = [name for name, effect in catalogue().items() if model.offers(effect)]
            raise OfferError(f'{self.name} does not act in {model.title}, but it must be one of '
                             f'{", ".join(offered)}')

    @property
    def name(self) -> str:
        """Of the effect."""
        return self.effect.name

    def present(self, model: ForceModel) -> bool:
        """Return whether the model has it already, on every drive that is asked for."""
        for effect in model.effects:
            if effect.name == self.name:
                return not isinstance(effect, DriveEffect) or (
                    self.drives is not None and set(self.drives) <= set(effect.drives))
        return False


@dataclass(frozen=True)
class Trial:
    """A model with an effect, and how its fit came about.

    Parameters
    ----------
    offer : Offer
    drives : tuple of str or None
        On which it was fitted.
    model : ForceModel
        With the effect.
    plain : ForceModel
        Without it, its own numbers fitted alike.
    parameters : dict of str to Estimate
    at_bound : tuple of str
    calibrated : list of Calibration
    evidence : float
    own_share : float
        The least share of a column's square that nothing else in the model explains.
    regression, fit, without : Regression, JointFit, JointFit
        Around the model as given: with the effect and without it.
    held_out_before, held_out_after : float
        Over blocks, each predicted from the others [N].
    block_gains : (B,) array
        What the effect takes off the whitened squared error of each held-out block.
    """

    offer: Offer
    drives: tuple[str, ...] | None
    model: ForceModel
    plain: ForceModel
    parameters: dict[str, Estimate]
    at_bound: tuple[str, ...]
    calibrated: list[Calibration]
    evidence: float
    own_share: float
    regression: Regression
    fit: JointFit
    without: JointFit
    held_out_before: float
    held_out_after: float
    block_gains: np.typing.NDArray[np.float64]


def try_effect(
    model: ForceModel, offer: Offer, recordings: Sequence[Recording],
    progress: Callable[[float], None] | None = None,
) -> Trial | None:
    """Return the model with an effect that it does not have yet; None where it has it all.

    Raises
    ------
    ModelError
        Where the fit gives values that no model may have.
    StandingError
        Where friction is asked for on drives that hardly moved.
    PprsError
        As `measure_residuals`.
    """
    report = progress or (lambda share: None)
    design = Design.of(model, recordings, lambda share: report(0.4 * share))
    _require_motion(design, offer)
    regression = Regression(design)
    selector = Selector(regression)
    without = regression.fit((), selector.rich)
    judged = _best_fit(selector, without, offer)
    report(0.6)
    if judged is None:
        return None
    active, fit = judged.candidate.active, judged.fit
    parameters: dict[str, Estimate] = {}
    at_bound: tuple[str, ...] = ()
    for found in estimate_all(regression, fit):
        parameters.update(found.parameters)
        at_bound += found.at_bound
    # Drive by drive, and not in the order in which they were found.
    parameters = {key: parameters[key] for key in sorted(
        parameters, key=lambda key: design.drives.index(key.split('.')[0]) if '.' in key else 0)}
    noises = fit.noises
    before = regression.block_losses((), noises).losses
    around, last = regression, fit
    if offer.name in NOT_LINEAR:
        # Its columns hold around the model without it; the fit is done again around the one
        # with it, its numbers counted from the same values.
        around = Regression(Design.of(model_of(regression, fit, calibrate=False), recordings,
                                      lambda share: report(0.6 + 0.3 * share)))
        last = around.fit((), noises)
    after = around.block_losses(last.active, noises).losses
    regression.tell_widths(list(estimate_widths(regression, fit)))
    around.tell_widths(list(estimate_widths(around, last)))
    moved = [one for one in calibrations(around, last) if _is_move(around, one)]
    final = _with_numbers(model_of(around, last), model, moved)
    for key, estimate in parameters.items():
        value = float(final.values[f'effects.{offer.name}.{key}'])
        parameters[key] = Estimate(value, estimate.std, estimate.unit)
    report(1.0)
    drives = judged.candidate.drives
    return Trial(
        offer, None if drives is None else tuple(design.drives[d] for d in sorted(drives)),
        final, model_of(regression, regression.fit((), noises)), parameters, at_bound,
        moved,
        judged.evidence, _own_share(selector, active, fit), regression, fit, without,
        regression.held_out_error((), noises), around.held_out_error(last.active, noises),
        before - after)


def _require_motion(design: Design, offer: Offer) -> None:
    """Raise StandingError for friction on drives that stand, where these are asked for or all."""
    if not offer.effect.needs_motion:
        return
    asked = offer.drives or design.drives
    standing = [name for name in asked if not design.moves(design.drives.index(name))]
    if standing and (offer.drives or len(standing) == len(asked)):
        raise StandingError(f'{", ".join(standing)} hardly moved in the recordings, but they must '
                            'show friction where it is to be fitted')


def _is_move(regression: Regression, one: Calibration) -> bool:
    """Return whether a number moves at all against what its tolerance allows."""
    deviations = {(column.number.key, column.number.element): column.number.deviation
                  for column in regression.design.base if column.number is not None}
    # Widths of reversal have no tolerance: they are told where they differ for certain.
    return abs(one.after - one.before) > LEAST_MOVE * deviations.get((one.key, one.element), 0.0)


def _with_numbers(fitted: ForceModel, start: ForceModel, moved: Sequence[Calibration],
                  ) -> ForceModel:
    """Return a fitted model in which only some numbers are not as they were at the start."""
    values = {**fitted.values, **{key: start.values[key] for key in start.keys}}
    for one in moved:
        set_number(values, one.key, one.element, one.after)
    return replace(build_model(values), source=fitted.source)


def _best_fit(selector: Selector, without: JointFit, offer: Offer) -> Judged | None:
    """Return the effect with the shape and drives that do best, from two scans."""
    found = []
    for noises in (without.noises, selector.rich):
        scan = Scan(selector.library, (), noises)
        candidate = _candidate(scan, offer)
        if candidate is not None:
            found.append(selector.judge.of(scan.refined(candidate), without, ()))
    return max(found, key=lambda one: one.evidence, default=None)


def _candidate(scan: Scan, offer: Offer) -> Candidate | None:
    """Return the best variant and shape on every drive that is asked for, or where it pays."""
    library, names = scan.library, scan.regression.design.drives
    best: dict[int | None, Candidate] = {}
    spanning = (Candidate((active,), gain, library.penalty(active))
                for active, gain in scan.terms() if active.term.effect is offer.effect)
    local = (one for one in scan.local_bests() if one.effect is offer.effect)
    for one in (*spanning, *local):
        drive = one.active[0].term.drive
        asked = drive is None or offer.drives is None or names[drive] in offer.drives
        if asked and (drive not in best or one.score > best[drive].score):
            best[drive] = one
    kept = list(best.values())
    if offer.drives is None and kept:
        kept = ([one for one in kept if one.score > 0]
                or [max(kept, key=lambda one: one.score)])
    if not kept:
        return None
    return Candidate(tuple(active for one in kept for active in one.active),
                     sum(one.gain for one in kept),
                     sum(one.penalty for one in kept) + library.name_penalty)


def _own_share(selector: Selector, actives: Sequence[object], fit: JointFit) -> float:
    scan, least = Scan(selector.library, (), fit.noises), 1.0
    for active in fit.active:
        if active in actives and not active.fixed:
            S, _, whole = scan.projected(active.term.rows)  # type: ignore[union-attr]
            chosen = active.chosen  # type: ignore[union-attr]
            least = min(least, float((np.diag(S)[chosen] / whole[chosen]).min()))
    return least
