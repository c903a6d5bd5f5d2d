"""MQTT 5: publishing and subscribing. Depends on `_connection`, and on aiomqtt when it is used.

aiomqtt reads from the socket even if its messages are not taken, so the inbox here stops the reading when it is full.
"""

from __future__ import annotations

import asyncio
import logging
import secrets
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from functools import partial
from typing import Any, ClassVar, Final
from urllib.parse import urlsplit

from annotated_types import Ge, Interval, MinLen

from hfg.base.hosts import is_loopback
from hfg.nodes._extras import require
from hfg.nodes.buses._connection import Connection, Message, Sender, parted
from hfg.nodes.buses._failures import Lost, Refused, explained, printable
from hfg.nodes.buses._forms import BadMessage, Form
from hfg.nodes.buses._secrets import NO_SECRET, SOURCE, client_tls, secret_of
from hfg.ports import Event, Parameter

_PORTS: Final = {"mqtt": 1883, "mqtts": 8883}
_WAITING: Final = 32  # messages in the inbox before the socket rests
_HEAD: Final = 70_000  # bytes of a packet without its payload: a topic, and properties
_NO: Final = 0x80  # and above: a reason code of failure
_FOR_GOOD: Final = {0x84, 0x85, 0x86, 0x87, 0x8A, 0x8C}  # version, name, password, not authorized, banned, method


class Broker(Connection):
    """A connection with an MQTT broker.

    Attributes:
      broker: where it is: "mqtt://host:port", or "mqtts://" if it is encrypted and the broker has to prove itself.
      user: the name that it knows us by; empty: none.
      secret: where the password is: "env:NAME" or "file:PATH".
      ca_file: a file with the authorities that are believed; empty: those of this computer.
      identifier: by which the broker knows this client over several runs, unique at the broker; empty: a random one.
      session_s: how long the broker keeps what it owes us while we are away.
      insecure: the password may be sent unencrypted to another computer.

    Raises:
      ModuleNotFoundError: aiomqtt is not installed.
    """

    broker = Parameter("mqtt://127.0.0.1:1883", MinLen(1), NO_SECRET)
    user = Parameter("")
    secret = Parameter("", SOURCE)
    ca_file = Parameter("")
    identifier = Parameter("")
    session_s = Parameter(3600, Interval(ge=0, le=2**32 - 1))
    insecure = Parameter(False)

    async def setup(self) -> None:
        """See whether the package is there."""
        self._aiomqtt = require("aiomqtt", "mqtt")
        self._name = self.identifier or f"hfg-{secrets.token_hex(8)}"
        self._inbox = Inbox()
        await super().setup()

    def address(self) -> str:
        """Return where the broker is."""
        return self.broker

    @asynccontextmanager
    async def link(self) -> AsyncIterator[Any]:
        """Connect."""
        from paho.mqtt.packettypes import PacketTypes  # comes with aiomqtt
        from paho.mqtt.properties import Properties

        parts = urlsplit(self.broker)
        if parts.scheme not in _PORTS or not parts.hostname:
            raise Refused('it is not the address of a broker; write "mqtt://host:port" or "mqtts://host:port"')
        password = await asyncio.to_thread(secret_of, self.secret)
        encrypted = parts.scheme == "mqtts"
        if password and not encrypted and not self.insecure and not is_loopback(parts.hostname):
            raise Refused('the password would be sent unencrypted; write "mqtts://", or set insecure=True')
        asked: Any = Properties(PacketTypes.CONNECT)  # type: ignore[no-untyped-call]  # so is the library
        asked.SessionExpiryInterval = self.session_s
        asked.MaximumPacketSize = _HEAD + self._most_bytes()
        client = self._aiomqtt.Client(
            parts.hostname,
            parts.port or _PORTS[parts.scheme],
            username=self.user or None,
            password=password or None,
            identifier=self._name,
            protocol=self._aiomqtt.ProtocolVersion.V5,
            clean_start=False,  # mosquitto 2.0 forgets sessions that began with a clean start when it restarts
            properties=asked,
            tls_context=client_tls(self.ca_file) if encrypted else None,
            queue_type=self._inbox.adopted,
            timeout=self.timeout_s,
            logger=_quiet(),
        )
        client._client.on_socket_register_write = partial(_write_when_ready, client)
        try:
            async with client:
                self._inbox.attend(client, asked.MaximumPacketSize)
                try:
                    yield client
                finally:
                    self._inbox.go_on()
        except self._aiomqtt.MqttError as error:
            raise _explained(error) from error

    def _most_bytes(self) -> int:
        return 0

    @contextmanager
    def explaining(self) -> Iterator[None]:
        """Raise errors of the library as ours."""
        try:
            yield
        except self._aiomqtt.MqttError as error:
            raise _explained(error) from error


def _explained(error: Exception) -> Lost | Refused:
    """Return the reason that a broker gives."""
    reason = getattr(error, "rc", None)
    cause = error.__cause__ or error.__context__
    if isinstance(cause, OSError):
        return explained(cause)
    if getattr(reason, "value", reason) in _FOR_GOOD:
        return Refused(f"the broker refuses us: {printable(reason)}; look at the parameters user and secret")
    return Lost(f"the broker is away ({printable(error)})")


