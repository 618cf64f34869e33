# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Hidden faults of the sensors: they change what is measured, not what the drives must do."""

from __future__ import annotations

from typing import ClassVar

from pprs_dynamics.simulation.hidden_effect import Range, SensorEffect


class EffortGain(SensorEffect):
    """A drive constant that is not what the amplifier thinks."""

    name: ClassVar[str] = 'effort_gain'
    form: ClassVar[str] = 'measured effort = (1 + gain) effort'
    ranges: ClassVar[dict[str, Range]] = {'gain': Range('1', 0.03, 0.12, 'signed', scales=True)}


class HomingError(SensorEffect):
    """A drive whose zero is off: it is elsewhere than its encoder, and its control, believe."""

    name: ClassVar[str] = 'homing_error'
    form: ClassVar[str] = 'measured position = position + zero'
    ranges: ClassVar[dict[str, Range]] = {'zero': Range('m', 0.0005, 0.003, 'signed', scales=True)}


class TimeDelay(SensorEffect):
    """Effort measured late (positive), or early because all encoders' values are late."""

    name: ClassVar[str] = 'time_delay'
    form: ClassVar[str] = ('measured effort (t) = effort (t - delay), '
                           'by late encoders where delay < 0')
    ranges: ClassVar[dict[str, Range]] = {'delay': Range('s', 0.003, 0.015, 'signed', scales=True)}
