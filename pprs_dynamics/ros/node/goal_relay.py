# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Goals sent on to another action server, whose silence ends them."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.task import Future

from pprs_dynamics.errors import PprsError
from pprs_dynamics.ros.node.clocks import steady_timer

LOOK_PERIOD = 0.1  # [s] between looks at whether the server still lives
DISCOVERY = 3.0  # [s] that a server may take to be found, after it or this node has started


class ControllerError(PprsError):
    """The server of the other action is not there, rejects a goal, or has fallen silent.

    Parameters
    ----------
    text : str
    began : bool
        Whether it had accepted the goal, and the drives may be anywhere on the way.
    """

    def __init__(self, text: str, began: bool = False) -> None:
        self.began = began
        super().__init__(text)


class GoalRelay:
    """Sends goals on, passes feedback and cancelling, and never waits for a dead server.

    A server counts as dead when discovery reports that it has gone. It also counts as dead after a
    silence of `patience`: while it owes an answer, after its last feedback, or after the end of the
    goal's motion. Discovery alone reports a killed process after 20 s, and a process that hangs
    never.

    Parameters
    ----------
    node : Node
    action_type : type
    name : str
        Of the other action.
    patience : callable
        Returns the longest silence [s]; 0: any.
    """

    def __init__(self, node: Node, action_type: Any, name: str,
                 patience: Callable[[], float]) -> None:
        self._node, self._name, self._patience = node, name, patience
        self._client = ActionClient(node, action_type, name)
        self._running: dict[bytes, _Watched] = {}

    def server_is_there(self) -> bool:
        """Return whether discovery knows a server."""
        return bool(self._client.server_is_ready())

    async def accepted(self, handle: Any, goal: Any, duration: float) -> _Watched:
        """Send a goal on, and return what watches it once the server has accepted it.

        Parameters
        ----------
        handle : ServerGoalHandle
            Of the goal that came in.
        goal : message
        duration : float
            Of the motion that it asks for [s].

        Raises
        ------
        ControllerError
        """
        watched = self._running[bytes(handle.goal_id.uuid)] = _Watched(handle, duration)
        try:
            if not await self._found():
                raise ControllerError(f'nobody serves {self._name}: is the controller active?')
            watched.sent(self._node.get_clock().now().nanoseconds)
            sent = self._client.send_goal_async(goal, feedback_callback=watched.on_feedback)
            if reason := await self._lost(sent, watched):
                sent.add_done_callback(_cancel_late)
                raise ControllerError(f'{reason}; the goal was not accepted')
            theirs = sent.result()
            if not theirs.accepted:
                raise ControllerError('the controller rejected the goal; its log has the reason')
        except ControllerError:
            self._forget(watched)
            raise
        watched.accepted(theirs)
        if handle.is_cancel_requested:  # while the controller made up its mind
            watched.cancel()
        return watched

    async def finished(self, watched: _Watched) -> Any:
        """Return the server's answer to a goal that it accepted: its status and result.

        Raises
        ------
        ControllerError
            Where none will come; the goal is cancelled then, should anybody still follow it.
        """
        try:
            answer = watched.theirs.get_result_async()
            if reason := await self._lost(answer, watched):
                watched.cancel()
                raise ControllerError(f'{reason} in the middle of a goal; what the drives do now '
                                      'is not known', began=True)
            return answer.result()
        finally:
            self._forget(watched)

    @property
    def is_idle(self) -> bool:
        """Whether no goal is being followed, or is on its way to the server."""
        return not self._running

    def _forget(self, watched: _Watched) -> None:
        watched.ended = True
        del self._running[bytes(watched.handle.goal_id.uuid)]

    async def _found(self) -> bool:
        """Return whether discovery knows a server, as soon as it does and after a while at most."""
        if self.server_is_there():
            return True
        deadline, was_there = time.monotonic() + DISCOVERY, False

        def look() -> bool | None:
            nonlocal was_there
            # Discovery is one-sided: a server may see us a moment after we see it, and its answer
            # to a goal in between is lost.
            before, was_there = was_there, self.server_is_there()
            return was_there if before or time.monotonic() > deadline else None

        return bool(await self._first(look, Future()))

    def cancel(self, handle: Any) -> None:
        """Cancel the goal that was sent on for a goal, if any."""
        watched = self._running.get(bytes(handle.goal_id.uuid))
        if watched is not None:
            watched.cancel()

    async def _lost(self, answer: Any, watched: _Watched) -> str:
        """Wait for an answer; return why none will come, or '' where it is there."""
        def look() -> str | None:
            patience = self._patience()
            if not self.server_is_there():
                return f'the server of {self._name} has gone'
            if patience and watched.silence() > patience:
                return f'the server of {self._name} has been silent for {patience:g} s'
            return None

        ended: Future[str] = Future()
        answer.add_done_callback(lambda _: ended.done() or ended.set_result(''))
        return str(await self._first(look, ended))

    async def _first(self, look: Callable[[], Any], ended: Future[Any]) -> Any:
        """Return the first value of `look` that is not None, or that of a future that is done."""
        def tick() -> None:
            if not ended.done() and (value := look()) is not None:
                ended.set_result(value)

        timer = steady_timer(self._node, LOOK_PERIOD, tick)
        try:
            return await ended
        finally:
            self._node.destroy_timer(timer)


class _Watched:
    """A goal that was sent on, and when its server last said, or owed, something."""

    def __init__(self, handle: Any, duration: float) -> None:
        self.handle, self.ended = handle, False
        self.theirs: Any = None
        self.sent_at = 0  # [ns] by the node's clock
        self._duration = duration
        self._due = time.monotonic()

    def sent(self, now: int) -> None:
        self.sent_at, self._due = now, time.monotonic()

    def accepted(self, theirs: Any) -> None:
        self.theirs = theirs
        self._due = time.monotonic() + self._duration

    def on_feedback(self, message: Any) -> None:
        if not self.ended:
            self._due = time.monotonic()
            self.handle.publish_feedback(message.feedback)

    def cancel(self) -> None:
        if self.theirs is not None:  # else as soon as it is accepted
            self._due = min(self._due, time.monotonic())
            self.theirs.cancel_goal_async()

    def silence(self) -> float:
        """Return for how long something has been due [s]."""
        return time.monotonic() - self._due


def _cancel_late(sent: Any) -> None:
    """Cancel a goal that is accepted after its sender got a refusal."""
    theirs = sent.result()
    if theirs is not None and theirs.accepted:
        theirs.cancel_goal_async()
