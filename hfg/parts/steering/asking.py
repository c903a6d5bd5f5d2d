"""Requests from outside to the other parts of a run, on the side of the main part (rules P8, P10, R3, R7).

A request is sent as a `Call` and answered with a `Result`. A continuing request, such as a tap, has a `Call` that stays
open, and `Seen` messages for as long as it does. Open requests, and parameters that were set, are sent to a part before
its nodes are set up: so requests in `begin=` miss nothing, and a restarted part is as it was. If a part dies during a
request, the request is repeated if it only observes or waits; otherwise it fails because it is unknown whether it was
executed. Depends on the places of nodes and on `crossing`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import count
from typing import Any, Final

import msgspec

from hfg.base.logs import Log
from hfg.engine.face.composition import Composition
from hfg.engine.runtime import relays
from hfg.errors import EncodingError, HfgError, RunError
from hfg.graph import Graph
from hfg.graph.flat import MAIN, Cutting, FlatGraph
from hfg.graph.flat.flat_graph import ROOT, FlatEdge
from hfg.graph.graph import graph_of
from hfg.graph.structure.edge import Edge as DrawnEdge
from hfg.nodetypes.node import Node
from hfg.parts.model.failing import as_error
from hfg.parts.model.messages import Call, Failed, Parcel, Result, Seen, Untrue
from hfg.parts.steering.crossing import Crossing

_LOGGER = Log("hfg.parts")
_NOBODY: Final = 0  # the number of calls whose result is ignored
_CHANGES_NOTHING: Final = ("wait_for", "wait_inputs", "wait_outputs", "wait_paused", "counts", "try_edit", "known")
"""Requests that are repeated to a restarted part: repeating them has no further effect."""

_PARAMETER: Final = "parameter "  # prefix of the keys of parameters

_GONE_WITH_THE_PART: Final = ("edit", "undo", "redo")
"""Requests without any effect if the part dies before it has answered."""


class Homes:
    """Where each node, port and edge of a graph that is cut lives."""

    def __init__(self, flat: FlatGraph, cutting: Cutting) -> None:
        """Look at a graph.

        Args:
          flat: all of it.
          cutting: of the same.
        """
        self.draw(flat, cutting)

    def draw(self, flat: FlatGraph, cutting: Cutting) -> None:
        """From now on, the graph is as drawn here."""
        self.order = [node.path for one in flat.walk() for node in one.nodes]
        self._flat = flat
        self._nodes = [node.node for node in flat.nodes]
        self._of_path = {node.path: name for name, part in cutting.parts.items() for node in part.nodes}
        self._of_node = {id(node.node): self._of_path[node.path] for node in flat.nodes}
        for node in flat.nodes:
            for inner in node.iteration.walk() if node.iteration is not None else ():
                for one in inner.nodes:
                    self._of_path[one.path] = self._of_path[node.path]
                    self._of_node[id(one.node)] = self._of_path[node.path]

    def has(self, node: Node) -> bool:
        """Return whether a node fires in some part; a subgraph does not."""
        return id(node) in self._of_node

    def far_nodes(self) -> Iterator[Node]:
        """Return the nodes of parts other than the main one."""
        return (node for node in self._nodes if self.of_node(node) != MAIN)

    def of_path(self, path: str) -> str:
        """Return the part of a node by its path; the main part if there is no such node."""
        return self._of_path.get(path, MAIN)

    def below(self, path: str) -> set[str]:
        """Return the parts of a node, or of those inside a subgraph."""
        return {home for one, home in self._of_path.items() if one == path or one.startswith(f"{path}/")}

    def of_node(self, node: Any) -> str:
        """Return the part of a node, or of a subgraph that is completely in one part; otherwise the main part."""
        if isinstance(node, Node) and id(node) not in self._of_node and node._place is not None:
            inside = {home for path, home in self._of_path.items() if path.startswith(f"{node.place.path}/")}
            return inside.pop() if len(inside) == 1 else MAIN
        return self._of_node.get(id(node), MAIN)

    def of_place(self, place: Any) -> set[str]:
        """Return the parts in which tokens pass a port or an edge; for an edge, the part of its source."""
        if isinstance(place, Node):
            return {self.of_node(place)}
        kind = getattr(place, "kind", "")
        if kind == "event":
            events = relays.events_behind(place) if relays.is_relay(place) else [place]
            return {self.of_node(event.node) for event in events} or {MAIN}
        if kind in ("slot", "output") and not relays.is_relay(place):
            return {self.of_node(place.node)}
        found = set()
        for one in self._flat.walk():
            for edge in one.edges:
                if place == edge.label or (
                    place in edge.segments if isinstance(place, DrawnEdge) else relays.is_at(edge.segments, place)
                ):
                    found.add(self._of_edge(edge))
        return found or {MAIN}

    def _of_edge(self, edge: FlatEdge) -> str:
        """Where its source is; the graph's own events are in each part."""
        source, _, target = edge.label.partition(" -> ")
        end = target if edge.source.node == ROOT and edge.source.kind == "event" else source
        path = end.rpartition(".")[0]
        if path in self._of_path or not path:
            return self.of_path(path)
        return self.of_node(graph_of(self._flat.graph)[path])

    def label_of(self, edge: DrawnEdge) -> str:
        """Return the label in the run of a drawn edge; "" if it does not have one."""
        labels = {one.label for flat in self._flat.walk() for one in flat.edges if edge in one.segments}
        return labels.pop() if len(labels) == 1 else ""


