# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""In which unit efforts are, by the factors of weight and inertia over a model's."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.readings.evidence import Shares
from pprs_dynamics.inference.readings.findings import OtherReading, Scales
from pprs_dynamics.inference.readings.table import (
    CERTAIN,
    EFFORTS,
    LARGEST_COMPLIANCE,
    LARGEST_OVERLOAD,
    NEAR_ONE,
    NEAR_UNIT,
    ONE_FACTOR,
    SAME_MASSES,
    SEVERAL_FACTORS,
    SHARES,
    named,
)
from pprs_dynamics.measurement.files.recording import Recording, signed
from pprs_dynamics.measurement.files.samples import Defect
from pprs_dynamics.physics.model.drive_model import DriveModel

BITS = range(7, 16)  # of magnitudes
CALMER = 0.5  # changes from sample to sample, over those of the numbers as they are


def find_scales(model: DriveModel, contents: Mapping[str, Shares]) -> list[OtherReading]:
    """Return the unit of efforts whose common or several factors over the model's tell it."""
    factors = {k: contents[drive].scale for k, drive in enumerate(model.drives)
               if drive in contents}
    certain = {k: scale for k, (scale, doubt) in factors.items() if scale > CERTAIN * doubt}
    # Masses of a description are right within a factor; inertia alone may be invented.
    weighed = any(contents[model.drives[k]].gravity > CERTAIN * contents[model.drives[k]]
                  .gravity_doubt for k in certain)
    if not weighed:
        return []
    every = tuple(range(len(model.drives)))
    scales, of_all = np.array([*certain.values()]), f'the effort of {named(model.drives, every)}'
    for unit, name in EFFORTS.items():
        if np.all(np.abs(scales / unit - 1) < NEAR_UNIT):
            word = name.format(model.units[0].effort)
            return [_unit(model, f'{of_all} looks like {unit:.4g} times what the model says, as if '
                          f'it were in {word}', np.full(len(every), 1 / unit))]
    limits = model.effort_limits[[*certain]]
    if len(certain) > 1 and np.all(np.isfinite(limits)):
        gains = np.log(scales * limits)
        are_one = np.std(np.log(scales)) > SEVERAL_FACTORS and np.std(gains) < ONE_FACTOR
        for share, name in SHARES.items():
            if are_one:
                is_share = 1 - NEAR_ONE <= np.exp(gains.mean()) * share <= LARGEST_OVERLOAD
            else:  # of two drives the factors may be near, and yet just these
                is_share = bool(np.all(np.abs(scales * limits * share - 1) < NEAR_ONE / 2)
                                and np.any(np.abs(np.log(scales)) > SEVERAL_FACTORS))
            if is_share:
                return [_unit(model, f"{of_all} looks like {name} of the drives' largest",
                              share * model.effort_limits)]
    if (np.all(np.abs(np.log(scales)) > np.log(SAME_MASSES))
            and np.all(scales > LARGEST_COMPLIANCE)):
        listed = ', '.join(f'{scale:.3g} ({model.drives[k]})' for k, scale in certain.items())
        gain = ', '.join(f'{1 / certain[k]:.3g}' if k in certain else '1.0' for k in every)
        return [OtherReading.of(
            'drive_constant', model.drives, every, f'{of_all} is another multiple of what the '
            f'masses need: {listed}: it looks like currents in amperes, or another unit',
            f'effort_kind: current, and beside urdf or mjcf  gain: [{gain}]')]
    return []


def _unit(model: DriveModel, what: str, factors: Array) -> OtherReading:
    before = model.recorded.columns
    scales: Scales = tuple((drive, 'effort_scale', float(factors[k]) * (
        1.0 if before is None else before.drives[drive].effort_scale))
        for k, drive in enumerate(model.drives))
    return OtherReading.of('effort_unit', model.drives, range(len(model.drives)), what,
                           scales=scales)


def sign_bit(recording: Recording) -> Iterator[Defect]:
    """Yield efforts that are magnitudes with a bit for their sign, as servos report loads."""
    found: dict[int, list[int]] = {}
    for d in range(len(recording.drives)):
        effort = recording.effort[np.isfinite(recording.effort[:, d]), d]
        if len(effort) < 2 or np.any(effort < 0) or np.any(effort != np.rint(effort)):
            continue
        for bit in BITS:
            is_set = effort >= 2.0 ** bit
            if 0.02 < is_set.mean() < 0.98 and effort.max() < 2.0 ** (bit + 1) and (
                    np.abs(np.diff(signed(effort, bit))).sum()
                    < CALMER * np.abs(np.diff(effort)).sum()):
                found.setdefault(bit, []).append(d)
    for bit, group in found.items():
        drives = tuple(group)
        yield OtherReading.of(
            'effort_sign_bit', recording.drives, drives,
            f'the effort of {named(recording.drives, drives)} looks like a magnitude whose sign '
            f'is bit {bit} ({2 ** bit})',
            scales=tuple((recording.drives[d], 'effort_sign_bit', float(bit)) for d in drives))
