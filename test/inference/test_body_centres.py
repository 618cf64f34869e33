# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A body far from its link's centre: its columns hold its inertia."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import made_up_arm as arm
import numpy as np
import pytest

from pprs_dynamics import DriveModel
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.search.body_centres import find_centre
from pprs_dynamics.physics.effects.laws.link_mass import LinkMass
from pprs_dynamics.physics.mechanism.description import body_at

MASS = 4.0


def columns(tmp_path: Path) -> tuple[DriveModel, type[LinkMass], np.ndarray, tuple]:
    """Return a model, bodies on its links, their columns (k, N, 3), and the states of these."""
    model = DriveModel.load(arm.write_arm(tmp_path))
    kind, states = model.bound(LinkMass), tuple(np.random.default_rng(2).uniform(-1, 1, (3, 25, 3)))
    none = model.robot.torques(*states)
    return model, kind, np.stack([
        kind.at({c.name: 1.0}).changed(model.robot).torques(*states) - none
        for c in kind.coefficients]), states


def test_the_columns_about_a_centre_are_exact_for_a_body_there(tmp_path: Path) -> None:
    model, kind, rows, states = columns(tmp_path)
    link, centre, *_ = kind.places[0]
    away = np.array([0.3, -0.2, 0.5])
    there = {f'{link}.mass': MASS, **{f'{link}.moment_{axis}': MASS * d
                                      for axis, d in zip('xyz', away, strict=True)}}
    c = np.array([there.get(c.name, 0.0) for c in kind.coefficients])
    heavier = model.robot.with_body(link, body_at(MASS, tuple(centre + away), np.zeros((3, 3))))
    expected = heavier.torques(*states) - model.robot.torques(*states)
    about = kind.rows_about(f'{link}.', rows, away)
    assert np.tensordot(c, about, 1) == pytest.approx(expected, abs=1e-9)
    # Without its inertia it would be another force.
    assert np.abs(np.tensordot(c, rows, 1) - expected).max() > 0.1 * np.abs(expected).max()


def test_a_body_is_the_same_about_whichever_centre_its_columns_are(tmp_path: Path) -> None:
    model, kind, rows, states = columns(tmp_path)
    prefix, away = f'{kind.places[0].link}.', (0.3, -0.2, 0.5)
    fitted = {f'{prefix}{name}': value for name, value in {
        'mass': MASS, 'moment_x': 0.4, 'moment_y': -0.3, 'moment_z': 0.2,
        'xx': 0.5, 'yy': 0.6, 'zz': 0.4, 'xy': 0.02, 'xz': -0.03, 'yz': 0.01}.items()}
    names = [c.name for c in kind.coefficients]
    c = np.array([fitted.get(name, 0.0) for name in names])
    own = kind.about_own_centre(tuple(fitted), c, away)
    body = kind.at(dict(zip(names, own.tolist(), strict=True))).changed(model.robot)
    assert body.torques(*states) - model.robot.torques(*states) == pytest.approx(
        np.tensordot(c, kind.rows_about(prefix, rows, np.array(away)), 1), abs=1e-9)


def test_the_centre_is_found_from_the_error(tmp_path: Path) -> None:
    model = DriveModel.load(arm.write_arm(tmp_path))
    real = arm.real_arm(tmp_path)
    kind = model.bound(LinkMass)
    name = model.robot.body_names[1]
    link, centre, *_ = next(place for place in kind.places if place.link == name)
    prefix = f'{link}.'
    away = np.array([0.1, 0.3, -0.2])
    real = replace(real, robot=real.robot.with_body(
        link, body_at(MASS, tuple(centre + away), np.zeros((3, 3)))))
    design = Design.of(arm.real_arm(tmp_path), [arm.record(real, arm.motion(20.0), 0.01)])
    term = next(one for one in design.structure if one.effect is kind)
    found = find_centre(term, f'{prefix}mass', design.residuals.error,
                        dict.fromkeys(range(3), 1.0), design.given)
    assert found == pytest.approx(away, abs=0.02)