class Subscription:
    """A continuing request to other parts, until it is ended here.

    Attributes:
      number: number of its calls.
      parts: the parts that were asked.
      waits_for: the parts in which it continues.
    """

    def __init__(
        self,
        number: int,
        parts: Iterable[str],
        seen: Callable[[str, Seen], None],
        ended: Callable[[], None] | None,
        gone: Callable[[str, str], None] | None,
    ) -> None:
        self.number = number
        self.parts = frozenset(parts)
        self.seen = seen
        self.ended = ended
        self.gone = gone
        self.waits_for: set[str] = set()


class Asking:
    """Sends requests to the other parts, and processes their answers.

    Attributes:
      homes: the part of each node.
      crossing: encodes values in both directions.
      others: the names of the other parts.
    """

    def __init__(self, flat: FlatGraph, cutting: Cutting, say: Callable[[str, Call], None]) -> None:
        """Start without requests.

        Args:
          flat: the whole graph.
          cutting: of the same.
          say: sends a call to a part.
        """
        self.homes = Homes(flat, cutting)
        self.crossing = Crossing(flat)
        self.cutting = cutting
        self.others = [name for name in cutting.parts if name != MAIN]
        self.composition: Composition
        self.graph: Graph = graph_of(flat.graph)
        self._say = say
        self._numbers = count(1)
        self._open: set[str] = set()
        self._over: set[str] = set()
        self._kept: dict[tuple[str, str], Call] = {}  # calls for a part that starts, by part and key
        self._early: dict[str, list[Call]] = {}  # what was asked for before the part was there
        self._waiting: dict[int, tuple[str, Call, asyncio.Future[Any]]] = {}
        self._subscriptions: dict[int, Subscription] = {}
        self._when_gone: list[Callable[[], None]] = []
        self._answers: dict[str, Any] = {}

    # --- asking -----------------------------------------------------------------------------------------------------

    def ask(self, part: str, verb: str, **arguments: Any) -> asyncio.Future[Any]:
        """Send a request to a part. Return a future for its answer."""
        number = next(self._numbers)
        future: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        call = Call(number, verb, arguments)
        self._waiting[number] = part, call, future
        future.add_done_callback(lambda _: self._waiting.pop(number, None))
        self._send(part, call)
        return future

    def tell(self, part: str, verb: str, **arguments: Any) -> None:
        """Have a part do something; that it cannot be done is logged."""
        self._send(part, Call(_NOBODY, verb, arguments))

    def keep(self, part: str, key: str, verb: str, **arguments: Any) -> None:
        """Send a request to a part, and repeat it whenever the part is restarted."""
        call = Call(_NOBODY, verb, arguments)
        self._kept.pop((part, key), None)
        self._kept[part, key] = call
        if part in self._open:
            self._say(part, call)

    def tell_if_there(self, part: str, verb: str, **arguments: Any) -> None:
        """Do the same, unless the part is still to start: then it learns this in another way."""
        if part in self._open:
            self._say(part, Call(_NOBODY, verb, arguments))

    def draw_again(self, flat: FlatGraph, cutting: Cutting) -> None:
        """The graph was edited; edges between the parts are unchanged."""
        self.homes.draw(flat, cutting)
        self.crossing.draw(flat)
        self.cutting = cutting

    def expect(self, answers: Mapping[str, Any]) -> None:
        """Set the types of answers, by verb; others are refused."""
        self._answers.update(answers)

    def when_gone(self, then: Callable[[], None]) -> None:
        """Call a function when a part has died."""
        self._when_gone.append(then)

    def forget(self, part: str, key: str) -> None:
        """Do not repeat this to a restarted part any more."""
        self._kept.pop((part, key), None)

    def forget_parameters(self) -> None:
        """Forget parameters: a restarted part is sent the graph, which has them."""
        for part, key in [one for one in self._kept if one[1].startswith(_PARAMETER)]:
            del self._kept[part, key]

    def keep_parameter(self, part: str, path: str, parcel: Parcel) -> None:
        """Set a parameter in a part, including its later incarnations."""
        self.keep(part, f"{_PARAMETER}{path}", "set", path=path, parcel=parcel)

    def subscribe(
        self,
        parts: Iterable[str],
        verb: str,
        seen: Callable[[str, Seen], None],
        ended: Callable[[], None] | None = None,
        gone: Callable[[str, str], None] | None = None,
        **arguments: Any,
    ) -> Subscription:
        """Start a continuing request in some parts.

        Args:
          parts: the parts.
          verb: the request; it takes the number as `number`.
          seen: called with the name of the part and its observations.
          ended: called when all these parts are over.
          gone: called with the name of a part that has died, and how; it continues in the next one.
          **arguments: of the verb.
        """
        subscription = Subscription(next(self._numbers), parts, seen, ended, gone)
        self._subscriptions[subscription.number] = subscription
        for part in sorted(subscription.parts):
            if part not in self._over:
                subscription.waits_for.add(part)
                self.keep(part, f"subscription {subscription.number}", verb, number=subscription.number, **arguments)
        if not subscription.waits_for and ended is not None:
            ended()
        return subscription

    def end(self, subscription: Subscription) -> None:
        """End a continuing request. A second call does nothing."""
        if self._subscriptions.pop(subscription.number, None) is not None:
            for part in subscription.waits_for:
                self.forget(part, f"subscription {subscription.number}")
                self._send(part, Call(_NOBODY, "leave", {"number": subscription.number}))

    def _send(self, part: str, call: Call) -> None:
        if part in self._open:
            self._say(part, call)
        elif part not in self._over:
            self._early.setdefault(part, []).append(call)

    # --- hearing ----------------------------------------------------------------------------------------------------

    def open(self, part: str) -> list[Call]:
        """A part starts: return the calls to make before its nodes are set up."""
        self._open.add(part)
        kept = [call for (name, _), call in self._kept.items() if name == part]
        return kept + self._early.pop(part, [])

    def hear(self, part: str, message: Result | Seen) -> None:
        """Process an answer or an observation of a part.

        Raises:
          Untrue: it was not asked, or its message cannot be read.
        """
        if isinstance(message, Seen):
            subscription = self._subscriptions.get(message.number)
            if subscription is None:
                return  # it was ended here meanwhile
            if part not in subscription.parts:
                raise Untrue("and was not asked to look")
            try:
                subscription.seen(part, message)
            except EncodingError as error:
                raise Untrue(f"which cannot be read: {error}") from error
            return
        if message.number == _NOBODY:
            if message.failed is not None:
                _LOGGER.warning("%s", self._error(part, message.failed))
            return
        waiting = self._waiting.get(message.number)
        if waiting is None or waiting[2].done():
            return
        asked, call, future = waiting
        if asked != part:
            raise Untrue("to what another part was asked")
        if message.failed is None:
            self._answered(call, future, message.value)
        else:
            future.set_exception(self._error(part, message.failed))

    def _answered(self, call: Call, future: asyncio.Future[Any], value: Any) -> None:
        try:
            future.set_result(msgspec.convert(value, self._answers.get(call.verb, Any)))
        except msgspec.ValidationError as error:
            future.set_exception(RunError(f"the answer to {_named(call)} is not valid: {error}"))
            raise Untrue(f"which is not an answer to {_named(call)}: {error}") from error

    def gone(self, part: str, error: HfgError) -> None:
        """A part no longer answers; whether it is restarted is decided elsewhere."""
        was_open = part in self._open
        self._open.discard(part)
        for then in self._when_gone:
            then()
        for subscription in list(self._subscriptions.values()):
            if part in subscription.parts and subscription.gone is not None:
                subscription.gone(part, str(error))
        for name, call, future in list(self._waiting.values()):
            if name != part or future.done():
                continue
            if call.verb in _CHANGES_NOTHING:
                if was_open:
                    self._early.setdefault(part, []).append(call)
                continue
            what = f"{_named(call)} may have been done or not: look, and ask again"
            if call.verb in _GONE_WITH_THE_PART:
                what = f"the {call.verb} was not made because the next incarnation starts with the graph as it was"
            future.set_exception(RunError(f"{error}; {what}"))
            future.exception()  # possibly nothing awaits it any more

    def over(self, part: str) -> None:
        """The run is over in a part."""
        self._over.add(part)
        for subscription in list(self._subscriptions.values()):
            if part in subscription.waits_for:
                subscription.waits_for.discard(part)
                if not subscription.waits_for and subscription.ended is not None:
                    subscription.ended()

    def close(self) -> None:
        """All parts are gone."""
        for part in self.others:
            self._open.discard(part)
            self.over(part)
        for _, _, future in list(self._waiting.values()):
            future.cancel()

    def _error(self, part: str, failed: Failed) -> HfgError:
        return as_error(failed, f"the process of group {part!r}")


def _named(call: Call) -> str:
    place = call.arguments.get("path") or call.arguments.get("node")
    return f'"{call.verb}" of "{place}"' if place else f'"{call.verb}"'
