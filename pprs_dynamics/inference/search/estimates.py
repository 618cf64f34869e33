# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Parameters with uncertainty, from a set and those that are nearly as good."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.base_columns import (
    ModelNumber,
    PresentParameter,
    present_values,
    units_of,
    within,
)
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.joint_fit import JointFit
from pprs_dynamics.inference.regression.normal_equations import Block
from pprs_dynamics.inference.search.candidates import CandidateSet, Component, EffectCandidate
from pprs_dynamics.inference.search.components import placed
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.effects.structure_effect import AXES, AddedBody

DETERMINED = 0.5  # of a coefficient's prior variance, below which the recordings determine it
# Of the usual precision, for the centre of a body about which the set says nothing.
FREE = 1e-2


@dataclass(frozen=True)
class Estimate:
    """A fitted value and its standard deviation."""

    value: float
    std: float
    unit: str


@dataclass(frozen=True)
class FittedNumber:
    """A number of the model, before and after a fit, with its standard deviation.

    Parameters
    ----------
    key, drive : str
        Drive '' where the key says all.
    before, after, std : float
    unit : str
    """

    key: str
    drive: str
    before: float
    after: float
    std: float
    unit: str


@dataclass(frozen=True)
class Estimates:
    """Estimates of the parameters of an effect.

    Parameters
    ----------
    parameters : dict of str to Estimate
        By drive.parameter, or parameter.
    at_bound : tuple of str
        Those at the edge of the shapes that were tried.
    moments : dict of str to Estimate
        First moments of added bodies about the frames of their links, by the name of their
        coefficient: a slow motion determines these, and not mass and centre.
    """

    parameters: dict[str, Estimate]
    at_bound: tuple[str, ...]
    moments: dict[str, Estimate] = field(default_factory=dict)


def estimate(fits: FittedSets, fitted: CandidateSet, candidate: EffectCandidate,
             are_drives_known: bool = False) -> Estimates:
    """Return the parameters of an effect, in the values that the set has.

    Their uncertainty is that of the whole fit: shapes take part by their derivatives, tolerances
    and noise as they are.

    Parameters
    ----------
    fits : FittedSets
    fitted : CandidateSet
    candidate : EffectCandidate
        Of the set.
    are_drives_known : bool
        It is on these drives for certain: somebody chose them.
    """
    slopes = fits.slopes(fitted)
    elsewhere = [] if are_drives_known else _determined_on_other_drives(fits, fitted, candidate)
    centres = {component: _free_centre(fits, component, names)
               for component in candidate.components
               if (names := moments_left_out(component.effect, component.names))}
    elsewhere += centres.values()
    fit = fits.regression.stated(fitted.fit, [*dict.fromkeys(slopes.values()), *elsewhere])
    parameters: dict[str, Estimate] = {}
    bound: list[str] = []
    moments: dict[str, Estimate] = {}
    for component in candidate.components:
        index = _places(fits, fit, component, slopes.get(component))
        c, covariance = fitted.coefficients(component), _covariance(
            fits, fit, component, len(index), index)
        if component in centres:
            determined, covariance[0, 0] = _beside_centre(
                component, c, fit, [*index[:1], *fit.index_of([centres[component]])],
                fits.components.block(component).precision[0, 0])
            moments.update(determined)
        some, held = _of_component(fits, component, c, covariance, moved=fitted.fit.coefficients)
        parameters.update(some)
        bound += held
        moments.update(_moments(_moved(fits, component, fitted.fit.coefficients), c, covariance))
    for key, changed in _left_out(fits, fitted, candidate).items():
        parameters[key] = replace(parameters[key], std=changed.std)
    return Estimates(parameters, tuple(bound), moments)


def moments_left_out(effect: type[CatalogueEffect], names: Sequence[str]) -> tuple[str, ...]:
    """Return the first moments of a body at the tool that was fitted as a mass alone."""
    moments = tuple(f'moment_{axis}' for axis in AXES)
    known = {coefficient.name for coefficient in effect.coefficients}
    return moments if (issubclass(effect, AddedBody) and tuple(names) == ('mass',)
                       and known.issuperset(moments)) else ()


