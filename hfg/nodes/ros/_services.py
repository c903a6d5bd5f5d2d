"""Services of ROS 2: a server whose requests are events and whose answers come to a slot, and a client.

Depends on `_node`.
"""

from __future__ import annotations

import asyncio
from collections import deque
from typing import Any

from annotated_types import Ge, Gt

from hfg.base.clock import now
from hfg.base.token import Token
from hfg.errors import EncodingError, NoAnswer
from hfg.nodes.ros._node import RosNode
from hfg.ports import Event, Input, Output, Parameter, slot
from hfg.ros.connection import Connection
from hfg.ros.messages import ServiceType, service
from hfg.ros.wire import GID, Attachment, Entity, read_attachment

__all__ = ["RosService", "RosServiceClient"]


class RosService(RosNode):
    """Serve a service of ROS 2: requests are events, and the graph sends the answers to a slot.

    Requests are worked on one at a time, in the order in which they came: the next event follows the answer. An answer
    that is older than the request, by its stamp, is late and counted.

    Attributes:
      request: what is asked.
      answer: what is answered.
      name: its name: "/absolute", "relative" to the namespace or "~/private".
      type: of the service, "std_srvs/srv/SetBool".
      timeout_s: how long the graph may take; then the client is refused.
      depth: how many requests wait; more are refused.

    Raises:
      EncodingError: an answer is not of the type.
    """

    request = Event(Any)
    name = Parameter("")
    type = Parameter("")
    timeout_s = Parameter(10.0, Gt(0), unit="s")
    depth = Parameter(10, Ge(1))

    async def setup(self) -> None:
        """Serve, now or as soon as the router is there."""
        self._service: ServiceType = service(self.type)
        self._pending: deque[Any] = deque()
        self._news = asyncio.Event()
        self._answer: asyncio.Future[Any] | None = None
        self._asked_at = 0.0
        self._asked = self._answered = self._refused = self._late = 0
        await self.connect(self.name)
        self.start_soon(self._serve())

    async def _declare(self, link: Connection) -> None:
        mine = self.seen_as("SS", self._full, self._service)
        self._open.append(link.session.serve(mine.key, self._came))

    def _came(self, requests: list[Any]) -> None:
        for one in requests:
            self._asked += 1
            if len(self._pending) < self.depth:
                self._pending.append(one)
                self._news.set()
            else:
                self._refuse(one, f'"{self._full}" has {self.depth} requests already; ask again later')

    def _refuse(self, request: Any, why: str) -> None:
        self._refused += 1
        self.tell_once(why, f"a request was refused: {why}")
        request.refuse(why)

    async def _serve(self) -> None:
        try:
            while True:
                while not self._pending:
                    self._news.clear()
                    await self._news.wait()
                await self._serve_one(self._pending.popleft())
        finally:
            for one in self._pending:
                one.refuse(f'"{self._full}" is served no more')

    async def _serve_one(self, request: Any) -> None:
        try:
            value = self._service.request.decode(request.payload)
        except EncodingError as error:
            self._refuse(request, f"this is not a request of {self._service.name}: {error}")
            return
        self._answer = asyncio.get_running_loop().create_future()
        self._asked_at = now()
        self.request.trigger(value, stamp=self._asked_at)
        try:
            async with asyncio.timeout(self.timeout_s):
                payload = await self._answer
        except TimeoutError:
            self._refuse(request, f'"{self._full}" has not answered within {self.timeout_s:g} s')
            return
        except BaseException:
            request.refuse(f'"{self._full}" is served no more')
            raise
        finally:
            self._answer = None
        asked = read_attachment(request.attachment) or Attachment(0, 0, bytes(GID))
        said = Attachment(asked.sequence, int(now() * 1e9), asked.gid).encode()
        await asyncio.to_thread(request.answer, payload, said)
        self._answered += 1

    @slot
    def answer(self, value: Token[Any]) -> None:
        """Answer the request that was sent last."""
        if self._answer is None or self._answer.done() or value.stamp < self._asked_at:
            self._late += 1
            self.tell_once("late", f'an answer of "{self._full}" came without a request or too late')
            return
        self._answer.set_result(self._service.response.encode(value.value))

    def counts(self) -> dict[str, int]:
        """Return how many requests were `asked`, `answered` or `refused`, and answers `late`."""
        numbers = {"asked": self._asked, "answered": self._answered}
        return {**numbers, "refused": self._refused, "late": self._late}


