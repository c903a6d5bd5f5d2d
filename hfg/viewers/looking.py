"""Viewers of a run: their subscriptions, and messages in transit. It lives on the server's loop, and never waits.

Each viewer has a short queue for each channel that it sees; if it reads too slowly, the oldest message gives way. A
channel whose viewers all have enough waiting is not encoded. Depends on `channels` and `protocol`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from typing import Final

import msgspec

from hfg.errors import UsageError
from hfg.recording.writing import as_text
from hfg.viewers import protocol
from hfg.viewers.channels import ACTIVITY, Channel

MOST_VIEWERS: Final = 16
_MOST_MESSAGES: Final = 256
_MOST_BYTES: Final = 512 * 1024
"""In one queue; the newest message stays however long it is."""

_MOST_WORDS: Final = 16


class _Queue:
    """Messages of one channel for one viewer; the oldest give way."""

    def __init__(self) -> None:
        self.messages: deque[bytearray] = deque()
        self.size = 0

    @property
    def has_room(self) -> bool:
        return len(self.messages) < _MOST_MESSAGES and self.size < _MOST_BYTES

    def put(self, message: bytearray) -> int:
        """Add a message. Return how many gave way to it."""
        skipped = 0
        while self.messages and not self.has_room:
            self.take()
            skipped += 1
        self.messages.append(message)
        self.size += len(message)
        return skipped

    def take(self) -> bytearray:
        message = self.messages.popleft()
        self.size -= len(message)
        return message


class Viewer:
    """One viewer.

    Attributes:
      subscriptions: the channels that it sees, by its own numbers.
      skipped: how many messages it will never see, because it reads too slowly.
      clock: the time on the run's clock to send next, in nanoseconds.
    """

    def __init__(self, looking: Looking, wake: Callable[[], None]) -> None:
        self._looking = looking
        self._wake = wake
        self._words: deque[str] = deque()  # texts, in order; they go first
        self._queues: dict[int, _Queue] = {}  # by channel; those that had their turn last are last
        self.subscriptions: dict[int, int] = {}
        self.skipped = 0
        self.clock: int | None = None

    # --- what it says -------------------------------------------------------------------------------------------------

    def say(self, data: str | bytes) -> None:
        """Take what it says.

        Raises:
          UsageError: it is not a message.
        """
        message = protocol.read(data)
        refused: list[str] = []
        match message:
            case protocol.Subscribe():
                for one in message.subscriptions:
                    refused += self._subscribe(one.id, one.channelId)
            case protocol.Unsubscribe():
                for number in message.subscriptionIds:
                    self._unsubscribe(number)
            case _:
                refused.append(f'this server shows and takes nothing, so "{message[:40]}" is refused')
        if refused and len(self._words) < _MOST_WORDS:
            self.tell(protocol.refusals(refused[:3]))

    def _subscribe(self, number: int, channel: int) -> list[str]:
        if number in self.subscriptions:
            return [f"subscription {number} is there already"]
        if channel not in self._looking.channels:
            return [f"there is no channel {channel}"]
        if channel in self._queues:
            return [f"channel {channel} is subscribed already"]
        self.subscriptions[number] = channel
        self._queues[channel] = _Queue()
        self._looking.look(self, number, channel)
        return []

    def _unsubscribe(self, number: int) -> None:
        channel = self.subscriptions.pop(number, None)
        if channel is not None:
            del self._queues[channel]
            self._looking.look_away(self, channel)

    def forget(self, channels: Iterable[int]) -> None:
        """These channels are gone."""
        gone = set(channels)
        for number in [number for number, channel in self.subscriptions.items() if channel in gone]:
            self._unsubscribe(number)

    def leave(self) -> None:
        """It is gone."""
        for number in list(self.subscriptions):
            self._unsubscribe(number)
        self._looking.leave(self)

    # --- what it is told ----------------------------------------------------------------------------------------------

    def tell(self, words: str) -> None:
        """Send it a text."""
        self._words.append(words)
        self._wake()

    def has_room(self, channel: int) -> bool:
        """Return whether it can take more of a channel."""
        return self._queues[channel].has_room

    def put(self, channel: int, message: bytearray) -> None:
        """Send it a message, unless newer ones take its place before it reads."""
        self.skipped += self._queues[channel].put(message)
        self._wake()

    def take(self) -> str | bytes | bytearray | None:
        """Return what to send next: a text, or bytes; None: nothing."""
        if self._words:
            return self._words.popleft()
        if self.clock is not None:
            clock, self.clock = self.clock, None
            return protocol.time(clock)
        channel = next((channel for channel, queue in self._queues.items() if queue.messages), None)
        if channel is None:
            return None
        queue = self._queues[channel] = self._queues.pop(channel)  # the others have their turn before it
        message = queue.take()
        self._looking.has_room(channel)
        return message


class Looking:
    """All viewers of one run.

    Attributes:
      channels: what they can see, by number.
      viewers: those who are there.
    """

    def __init__(
        self, channels: Iterable[Channel], wish: Callable[[int, bool], None], *, virtual: bool, name: str, session: str
    ) -> None:
        """Begin without viewers.

        Args:
          channels: what can be seen.
          wish: called with the number of a channel, and whether it has a subscription.
          virtual: the run is in virtual time, so viewers need its clock.
          name: of the graph.
          session: tells this run from others.
        """
        self.channels = {one.number: one for one in channels}
        self.viewers: list[Viewer] = []
        self._wish = wish
        self._virtual = virtual
        self._greeting = protocol.server_info(name, session, has_clock=virtual)
        self._numbers: dict[int, dict[Viewer, int]] = {}  # of the subscriptions of each channel
        self._encoder = msgspec.json.Encoder(enc_hook=as_text)

    def enter(self, wake: Callable[[], None]) -> Viewer:
        """Let a viewer in. `wake` is called when there is something for it.

        Raises:
          UsageError: too many are there.
        """
        if len(self.viewers) >= MOST_VIEWERS:
            raise UsageError(f"{MOST_VIEWERS} viewers are looking already; close one of them")
        viewer = Viewer(self, wake)
        self.viewers.append(viewer)
        viewer.tell(self._greeting)
        viewer.tell(_advertised(self.channels.values()))
        return viewer

    def leave(self, viewer: Viewer) -> None:
        """A viewer is gone."""
        self.viewers.remove(viewer)

    def change(self, new: list[Channel], gone: list[Channel]) -> None:
        """The graph was edited."""
        self.channels |= {one.number: one for one in new}
        numbers = [one.number for one in gone]
        for viewer in self.viewers:
            viewer.forget(numbers)
            if new:
                viewer.tell(_advertised(new))
            if gone:
                viewer.tell(protocol.json_of("unadvertise", channelIds=numbers))
        for number in numbers:
            del self.channels[number]

    def look(self, viewer: Viewer, number: int, channel: int) -> None:
        """A viewer has subscribed to a channel."""
        viewers = self._numbers.setdefault(channel, {})
        viewers[viewer] = number
        if len(viewers) == 1 or self.channels[channel].topic == ACTIVITY:
            self._wish(channel, True)

    def look_away(self, viewer: Viewer, channel: int) -> None:
        """A viewer has unsubscribed."""
        viewers = self._numbers[channel]
        del viewers[viewer]
        if not viewers:
            del self._numbers[channel]
            self._wish(channel, False)

    def has_room(self, channel: int) -> None:
        """A viewer has taken something of a channel."""
        if self.channels[channel].waiting:
            self.deliver(self.channels[channel])

    def deliver(self, channel: Channel) -> None:
        """Something waits in a channel: encode it once for all that see it, if any of them has room."""
        channel.is_told = False
        viewers = self._numbers.get(channel.number)
        if not viewers or not any(viewer.has_room(channel.number) for viewer in viewers):
            return
        for data, when in channel.messages(self._encoder, exact=self._virtual):
            ns = max(int(when * 1e9), 0)
            for viewer, number in viewers.items():
                viewer.clock = ns if self._virtual else None
                message = data if len(viewers) == 1 else data[:]
                message[: protocol.HEAD] = protocol.message_head(number, ns)
                viewer.put(channel.number, message)


def _advertised(channels: Iterable[Channel]) -> str:
    said = [
        {
            "id": one.number,
            "topic": one.topic,
            "encoding": "json",
            "schemaName": one.schema_name,
            "schemaEncoding": "jsonschema",
            "schema": one.schema.decode(),
        }
        for one in channels
    ]
    return protocol.json_of("advertise", channels=said)