def _free_centre(fits: FittedSets, component: Component, moments: tuple[str, ...]) -> Block:
    """Return the columns of first moments, of which nearly nothing is known beforehand.

    A motion that determines mass times distance alone determines neither of them: the interval of
    the mass has to allow for every centre.
    """
    block = fits.components.block(replace(component, names=moments, given=()))
    return replace(block, precision=FREE * block.precision)


def _beside_centre(component: Component, c: Array, fit: JointFit, index: Sequence[int],
                   precision: float) -> tuple[dict[str, Estimate], float]:
    """Return the best known combination of mass and first moments, and the variance of the mass.

    Parameters
    ----------
    component : Component
        A mass at a fixed centre.
    c : (1,) array
        The mass.
    fit : JointFit
    index : sequence of int
        Places of the mass and of the first moments in the fit.
    precision : float
        Of the mass in its prior, which would narrow the interval by itself.
    """
    covariance = fit.covariance[np.ix_(index, index)]
    scale = np.sqrt(np.diag(covariance))
    inverse = np.linalg.pinv(covariance / np.outer(scale, scale), hermitian=True)
    weights = inverse[0] / inverse[0, 0] * scale[0] / scale
    terms = [f'{"+" if weight > 0 else "-"} {abs(weight):.3g} moment_{axis}'
             for axis, weight in zip(AXES, weights[1:], strict=True) if abs(weight) > 1e-3]
    total = component.total(c)[[k.name for k in component.effect.coefficients].index('mass')]
    combination = Estimate(
        float(total), float(scale[0] * inverse[0, 0] ** -0.5), 'kg')
    # Without its prior; of a mass that is all prior, with a share of it (Sherman and Morrison).
    variance = covariance[0, 0] / max(1 - precision * covariance[0, 0], FREE)
    return {' '.join(['mass', *terms]): combination} if terms else {}, float(variance)


def averaged(reported: Estimates, others: Sequence[tuple[float, Estimates]],
             shared: Collection[str]) -> Estimates:
    """Return estimates whose uncertainty has what other sets say differently.

    Parameters
    ----------
    reported : Estimates
        Their values stay.
    others : sequence of (float, Estimates)
        Each with what its set costs more, which weighs it by exp(-cost / 2).
    shared : collection of str
        Parameters that all drives share: another set may have them on fewer drives.
    """
    weights = np.array([1.0, *(np.exp(-0.5 * max(more, 0.0)) for more, _ in others)])
    share = weights / weights.sum()
    parameters = {}
    for key, estimate in reported.parameters.items():
        name = key.rpartition('.')[2]
        there = [estimate, *(next((
            other for at, other in estimates.parameters.items()
            if at == key or (name in shared and at.endswith(f'.{name}'))), estimate)
            for _, estimates in others)]
        squares = [other.std ** 2 + (other.value - estimate.value) ** 2 for other in there]
        parameters[key] = replace(estimate, std=float(np.sqrt(share @ squares)))
    return replace(reported, parameters=parameters)


def _determined_on_other_drives(fits: FittedSets, fitted: CandidateSet, candidate: EffectCandidate,
                                ) -> list[Block]:
    """Return an effect's columns on other drives whose coefficients are determined.

    That it is on some drives is a choice, and less certain than values given that choice: gains
    of some drives are known as well as those of the others are known to be none. Not where the
    recordings say nothing (a zero of one lift, which shifts the robot); shapes are those of one
    drive alone.
    """
    effect, drives = candidate.effect, candidate.drives
    if drives is None or effect.shape or fitted.blocks[candidate.components[0]].mean is not None:
        return []
    names = candidate.components[0].names
    blocks = [fits.components.block(placed(fits.design, effect, d, {}, names))
              for d in fits.regression.drives
              if d not in drives and fits.design.acts_on(effect, d)]
    fit = fits.regression.at((*fitted.fit.blocks, *blocks), fitted.fit)
    return [block for block in blocks if np.all(
        np.diag(fit.covariance[fit.places[block], fit.places[block]])
        < DETERMINED * np.diag(np.linalg.inv(block.precision)))]


