"""Work concurrent with the stream that requests it. Depends on nodetype and ports."""

from __future__ import annotations

import asyncio
from typing import Any

from annotated_types import Ge

from hfg.base.token import Token
from hfg.nodetypes.node import Node
from hfg.ports import Event, Input, Parameter, State


class Background(Node):
    """Work on every value in a task of its own, concurrently with the stream: derive from it and override `work`.

    The sender continues at once, until `at_most` values are in progress; then it waits for a place, and slot calls of
    this node, such as `reset`, wait with it (rule F9). What is done is signalled as it is done, in any order, with the
    stamp of the value. The run knows the tasks (rules X1, R5): it does not end before them, what one raises is an error
    of the node by its `on_error`, and they are cancelled when the node is torn down, reset or disabled. The end of the
    input waits for none of them. Activity that a value has brought leaves with what is done next. Where results must
    come in order, `concurrency=` of any async node is simpler (rule F14).

    Attributes:
      value: what is worked on.
      at_most: maximum number of values in progress at once.
      done: the result of `work` for a value.

    Examples:
      >>> class Upload(Background):
      ...     '''Bring pictures to a server.'''
      ...     async def work(self, value: bytes) -> int:
      ...         await asyncio.sleep(0.1)
      ...         return len(value)
    """

    value = Input(Any)
    done = Event(Any)
    at_most = Parameter(8, Ge(1))
    under_way = State(0)

    async def work(self, value: Any) -> Any:
        """Work on one value; as it stands, give it back."""
        return value

    def setup(self) -> None:
        """Nobody waits for a place yet."""
        self.place_is_free = asyncio.Event()

    async def process(self, value: Token[Any]) -> None:
        """Begin, as soon as there is a place."""
        while self.under_way >= self.at_most:
            self.place_is_free.clear()
            await self.place_is_free.wait()
        self.under_way += 1
        self.start_soon(self._work(value))

    async def _work(self, token: Token[Any]) -> None:
        try:
            result = await self.work(token.value)
        finally:
            self.under_way -= 1
            self.place_is_free.set()
        self.done.trigger(result, stamp=token.stamp)
