# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Speed of the model against Pinocchio and MuJoCo: ratios from one run, with their spread.

Every figure is taken in rounds, all of a table in turn, so that a busy machine slows them alike.
Times are those of the processor, but for what runs on two cores. A ratio is that of one round;
given are the median over the rounds, the middle half of them, and the ratio of the best times.

    python -m benchmarks.speed.model [rounds]
"""

from __future__ import annotations

import resource
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, ClassVar

import numpy as np
from random_states import random_motion

from benchmarks import ROOT
from benchmarks.speed.peers import MujocoPeer, PinocchioPeer
from pprs_dynamics import DriveModel, PlatformMotion
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.effects.structure_effect import BodyEffect, PassiveJointEffect
from pprs_dynamics.physics.mechanism.state import MechanismState
from pprs_dynamics.physics.three_pprs.closed_form import _is_regular, read_parameters

ROUNDS = 25
CALLS = 200  # of one sample, per round
BATCH, LONG, LONGEST = 10_000, 20_000, 1_000_000
AGREEMENT = 1e-10  # [N], of peers and model, frictionless


def main(rounds: int) -> None:
    """Print all tables."""
    model = DriveModel.load()
    motion = random_motion(np.random.default_rng(1), BATCH)
    peers = [PinocchioPeer(model.robot), MujocoPeer(model.robot)]
    forces = model.drive_forces(motion)
    for peer in peers:
        gap = np.abs(peer.many(motion) - forces.parts['rigid_body']).max()
        assert gap < AGREEMENT, f'{peer.name} is {gap} N off'
    print(f'{rounds} rounds; peers agree within {AGREEMENT:g} N')
    one_sample(model, peers, motion, rounds)
    batches(model, peers, motion, rounds)
    growth(model, motion)
    operations(model, motion)
    start()


def one_sample(
    model: DriveModel, peers: list[PinocchioPeer | MujocoPeer], motion: PlatformMotion,
    rounds: int,
) -> None:
    """Compare single samples."""
    rows = [tuple(a[k:k + 1].copy() for a in _arrays(motion)) for k in range(CALLS)]
    flat = [tuple(a[0] for a in row) for row in rows]

    def ours() -> None:
        for row in rows:
            model.drive_forces(PlatformMotion(*row)).total  # noqa: B018

    def theirs(peer: PinocchioPeer | MujocoPeer) -> Callable[[], None]:
        def run() -> None:
            for row in flat:
                peer.forces_of_sample(*row)
        return run

    found = _rounds({'model, with friction': ours, **{p.name: theirs(p) for p in peers}}, rounds)
    _print('one sample, arrays in, six forces out', found, 1e6 / CALLS)


def batches(
    model: DriveModel, peers: list[PinocchioPeer | MujocoPeer], motion: PlatformMotion,
    rounds: int,
) -> None:
    """Compare batches, two cores, forward kinematics and regressors."""
    arrays = _arrays(motion)
    q = model.drive_forces(motion).mechanism.position
    long = tuple(np.concatenate((a, a)) for a in arrays)
    blocks = [motion[k:k + BATCH // 4] for k in range(0, BATCH, BATCH // 4)] * 8
    pool = ThreadPoolExecutor(2)

    def on_threads() -> None:
        list(pool.map(model.drive_forces, blocks))

    def on_one() -> None:
        for block in blocks:
            model.drive_forces(block)

    found = _rounds({
        'model, with friction': lambda: model.drive_forces(PlatformMotion(*arrays)),
        **{peer.name: lambda peer=peer: peer.many(PlatformMotion(*arrays)) for peer in peers},
        'forward kinematics': lambda: model.robot.at(q, 0 * q, 0 * q),
    }, rounds)
    _print(f'batches of {BATCH}, per sample', found, 1e6 / BATCH)
    found = _rounds({'one core': on_one, 'two cores': on_threads}, rounds, time.perf_counter)
    _print('blocks on threads, per sample', found, 1e6 / (8 * BATCH))
    columns = _regressors(model, PlatformMotion(*long))
    found = _rounds({
        'one evaluation': lambda: model.drive_forces(PlatformMotion(*long)),
        f'regressors, {columns} columns': lambda: _regressors(model, PlatformMotion(*long)),
        }, max(5, rounds // 5))
    _print(f'all linear effects, {LONG} samples, per sample', found, 1e6 / LONG)


def _regressors(model: DriveModel, motion: PlatformMotion) -> int:
    """Evaluate the columns of all linear effects; return how many, each drive's as one."""
    forces = model.drive_forces(motion)
    state, reference, columns = forces.mechanism, forces.total, []
    for effect in CATALOGUE.values():
        if effect.shape or not issubclass(effect, (BodyEffect, PassiveJointEffect)):
            continue
        for coefficient in effect.coefficients:
            small = effect.at({coefficient.name: coefficient.scale})
            if isinstance(small, BodyEffect):
                change = _total(model, small.apply(state)) - reference
            else:
                change = small.force(state)
            columns.append(change / coefficient.scale)
    columns += [state.velocity, state.direction, np.abs(state.direction),
                state.velocity * np.abs(state.velocity), state.friction_load * state.direction,
                np.ones_like(state.velocity), reference, state.position, state.acceleration]
    return len(columns)


