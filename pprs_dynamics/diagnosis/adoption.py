"""From a fit to numbers with uncertainty, and to a model that has them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.diagnosis.joint_fit import Active, Columns, JointFit, Regression
from pprs_dynamics.diagnosis.reversal_widths import estimate_widths, place_of
from pprs_dynamics.effects.drive_effect import DriveEffect
from pprs_dynamics.effects.effect import CatalogueEffect, Parameter
from pprs_dynamics.effects.time_delay import TimeDelay
from pprs_dynamics.model.force_model import ForceModel
from pprs_dynamics.model.keys import set_number
from pprs_dynamics.model.model_file import build_model
from pprs_dynamics.regression.design import SHAPE_STEP, BaseColumn, Design

DELAY_STEP = 1e-4  # [s]
DIGITS = 6  # significant, of fitted values


@dataclass(frozen=True)
class Estimate:
    """A fitted value: with `std` as far as correlated noise lets it be known."""

    value: float
    std: float
    unit: str

    def as_data(self) -> dict[str, Any]:
        """Return the keys of the interface."""
        return {'value': self.value, 'std': self.std, 'unit': self.unit}


@dataclass(frozen=True)
class Calibration:
    """A number of the model that was moved within its tolerance."""

    key: str
    element: int | None
    before: float
    after: float
    std: float
    unit: str

    @property
    def label(self) -> str:
        """Name for people, e.g. masses.slides[2]."""
        return self.key if self.element is None else f'{self.key}[{self.element + 1}]'


@dataclass(frozen=True)
class Estimates:
    """What a fit says about an effect.

    Parameters
    ----------
    parameters : dict of str to Estimate
        By drive.parameter, or parameter.
    at_bound : tuple of str
        Those that the bounds of the catalogue held back.
    """

    parameters: dict[str, Estimate]
    at_bound: tuple[str, ...]


def estimate_all(regression: Regression, fit: JointFit) -> list[Estimates]:
    """Return parameters with uncertainty for every active term of a fit.

    Shape parameters take part in the covariance by their derivatives, so that what is uncertain
    in them makes the coefficients uncertain, too.
    """
    design, actives = regression.design, [a for a in fit.active if isinstance(a, Active)]
    extended: list[Active | Columns] = []
    place = len(design.base)
    for active in actives:
        c = fit.coefficients[place:place + active.size]
        place += active.size
        extended.append(active)
        slopes = _shape_rows(design, active, c)
        if slopes is not None:
            extended.append(slopes)
    _, covariance, _ = regression.solve(extended, fit.noises)
    found, place, fitted = [], len(design.base), len(design.base)
    for active in actives:
        c = fit.coefficients[fitted:fitted + active.size]
        fitted += active.size
        shapes = len(active.term.shape)
        width = active.size + shapes
        block = covariance[place:place + width, place:place + width]
        place += width
        found.append(_estimates(design, active, c, block))
    return found


def _shape_rows(design: Design, active: Active, coefficients: Array) -> Columns | None:
    """Return derivatives by the shape parameters, relative ones but for a delay."""
    term = active.term
    if term.drive is None or not issubclass(term.effect, DriveEffect) or not term.shape:
        return None
    rows = []
    for name, value in term.shape.items():
        if term.effect is TimeDelay:
            later = design.drive_rows(term.effect, term.drive, {name: value + DELAY_STEP})
            rows.append((later - term.rows[term.drive])[0] / DELAY_STEP)
            continue
        moved = design.drive_rows(term.effect, term.drive,
                                  {**term.shape, name: value * (1 + SHAPE_STEP)})
        change: Array = (
            moved - design.drive_rows(term.effect, term.drive, term.shape)) / SHAPE_STEP
        rows.append(coefficients @ change[active.chosen])
    return Columns({term.drive: np.stack(rows)})


def linear_values(active: Active, coefficients: Array) -> dict[str, float]:
    """Return the linear parameters of an active term."""
    effect = active.term.effect
    every = {c.name: 0.0 for c in effect.coefficients}
    every.update(zip(active.variant, (float(c) for c in coefficients), strict=False))
    return {name: float(value) for name, value in effect.from_coefficients(every).items()}


def _estimates(design: Design, active: Active, c: Array, covariance: Array) -> Estimates:
    effect, term = active.term.effect, active.term
    prefix = '' if term.drive is None else f'{design.drives[term.drive]}.'
    values = linear_values(active, c)
    size = active.size
    found, bound = {}, []
    # From coefficients to parameters: the map is smooth but for angles, which it may wrap.
    for parameter in effect.linear:
        slope = np.zeros(size)
        for k in range(size):
            step = 1e-4 * max(float(np.sqrt(covariance[k, k])), 1e-12)
            moved = c.copy()
            moved[k] += step
            slope[k] = (linear_values(active, moved)[parameter.name]
                        - values[parameter.name]) / step
        variance = float(slope @ covariance[:size, :size] @ slope)
        std = max(variance, 0.0) ** 0.5
        found[prefix + parameter.name] = Estimate(
            _within(parameter, values[parameter.name]), std, parameter.unit)
        if not parameter.lower <= values[parameter.name] <= parameter.upper:
            bound.append(prefix + parameter.name)
    for k, parameter in enumerate(effect.shape):
        value = float(term.shape[parameter.name])
        std = float(np.sqrt(max(covariance[size + k, size + k], 0.0)))
        found[prefix + parameter.name] = Estimate(
            _within(parameter, value), std if effect is TimeDelay else std * abs(value),
            parameter.unit)
        trials = sorted({trial[parameter.name] for trial in _trials(design, active)})
        if len(trials) > 2 and not trials[0] * 1.02 < value < trials[-1] * 0.98:
            bound.append(prefix + parameter.name)
    return Estimates(found, tuple(bound))


def _trials(design: Design, active: Active) -> Sequence[Mapping[str, float]]:
    effect, drive = active.term.effect, active.term.drive
    if drive is None or not issubclass(effect, DriveEffect):
        return ()
    return effect.trials(design.covered[drive])


def _within(parameter: Parameter, value: float) -> float:
    rounded = float(f'{value:.{DIGITS}g}')
    return float(min(max(rounded, parameter.lower), parameter.upper))


def calibrations(regression: Regression, fit: JointFit,
                 given: ForceModel | None = None) -> list[Calibration]:
    """Return the numbers that the fit moves within their tolerances.

    Parameters
    ----------
    regression : Regression
    fit : JointFit
    given : ForceModel, optional
        From which widths of reversal are counted; by default the design's.
    """
    found = []
    for k, column in enumerate(regression.design.base):
        if column.number is None:
            continue
        number, share = column.number, float(fit.coefficients[k])
        std = float(np.sqrt(fit.covariance[k, k])) * number.deviation
        found.append(Calibration(
            number.key, number.element, number.value,
            float(f'{number.value + np.sign(number.value) * share * number.deviation:.{DIGITS}g}'),
            std, number.unit))
    model, count = regression.design.model, len(regression.design.drives)
    before = np.broadcast_to((given or model).reversal.velocity, count)
    after = np.array(np.broadcast_to(model.reversal.velocity, count))
    for d, width in estimate_widths(regression, fit).items():
        after[d] = float(f'{width:.{DIGITS}g}')
    # Widths are told without an uncertainty: the fits allow for all of them anyway.
    found += [Calibration(*place_of(regression.design, d), float(before[d]), float(after[d]), 0.0,
                          'm/s') for d in range(count) if before[d] != after[d]]
    return found


def fitted_model(regression: Regression, fit: JointFit, calibrate: bool = True) -> ForceModel:
    """Return the model with the effects of a fit, and its own numbers as the fit moves them.

    Raises
    ------
    ModelError
        For values that no model may have.
    """
    design = regression.design
    values: dict[str, Any] = dict(design.model.values)
    if calibrate:
        for one in calibrations(regression, fit):
            set_number(values, one.key, one.element, one.after)
    _update_present(values, design, fit)
    names = list(values.get('effects.active', []))
    for active, estimates in zip([a for a in fit.active if isinstance(a, Active)],
                                 estimate_all(regression, fit), strict=True):
        name = active.term.effect.name
        if name not in names:
            names.append(name)
        for key, estimate in estimates.parameters.items():
            values[f'effects.{name}.{key}'] = estimate.value
    if names:
        values['effects.active'] = names
    model = build_model(values)
    return replace(model, source=design.model.source)


def estimate_present(regression: Regression, fit: JointFit, name: str) -> Estimates:
    """Return what a fit says about an effect that its model has already.

    Only for effects whose parameters are their coefficients.
    """
    values = dict(regression.design.model.values)
    _update_present(values, regression.design, fit)
    effect = next(e for e in regression.design.model.effects if e.name == name)
    assert isinstance(effect, CatalogueEffect)
    units = {p.name: p.unit for p in effect.parameters}
    steps = {p.name: p.scale for p in effect.parameters}
    found = {}
    for k, column in enumerate(regression.design.base):
        if column.kind == 'present' and column.label.startswith(f'{name}.'):
            _, drive, parameter = column.label.split('.')
            key = f'{drive}.{parameter}' if drive else parameter
            std = float(np.sqrt(fit.covariance[k, k])) * (
                1e-3 if parameter == 'delay' else steps[parameter])
            found[key] = Estimate(values[f'effects.{name}.{key}'], std, units[parameter])
    return Estimates(found, ())


def _update_present(values: dict[str, Any], design: Design, fit: JointFit) -> None:
    """Move what is in the model already by what the fit says."""
    changes: dict[tuple[str, str], list[tuple[BaseColumn, float]]] = {}
    for column, c in zip(design.base, fit.coefficients, strict=False):
        if column.kind == 'present':
            name, drive, _ = column.label.split('.')
            changes.setdefault((name, drive), []).append((column, float(c)))
    for effect in design.model.effects:
        for (name, drive), found in changes.items():
            if name != effect.name:
                continue
            kind: Any = type(effect)
            block: dict[str, float] = (effect.drives[drive] if drive  # type: ignore[attr-defined]
                                       else effect.values)  # type: ignore[attr-defined]
            coefficients = kind.to_coefficients(block)
            scales = {p.name: p.scale for p in kind.coefficients}
            shape = {p.name: block[p.name] for p in kind.shape}
            for column, c in found:
                last = column.label.split('.')[2]
                if last in coefficients:
                    coefficients[last] += c * scales[last]
                elif kind is TimeDelay:
                    shape[last] += c * 1e-3
                elif last == 'zero':
                    coefficients[last] += c * kind.linear[0].scale
                else:
                    shape[last] *= float(np.exp(np.clip(0.1 * c, -0.5, 0.5)))
            every = {**kind.from_coefficients(coefficients), **shape}
            prefix = f'effects.{name}.{drive}.' if drive else f'effects.{name}.'
            for parameter in kind.parameters:
                values[prefix + parameter.name] = _within(parameter, every[parameter.name])


def contributed_force(design: Design, active: Sequence[Active], coefficients: Array) -> Array:
    """Return what active terms contribute, (M, D) [N]."""
    force, place = np.zeros(design.residuals.measured.shape), 0
    for one in active:
        for d in one.term.rows:
            rows = one.on(d)
            assert rows is not None
            force[:, d] += rows[0] if one.fixed else coefficients[place:place + one.size] @ rows
        place += one.size
    return force
