"""The edges of a running graph: the tokens on them, and when another may be added (rules P4, P5, P7).

Three state machines: a synchronous edge with one place, a synchronous edge with room for more (a buffer, a delay), and
an event edge with a queue. They hold tokens and count them; the engine moves the tokens. `source` and `target` are the
engine's workers, opaque here. Depends on `token`; never waits.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, Final, Literal, TypeAlias

from hfg.base.token import Token
from hfg.errors import EngineInternalError

__all__ = ["ACTIVITY", "NUMBER", "VALUE", "AnyEdge", "BufferEdge", "Edge", "EventEdge", "Lying", "Overflow", "SyncEdge"]

Overflow = Literal["wait", "drop_oldest", "drop_newest", "latest", "error"]

Lying: TypeAlias = tuple[Any, int, float, int]
"""Entry of a queue for each token: value, activity, stamp and number; the token is made when a consumer takes it."""

VALUE: Final = 0
ACTIVITY: Final = 1
NUMBER: Final = 3


class Edge:
    """State and counts that all edges of a run have.

    Attributes:
      index: position in the order of drawing; edges that an edit adds get numbers in between.
      label: "source -> target", as traces and reports show it.
      active: whether it carries activity, A(e) (rule A1).
      target_kind: the kind of its target: "input", "slot", or "parameter".
      position: which input of the target's node type; inputs first, then parameters.
      mandatory: whether it feeds a mandatory input (F4's m).
      sent, dropped, drained: counts for the report; `sent` is also the number of the newest token.
      lost: number of its tokens that were lost with a process (L2).
      live: whether both ends are enabled (F1).
      sequential: its tokens are processed when the consumer's outputs are, not when they are taken (F5).
      follows: work that it enables runs before all other work of the group (R2): the edge is sequential, within one
        group, and the group works first in, first out.
      while_active: the slot at its end accepts signals only while its node is active (T4).
      ended: the consumer has taken END from it and no longer waits for it (F4).
      handler: the plain handler of the slot at its end, which takes the value, or the token if `takes_token`; None: the
        interpreter makes the call.
      waits: the worker whose output barrier counts an unprocessed token of this edge: the source, or the head of the
        source's region. Without meaning for event edges.
      tap: called with every token that is put on the edge; None without observers.
      via: the scopes (subgraphs) whose relays it passes; all must be enabled.
      segments: the declared edges that it consists of, from source to target; empty if it comes from outside the graph.
      options: the declared `EdgeOptions`; None if it comes from outside.
      source_port, target_port: the bound ports at its ends; an observable is its own port.
    """

    __slots__ = (
        "active",
        "depth_first",
        "drained",
        "dropped",
        "ended",
        "handler",
        "index",
        "label",
        "live",
        "lost",
        "mandatory",
        "options",
        "port_name",
        "position",
        "segments",
        "sent",
        "sequential",
        "source",
        "source_port",
        "takes_token",
        "tap",
        "target",
        "target_kind",
        "target_port",
        "via",
        "waits",
        "while_active",
    )

    def __init__(self, index: float, label: str, active: bool) -> None:
        self.index = index
        self.label = label
        self.active = active
        self.source: Any = None
        self.waits: Any = None
        self.target: Any = None
        self.target_kind = "input"
        self.while_active = False
        self.port_name = ""
        self.position = 0
        self.mandatory = False
        self.sent = 0
        self.dropped = 0
        self.drained = 0
        self.lost = 0
        self.live = True
        self.sequential = False
        self.depth_first = False
        self.ended = False
        self.via: tuple[Any, ...] = ()
        self.segments: tuple[Any, ...] = ()
        self.options: Any = None
        self.source_port: Any = None
        self.target_port: Any = None
        self.handler: Callable[[Any], Any] | None = None
        self.takes_token = False
        self.tap: Callable[[Token[Any]], None] | None = None

    def join(self, source: Any, target: Any) -> None:
        """Set both ends."""
        self.source = self.waits = source
        self.target = target

    def enter(self, kind: str, name: str, position: int, mandatory: bool) -> None:
        """Make an input or parameter of the target the edge's end."""
        self.target_kind = kind
        self.port_name = name
        self.position = position
        self.mandatory = mandatory

    def enter_slot(self, name: str, handler: Callable[[Any], Any] | None, spec: Any) -> None:
        """Make a slot of the target the edge's end.

        Args:
          name: of the slot.
          handler: takes the value, or the token; None: the slot has none, or an async one.
          spec: how the slot is declared; None: it belongs to every node, or to a subgraph.
        """
        self.target_kind = "slot"
        self.port_name = name
        self.handler = handler
        self.takes_token = spec is not None and spec.token
        self.while_active = spec is not None and spec.while_active

    def stand_for(
        self, segments: tuple[Any, ...], source_port: Any, target_port: Any, via: tuple[Any, ...], options: Any
    ) -> None:
        """Set what the edge represents in the declared graph, and its options there."""
        self.segments = segments
        self.options = options
        self.source_port = source_port
        self.target_port = target_port
        self.via = via

    def be_released(self, *, sequential: bool, depth_first: bool) -> None:
        """Set when its tokens are processed: it depends on the consumer's mode and the groups of both ends (F5, R2)."""
        self.sequential = sequential
        self.depth_first = depth_first

    def go_on(self, sent: int, *, ended: bool) -> None:
        """Take the place of an edge that has transported `sent` tokens; `ended` if the last of them was END."""
        self.sent = sent
        self.ended = ended

    def rename(self, label: str) -> None:
        """Set the name that traces and reports use from now on."""
        self.label = label

    def renumber(self, index: float) -> None:
        """Set its position in the order of all edges."""
        self.index = index

    def carry(self, active: bool) -> None:
        """Set whether it carries activity from now on (A1)."""
        self.active = active

    def number(self) -> int:
        """Count one more token on the edge. Return its number (T5)."""
        self.sent += 1
        return self.sent

    def count_dropped(self, count: int = 1) -> None:
        """Count `count` tokens of this edge as dropped."""
        self.dropped += count

    def count_drained(self) -> None:
        """Count a token that was processed without a firing (F12)."""
        self.drained += 1

    def end(self, ended: bool) -> None:
        """Set whether the token that the consumer took last is END (F4)."""
        self.ended = ended

    def begin_afresh(self) -> None:
        """Reset for a consumer that starts over. An END that an optional input already received stays valid (F4)."""
        self.ended = self.ended and not self.mandatory

    def joins(self) -> bool:
        """Return whether firings take from this edge (F3, P8).

        From other edges, tokens are taken by slot calls, or by whatever sets a parameter between firings.
        """
        return self.target_kind != "slot"

    def enliven(self, live: bool) -> None:
        """Set whether both its ends are enabled."""
        self.live = live

    def check_invariants(self) -> None:
        """Check what must hold for every edge between two steps of the run.

        Raises:
          EngineInternalError: an invariant is violated.
        """
        for holds, relation in self._relations():
            if not holds:
                raise EngineInternalError(f'edge "{self.label}": {relation}')

    def _relations(self) -> Iterator[tuple[bool, str]]:
        """Yield its invariants, each with its text."""
        raise NotImplementedError


class SyncEdge(Edge):
    """A synchronous edge with one place, from an output (P4).

    Attributes:
      token: the untaken token, or None.
      unprocessed: the producer's place is occupied: from sending until the token counts as processed (F5).
    """

    __slots__ = ("token", "unprocessed")

    def __init__(self, index: float, label: str, active: bool) -> None:
        super().__init__(index, label, active)
        self.token: Token[Any] | None = None
        self.unprocessed = False
        self.sequential = True

    def put(self, token: Token[Any]) -> bool:
        """Put the one token on the edge that it has a place for. Return True: the producer has to wait (P4).

        Raises:
          EngineInternalError: the place is occupied.
        """
        if self.token is not None or self.unprocessed:
            raise EngineInternalError(f'a second token on synchronous edge "{self.label}"')
        self.token = token
        self.unprocessed = True
        return True

    def take(self) -> Token[Any]:
        """Take the token. Its place stays occupied until `release` (F5)."""
        token, self.token = self.token, None
        assert token is not None
        return token

    def release(self) -> bool:
        """Mark the token as processed. Return whether its producer was waiting for it."""
        unprocessed, self.unprocessed = self.unprocessed, False
        return unprocessed

    def strip(self, changed: Callable[[Token[Any]], Token[Any]]) -> None:
        """Replace the modifier of the token on the edge."""
        if self.token is not None:
            self.token = changed(self.token)

    @property
    def untaken(self) -> int:
        """1 if a token is on the edge, otherwise 0."""
        return 0 if self.token is None else 1

    @property
    def deepest(self) -> int:
        """1 if a token was ever on the edge, otherwise 0."""
        return 1 if self.sent > self.drained else 0

    def clear(self) -> list[Token[Any]]:
        """Remove and return the token on the edge."""
        token, self.token = self.token, None
        return [] if token is None else [token]

    def contents(self) -> list[Token[Any]]:
        """Return the token on the edge without taking it."""
        return [] if self.token is None else [self.token]

    def _relations(self) -> Iterator[tuple[bool, str]]:
        yield self.token is None or self.unprocessed, "a token on it counts as processed (F5)"


class _QueueEdge(Edge):
    """Common part of both edges with a queue: initial tokens come first, then those that were sent.

    Attributes:
      deepest: the largest number of tokens that were ever on it.
    """

    __slots__ = ("deepest", "initial", "queue")

    def __init__(self, index: float, label: str, active: bool, initial: tuple[Any, ...]) -> None:
        super().__init__(index, label, active)
        self.queue: deque[Lying] = deque()
        self.initial = initial
        self.deepest = len(initial)

    def lay(self, lying: Lying) -> None:
        """Put a token at the end of the queue."""
        queue = self.queue
        queue.append(lying)
        if len(queue) > self.deepest:
            self.deepest = len(queue)

    def begin(self, stamp: float) -> None:
        """Put the initial tokens on the edge, at the start of the run or of the edge (P7)."""
        self.queue.extend((value, 0, stamp, 0) for value in self.initial)

    def take(self) -> Token[Any]:
        """Take the oldest token."""
        return Token(*self.queue.popleft())

    def strip(self, changed: Callable[[Token[Any]], Token[Any]]) -> None:
        """Replace the modifiers of the tokens on the edge."""
        tokens = [changed(token) for token in self.clear()]
        self.queue.extend((token.value, token.activity, token.stamp, token.sequence) for token in tokens)

    @property
    def untaken(self) -> int:
        """Number of tokens on the edge."""
        return len(self.queue)

    def clear(self) -> list[Token[Any]]:
        """Remove and return the tokens on the edge, oldest first."""
        tokens = self.contents()
        self.queue.clear()
        return tokens

    def contents(self) -> list[Token[Any]]:
        """Return the tokens on the edge, oldest first, without taking them."""
        return [Token(*lying) for lying in self.queue]


class BufferEdge(_QueueEdge):
    """An edge from an output to an input with room for several tokens: a buffer (P4), initial tokens (P7), or both.

    In the model it is a chain of relays with pipelined release, and the consumer takes from the edge of the last one.
    Here the tokens on all of these edges are in one queue.

    Attributes:
      queue: untaken tokens.
      room: how many tokens may be here while the producer continues: the places of the buffer plus the initial tokens.
      working: only for a sequential edge: the consumer has taken a token that is not processed yet.
      unprocessed: the producer's newest token counts as unprocessed because there is no room for it.
    """

    __slots__ = ("room", "unprocessed", "working")

    def __init__(self, index: float, label: str, active: bool, initial: tuple[Any, ...], buffer: int) -> None:
        super().__init__(index, label, active, initial)
        self.room = len(initial) + buffer
        self.working = False
        self.unprocessed = False

    def put(self, token: Token[Any]) -> bool:
        """Put a token at the end of the queue. Return whether the producer has to wait (P4, P7).

        Raises:
          EngineInternalError: the producer is already waiting.
        """
        if self.unprocessed:
            raise EngineInternalError(f'one token too many on synchronous edge "{self.label}"')
        self.lay((token.value, token.activity, token.stamp, token.sequence))
        self.unprocessed = self.crowded
        return self.unprocessed

    def take(self) -> Token[Any]:
        """Take the oldest token. On a sequential edge, its place stays occupied until `release` (F5)."""
        self.working = self.sequential
        return super().take()

    def release(self) -> bool:
        """Mark the taken token as processed. Return whether its producer was waiting for it and continues now."""
        self.working = False
        if not self.unprocessed or self.crowded:
            return False
        self.unprocessed = False
        return True

    def go_on_working(self, working: bool) -> None:
        """Set whether the consumer still processes a token that it took, although its edge is empty now (F10)."""
        self.working = working

    @property
    def capacity(self) -> int:
        """The largest number of tokens that it holds."""
        return self.room + 1

    @property
    def crowded(self) -> bool:
        """Whether it holds more tokens than it has room for, so that its producer waits."""
        return len(self.queue) + self.working > self.room

    def _relations(self) -> Iterator[tuple[bool, str]]:
        yield len(self.queue) + self.working <= self.capacity, f"it holds more than {self.capacity} tokens (P4, P7)"
        yield (
            self.unprocessed == self.crowded or not self.live,
            "its producer waits although there is room, or does not wait although there is none",
        )
        yield self.sequential or not self.working, "tokens of a pipelined edge are processed when they are taken (F5)"


class EventEdge(_QueueEdge):
    """An edge from an event: a first-in first-out queue with a capacity and an overflow policy (P5).

    Attributes:
      queue: untaken tokens.
      capacity: number of places; grows only by rule F8.
      capacity_limit: the largest capacity that it may grow to, or None.
      overflow: what to do with a token when the queue is full.
      full: a `wait` edge that holds `capacity` tokens or more: its source starts nothing new (F8).
      grown: how often F8 has enlarged it.
      ripening: how many tokens its operators hold back until they are due (P9).
      pipeline: feeds a token to the operators on the edge (P9), or None.
      complete: tells the operators that the stream is over; None: there are no operators, or they already know.
      renew: reconnects the operators for a node that starts over; or None.
      end_sent: END was put on it (F13, once per edge); later tokens are dropped.
    """

    __slots__ = (
        "capacity",
        "capacity_limit",
        "complete",
        "end_sent",
        "full",
        "grown",
        "overflow",
        "pipeline",
        "renew",
        "ripening",
    )

    def __init__(
        self,
        index: float,
        label: str,
        active: bool,
        capacity: int = 16,
        overflow: Overflow = "wait",
        capacity_limit: int | None = None,
        initial: tuple[Any, ...] = (),
    ) -> None:
        super().__init__(index, label, active, initial)
        self.capacity = 1 if overflow == "latest" else capacity
        self.capacity_limit = capacity_limit
        self.overflow: Overflow = overflow
        self.full = False
        self.grown = 0
        self.ripening = 0
        self.end_sent = False
        self.pipeline: Callable[[Token[Any]], None] | None = None
        self.complete: Callable[[], None] | None = None
        self.renew: Callable[[], None] | None = None

    def pipe(self, feed: Callable[[Token[Any]], None], complete: Callable[[], None] | None) -> None:
        """P9: send tokens through operators (at first, placeholders for them) before they are put on the edge."""
        self.pipeline = feed
        self.complete = complete

    def pipe_afresh_by(self, renew: Callable[[], None]) -> None:
        """P9: set the function that reconnects its operators for a node that starts over."""
        self.renew = renew

    def joins(self) -> bool:
        """See `Edge`: among signals, only those into inputs take part in a firing (F6, P8)."""
        return self.target_kind == "input"

    def fill(self) -> bool:
        """F8: return whether the edge has just become full, so that its source starts nothing new."""
        if self.overflow == "wait" and not self.full and len(self.queue) >= self.capacity and self.live:
            self.full = True
            return True
        return False

    def free(self) -> bool:
        """F8: return whether the edge was full and no longer is."""
        if self.full and len(self.queue) < self.capacity:
            self.full = False
            return True
        return False

    def grow(self) -> None:
        """F8: add one place."""
        self.capacity += 1
        self.grown += 1

    def ripen(self, how_much: int) -> None:
        """P9: count `how_much` more tokens that its operators hold back until they are due."""
        self.ripening += how_much

    def say_end(self) -> None:
        """F13: record that END is on the edge, which happens once; later tokens are dropped."""
        self.end_sent = True

    def take_complete(self) -> Callable[[], None] | None:
        """Return, once, the function that tells the operators that the stream is over (P9)."""
        complete, self.complete = self.complete, None
        return complete

    def overflows(self) -> bool:
        """Return whether the queue is full and its policy drops or refuses the next token (P5)."""
        return self.overflow != "wait" and len(self.queue) >= self.capacity and not self.end_sent

    def _relations(self) -> Iterator[tuple[bool, str]]:
        holds_back = self.overflow == "wait" and len(self.queue) >= self.capacity
        yield holds_back or not self.full, "it holds its source back and is not full (F8)"
        yield self.full or not holds_back or not self.live, "it is full and does not hold its source back (F8)"
        if self.overflow != "wait" and not self.end_sent:
            yield len(self.queue) <= max(self.capacity, len(self.initial)), f"it holds more than {self.capacity} (P5)"


AnyEdge: TypeAlias = SyncEdge | BufferEdge | EventEdge
"""An edge that can hold tokens."""
