"""The state of a part with a ledger, as one piece of data, and how a new incarnation resumes from it (rules L2, L4).

Between two firings, a part consists of the state of its nodes, the tokens on its edges, and its positions on the edges
to and from other parts. They are stored together, or not at all. Until they are stored, no consequence leaves the part,
and no producer is told that a token is processed. So whatever dies, the part's own state never differs from what others
know about it, and no node has to repeat its work identically.

Decides, never waits. Depends on the engine; `part` and `ends` provide the data about edges.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Final, Protocol, get_type_hints

import msgspec
import numpy as np

from hfg.base.token import Token
from hfg.encoding import TokenCodec, data
from hfg.engine.model.running_node import ENDED, RunningNode
from hfg.engine.rules.agenda import consider, queue_next_in_wave
from hfg.engine.rules.ending import drain_left
from hfg.engine.rules.putting import put
from hfg.engine.rules.sending import enqueue
from hfg.engine.runtime.borders import Inlet, Outlet
from hfg.engine.runtime.engine import Engine
from hfg.errors import EncodingError, HfgError, RunError
from hfg.links import Outbox
from hfg.nodetypes.node import Node
from hfg.parts.model.inheriting import Where
from hfg.ports import Port
from hfg.ports.edges import AnyEdge, EventEdge
from hfg.transport import Position

_BYTES_PER_S: Final = 10_000_000  # how much is kept at most: large state is kept less often
_VERSION: Final = 1

Packed = tuple[int, bytes, bytes]
"""A value: how it is encoded, metadata, and the bytes."""

_BY_TYPE: Final = 0
_AS_ARRAY: Final = 1
_AS_DATA: Final = 2


class KeptEdge(msgspec.Struct, array_like=True):
    """The state of an edge between two firings.

    Attributes:
      sent: how many tokens were put on it; for an incoming edge: and taken.
      ended: END was taken from it.
      end_sent: END was put on it, of an event edge.
      tokens: tokens on it: value, modifier and stamp of each.
    """

    sent: int
    ended: bool
    end_sent: bool
    tokens: list[tuple[Packed, int, float]]


class KeptOutbox(msgspec.Struct, array_like=True):
    """Tokens that left over an edge and may be unacknowledged: see `Outbox`."""

    stream: int
    first: int
    tokens: list[tuple[bytes, bytes]]


class Snapshot(msgspec.Struct):
    """A part between two firings.

    Attributes:
      version: of this class.
      states: of nodes, by path and name.
      ended: the nodes that have ended, by path; whether END is still to be sent.
      edges: within the part and at its ends, by label.
      coming: the position of the last token that was taken, by label of the edge.
      leaving: what was sent, by label of the edge.
    """

    version: int
    states: dict[str, dict[str, Packed]]
    ended: dict[str, bool]
    edges: dict[str, KeptEdge]
    coming: dict[str, Where]
    leaving: dict[str, KeptOutbox]


def read(kept: bytes, part: str) -> Snapshot:
    """Return the data in a ledger.

    Raises:
      RunError: it is not data of this version of hfg.
    """
    try:
        snapshot = msgspec.msgpack.decode(kept, type=Snapshot)
    except msgspec.DecodeError as error:
        raise RunError(f'cannot read the ledger of group "{part}" ({error}): remove it to start over') from error
    if snapshot.version != _VERSION:
        raise RunError(
            f'the ledger of group "{part}" belongs to another version of hfg ({snapshot.version}, this is '
            f"{_VERSION}): let that version finish the run, or remove the ledger to start over"
        )
    return snapshot


class Leaving(Protocol):
    """The link of an edge that leaves a part with a ledger."""

    def outbox(self) -> Outbox | None:
        """Return the tokens that may be unacknowledged, including unstored ones; None if signals may be lost."""

    @property
    def held(self) -> int:
        """How many tokens wait until they are kept."""

    def let_go(self, count: int) -> None:
        """`count` of these are stored: they may leave."""


class _Asked(msgspec.Struct):
    """What will be known when the state is stored.

    Attributes:
      number: number of the message.
      signature: signature of the moment.
      taken: how many tokens were taken, by label of the edge.
      held: how many tokens waited for it, by label of the edge.
    """

    number: int
    signature: Any
    taken: dict[str, int]
    held: dict[str, int]


class Checkpointer:
    """Keeps what one part does."""

    def __init__(
        self,
        name: str,
        engine: Engine,
        keep: Callable[[int, bytes], None],
        kept: Snapshot | None = None,
        *,
        keeps_states: bool = True,
    ) -> None:
        """Start without storing anything.

        Args:
          name: name of the part.
          engine: engine of the part, not started yet.
          keep: stores data under a number; `be_kept` is called when it is stored.
          kept: the state at which previous incarnations stopped.
          keeps_states: store the state of nodes as well as positions on edges.
        """
        self._keeps_states = keeps_states
        self.kept = kept
        self._name = name
        self._engine = engine
        self._keep = keep
        self._inlets: Mapping[str, Inlet] = {}
        self._outlets: Mapping[str, Outlet] = {}
        self._links: Mapping[str, Leaving] = {}
        self._wheres: dict[str, deque[Where]] = {}
        self._last: dict[str, Where] = {} if kept is None else dict(kept.coming)
        self._safe: dict[str, int] = {}
        self._asked: _Asked | None = None
        self._known: Any = None
        self._number = 0
        self._not_before = 0.0
        self._is_due = False
        self._own: dict[str, dict[str, Any]] = {}
        self._hints: dict[type, dict[str, Any]] = {}
        self._codecs: dict[Any, TokenCodec[Any] | None] = {}
        if kept is not None:
            engine.core.recall_with(self._recall)

    def stand_at(
        self, inlets: Mapping[str, Inlet], outlets: Mapping[str, Outlet], links: Mapping[str, Leaving]
    ) -> None:
        """These are the ends of the part."""
        self._inlets, self._outlets, self._links = inlets, outlets, links
        self._wheres = {label: deque() for label in inlets}
        self._safe = dict.fromkeys(inlets, 0)
        before = {} if self.kept is None else self.kept.edges
        for edge in self._engine.core.edges:
            if edge.label in before and edge.label in inlets:  # before anything comes
                edge.go_on(before[edge.label].sent, ended=False)

    def position(self, label: str) -> Position | None:
        """Return the position of the last token of an edge that previous incarnations have taken, if stored."""
        where = None if self.kept is None else self.kept.coming.get(label)
        return None if where is None else Position(*where)

    def outbox(self, label: str) -> Outbox | None:
        """Return the tokens that previous incarnations have sent over an edge, if stored."""
        found = None if self.kept is None else self.kept.leaving.get(label)
        return None if found is None else Outbox(found.stream, found.first, tuple(found.tokens))

    # --- tokens that come -------------------------------------------------------------------------------------------

    def came(self, label: str, wheres: list[Where]) -> None:
        """Tokens with these positions have come."""
        self._wheres[label].extend(wheres)

    def rebased(self, label: str, total: int) -> None:
        """Count `total` more tokens for previous incarnations, according to the other end."""
        self._safe[label] += total
        if self._asked is not None:
            self._asked.taken[label] += total

    def safe(self, label: str) -> int:
        """Return how many tokens were taken whose effects are kept."""
        return self._safe[label]

    # --- keeping ----------------------------------------------------------------------------------------------------

    @property
    def is_behind(self) -> bool:
        """Whether something has happened that is not kept."""
        return self._asked is not None or self._signature() != self._known

    def _signature(self) -> Any:
        core = self._engine.core
        core.settle_counts()
        workers = core.workers
        return (
            sum(worker.counts.done for worker in workers),
            [worker.path for worker in workers if worker.blocked & ENDED],
            [worker.path for worker in workers if worker.pending_end],
            [outlet.left for outlet in self._outlets.values()],  # not `sent`, which may go back when a neighbour joins
            [inlet.received - inlet.waiting for inlet in self._inlets.values()],
        )

    def look(self) -> None:
        """A slice of the engine is over: keep what has happened, if this is a moment between firings."""
        engine = self._engine
        core = engine.core
        if self._asked is not None or self._is_due or core.over or any(worker.busy for worker in core.workers):
            return
        signature = self._signature()
        if signature == self._known:
            return
        if self._not_before > engine.loop.time():
            self._is_due = True
            engine.loop.call_at(self._not_before, self._look_again)
            return
        try:
            kept = msgspec.msgpack.encode(self._snapshot())
        except HfgError as error:
            engine.finish("failed", error)
            return
        self._not_before = engine.loop.time() + len(kept) / _BYTES_PER_S
        self._number += 1
        taken = {label: inlet.received - inlet.waiting for label, inlet in self._inlets.items()}
        held = {label: link.held for label, link in self._links.items()}
        self._asked = _Asked(self._number, signature, taken, held)
        self._keep(self._number, kept)

    def _look_again(self) -> None:
        self._is_due = False
        self._not_before = 0.0  # a clock may fire slightly before the time for which it was set
        self._engine.guard(self.look)

    def be_kept(self, number: int) -> bool:
        """The state is stored: its consequences may leave. Return whether it is the latest request."""
        asked = self._asked
        if asked is None or asked.number != number:
            return False
        self._asked = None
        self._known = asked.signature
        self._safe |= asked.taken
        for label, count in asked.held.items():
            self._links[label].let_go(count)
        return True

    def _snapshot(self) -> Snapshot:
        core = self._engine.core
        if core.tasks:
            busy = next(worker.path for worker in core.workers if worker.tasks)
            raise RunError(
                f'group "{self._name}" has a ledger, and node "{busy}" has started a task concurrently with '
                "its firings, whose state cannot be stored: await its work in the firing, or remove ledger= "
                "from the group"
            )
        for label, inlet in self._inlets.items():
            wheres = self._wheres[label]
            while len(wheres) > inlet.waiting:
                self._last[label] = wheres.popleft()
        nodes = [worker for worker in core.workers if worker.node is not None and worker.scope is None]
        leaving: dict[str, KeptOutbox] = {}
        for label, link in self._links.items():
            outbox = link.outbox()
            if outbox is not None and outbox.stream:
                tokens = [(bytes(metadata), bytes(value)) for metadata, value in outbox.tokens]
                leaving[label] = KeptOutbox(outbox.stream, outbox.first, tokens)
        return Snapshot(
            _VERSION,
            {worker.path: self._states(worker) if self._keeps_states else {} for worker in nodes},
            {worker.path: worker.pending_end for worker in nodes if worker.blocked & ENDED},
            {edge.label: self._edge(edge) for edge in core.edges},
            dict(self._last),
            leaving,
        )

    def _edge(self, edge: AnyEdge) -> KeptEdge:
        tokens = edge.contents()
        sent = edge.sent
        if edge.label in self._inlets:  # they will come again
            sent -= len(tokens)
            tokens = []
        elif edge.label in self._outlets:
            tokens = self._outlets[edge.label].unsent
            sent -= len(tokens)
        else:
            sent -= len(tokens)
        hint = getattr(edge.source_port, "type", Any)
        what = f'a value on "{edge.label}"'
        packed = [(self._pack(token.value, hint, what), token.activity, token.stamp) for token in tokens]
        return KeptEdge(sent, edge.ended, isinstance(edge, EventEdge) and edge.end_sent, packed)

    def _states(self, worker: RunningNode) -> dict[str, Packed]:
        node: Node = worker.node
        self._need_state(worker.path, node)
        found = {}
        hints = self._hints_of(node)
        for name in node._type.states:
            found[name] = self._pack(node.__dict__[name], hints[name], f'"{name}" of node "{worker.path}"')
        return found

    # --- going on ---------------------------------------------------------------------------------------------------

    def _recall(self, worker: RunningNode) -> None:
        """Before a node is set up: restore its stored state."""
        assert self.kept is not None
        node = worker.node
        states = self.kept.states.get(worker.path)
        if node is None or states is None:
            return
        hints = self._hints_of(node)
        for name, packed in states.items():
            if name in node._type.states:
                node.__dict__[name] = self._unpack(packed, hints[name], f'"{name}" of node "{worker.path}"')

    def go_on(self) -> None:
        """The nodes are set up and started, and none has moved: restore the stored state."""
        core = self._engine.core
        for worker in core.workers:
            if worker.node is not None and worker.scope is None:
                if self.kept is not None:
                    self._recall(worker)  # what setup() has written is older
                self._own[worker.path] = _copies(_own(worker.node))
        core.recall_with(None)
        if self.kept is not None:
            self._go_on(self.kept)
        self._known = self._signature()

    def _go_on(self, kept: Snapshot) -> None:
        core = self._engine.core
        edges = {edge.label: edge for edge in core.edges}
        self._end_again(kept)
        for label, found in kept.edges.items():
            if label in self._inlets:  # new tokens are already on it
                edges[label].end(found.ended)
            else:
                edges[label].clear()
                edges[label].go_on(found.sent, ended=found.ended)
        for worker in core.workers:
            core.rules.rewire(worker)
        since = len(core.next_in_wave)
        for label, found in kept.edges.items():
            self._lay_again(edges[label], found)
        queue_next_in_wave(core, since)
        for worker in core.workers:
            consider(worker)
        self._say_ends(kept)

    def _end_again(self, kept: Snapshot) -> None:
        for path, is_pending in kept.ended.items():
            worker = self._engine.core.by_path[path]
            worker.end()
            assert worker.ending is not None
            if is_pending:
                worker.promise_end(None)
            else:
                worker.ending.take_deferred()
            drain_left(worker.in_edges)

    def _lay_again(self, edge: AnyEdge, found: KeptEdge) -> None:
        """Put the stored tokens back on an edge."""
        hint = getattr(edge.source_port, "type", Any)
        for packed, activity, stamp in found.tokens:
            value = self._unpack(packed, hint, f'a value on "{edge.label}"')
            if isinstance(edge, EventEdge):
                enqueue(edge, value, activity, stamp)
            else:
                put(edge, value, activity, stamp)
                source: RunningNode = edge.source
                if source.outputs.missing and source.fireable:
                    source.drop_firing()
        if isinstance(edge, EventEdge) and found.end_sent:
            edge.say_end()

    def _say_ends(self, kept: Snapshot) -> None:
        core = self._engine.core
        for path, is_pending in kept.ended.items():
            worker = core.by_path[path]
            if not is_pending:
                core.rules.node_ended(worker)
            elif not worker.outputs.missing:
                core.rules.send_end(worker)

    def check(self) -> None:
        """See whether what was kept is of this part.

        Raises:
          RunError: it is of another graph.
        """
        if self.kept is None:
            return
        core = self._engine.core
        nodes = {worker.path: worker.node for worker in core.workers if worker.node is not None and not worker.scope}
        strange = sorted(self.kept.states.keys() ^ nodes.keys())
        strange += sorted(self.kept.edges.keys() ^ {edge.label for edge in core.edges})
        for path, states in self.kept.states.items():
            node = nodes.get(path)
            if node is not None and self._keeps_states:
                strange += sorted(f"{path}.{name}" for name in states.keys() ^ node._type.states.keys())
        if strange:
            raise RunError(
                f'the ledger of group "{self._name}" belongs to another graph: "{strange[0]}" is in only one '
                "of them; run that graph to its end, or remove the ledger to start over"
            )

    # --- values -----------------------------------------------------------------------------------------------------

    def _hints_of(self, node: Node) -> dict[str, Any]:
        """Return the declared types of a node's states, or types derived from their initial values."""
        kind = type(node)
        if kind not in self._hints:
            try:
                said = get_type_hints(kind)
            except Exception:  # a name that exists only for type checkers
                said = {}
            hints: dict[str, Any] = {}
            for name, state in node._type.states.items():
                begins = type(state.default[0]) if state.default else state.factory
                hints[name] = said.get(name, begins if isinstance(begins, type) or hasattr(begins, "__args__") else Any)
            self._hints[kind] = hints
        return self._hints[kind]

    def _codec(self, hint: Any) -> TokenCodec[Any] | None:
        try:
            if hint not in self._codecs:
                self._codecs[hint] = _codec(hint)
            return self._codecs[hint]
        except TypeError:  # unhashable
            return _codec(hint)

    def _pack(self, value: Any, hint: Any, what: str) -> Packed:
        for kind, one in ((_BY_TYPE, hint), (_AS_ARRAY, np.ndarray if isinstance(value, np.ndarray) else None)):
            codec = None if one is None else self._codec(one)
            if codec is not None:
                try:
                    return (kind, *codec.encode(Token(value)))
                except EncodingError:
                    pass  # it may be data all the same
        try:
            plain = data.encode(value)
            if data.has_tag(plain):
                data.decode(plain, find=_refuse)
            return (_AS_DATA, b"", msgspec.msgpack.encode(plain))
        except (EncodingError, OverflowError, TypeError) as error:
            raise RunError(
                f'group "{self._name}" has a ledger, and {what} cannot be kept: {error}; declare its type, as in '
                "seen: dict[str, int] = hfg.State(factory=dict), or take ledger= from the group"
            ) from error

    def _unpack(self, packed: Packed, hint: Any, what: str) -> Any:
        kind, metadata, value = packed
        try:
            if kind == _AS_DATA:
                return data.decode(msgspec.msgpack.decode(value), find=_refuse)
            codec = self._codec(hint if kind == _BY_TYPE else np.ndarray)
            if codec is None:
                raise EncodingError("its type is another now")
            found = codec.decode(metadata, value).value
            return found.copy() if isinstance(found, np.ndarray) else found
        except (EncodingError, msgspec.DecodeError) as error:
            raise RunError(
                f'the ledger of group "{self._name}" cannot be used: {what} is not a value of its current '
                f"type ({error}); remove the ledger to start over"
            ) from error

    def _need_state(self, path: str, node: Node) -> None:
        """Check that a node has no state outside `hfg.State`, which would be lost silently."""
        before = self._own[path]
        for name, value in _own(node).items():
            if name in before and _is_same(before[name], value):
                continue
            raise RunError(
                f'group "{self._name}" has a ledger, and node "{path}" keeps "{name}" outside of '
                f"hfg.State, which {'changes' if name in before else 'appears'} while it runs and would be "
                f"lost with its process: declare it as a state, as in {name} = hfg.State(0), or remove "
                "ledger= from the group"
            )


def _codec(hint: Any) -> TokenCodec[Any] | None:
    try:
        return TokenCodec(hint)
    except EncodingError:
        return None


def _refuse(reference: str) -> Any:
    raise EncodingError(f'"{reference}" is code, and a ledger cannot store code')


def _own(node: Node) -> dict[str, Any]:
    """Return what the code of a node has written on it besides its state."""
    states = node._type.states
    before = node._written_before or frozenset()
    return {
        name: value
        for name, value in node.__dict__.items()
        if name not in states and name not in before and not isinstance(value, Port)
    }


def _copies(own: dict[str, Any]) -> dict[str, Any]:
    """Copies of what can change in its place, as far as that is seen at once."""
    return {name: value.copy() if type(value) in _CONTAINERS else value for name, value in own.items()}


def _is_same(before: Any, now: Any) -> bool:
    if before is now:
        return True
    if type(before) is not type(now) or type(now) not in (*_CONTAINERS, int, float, str, bytes, bool):
        return False
    try:
        return bool(before == now)
    except Exception:
        return len(before) == len(now)


_CONTAINERS: Final = (list, dict, set, deque, bytearray)
