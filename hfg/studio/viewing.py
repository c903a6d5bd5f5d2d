"""One page: what goes to it, what it has subscribed to, and how many frames it has not painted yet.

A page gives a credit back when a frame is painted. Without credit nothing is made for it, so a page that is slow,
suspended or gone costs nothing; dropping what the network buffers had already swallowed came seconds too late.
Depends on `messages`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple, Protocol

from hfg.errors import HfgError
from hfg.studio.budget import Budget
from hfg.studio.messages import HEADER, Data, Gone, encode

__all__ = ["Frame", "Outbox", "Shown", "Subscription", "Topic", "Viewer"]

MOST_SUBSCRIPTIONS: Final = 256
MOST_REQUESTS: Final = 100
"""Of one page that are not answered yet."""


class Shown(NamedTuple):
    """What a page shows of a graph.

    Attributes:
      path: of the subgraph, "" for the whole graph.
      view: "activity", "mission", "all", or "" for the one that fits.
      deep: what is inside of its subgraphs, too.
    """

    path: str = ""
    view: str = ""
    deep: bool = False

    @property
    def key(self) -> str:
        """The key of its layout in the table of layouts."""
        return f"{self.view}{'+' * self.deep}:{self.path}"


class Frame(NamedTuple):
    """Something to send: bytes, or what makes them, which is called off the graph's loop."""

    data: bytes | Callable[[], bytes]
    is_binary: bool = False


class Outbox(Protocol):
    """The way to a page. Neither call waits, and both may come from any thread."""

    def put(self, frame: Frame) -> None:
        """Send it after all others; a page that takes nothing is sent away."""

    def close(self, code: int, reason: str) -> None:
        """Send the page away."""


class Topic(Protocol):
    """What a subscription is about.

    Attributes:
      credit: frames that may be in flight.
      kind: of its binary frames; 0: its frames are JSON.
      most_hz: frames per second at most.
    """

    credit: int
    kind: int
    most_hz: float

    def take(self) -> Any:
        """Return what is new since the last frame, None if nothing is: a value, bytes, or a function that gives one."""

    def time(self) -> float:
        """Return the seconds on the run's clock."""

    def close(self) -> None:
        """The subscription is over."""


class Subscription:
    """A topic in transit to one page.

    Attributes:
      due: when the next frame may be sent, on the loop's clock.
    """

    def __init__(self, sub: int, topic: Topic, hz: float) -> None:
        self.sub = sub
        self.topic = topic
        self.pause_s = 1.0 / min(hz, topic.most_hz)
        self.due = 0.0
        self._sent = 0
        self._painted = 0

    @property
    def has_credit(self) -> bool:
        """Whether the page can take another frame."""
        return self._sent - self._painted < self.topic.credit

    def painted(self, seq: int) -> None:
        """A frame is on the screen, and so are those before it."""
        self._painted = max(self._painted, min(seq, self._sent))

    def frame(self, now: float) -> Frame | None:
        """Return the next frame, if it is time, there is credit and something is new."""
        if now < self.due or not self.has_credit:
            return None
        value = self.topic.take()
        if value is None:
            return None
        self.due = max(self.due, now - self.pause_s) + self.pause_s
        self._sent += 1
        return self._framed(value, self._sent, self.topic.time())

    def _framed(self, value: Any, seq: int, time: float) -> Frame:
        kind, sub = self.topic.kind, self.sub

        def made() -> Any:
            return value() if callable(value) else value

        if kind:
            return Frame(lambda: HEADER.pack(kind, 0, sub, seq & 0xFFFFFFFF, time) + made(), is_binary=True)
        return Frame(lambda: encode(Data(sub, seq, time, made())))


class Viewer:
    """One page.

    Attributes:
      number: by which others know it.
      joined: it has the tables, and so gets every patch.
      visible: it is not in a hidden tab.
      levels: what it shows.
      pending: requests that are not answered yet.
      budget: of its requests.
    """

    def __init__(self, number: int, outbox: Outbox) -> None:
        self.number = number
        self.joined = False
        self.visible = True
        self.levels: set[Shown] = set()
        self.pending = 0
        self.budget = Budget()
        self.subscriptions: dict[int, Subscription] = {}
        self._outbox = outbox

    def send(self, message: Any) -> None:
        """Send a message, or one that is encoded already."""
        self._outbox.put(Frame(message if isinstance(message, bytes) else encode(message)))

    def send_later(self, make: Callable[[], bytes]) -> None:
        """Send what is encoded off the graph's loop."""
        self._outbox.put(Frame(make))

    def subscribe(self, subscription: Subscription) -> None:
        """Send a topic from now on, in place of what had its number."""
        self.unsubscribe(subscription.sub)
        self.subscriptions[subscription.sub] = subscription

    def unsubscribe(self, sub: int, why: str = "") -> None:
        """Send it no more; report the reason to the page if there is one."""
        found = self.subscriptions.pop(sub, None)
        if found is not None:
            found.topic.close()
        if why:
            self.send(Gone(sub, why))

    def beat(self, now: float) -> None:
        """Send what is new and due."""
        for subscription in list(self.subscriptions.values()) if self.visible else ():
            try:
                frame = subscription.frame(now)
            except HfgError as error:  # what it is about is not in this run
                self.unsubscribe(subscription.sub, str(error))
                continue
            if frame is not None:
                self._outbox.put(frame)

    def hurry(self, now: float) -> None:
        """Send what is new at once, as far as there is credit, however long ago the last frames were."""
        for subscription in self.subscriptions.values():
            subscription.due = min(subscription.due, now)
        self.beat(now)

    def leave(self) -> None:
        """The page is gone."""
        for sub in list(self.subscriptions):
            self.unsubscribe(sub)

    def send_away(self, code: int, reason: str) -> None:
        """Close the connection."""
        self._outbox.close(code, reason)