class Asking:
    """The client of one service.

    Args:
      node: whose it is.
      type_: of the service.
    """

    def __init__(self, node: RosNode, type_: ServiceType) -> None:
        self._node = node
        self._type = type_
        self._sequence = 0
        self._mine: Entity | None = None

    def declare(self, name: str) -> None:
        """Be seen as its client."""
        self._mine = self._node.seen_as("SC", name, self._type)

    @property
    def served(self) -> bool:
        """Whether there is a server."""
        return self._mine is not None and bool(self._node.link.graph.fit(self._mine, "SS"))

    async def wait_served(self) -> None:
        """Wait until there is a server."""
        while not self.served:
            await self._node.link.wait_changed()

    async def ask(self, value: Any, *, timeout_s: float | None) -> Any:
        """Return the answer of a server that is there.

        Raises:
          EncodingError: the value is not of the type, or the answer is not.
          NoAnswer: none has come.
          QueryRefused: the server answers with an error.
        """
        payload = self._type.request.encode(value)
        return self._type.response.decode(await self.ask_raw(payload, timeout_s=timeout_s))

    async def ask_raw(self, payload: bytes | bytearray, *, timeout_s: float | None) -> bytes:
        """Return the encoded answer to an encoded request; see `ask`."""
        assert self._mine is not None
        self._sequence += 1
        said = Attachment(self._sequence, int(now() * 1e9), self._mine.gid).encode()
        answer: bytes = await self._node.link.session.ask(self._mine.key, payload, said, timeout_s=timeout_s)
        return answer


class RosServiceClient(RosNode):
    """Ask a service of ROS 2, once for each value, and send the answers.

    It waits for a server, and then for the answer, together no longer than `timeout_s`. A request is sent once only.

    Attributes:
      request: what is asked.
      response: what is answered.
      name: its name: "/absolute", "relative" to the namespace or "~/private".
      type: of the service, "std_srvs/srv/SetBool".
      timeout_s: see above.

    Raises:
      EncodingError: a value is not of the type.
      NoAnswer: no server is there, or no answer has come; `on_error` decides what follows.
      QueryRefused: the server answers with an error.
    """

    request = Input(Any)
    response = Output(Any)
    name = Parameter("")
    type = Parameter("")
    timeout_s = Parameter(10.0, Gt(0), unit="s")

    async def setup(self) -> None:
        """Be a client, now or as soon as the router is there."""
        self._asking = Asking(self, service(self.type))
        self._asked = self._answered = 0
        await self.connect(self.name)

    async def _declare(self, link: Connection) -> None:
        self._asking.declare(self._full)

    async def process(self, request: Token[Any]) -> None:
        """Ask, and send the answer."""
        began = now()
        what = f'"{self._full}" ({self.type}) at "{self.link.where}"'
        try:
            async with asyncio.timeout(self.timeout_s):
                await self._asking.wait_served()
        except TimeoutError:
            why = "no server is there" if self.link.connected else "the router is away"
            raise NoAnswer(f"{what} cannot be asked: {why} for {self.timeout_s:g} s; start it") from None
        self._asked += 1
        left_s = max(0.0, self.timeout_s - (now() - began))
        try:
            answer = await self._asking.ask(request.value, timeout_s=left_s)
        except NoAnswer as error:
            raise NoAnswer(f"{what} does not answer: {error}") from error
        self._answered += 1
        self.response.send(answer, stamp=request.stamp)

    def counts(self) -> dict[str, int]:
        """Return how many requests were `asked` and `answered`."""
        return {"asked": self._asked, "answered": self._answered}
