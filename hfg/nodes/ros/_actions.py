"""Actions of ROS 2: a client whose goal lives as long as its node is active. Depends on `_node` and `_services`."""

from __future__ import annotations

import asyncio
import secrets
from typing import Any, Final

from hfg.base.token import Token
from hfg.errors import EncodingError, NoAnswer, TransportError
from hfg.nodes.ros._node import RosNode
from hfg.nodes.ros._services import Asking
from hfg.ports import Event, Parameter, slot
from hfg.ros import goals
from hfg.ros.connection import Connection
from hfg.ros.messages import ActionType, action, service
from hfg.ros.wire import Qos

__all__ = ["RosAction"]

_CANCEL_S: Final = 2.0
_PAUSE_S: Final = 0.5
_WORDS: Final[dict[int, str]] = {goals.Status.SUCCEEDED: "succeeded", goals.Status.CANCELED: "canceled"}


class RosAction(RosNode):
    """Pursue a goal of an action of ROS 2 for as long as the node is active (rule A15).

    An active edge into `goal` brings the goal and the activity. The goal is sent as soon as there is a server, and
    cancelled when the node becomes inactive before its end. When the router or the server goes away meanwhile, the
    result is asked for again until it comes: `active_for_s` limits that. How it ends is an event; then `completed`
    follows with the name of that event, unless the activity has left with it.

    Attributes:
      goal: what is to be reached.
      feedback: what the server tells meanwhile.
      succeeded: the result.
      aborted: the result of a goal that the server has given up.
      canceled: the result of a goal that another program has cancelled.
      rejected: the server does not take the goal.
      name: of the action: "/absolute", "relative" to the namespace or "~/private".
      type: of the action, "nav2_msgs/action/NavigateToPose".

    Raises:
      EncodingError: a goal is not of the type.
    """

    feedback = Event(Any)
    succeeded = Event(Any)
    aborted = Event(Any)
    canceled = Event(Any)
    rejected = Event(None)
    name = Parameter("")
    type = Parameter("")

    async def setup(self) -> None:
        """Be a client, now or as soon as the router is there."""
        self._action: ActionType = action(self.type)
        self._sending = Asking(self, self._action.send_goal)
        self._getting = Asking(self, self._action.get_result)
        self._canceling = Asking(self, service(goals.CANCEL))
        self._wish: bytes | bytearray | None = None
        self._goal_id = b""
        self._counts = dict.fromkeys(("sent", "accepted", "cancelled", "asked_again", "refused"), 0)
        await self.connect(self.name)

    async def _declare(self, link: Connection) -> None:
        below = f"{self._full}/_action"
        self._sending.declare(f"{below}/send_goal")
        self._getting.declare(f"{below}/get_result")
        self._canceling.declare(f"{below}/cancel_goal")
        told = self.seen_as("MS", f"{below}/feedback", self._action.feedback_message, Qos())
        self._open.append(link.session.subscribe(told.key, self._fed_back))

    def _fed_back(self, messages: list[Any]) -> None:
        for one in messages:
            try:
                goal_id, value = goals.read_feedback(one.payload)
                if goal_id == self._goal_id and self.active:
                    self.feedback.trigger(self._action.feedback.decode(value))
            except EncodingError as error:
                self._counts["refused"] += 1
                self.tell_once("feedback", f'feedback of "{self._full}" cannot be read: {error}')

    @slot
    def goal(self, value: Token[Any]) -> None:
        """Take the goal to pursue once the node is active."""
        self._wish = self._action.goal.encode(value.value)

    async def do(self) -> str:
        """Pursue the goal that came last."""
        if self._wish is None:
            raise EncodingError(f'"{self.place.path}" is active without a goal: activate it by an edge into "goal"')
        await self._sending.wait_served()
        goal_id = self._goal_id = secrets.token_bytes(goals.ID)
        self._counts["sent"] += 1
        try:
            request = goals.goal_request(goal_id, self._wish)
            if not goals.is_accepted(await self._sending.ask_raw(request, timeout_s=None)):
                return self._ended("rejected", None)
            self._counts["accepted"] += 1
            status, result = await self._result(goal_id)
        except asyncio.CancelledError:
            await self._cancel(goal_id)
            raise
        finally:
            self._goal_id = b""
        return self._ended(_WORDS.get(status, "aborted"), result)

    def _ended(self, word: str, result: Any) -> str:
        getattr(self, word).trigger(result)
        return word

    async def _result(self, goal_id: bytes) -> tuple[int, Any]:
        while True:
            await self._getting.wait_served()
            try:
                answer = await self._getting.ask_raw(goals.result_request(goal_id), timeout_s=None)
            except NoAnswer:  # the router or the server has gone
                self._counts["asked_again"] += 1
                self.tell_once("again", f'the server of "{self._full}" was lost; its result is asked for again')
                await asyncio.sleep(_PAUSE_S)
                continue
            value = self._action.get_result.response.decode(answer)
            return int(value.status), value.result

    async def _cancel(self, goal_id: bytes) -> None:
        try:
            await self._canceling.ask_raw(goals.cancel_request(goal_id), timeout_s=_CANCEL_S)
            self._counts["cancelled"] += 1
        except TransportError as error:
            self.log.warning('a goal of "%s" could not be cancelled: %s', self._full, error)

    def counts(self) -> dict[str, int]:
        """Return how many goals were `sent`, `accepted` and `cancelled` from here, and what was `refused`."""
        return self._counts
