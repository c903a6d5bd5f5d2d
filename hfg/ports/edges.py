"""The edges of a running graph: what lies on them and who may put more (rules P4, P5, P7).

Three state machines: a synchronous edge with one place, one with room for more (a buffer, a delay), and an event edge
with a queue. They hold tokens and count; the engine moves them. `source` and `target` are the engine's workers, opaque
here. Stands on `token`; never waits.
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
"""What a queue holds for each token: value, activity, stamp and number; the token is made when somebody takes it."""

VALUE: Final = 0
ACTIVITY: Final = 1
NUMBER: Final = 3


class Edge:
    """What all edges of a run have.

    Attributes:
      index: grows along the order of drawing; an edit puts numbers in between.
      label: "source -> target", as traces and reports name it.
      active: whether it carries activity, A(e) (rule A1).
      target_kind: what it leads into: "input", "slot", or "parameter".
      position: which input of the target's node type; inputs first, then parameters.
      mandatory: whether it feeds a mandatory input (F4's m).
      sent, dropped, drained: counts for the report; `sent` is also the number of the newest token.
      lost: tokens of it that are gone with a process (L2).
      live: whether both ends are enabled (SEMANTICS, "live edge").
      sequential: what lies on it is processed when the consumer's outputs are, not when it is taken (F5).
      follows: what it enables goes before all else of the group (R2): sequential, within one group, first in first out.
      while_active: the slot it leads into listens only while its node is active (T4).
      ended: the consumer has taken END from it and waits for it no more (F4).
      handler: of the slot it leads into, taking the value, where that is all there is to a call; None:
        the interpreted way.
      waits: at whose output barrier an unprocessed token of it counts: the source, or the head of the region of the
        source; of no meaning for event edges.
      tap: sees every token that is put on it; None: nobody looks.
      via: the scopes (subgraphs) whose relays it passes; all must be enabled.
      segments: the drawn edges that it consists of, from source to target; none if it comes from outside the graph.
      source_port, target_port: the bound ports at its ends; for an observable itself.
    """

    __slots__ = (
        "active",
        "drained",
        "dropped",
        "ended",
        "follows",
        "handler",
        "index",
        "label",
        "live",
        "lost",
        "mandatory",
        "port_name",
        "position",
        "segments",
        "sent",
        "sequential",
        "source",
        "source_port",
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
        self.follows = False
        self.ended = False
        self.via: tuple[Any, ...] = ()
        self.segments: tuple[Any, ...] = ()
        self.source_port: Any = None
        self.target_port: Any = None
        self.handler: Callable[[Any], Any] | None = None
        self.tap: Callable[[Token[Any]], None] | None = None

    def join(self, source: Any, target: Any) -> None:
        """It leads from here to there."""
        self.source = self.waits = source
        self.target = target

    def enter(self, kind: str, name: str, position: int, mandatory: bool) -> None:
        """It leads into this input or parameter of its target."""
        self.target_kind = kind
        self.port_name = name
        self.position = position
        self.mandatory = mandatory

    def enter_slot(self, name: str, handler: Callable[[Any], Any] | None, while_active: bool) -> None:
        """It leads into this slot of its target."""
        self.target_kind = "slot"
        self.port_name = name
        self.handler = handler
        self.while_active = while_active

    def stand_for(self, segments: tuple[Any, ...], source_port: Any, target_port: Any, via: tuple[Any, ...]) -> None:
        """This is what it is in the drawn graph."""
        self.segments = segments
        self.source_port = source_port
        self.target_port = target_port
        self.via = via

    def be_released(self, *, sequential: bool, follows: bool) -> None:
        """So the consumer's mode has it, and where both of them run (F5, R2)."""
        self.sequential = sequential
        self.follows = follows

    def go_on(self, sent: int, *, ended: bool) -> None:
        """It takes the place of one over which so many tokens went, END last of all or not."""
        self.sent = sent
        self.ended = ended

    def rename(self, label: str) -> None:
        """Traces and reports call it so from now on."""
        self.label = label

    def renumber(self, index: float) -> None:
        """It comes here in the order of all."""
        self.index = index

    def carry(self, active: bool) -> None:
        """Whether it carries activity from now on (A1)."""
        self.active = active

    def number(self) -> int:
        """One more token is put on it: this is its number (T5)."""
        self.sent += 1
        return self.sent

    def count_dropped(self, count: int = 1) -> None:
        """So many tokens of it went nowhere."""
        self.dropped += count

    def count_drained(self) -> None:
        """A token of it was processed without a firing (F12)."""
        self.drained += 1

    def end(self, ended: bool) -> None:
        """Whether END is what the consumer has taken from it last (F4)."""
        self.ended = ended

    def begin_afresh(self) -> None:
        """The consumer begins afresh; who has said END to an optional input has said it (F4)."""
        self.ended = self.ended and not self.mandatory

    def joins(self) -> bool:
        """Whether a firing takes from it (F3, P8); else slot calls do, or what sets a parameter between firings."""
        return self.target_kind != "slot"

    def enliven(self, live: bool) -> None:
        """Whether both its ends are enabled."""
        self.live = live

    def check_invariants(self) -> None:
        """Between two steps of the run certain things hold of every edge.

        Raises:
          EngineInternalError: one of them does not.
        """
        for holds, relation in self._relations():
            if not holds:
                raise EngineInternalError(f'edge "{self.label}": {relation}')

    def _relations(self) -> Iterator[tuple[bool, str]]:
        """What holds of it between two steps."""
        raise NotImplementedError


class SyncEdge(Edge):
    """From an output, one place (P4).

    Attributes:
      token: the untaken token, or None.
      held: from the sending until it counts as processed (F5): the producer's place is occupied.
    """

    __slots__ = ("held", "token")

    def __init__(self, index: float, label: str, active: bool) -> None:
        super().__init__(index, label, active)
        self.token: Token[Any] | None = None
        self.held = False
        self.sequential = True

    def put(self, token: Token[Any]) -> bool:
        """Lay the one token on it that there is a place for: the producer has to wait (P4).

        Raises:
          EngineInternalError: the place is taken.
        """
        if self.token is not None or self.held:
            raise EngineInternalError(f'a second token on synchronous edge "{self.label}"')
        self.token = token
        self.held = True
        return True

    def take(self) -> Token[Any]:
        """Take the token from it; its place stays occupied until `release` (F5)."""
        token, self.token = self.token, None
        assert token is not None
        return token

    def release(self) -> bool:
        """The token is processed; whether its producer has waited for that."""
        held, self.held = self.held, False
        return held

    def strip(self, changed: Callable[[Token[Any]], Token[Any]]) -> None:
        """Give what lies on it another modifier."""
        if self.token is not None:
            self.token = changed(self.token)

    @property
    def untaken(self) -> int:
        """1 if a token lies on it, else 0."""
        return 0 if self.token is None else 1

    @property
    def deepest(self) -> int:
        """1 if a token ever lay on it, else 0."""
        return 1 if self.sent > self.drained else 0

    def clear(self) -> list[Token[Any]]:
        """Take away what lies on it."""
        token, self.token = self.token, None
        return [] if token is None else [token]

    def contents(self) -> list[Token[Any]]:
        """What lies on it, without taking it."""
        return [] if self.token is None else [self.token]

    def _relations(self) -> Iterator[tuple[bool, str]]:
        yield self.token is None or self.held, "a token lies on it that counts as processed (F5)"


class _QueueEdge(Edge):
    """What both edges with a queue share: initial tokens first, then what was sent.

    Attributes:
      deepest: the most tokens that ever lay on it.
    """

    __slots__ = ("deepest", "initial", "queue")

    def __init__(self, index: float, label: str, active: bool, initial: tuple[Any, ...]) -> None:
        super().__init__(index, label, active)
        self.queue: deque[Lying] = deque()
        self.initial = initial
        self.deepest = len(initial)

    def lay(self, lying: Lying) -> None:
        """Put a token behind all others."""
        queue = self.queue
        queue.append(lying)
        if len(queue) > self.deepest:
            self.deepest = len(queue)

    def begin(self, stamp: float) -> None:
        """The run, or the edge, begins: its initial tokens lie on it (P7)."""
        self.queue.extend((value, 0, stamp, 0) for value in self.initial)

    def take(self) -> Token[Any]:
        """Take the oldest token."""
        return Token(*self.queue.popleft())

    def strip(self, changed: Callable[[Token[Any]], Token[Any]]) -> None:
        """Give what lies on it other modifiers."""
        tokens = [changed(token) for token in self.clear()]
        self.queue.extend((token.value, token.activity, token.stamp, token.sequence) for token in tokens)

    @property
    def untaken(self) -> int:
        """How many tokens lie on it."""
        return len(self.queue)

    def clear(self) -> list[Token[Any]]:
        """Take away what lies on it, oldest first."""
        tokens = self.contents()
        self.queue.clear()
        return tokens

    def contents(self) -> list[Token[Any]]:
        """What lies on it, oldest first, without taking it."""
        return [Token(*lying) for lying in self.queue]


class BufferEdge(_QueueEdge):
    """From an output into an input, with room for more than one token: a buffer (P4), initial tokens (P7), or both.

    It is a row of relays with pipelined release, the last of them the one edge that the consumer takes from; what lies
    on all of them lies here in one queue.

    Attributes:
      queue: untaken tokens.
      room: how many may lie here while the producer goes on: the places of the buffer and the initial tokens.
      working: of a sequential one: the consumer has taken a token that is not processed yet.
      held: the producer's newest token counts as unprocessed, for there is no room for it.
    """

    __slots__ = ("held", "room", "working")

    def __init__(self, index: float, label: str, active: bool, initial: tuple[Any, ...], buffer: int) -> None:
        super().__init__(index, label, active, initial)
        self.room = len(initial) + buffer
        self.working = False
        self.held = False

    def put(self, token: Token[Any]) -> bool:
        """Put a token behind all others; whether the producer has to wait (P4, P7).

        Raises:
          EngineInternalError: the producer waits already.
        """
        if self.held:
            raise EngineInternalError(f'one token too many on synchronous edge "{self.label}"')
        self.lay((token.value, token.activity, token.stamp, token.sequence))
        self.held = self.crowded
        return self.held

    def take(self) -> Token[Any]:
        """Take the oldest token; a sequential one keeps its place until `release` (F5)."""
        self.working = self.sequential
        return super().take()

    def release(self) -> bool:
        """What was taken is processed; whether its producer has waited for that and goes on."""
        self.working = False
        if not self.held or self.crowded:
            return False
        self.held = False
        return True

    def go_on_working(self, working: bool) -> None:
        """The consumer finishes what it has taken, though its edge is empty now (F10)."""
        self.working = working

    @property
    def capacity(self) -> int:
        """How many tokens it holds at most."""
        return self.room + 1

    @property
    def crowded(self) -> bool:
        """Whether it holds more than there is room for, so that its producer waits."""
        return len(self.queue) + self.working > self.room

    def _relations(self) -> Iterator[tuple[bool, str]]:
        yield len(self.queue) + self.working <= self.capacity, f"it holds more than {self.capacity} tokens (P4, P7)"
        yield self.held == self.crowded or not self.live, "its producer waits though there is room, or not though none"
        yield self.sequential or not self.working, "what is pipelined is processed when it is taken (F5)"


class EventEdge(_QueueEdge):
    """From an event: a first-in first-out queue with a capacity and an overflow policy (P5).

    Attributes:
      queue: untaken tokens.
      capacity: places; grows only by rule F8.
      capacity_limit: the most it may grow to, or None.
      overflow: what happens to a token too many.
      full: a `wait` edge that holds `capacity` or more: its source starts nothing new (F8).
      grown: how often F8 made it longer.
      ripening: how much its operators hold back until its time has come (P9).
      pipeline: feeds a token to the operators on the edge (P9), or None.
      complete: tells the operators that no more comes; None: there are none, or they know.
      renew: connects the operators afresh, for a node that starts afresh; or None.
      end_sent: END has been put on it (F13, once an edge); what comes later is dropped.
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
        """P9: tokens go through operators before they lie on it, or to what stands for those at first."""
        self.pipeline = feed
        self.complete = complete

    def pipe_afresh_by(self, renew: Callable[[], None]) -> None:
        """P9: so its operators are connected again, for a node that starts afresh."""
        self.renew = renew

    def joins(self) -> bool:
        """See `Edge`: of the signals only those into inputs take part in a firing (F6, P8)."""
        return self.target_kind == "input"

    def fill(self) -> bool:
        """F8: whether it has just become full, so that its source starts nothing new."""
        if self.overflow == "wait" and not self.full and len(self.queue) >= self.capacity and self.live:
            self.full = True
            return True
        return False

    def free(self) -> bool:
        """F8: whether it was full and is not any more."""
        if self.full and len(self.queue) < self.capacity:
            self.full = False
            return True
        return False

    def grow(self) -> None:
        """F8: one more place."""
        self.capacity += 1
        self.grown += 1

    def ripen(self, how_much: int) -> None:
        """P9: its operators hold back so much more until its time has come."""
        self.ripening += how_much

    def say_end(self) -> None:
        """F13: END is put on it, once; what comes later is dropped."""
        self.end_sent = True

    def take_complete(self) -> Callable[[], None] | None:
        """What tells the operators that no more comes, to be called once (P9)."""
        complete, self.complete = self.complete, None
        return complete

    def overflows(self) -> bool:
        """Whether one more token is one too many for a policy that drops or refuses (P5)."""
        return self.overflow != "wait" and len(self.queue) >= self.capacity and not self.end_sent

    def _relations(self) -> Iterator[tuple[bool, str]]:
        holds_back = self.overflow == "wait" and len(self.queue) >= self.capacity
        yield holds_back or not self.full, "it holds its source back and is not full (F8)"
        yield self.full or not holds_back or not self.live, "it is full and does not hold its source back (F8)"
        if self.overflow != "wait" and not self.end_sent:
            yield len(self.queue) <= max(self.capacity, len(self.initial)), f"it holds more than {self.capacity} (P5)"


AnyEdge: TypeAlias = SyncEdge | BufferEdge | EventEdge
"""An edge that something lies on."""