def _total(model: DriveModel, state: MechanismState) -> np.ndarray:
    """Return rigid body and friction, which follows the loads of other bodies."""
    return sum((effect.force(state) for effect in model.effects), state.rigid_force)


def growth(model: DriveModel, motion: PlatformMotion) -> None:
    """Print time and memory from a thousand samples to a million, in blocks."""
    print('\nblocks of 10 000: samples, us per sample, peak memory more [MB]')
    arrays = _arrays(motion)
    for samples in (1_000, 10_000, 100_000, LONGEST):
        before, best = _peak(), np.inf
        for _ in range(max(3, 200_000 // samples)):
            start = time.process_time()
            done = 0
            while done < samples:
                size = min(BATCH, samples - done)
                model.drive_forces(PlatformMotion(*(a[:size] for a in arrays)))
                done += size
            best = min(best, time.process_time() - start)
        print(f'{samples:>9}  {1e6 * best / samples:.3f}  {_peak() - before:.1f}')


def start() -> None:
    """Print how long imports and a first evaluation take in a fresh process."""
    print(f'\nfresh processes, best of 5 [s]{"":<6}elapsed  processor')
    evaluation = ('from pprs_dynamics import DriveModel, PlatformMotion; '
                  'DriveModel.load().drive_forces(PlatformMotion.at_rest((0, 0, 0.5)))')
    for name, code in (('python alone', 'pass'), ('import numpy', 'import numpy'),
                       ('import pprs_dynamics', 'import pprs_dynamics'),
                       ('first evaluation, caches warm', evaluation)):
        elapsed, used = np.inf, np.inf
        for _ in range(5):
            begin, before = time.perf_counter(), _processor_of_children()
            subprocess.run([sys.executable, '-c', code], check=True, cwd=ROOT)
            elapsed = min(elapsed, time.perf_counter() - begin)
            used = min(used, _processor_of_children() - before)
        print(f'{name:<36}{elapsed:>7.2f}{used:>11.2f}')


def _processor_of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


class _Counted(float):
    """A float that counts what is done with it."""

    counts: ClassVar[Counter[str]] = Counter()


def _counting(name: str, kind: str) -> Callable[..., _Counted]:
    plain = getattr(float, name)

    def run(*operands: float) -> _Counted:
        _Counted.counts[kind] += 1
        return _Counted(plain(*operands))

    return run


for _name, _kind in (('add', 'additions'), ('sub', 'additions'), ('mul', 'multiplications'),
                     ('truediv', 'divisions')):
    setattr(_Counted, f'__{_name}__', _counting(f'__{_name}__', _kind))
    setattr(_Counted, f'__r{_name}__', _counting(f'__r{_name}__', _kind))


class _CountedTable(dict[Any, Any]):

    def __missing__(self, key: Any) -> _Counted:
        return _Counted(0.0)


def _counted(named: Any) -> Any:
    """Return parameters with counting floats."""
    if not isinstance(named, tuple):
        return _Counted(named)
    elements = [_counted(element) for element in named]
    return type(named)(*elements) if hasattr(named, '_fields') else tuple(elements)


def operations(model: DriveModel, motion: PlatformMotion) -> None:
    """Print the floating-point operations of one sample."""
    _Counted.counts.clear()
    table = _CountedTable({(0, k): _Counted(x) for k, x in enumerate(motion.rows[0].tolist())})
    parameters = _counted(read_parameters(model._own_parameters[0]))
    _is_regular(parameters, 0, table, _CountedTable())
    counts = dict(_Counted.counts)
    print(f'\none sample: {sum(counts.values())} operations ({counts}), 18 roots, 12 tanh')


def _arrays(motion: PlatformMotion) -> tuple[np.ndarray, ...]:
    return (motion.position, motion.orientation, motion.linear_velocity, motion.angular_velocity,
            motion.linear_acceleration, motion.angular_acceleration)


def _rounds(
    work: dict[str, Callable[[], object]], rounds: int,
    clock: Callable[[], float] = time.process_time,
) -> dict[str, np.ndarray]:
    """Return seconds by name, one per round."""
    times: dict[str, list[float]] = {name: [] for name in work}
    for run in work.values():
        run()
    for _ in range(rounds):
        for name, run in work.items():
            begin = clock()
            run()
            times[name].append(clock() - begin)
    return {name: np.array(values) for name, values in times.items()}


def _print(title: str, found: dict[str, np.ndarray], scale: float) -> None:
    print(f'\n{title}\n{"":<28}{"best":>9}{"median":>9} us   ratio of the first to it, middle half')
    first = next(iter(found.values()))
    for name, values in found.items():
        low, middle, high = np.percentile(first / values, (25, 50, 75))
        print(f'{name:<28}{scale * values.min():>9.3f}{scale * np.median(values):>9.3f}      '
              f'{middle:.3f}  ({low:.3f} to {high:.3f}), of the best '
              f'{first.min() / values.min():.3f}')


def _peak() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == '__main__':
    main(int(sys.argv[1]) if len(sys.argv) > 1 else ROUNDS)
