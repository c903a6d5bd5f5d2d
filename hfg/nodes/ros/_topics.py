"""Topics of ROS 2: a subscription as a source, a publisher as a sink. Depends on `_node`."""

from __future__ import annotations

import asyncio
from collections import deque
from typing import Any, Final, Literal

from annotated_types import Ge

from hfg.base.clock import now
from hfg.base.token import Token
from hfg.errors import EncodingError
from hfg.nodes.ros._node import RosNode
from hfg.ports import Input, Output, Parameter
from hfg.ros.connection import Connection
from hfg.ros.messages import MessageType, message
from hfg.ros.wire import Attachment, Gaps, Qos, read_attachment

__all__ = ["RosPublish", "RosSubscribe"]

_ALL: Final = 10_000
"""Messages that are kept with depth 0."""


class RosSubscribe(RosNode):
    """Send what is published on a topic of ROS 2: a source that waits for it.

    Tokens have the publisher's stamps. When the graph is slower than the topic, the oldest of `depth` messages is
    dropped and counted, as in ROS.

    Attributes:
      out: the messages, as hfg's types where there is one (Image, LaserScan, Pose ...), else as records.
      topic: its name: "/absolute", "relative" to the namespace or "~/private".
      type: of its messages, "std_msgs/msg/String".
      durability: "transient_local": begin with what publishers of that kind have kept.
      reliability: what others see; messages come over TCP either way.
      depth: how many messages wait here, and how many kept ones are asked for; 0: 10,000.
    """

    out = Output(Any)
    topic = Parameter("")
    type = Parameter("")
    durability = Parameter("volatile", type=Literal["volatile", "transient_local"])
    reliability = Parameter("reliable", type=Literal["reliable", "best_effort"])
    depth = Parameter(10, Ge(0))

    async def setup(self) -> None:
        """Subscribe, now or as soon as the router is there."""
        self._message: MessageType = message(self.type)
        self._waiting: deque[Any] = deque()
        self._news = asyncio.Event()
        self._gaps = Gaps()
        self._received = self._dropped = self._refused = 0
        await self.connect(self.topic)

    async def _declare(self, link: Connection) -> None:
        qos = Qos(self.reliability, self.durability, self.depth)
        mine = self.seen_as("MS", self._full, self._message, qos)
        history = (self.depth or _ALL) if self.durability == "transient_local" else 0
        self._open.append(link.session.subscribe(mine.key, self._came, history=history))

    def _came(self, messages: list[Any]) -> None:
        for one in messages:
            self._received += 1
            if len(self._waiting) >= (self.depth or _ALL):
                self._waiting.popleft()
                self._dropped += 1
                self.tell_once("full", f'"{self._full}" sends faster than the graph takes; the oldest are dropped')
            attachment = read_attachment(one.attachment)
            if attachment is not None and self._gaps.note(attachment):
                self.tell_once("gap", f'messages of "{self._full}" were lost on the way, see "lost" in the report')
            self._waiting.append((one.payload, attachment))
        self._news.set()

    async def process(self) -> None:
        """Wait for the next message and send it."""
        while True:
            while not self._waiting:
                self._news.clear()
                await self._news.wait()
            payload, attachment = self._waiting.popleft()
            try:
                value = self._message.decode(payload)
            except EncodingError as error:
                self._refused += 1
                self.tell_once("refused", f'a message of "{self._full}" is no {self._message.name}: {error}')
                continue
            self.out.send(value, stamp=now() if attachment is None else attachment.stamp_ns / 1e9)
            return

    def counts(self) -> dict[str, int]:
        """Return what was `received`, `dropped` here, `lost` on the way or `refused`."""
        numbers = {"received": self._received, "dropped": self._dropped}
        return {**numbers, "lost": self._gaps.lost, "refused": self._refused}


class RosPublish(RosNode):
    """Publish all values on a topic of ROS 2.

    While the router is away, values are lost and counted; with durability="transient_local" the last `depth` of them
    are kept for it. A reliable publisher waits while the connection has no room.

    Attributes:
      value: what is published.
      topic: its name: "/absolute", "relative" to the namespace or "~/private".
      type: of its messages, "std_msgs/msg/String".
      durability: "transient_local": the last `depth` messages are kept for those who subscribe later.
      reliability: "best_effort": never wait; Zenoh drops what finds no room, which subscribers see as a gap.
      depth: see durability; 0: 10,000.

    Raises:
      EncodingError: a value is not of the type.
    """

    value = Input(Any)
    topic = Parameter("")
    type = Parameter("")
    durability = Parameter("volatile", type=Literal["volatile", "transient_local"])
    reliability = Parameter("reliable", type=Literal["reliable", "best_effort"])
    depth = Parameter(10, Ge(0))

    async def setup(self) -> None:
        """Be a publisher, now or as soon as the router is there."""
        self._message: MessageType = message(self.type)
        self._publisher: Any = None
        self._sent = self._lost = self._sequence = 0
        self._is_kept = self.durability == "transient_local"
        self._kept: deque[bytes | bytearray] = deque(maxlen=(self.depth or _ALL) if self._is_kept else 0)
        await self.connect(self.topic)

    async def _declare(self, link: Connection) -> None:
        waits = self.reliability == "reliable"
        mine = self.seen_as("MP", self._full, self._message, Qos(self.reliability, self.durability, self.depth))
        self._gid = mine.gid
        publisher = link.session.publisher(mine.key, waits=waits, kept=self._kept.maxlen)
        self._open.append(publisher)
        while self._kept:
            await self._put(publisher, self._kept.popleft())
        self._publisher = publisher

    async def process(self, value: Token[Any]) -> None:
        """Publish it."""
        payload = self._message.encode_once(value.value, stamp=value.stamp)
        if self._publisher is None and self._is_kept:
            self._lost += len(self._kept) == self._kept.maxlen
            self._kept.append(payload)
        elif not self.link.connected and not self._is_kept:
            self._lost += 1
            self.tell_once("away", f'no router is at "{self.link.where}", so values of "{self._full}" are lost')
        else:
            await self._put(self._publisher, payload)

    async def _put(self, publisher: Any, payload: bytes | bytearray) -> None:
        self._sequence += 1
        await publisher.put(payload, Attachment(self._sequence, int(now() * 1e9), self._gid).encode())
        self._sent += 1

    def counts(self) -> dict[str, int]:
        """Return what was `sent`, and `lost` while the router was away."""
        return {"sent": self._sent, "lost": self._lost}
