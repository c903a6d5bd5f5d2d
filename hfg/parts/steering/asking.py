"""What somebody outside asks of the other parts of a run, from the side of the main one (rules P8, P10, R3, R7).

A question goes out as a `Call` and comes back as a `Result`. What goes on, such as a tap, has a `Call` that stands and
`Seen` as long as it does. What stands, and what was set, is told to a part before its nodes are set up: whoever asks in
`begin=` misses nothing, and a part that begins anew is as it was. What a part was asked when it died is asked again if
it only looks or waits; else it fails, for nobody knows whether it was done. Knows where each node lives. Stands on
`crossing`.
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

__all__ = ["Asking", "Homes", "Standing"]

_LOGGER = Log("hfg.parts")
_NOBODY: Final = 0  # the number of calls whose result nobody waits for
_CHANGES_NOTHING: Final = ("wait_for", "wait_inputs", "wait_outputs", "wait_paused", "counts", "try_edit")
"""What a part that begins anew is asked again: done twice it is as if done once."""

_PARAMETER: Final = "parameter "  # the keys of what was set begin so

_GONE_WITH_THE_PART: Final = ("edit", "undo", "redo")
"""What nobody has heard of when the part dies before it has answered."""


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
        """The graph is as it says here from now on."""
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
        """Whether a node fires in some part; a subgraph does not."""
        return id(node) in self._of_node

    def far_nodes(self) -> Iterator[Node]:
        """Give those of other parts than the main one."""
        return (node for node in self._nodes if self.of_node(node) != MAIN)

    def of_path(self, path: str) -> str:
        """Give the part of a node by its path; the main one where there is none."""
        return self._of_path.get(path, MAIN)

    def of_node(self, node: Any) -> str:
        """Give the part of a node, or of a subgraph all of which is in one; the main one for whatever else."""
        if isinstance(node, Node) and id(node) not in self._of_node and node._place is not None:
            inside = {home for path, home in self._of_path.items() if path.startswith(f"{node.place.path}/")}
            return inside.pop() if len(inside) == 1 else MAIN
        return self._of_node.get(id(node), MAIN)

    def of_place(self, place: Any) -> set[str]:
        """Give the parts in which something passes a port or an edge; that of its source, for an edge."""
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
        """Give the label of what an edge as drawn is in the run; "" if that is not one."""
        labels = {one.label for flat in self._flat.walk() for one in flat.edges if edge in one.segments}
        return labels.pop() if len(labels) == 1 else ""


class Standing:
    """Something that goes on in other parts, until it is ended here.

    Attributes:
      number: of its calls.
      parts: that were asked.
      waits_for: the parts in which it goes on.
    """

    def __init__(
        self,
        number: int,
        parts: Iterable[str],
        seen: Callable[[str, Seen], None],
        ended: Callable[[], None] | None,
    ) -> None:
        self.number = number
        self.parts = frozenset(parts)
        self.seen = seen
        self.ended = ended
        self.waits_for: set[str] = set()


class Asking:
    """Asks the other parts, and hears what they answer.

    Attributes:
      homes: where each node lives.
      crossing: encodes what goes there and comes back.
      others: the names of the other parts.
    """

    def __init__(self, flat: FlatGraph, cutting: Cutting, say: Callable[[str, Call], None]) -> None:
        """Ask nothing yet.

        Args:
          flat: the whole graph.
          cutting: of the same.
          say: brings a call to a part.
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
        self._kept: dict[tuple[str, str], Call] = {}  # what a part that begins is to be told, by part and key
        self._early: dict[str, list[Call]] = {}  # what was asked for before the part was there
        self._waiting: dict[int, tuple[str, Call, asyncio.Future[Any]]] = {}
        self._standing: dict[int, Standing] = {}
        self._when_gone: list[Callable[[], None]] = []
        self._answers: dict[str, Any] = {}

    # --- asking -----------------------------------------------------------------------------------------------------

    def ask(self, part: str, verb: str, **arguments: Any) -> asyncio.Future[Any]:
        """Ask a part, and give what will hold its answer."""
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
        """Have a part do something, and have it done again if it begins anew."""
        call = Call(_NOBODY, verb, arguments)
        self._kept.pop((part, key), None)
        self._kept[part, key] = call
        if part in self._open:
            self._say(part, call)

    def tell_if_there(self, part: str, verb: str, **arguments: Any) -> None:
        """The same, unless the part is still to begin: then it learns in another way what it is to know."""
        if part in self._open:
            self._say(part, Call(_NOBODY, verb, arguments))

    def draw_again(self, flat: FlatGraph, cutting: Cutting) -> None:
        """The graph was edited; what lies between the parts is the same as before."""
        self.homes.draw(flat, cutting)
        self.crossing.draw(flat)
        self.cutting = cutting

    def expect(self, answers: Mapping[str, Any]) -> None:
        """Take nothing else for the answer of a verb than what is of its type."""
        self._answers.update(answers)

    def when_gone(self, then: Callable[[], None]) -> None:
        """Have somebody called when a part has died."""
        self._when_gone.append(then)

    def forget(self, part: str, key: str) -> None:
        """A part that begins anew is not told this any more."""
        self._kept.pop((part, key), None)

    def forget_parameters(self) -> None:
        """A part that begins anew is sent the graph, and that has them."""
        for part, key in [one for one in self._kept if one[1].startswith(_PARAMETER)]:
            del self._kept[part, key]

    def keep_parameter(self, part: str, path: str, parcel: Parcel) -> None:
        """Have a parameter set in a part, also in its next life."""
        self.keep(part, f"{_PARAMETER}{path}", "set", path=path, parcel=parcel)

    def stand(
        self,
        parts: Iterable[str],
        verb: str,
        seen: Callable[[str, Seen], None],
        ended: Callable[[], None] | None = None,
        **arguments: Any,
    ) -> Standing:
        """Have something go on in some parts.

        Args:
          parts: in which.
          verb: what; it takes the number as `number`.
          seen: called with the name of the part and what has come by.
          ended: called when nothing more will come, for all these parts are over.
          **arguments: of the verb.
        """
        standing = Standing(next(self._numbers), parts, seen, ended)
        self._standing[standing.number] = standing
        for part in sorted(standing.parts):
            if part not in self._over:
                standing.waits_for.add(part)
                self.keep(part, f"standing {standing.number}", verb, number=standing.number, **arguments)
        if not standing.waits_for and ended is not None:
            ended()
        return standing

    def end(self, standing: Standing) -> None:
        """It goes on no more. Does nothing the second time."""
        if self._standing.pop(standing.number, None) is not None:
            for part in standing.waits_for:
                self.forget(part, f"standing {standing.number}")
                self._send(part, Call(_NOBODY, "leave", {"number": standing.number}))

    def _send(self, part: str, call: Call) -> None:
        if part in self._open:
            self._say(part, call)
        elif part not in self._over:
            self._early.setdefault(part, []).append(call)

    # --- hearing ----------------------------------------------------------------------------------------------------

    def open(self, part: str) -> list[Call]:
        """A part begins: give what it is to do before its nodes are set up."""
        self._open.add(part)
        kept = [call for (name, _), call in self._kept.items() if name == part]
        return kept + self._early.pop(part, [])

    def hear(self, part: str, message: Result | Seen) -> None:
        """A part has answered, or something has come by there.

        Raises:
          Untrue: it was not asked, or what it says cannot be read.
        """
        if isinstance(message, Seen):
            standing = self._standing.get(message.number)
            if standing is None:
                return  # it was ended here meanwhile
            if part not in standing.parts:
                raise Untrue("and was not asked to look")
            try:
                standing.seen(part, message)
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
            future.set_exception(RunError(f"{_named(call)} was answered with what is no answer: {error}"))
            raise Untrue(f"which is no answer to {_named(call)}: {error}") from error

    def gone(self, part: str, error: HfgError) -> None:
        """A part answers no more; whether it begins anew is for others to say."""
        was_open = part in self._open
        self._open.discard(part)
        for then in self._when_gone:
            then()
        for name, call, future in list(self._waiting.values()):
            if name != part or future.done():
                continue
            if call.verb in _CHANGES_NOTHING:
                if was_open:
                    self._early.setdefault(part, []).append(call)
                continue
            what = f"{_named(call)} may have been done or not: look, and ask again"
            if call.verb in _GONE_WITH_THE_PART:
                what = f"the {call.verb} was not made, for the next one begins with the graph as it was"
            future.set_exception(RunError(f"{error}; {what}"))
            future.exception()  # it may be that nobody waits for it any more

    def over(self, part: str) -> None:
        """The run is over in a part."""
        self._over.add(part)
        for standing in list(self._standing.values()):
            if part in standing.waits_for:
                standing.waits_for.discard(part)
                if not standing.waits_for and standing.ended is not None:
                    standing.ended()

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