def _write_when_ready(client: Any, _library: Any, _data: Any, there: Any) -> None:
    """Let the client write, unless its socket is closed by then: the client does not look."""

    def ready() -> None:
        try:
            client._client.loop_write()
        except Exception as error:
            if not client._disconnected.done():
                client._disconnected.set_exception(error)

    def begin() -> None:
        if there.fileno() >= 0:
            client._loop.add_writer(there.fileno(), ready)

    client._loop.call_soon_threadsafe(begin)


class Inbox(asyncio.Queue[Any]):
    """Messages of a broker that were not taken yet. It outlives the connection, and stops reading when it is full."""

    _client: Any = None
    _most_bytes = 0
    _rests = False

    def adopted(self, maxsize: int) -> Inbox:
        """Be the queue of another client."""
        del maxsize
        return self

    def attend(self, client: Any, most_bytes: int) -> None:
        """Read from the socket of a client that is connected, instead of the client."""
        self._client, self._most_bytes, self._rests = client, most_bytes, True
        self.go_on()

    def _put(self, item: Any) -> None:
        super()._put(item)
        if not self._rests and self.qsize() >= _WAITING:
            self._rests = True
            asyncio.get_running_loop().remove_reader(self._client._client.socket().fileno())

    def _get(self) -> Any:
        item = super()._get()
        if self.qsize() < _WAITING // 2:
            self.go_on()
        return item

    def go_on(self) -> None:
        """Read again, if the client is still connected."""
        client, self._rests, rests = self._client, False, self._rests
        there = client._client.socket() if rests else None
        if there is not None and there.fileno() >= 0:
            asyncio.get_running_loop().add_reader(there.fileno(), self._read, client)

    def _read(self, client: Any) -> None:
        """Read a packet, or more of what TLS has unpacked; one that is longer than we have allowed breaks it off."""
        library = client._client
        while True:
            library.loop_read()
            if library._in_packet["remaining_length"] > self._most_bytes:
                if not client._disconnected.done():
                    client._disconnected.set_exception(Lost("the broker sends a packet that is too long"))
                library._sock_close()
            there = library.socket()
            if self._rests or there is None or not getattr(there, "pending", lambda: 0)():
                return


class MqttPublish(Broker, Sender):
    """Publish values on an MQTT broker.

    With QoS 1 and 2 a value is done when the broker has acknowledged it; one that a lost connection has caught in
    between is sent again, so the broker may have it twice, and never not at all. With QoS 0 what the system had taken
    over when the connection was lost may be lost. Let it publish several values at a time by `concurrency`. Needs
    `hfg[mqtt]`.

    Attributes:
      message: what is published: a `Message` under its topic, anything else under `topic`.
      topic: of values that have none.
      qos: what the broker promises: 0 nothing, 1 at least once, 2 exactly once if neither side dies.
      retain: the broker keeps the last value for those who subscribe later.
    """

    topic = Parameter("hfg", MinLen(1))
    qos = Parameter(1, choices=(0, 1, 2))
    retain = Parameter(False)
    hears: ClassVar[tuple[str, ...]] = ()

    def packed(self, message: Any) -> tuple[bytes, str]:
        """Return the bytes, and the topic."""
        value, topic = parted(message)
        return self.as_bytes(value), topic or self.topic

    async def read(self, link: Any) -> None:
        """Wait until the broker is away."""
        with self.explaining():
            async for _ in link.messages:
                pass

    async def write(self, link: Any, message: tuple[bytes, str]) -> None:
        """Publish, and wait for the acknowledgement."""
        data, topic = message
        with self.explaining():
            await link.publish(topic, data, qos=self.qos, retain=self.retain)


class MqttSubscribe(Broker):
    """Hear what is published on an MQTT broker.

    A slow graph stops reading, so that the broker keeps what is to come: of QoS 1 and 2 it does so for `session_s`
    after a loss of the connection; how much it keeps is up to the broker. Needs `hfg[mqtt]`.

    Attributes:
      topic: what is heard; "+" stands for one level, "#" at the end for all below.
      qos: what the broker promises at most: 0 nothing, 1 at least once, 2 exactly once.
      form: what a message is: "text", "bytes" or "json".
      most_bytes: of one message; the broker does not send longer ones.
      received: a `Message` with a value, and the topic under which it was published.
      invalid: a message was skipped because it is not of the form; why.
    """

    topic = Parameter("hfg/#", MinLen(1))
    qos = Parameter(1, choices=(0, 1, 2))
    form = Parameter("text", type=Form)
    most_bytes = Parameter(2**20, Ge(1))
    received = Event(Message)
    invalid = Event(str)

    def _most_bytes(self) -> int:
        return self.most_bytes

    @asynccontextmanager
    async def link(self) -> AsyncIterator[Any]:
        """Connect and subscribe."""
        async with super().link() as client:
            with self.explaining():
                (code,) = await client.subscribe(self.topic, qos=self.qos)
            if getattr(code, "value", code) >= _NO:
                raise Refused(f'the broker does not let us subscribe to "{self.topic}": {printable(code)}')
            yield client

    async def read(self, link: Any) -> None:
        """Hear."""
        with self.explaining():
            async for message in link.messages:
                data = message.payload
                heard = data if len(data) <= self.most_bytes else BadMessage("a message is too long, and was skipped")
                await self.hear(heard, self.form, self.received, address=str(message.topic))


def _quiet() -> logging.Logger:
    """Return the log of the library, whose complaints this module says in its own words."""
    found = logging.getLogger("hfg.mqtt.library")
    found.setLevel(logging.CRITICAL)
    return found