def _left_out(fits: FittedSets, other: CandidateSet, candidate: EffectCandidate,
              ) -> dict[str, Estimate]:
    """Return the deviations of an effect's parameters that are not fitted, and are 0.

    Of an effect on one link or joint, and of a body, only what was fitted is reported.
    """
    if candidate.effect.is_of_one_place or issubclass(candidate.effect, AddedBody):
        return {}
    estimates = {}
    for component in candidate.components:
        every = tuple(c.name for c in candidate.effect.coefficients)
        rest = tuple(name for name in every if name not in component.names)
        if not component.names or not rest:
            continue
        block = fits.components.block(replace(component, names=rest))
        fit = fits.regression.stated(other.fit, [block])
        others = replace(component, names=rest, given=())
        index = _places(fits, fit, replace(component, names=rest))
        some, _ = _of_component(fits, others, np.zeros(len(rest)), _covariance(
            fits, fit, others, len(rest), index), with_shape=False)
        prefix = '' if component.drive is None else f'{fits.design.drives[component.drive]}.'
        changed = replace(component, given=()).values(other.coefficients(component))
        fitted = {prefix + p.name for p in candidate.effect.linear if changed[p.name]}
        # Of what the recordings do not show at all no more is known than its bounds.
        widest = {prefix + p.name: p.widest.upper - p.widest.lower
                  for p in candidate.effect.linear}
        estimates.update({key: replace(estimate, std=min(estimate.std, widest[key]))
                          for key, estimate in some.items() if key not in fitted})
    return estimates


def _places(fits: FittedSets, fit: JointFit, component: Component, slopes: Block | None = None,
            ) -> list[int]:
    """Return the places of a component's coefficients in a fit, then of its shape."""
    index = fit.index_of([fits.components.block(component)])
    places = index[:max(len(component.names), 1)].tolist()
    return places if slopes is None else [*places, *fit.index_of([slopes]).tolist()]


def _covariance(fits: FittedSets, fit: JointFit, component: Component, size: int,
                index: Sequence[int]) -> Array:
    """Return the covariance of a component's coefficients, then of its shape where that is in it.

    Of an effect that the given model has, with what it may be otherwise within its uncertainty.

    Parameters
    ----------
    fits : FittedSets
    fit : JointFit
    component : Component
    size : int
    index : sequence of int
        Their places in the fit; none where the base columns are all that there is of them.
    """
    weights = np.zeros((size, len(fit.coefficients)))
    weights[np.arange(len(index)), index] = 1.0
    first = max(len(component.names), 1 if index else 0)
    for k, column, values in _present_at(fits, component):
        if column.is_shape:
            at = first + component.effect.shape.index(column.parameter)
            if at < size:
                weights[at, k] = column.deviation
        else:
            slopes = column.slopes(values)
            weights[:len(component.names), k] = [slopes[name] for name in component.names]
    found: Array = weights @ fit.covariance @ weights.T
    return found


def _present_at(fits: FittedSets, component: Component,
                ) -> Iterator[tuple[int, PresentParameter, Mapping[str, float]]]:
    """Yield the base columns, with their places, of what the given model has of a component.

    And all parameters that it has of it.
    """
    name = None if component.drive is None else fits.design.drives[component.drive]
    for k, column in enumerate(fits.design.base):
        if (isinstance(column, PresentParameter)
                and (column.effect, column.drive) == (component.effect, name)):
            yield k, column, fits.design.present(component.effect, component.drive) or {}


