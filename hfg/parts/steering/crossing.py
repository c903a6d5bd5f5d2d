"""Values brought into another part of a run from outside, and values observed there, as data (rules L4, R7, P10).

Both sides have the whole graph, so both know the types of each port, edge and parameter, and encode values as links do.
Values that are brought in are exact, or refused. Observed values never fail: if a value cannot be encoded, its text is
shown. Depends on `messages`.
"""

from __future__ import annotations

from typing import Any, Final

import msgspec

from hfg.base.token import Token
from hfg.encoding import TokenCodec
from hfg.engine.observing.encoding import text
from hfg.errors import EncodingError, HfgError
from hfg.graph import Graph
from hfg.graph.flat import FlatGraph
from hfg.graph.graph import graph_of
from hfg.parts.model.failing import codec_of
from hfg.parts.model.messages import Parcel, Passed, PlainEvent, Sight
from hfg.ports import Port
from hfg.trace import (
    EventTriggered,
    ParameterSet,
    TokenDrained,
    TokenDropped,
    TokenSent,
    TokenTaken,
    TraceEvent,
)

_NOTHING: Final = TokenCodec[Any](None)  # for markers, and where a text takes the place of the value
_NO_VALUE: Final = _NOTHING.encode(Token(None))[1]
_MOST_SHOWN: Final = 2**24  # bytes: of what is larger the text is shown
_AT_EDGES: Final = {"sent": TokenSent, "taken": TokenTaken, "drained": TokenDrained}
_KIND: Final[dict[type, Any]] = {kind: name for name, kind in _AT_EDGES.items()}


class Crossing:
    """Encodes tokens, values of parameters and events of the trace by what the graph declares.

    Args:
      flat: the whole graph.
    """

    def __init__(self, flat: FlatGraph) -> None:
        self.draw(flat)

    def draw(self, flat: FlatGraph) -> None:
        """From now on, the graph is as drawn here."""
        self._graph: Graph = graph_of(flat.graph)
        self._ports: dict[str, Port] = {}
        for one in flat.walk():
            for edge in one.edges:
                is_made_over = bool(edge.options.through) or edge.source.kind == "observable"
                self._ports[edge.label] = (edge.target if is_made_over else edge.source).port
        self._codecs: dict[str, TokenCodec[Any] | None] = {}

    # --- exactly ----------------------------------------------------------------------------------------------------

    def codec(self, path: str, hint: Any) -> TokenCodec[Any]:
        """Return the codec for the values of a port.

        Raises:
          EncodingError: they cannot be sent to another process.
        """
        try:
            return codec_of(self._port(path), hint, f'the value of "{path}"')
        except EncodingError as error:
            raise EncodingError(
                f'"{path}" is in another process, and its values cannot go there: {error}; declare what it carries'
            ) from None

    def pack(self, path: str, hint: Any, token: Token[Any]) -> Parcel:
        """Encode a token.

        Raises:
          EncodingError: it cannot be.
        """
        return Parcel(*self.codec(path, hint).encode(token))

    def unpack(self, path: str, hint: Any, parcel: Any) -> Token[Any]:
        """Return the token in a parcel.

        Raises:
          EncodingError: it is not a token.
        """
        parcel = msgspec.convert(parcel, Parcel)
        return self.codec(path, hint).decode(parcel.metadata, parcel.value)

    # --- to look at -------------------------------------------------------------------------------------------------

    def show(self, place: str, token: Token[Any]) -> Parcel:
        """Encode a token that passes an edge, by label, or a port or parameter, by path."""
        codec = _NOTHING if token.is_marker else self._codec_at(place)
        if codec is not None:
            try:
                metadata, value = codec.encode(token)
            except HfgError:
                pass  # it is not what was declared, which only debug=True forbids
            else:
                if len(value) <= _MOST_SHOWN:
                    return Parcel(metadata, value)
        bare = _NOTHING.encode(Token(None, token.activity, token.stamp, token.sequence))
        return Parcel(*bare, shown=text(token.value))

    def see(self, place: str, parcel: Parcel) -> Token[Any]:
        """Return the token, or one with the text of its value."""
        shown, value = parcel.shown, parcel.value
        if shown is None:
            codec = self._codec_at(place)
            try:
                if codec is not None or not value:
                    return (codec or _NOTHING).decode(parcel.metadata, value)
            except EncodingError:
                pass
            # an edit has changed what passes there, and one of the two sides has not drawn it yet
            shown, value = f"({len(value)} bytes)", _NO_VALUE
        bare = _NOTHING.decode(parcel.metadata, value)
        return Token(shown, bare.activity, bare.stamp, bare.sequence)

    def show_event(self, event: TraceEvent) -> Sight:
        """Encode an event of the trace."""
        match event:
            case TokenSent() | TokenTaken() | TokenDrained():
                return Passed(event.time, _KIND[type(event)], event.edge, self.show(event.edge, event.token))
            case TokenDropped():
                return Passed(event.time, "dropped", event.edge, self.show(event.edge, event.token), event.reason)
            case EventTriggered():
                return Passed(event.time, "triggered", event.event, self.show(event.event, event.token))
            case ParameterSet():
                place = f"{event.node}.{event.parameter}"
                return Passed(event.time, "set", event.node, self.show(place, Token(event.value)), event.parameter)
        return event  # type: ignore[return-value]  # all others are plain

    def see_event(self, sight: PlainEvent | Passed) -> TraceEvent:
        """Return the event."""
        if not isinstance(sight, Passed):
            return sight
        place = f"{sight.place}.{sight.detail}" if sight.kind == "set" else sight.place
        token = self.see(place, sight.parcel)
        match sight.kind:
            case "triggered":
                return EventTriggered(sight.time, sight.place, token)
            case "set":
                return ParameterSet(sight.time, sight.place, sight.detail, token.value)
            case "dropped":
                return TokenDropped(sight.time, sight.place, token, sight.detail)  # type: ignore[arg-type]
        return _AT_EDGES[sight.kind](sight.time, sight.place, token)

    def _codec_at(self, place: str) -> TokenCodec[Any] | None:
        if place not in self._codecs:
            try:
                port = self._port(place)
                self._codecs[place] = codec_of(port, port.type, f'the value of "{place}"')
            except HfgError:
                self._codecs[place] = None  # of no type that can cross
        return self._codecs[place]

    def _port(self, place: str) -> Port:
        """Return the port of a token; for an edge that is not drawn, the one after the arrow of its label."""
        if place in self._ports:
            return self._ports[place]
        port = self._graph[place.rpartition(" -> ")[2]]
        if not isinstance(port, Port):
            raise EncodingError(f'"{place:.200}" is not a port: no token passes there')
        return port
