"""What the wiring of a node says about each of its firings, found once and not per token. Stands on `ports`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from hfg.graph.structure.options import NodeOptions
from hfg.ports.automatic import sent_name
from hfg.ports.edges import EventEdge, SyncEdge

__all__ = ["Shape"]


class _Run(Protocol):
    debug: bool


class _Vertex(Protocol):
    """What the shape follows from."""

    type: Any

    @property
    def core(self) -> _Run: ...

    @property
    def process(self) -> object: ...

    @property
    def options(self) -> NodeOptions | None: ...

    @property
    def events(self) -> Mapping[str, object]: ...

    @property
    def in_edges(self) -> tuple[Any, ...]: ...

    @property
    def live_inputs(self) -> tuple[Any, ...]: ...

    @property
    def out_edges(self) -> tuple[tuple[Any, ...], ...]: ...

    @property
    def gates_over(self) -> Sequence[object]: ...

    @property
    def paced(self) -> bool: ...

    @property
    def iteration(self) -> object: ...

    @property
    def unset(self) -> Sequence[object]: ...

    @property
    def wants_token(self) -> Sequence[bool]: ...


class Shape:
    """What follows from the live edges of one vertex.

    Attributes:
      sequential: inputs whose tokens are processed when its outputs are (F5).
      pipelined: those whose tokens are when it has taken them.
      plain: a firing without markers is a call of its function with what lies on its inputs, and nothing else.
      direct: the arguments of that call are the values, as they lie there.
      single: what the call gives back is the value of its one output.
      outgoing: where that is put, slots first (F9).
      gives: activity may leave by one of those edges (A3).
      announced: what is told behind it where somebody asks: `sent`, with the position of the output, then `processed`.
      remembers: `failed` is to tell what it has taken (X1).
    """

    __slots__ = ("announced", "direct", "gives", "outgoing", "pipelined", "plain", "remembers", "sequential", "single")

    def __init__(self, vertex: _Vertex) -> None:
        synchronous = [edge for edge in vertex.live_inputs if type(edge) is not EventEdge]
        self.sequential = tuple(edge for edge in synchronous if edge.sequential)
        self.pipelined = tuple(edge for edge in synchronous if not edge.sequential)
        self.announced = _announced(vertex) if vertex.events else ()
        self.remembers = "failed" in vertex.events
        self.plain = not self.remembers and _is_plain(vertex)
        self.direct = self.plain and _is_direct(vertex)
        self.single = _is_single(vertex)
        outgoing: tuple[Any, ...] = vertex.out_edges[0] if self.single else ()
        self.outgoing = tuple(sorted(outgoing, key=lambda edge: edge.target_kind != "slot"))
        self.gives = any(edge.active for edge in outgoing)


def _announced(vertex: _Vertex) -> tuple[tuple[str, int | None], ...]:
    """A9: nothing, as long as nobody asks."""
    outputs = () if vertex.type is None else enumerate(vertex.type.outputs)
    sent = [(sent_name(output), position) for position, output in outputs if sent_name(output) in vertex.events]
    return (*sent, ("processed", None)) if "processed" in vertex.events else tuple(sent)


def _is_plain(vertex: _Vertex) -> bool:
    if vertex.type is None or vertex.process is None or vertex.gates_over or vertex.paced or vertex.core.debug:
        return False
    if vertex.options is not None and (vertex.options.concurrency > 1 or vertex.options.retries):
        return False
    return all(type(edge) is SyncEdge and edge.target_kind == "input" for edge in vertex.live_inputs) and not any(
        edge.ended for edge in vertex.in_edges
    )


def _is_direct(vertex: _Vertex) -> bool:
    return (
        vertex.iteration is None
        and vertex.type.process_kind in ("function", "async")
        and [edge.position for edge in vertex.live_inputs] == list(range(len(vertex.unset)))
        and not any(vertex.wants_token)
    )


def _is_single(vertex: _Vertex) -> bool:
    kind = vertex.type
    return kind is not None and kind.result == "single" and len(vertex.out_edges) == 1 and not vertex.core.debug