def _of_component(
    fits: FittedSets, component: Component, c: Array, covariance: Array, with_shape: bool = True,
    moved: Array | None = None,
) -> tuple[dict[str, Estimate], list[str]]:
    """Return the parameters of a component, and those at the edge of what was tried.

    Parameters
    ----------
    fits : FittedSets
    component : Component
    c : (k,) array
        Its coefficients.
    covariance : (k + s, k + s) array
        Of these and of the shape.
    with_shape : bool
    moved : (P,) array, optional
        Coefficients of the fit, of which those of base columns move what the given model has.
    """
    effect, shape = component.effect, component.parameters
    if moved is not None:
        component = _moved(fits, component, moved)
    prefix = '' if component.drive is None else f'{fits.design.drives[component.drive]}.'
    unit_of = _units(fits.design, component.drive)
    units = units_of(fits.design.given, component.drive)
    values = component.values(c)
    size = len(c)
    found = {}
    # From coefficients to parameters: the map is smooth but for angles, which it may wrap.
    here = {name.rpartition('.')[0] for name in component.names}
    for parameter in effect.linear:
        if effect.is_of_one_place and parameter.name.rpartition('.')[0] not in here:
            continue  # of the links or joints that it is not on
        slope = np.zeros(size)
        for k in range(size):
            step = 1e-4 * max(float(np.sqrt(covariance[k, k])), 1e-12)
            beside = c.copy()
            beside[k] += step
            slope[k] = (component.values(beside)[parameter.name] - values[parameter.name]) / step
        variance = float(slope @ covariance[:size, :size] @ slope)
        found[prefix + parameter.name] = Estimate(
            within(parameter, values[parameter.name], units), max(variance, 0.0) ** 0.5,
            unit_of(parameter.unit))
    for k, parameter in enumerate(effect.shape if with_shape else ()):
        value = float(shape[parameter.name])
        amount = float(np.sqrt(max(covariance[size + k, size + k], 0.0)))
        found[prefix + parameter.name] = Estimate(
            within(parameter, value, units), parameter.spread(amount, value),
            unit_of(parameter.unit))
    return found, [prefix + name for name in fits.components.at_edge(
        component, fits.decisions.edge_share)]


def _moved(fits: FittedSets, component: Component, coefficients: Array) -> Component:
    """Return a component with what the given model has of it as base columns move it."""
    if not component.given:
        return component
    given = np.array(component.given)
    for k, column, values in _present_at(fits, component):
        if not column.is_shape:
            slopes = column.slopes(values)
            given += coefficients[k] * np.array([slopes[c.name]
                                                 for c in component.effect.coefficients])
    return replace(component, given=tuple(given.tolist()))


def _moments(component: Component, c: Array, covariance: Array) -> dict[str, Estimate]:
    """Return the first moments of an added body about its link's frame; none of anything else."""
    if not issubclass(component.effect, AddedBody):
        return {}
    about_links = component.effect.moments_about_links()
    total = dict(zip((coefficient.name for coefficient in component.effect.coefficients),
                     component.total(c), strict=True))
    units = {coefficient.name: coefficient.unit for coefficient in component.effect.coefficients}
    found = {}
    for name, weights in about_links.items():
        if name in component.names:
            slope = np.array([weights.get(name, 0.0) for name in component.names])
            variance = slope @ covariance[:len(slope), :len(slope)] @ slope
            value = sum(float(total[key]) * weight for key, weight in weights.items())
            found[name] = Estimate(value, float(np.sqrt(max(variance, 0.0))), units[name])
    return found


def _units(design: Design, drive: int | str | None) -> Callable[[str], str]:
    """Return the conversion of a unit of linear drives to that of a drive."""
    if drive is None:
        return lambda unit: unit
    name = drive if isinstance(drive, str) else design.drives[drive]
    return design.residuals.units_of(name).of


def estimate_present(fits: FittedSets, fitted: CandidateSet, effect: CatalogueEffect,
                     ) -> dict[str, Estimate]:
    """Return the parameters of an effect of the given model, as base columns move them.

    By drive.parameter, or parameter: within what the model file says of how well they are known,
    and how well after the fit.
    """
    kind, parameters = type(effect), dict[str, Estimate]()
    fit = fits.regression.stated(fitted.fit)
    for name in effect.drives if isinstance(effect, DriveEffect) else (None,):
        drive = None if name is None else fits.design.drives.index(name)
        values = present_values(effect, name)
        component = placed(fits.design, kind, drive, {p.name: values[p.name] for p in kind.shape},
                           tuple(c.name for c in kind.coefficients))
        count = len(kind.coefficients)
        some, _ = _of_component(
            fits, component, np.zeros(count),
            _covariance(fits, fit, component, count + len(kind.shape), []), moved=fit.coefficients)
        parameters.update(some)
    return parameters


def calibrations(fits: FittedSets, fitted: CandidateSet) -> tuple[FittedNumber, ...]:
    """Return the numbers of the model as the fit moves them within their tolerances."""
    fit = fitted.fit
    return tuple(FittedNumber(
        column.number.label, '', column.number.value, column.value(float(fit.coefficients[k])),
        float(np.sqrt(fit.covariance[k, k])) * column.number.deviation, column.number.unit)
        for k, column in enumerate(fits.design.base) if isinstance(column, ModelNumber))
