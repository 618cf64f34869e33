# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""One statement of the equations, two ways to run it: compiled, and as Python on floats.

What is claimed: both agree, the one pass over the paper's model agrees with the steps that are
kept, and a program starts where Numba has nowhere to keep what it compiled.
"""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from types import FunctionType
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from random_states import model_of, paper_model, random_motion, random_robot, without_compiler

from pprs_dynamics import DriveModel, PlatformMotion
from pprs_dynamics.errors import MotionError

# Compiled, sums may be associated otherwise; forces of up to 40 N then differ by some 1e-14.
AGREEMENT = 1e-12
SAMPLES = 40
VARIANTS: dict[str, dict[str, Any]] = {
    'corrected': {}, 'printed': {'equations': 'printed'},
    'widths': {'friction.reversal_rate': 0.3},
    'chains': {'friction.approach': 'independent_chains', 'limits.rod_cosine': 1e-6}}


def everything(model: DriveModel, motion: PlatformMotion, closes: bool) -> dict[str, np.ndarray]:
    """Return what kernels compute for a motion, closing its loops from home included."""
    forces = model.drive_forces(motion)
    s = forces.mechanism
    kept = model.forces_at(model.mechanism(motion))
    return {'total': forces.total, **forces.parts, 'in steps': kept.total,
            'position': s.position, 'acceleration': s.acceleration,
            'J': model.robot.jacobian(s.links),
            'friction_load': s.friction_load, **({'found': model.robot.at(
                s.position, s.velocity, s.acceleration).rows} if closes else {})}


@pytest.mark.parametrize('variant', VARIANTS)
@pytest.mark.parametrize('elbow', ['up', 'down'])
def test_compiled_equals_plain(variant, elbow):
    rng = np.random.default_rng(5)
    model = model_of(random_robot(rng, elbow), VARIANTS[variant])
    motion = random_motion(rng, SAMPLES, elbow)
    closes = variant == 'corrected'  # the motion is the same in every variant
    compiled, plain = everything(model, motion, closes), without_compiler(
        lambda: everything(model, motion, closes))
    for name, values in compiled.items():
        assert_allclose(values, plain[name], rtol=AGREEMENT, atol=AGREEMENT, err_msg=name)
    # One pass gives what the steps give that are kept.
    assert_allclose(compiled['total'], compiled['in steps'], rtol=AGREEMENT, atol=AGREEMENT)


def test_forces_are_copied_and_pickled_with_their_mechanism():
    model, motion = paper_model(), random_motion(np.random.default_rng(7), 3)
    forces = model.drive_forces(motion)
    for same in copy.deepcopy(forces), pickle.loads(pickle.dumps(forces)):
        assert_array_equal(sum(same.parts.values()), forces.total)
        assert_array_equal(same.mechanism.position, forces.mechanism.position)


def test_a_motion_of_rows_is_checked_like_one_of_arrays():
    motion = random_motion(np.random.default_rng(12), 5)
    table = motion.rows.copy()
    table[:, 3:7] *= 1.0005
    given = table.copy()
    rows = PlatformMotion.from_rows(table, np.arange(5.0))
    assert_allclose(rows.rows, motion.rows, rtol=AGREEMENT, atol=AGREEMENT)
    assert_array_equal(table, given)
    for wrong, word in ((1.1, 'length'), (np.nan, 'finite')):
        table = given.copy()
        table[3, 3:7] *= wrong
        with pytest.raises(MotionError, match=word):
            PlatformMotion.from_rows(table)
    with pytest.raises(MotionError, match='shape'):
        PlatformMotion.from_rows(given[:0])
    for time in ([np.nan], [0.0, 1.0]):
        with pytest.raises(MotionError, match='time'):
            PlatformMotion.from_rows(given[:1], time)


def test_nothing_is_compiled_where_nothing_is_evaluated():
    code = ("import sys; from pprs_dynamics import DriveModel, PlatformMotion; "
            "DriveModel.load('config/hexapod.yaml'); PlatformMotion.at_rest((0, 0, 0.5)); "
            "print('numba' in sys.modules)")
    assert subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                          check=True).stdout.split() == ['False']


def test_what_cannot_be_kept_is_compiled_all_the_same(monkeypatch):
    from pprs_dynamics.physics.mechanism import compilation

    def nowhere(**options):
        if options.pop('cache', False):
            raise RuntimeError('cannot cache function: no locator available')
        return compile_it(**options)

    compile_it = compilation.numba.njit
    monkeypatch.setattr(compilation.numba, 'njit', nowhere)
    compiled = compilation.compiled_function.__wrapped__(_twice)
    assert compiled(np.array([1.0, 2.0])) == 6.0


def _twice(values):
    total = 0.0
    for k in range(len(values)):
        total += 2.0 * values[k]
    return total


def test_code_that_moves_to_another_module_is_compiled_anew():
    """Stored code imports the modules that it came from, which may be there no longer."""
    from pprs_dynamics.physics.mechanism import compilation

    moved = FunctionType(_twice.__code__, _twice.__globals__)
    before = compilation._fingerprint(_twice)
    moved.__module__ = _twice.__module__
    assert compilation._fingerprint(moved) == before
    moved.__module__ = 'elsewhere'
    assert compilation._fingerprint(moved) != before
