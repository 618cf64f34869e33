# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What is hidden in the simulated robot, kept in step with its parameters while it runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.parameter import Parameter

from pprs_dynamics.errors import ModelError
from pprs_dynamics.ros.node.model_parameters import Followed
from pprs_dynamics.ros.node.parameters import NodeParameter, current_values
from pprs_dynamics.simulation.hidden_effect import HiddenEffect
from pprs_dynamics.simulation.hidden_effects import draw_effects

CHANGEABLE = ('hidden_effects', 'hidden_scale', 'seed')
OF_ROS = ('use_sim_time', 'start_type_description_service')


@dataclass(frozen=True)
class Hidden:
    """Hidden effects, and the words, scale and seed that they were drawn from."""

    words: tuple[str, ...]
    drawn_with: tuple[float, int]
    effects: tuple[HiddenEffect, ...]

    @classmethod
    def of(cls, values: Mapping[str, Any], running: Hidden | None = None) -> Hidden:
        """Return those that parameters say; what acts already stays what it is.

        Raises
        ------
        HiddenEffectError
            For words that name no effect.
        """
        words = tuple(values['hidden_effects'])
        drawn_with = values['hidden_scale'], values['seed']
        effects = draw_effects(words, np.random.default_rng(values['seed']),
                               values['hidden_scale'])
        kept = (dict(zip(running.words, running.effects, strict=True))
                if running is not None and running.drawn_with == drawn_with else {})
        return cls(words, drawn_with, tuple(
            kept.pop(word, effect) for word, effect in zip(words, effects, strict=True)))


def in_words(truths: Iterable[Mapping[str, Any]]) -> str:
    """Return what is hidden, for the log."""
    return '; '.join(f'{one["name"]} {one["parameters"]}' for one in truths) or 'none'


class HiddenParameters(Followed[tuple[dict[str, Any], Hidden | None]]):
    """Follows the parameters of what is hidden; all others stay as they were at the start.

    Parameters
    ----------
    node : Node
    declared : iterable of NodeParameter
        The node's own.
    hidden : Hidden or None
        What is hidden now; None of a robot in which that stays, too.
    use : callable
        Called with what is hidden from now on.
    """

    def __init__(self, node: Node, declared: Iterable[NodeParameter], hidden: Hidden | None,
                 use: Callable[[Hidden], None]) -> None:
        self._hidden, self._use = hidden, use
        super().__init__(node, (one for one in declared
                                if hidden is not None and one.name in CHANGEABLE))
        self._own, _ = self._checked

    def _validated(self, changes: Iterable[Parameter]) -> tuple[dict[str, Any], Hidden | None]:
        before, after = current_values(self._node), current_values(self._node, changes)
        changeable = [one.name for one in self._declared]
        for name in (change.name for change in changes):
            if name not in (*changeable, *OF_ROS) and before.get(name) != after.get(name):
                raise ModelError(name, after.get(name), 'stay as it was at the start: of a running '
                                 f'robot only {", ".join(changeable) or "the clock"} change')
        own = {one.name: one.check(after.get(one.name)) for one in self._declared}
        return own, None if self._hidden is None else Hidden.of(own, self._hidden)

    def _apply(self, checked: tuple[dict[str, Any], Hidden | None],
               changes: Iterable[Parameter]) -> None:
        before, (self._own, hidden) = self._own, checked
        if hidden is not None and self._own != before:
            self._hidden = hidden
            self._use(hidden)
