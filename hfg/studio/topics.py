"""Topics to which pages subscribe, by name. Each topic knows what is new; nothing is computed until a frame is due.

Depends on `sampled_topics`, `waiting`, `tapped_topics` and `scenes`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Final, TypeAlias

import msgspec
from typing_extensions import override

from hfg.engine import Run
from hfg.studio.following import Following
from hfg.studio.logs import LogKeeper
from hfg.studio.refusing import Refused
from hfg.studio.run_topics import RunTopic
from hfg.studio.sampled_topics import Flows, LoadTopic, Measures, NodeTopic, TimelineTopic
from hfg.studio.scenes import SceneTopic
from hfg.studio.spans import Ways
from hfg.studio.tapped_topics import HistoryTopic, ImageTopic, Values, ValueTopic
from hfg.studio.waiting import WaitsTopic
from hfg.trace import ActivityChanged, TraceEvent

__all__ = [
    "MOST_NODES",
    "MOST_VALUES",
    "TOPICS",
    "ActivityTopic",
    "Args",
    "Edges",
    "Field",
    "Inside",
    "LogTopic",
    "Nodes",
    "Nothing",
    "Path",
    "Paths",
    "Picture",
    "Topics",
    "View",
    "make_topic",
]

MOST_NODES: Final = 2000
MOST_VALUES: Final = 200
_MOST_MOVES: Final = 256
_NEAR: Final = 8
"""How many changes of activity before one may be its cause."""


class ActivityTopic(RunTopic):
    """The active nodes with the time of their activation, and the changes of activity."""

    def __init__(self, host: Following) -> None:
        super().__init__(host)
        self._moves: deque[list[Any]] = deque(maxlen=_MOST_MOVES)
        self._count = 0
        self._is_new = True
        self._ways = Ways({})
        self._rev = -1
        host.listeners.add(self._event)

    @override
    def attach(self, run: Run) -> None:
        self._is_new = True

    @override
    def let_go(self) -> None:
        self._is_new = True
        self._moves.clear()
        self._count = 0

    def _event(self, event: TraceEvent) -> None:
        if isinstance(event, ActivityChanged):
            via: list[str] = []
            if event.active:
                if self._rev != self.host.tables.rev:
                    self._rev, self._ways = self.host.tables.rev, Ways(self.host.tables.of["edges"])
                near = {*self.host.spans.active, *(move[1] for move in list(self._moves)[-_NEAR:])}
                via = self._ways.to(event.node, near)
            self._moves.append([self.host.steering.since_begin(event.time), event.node, event.active, event.cause, via])
            self._count += 1
            self._is_new = True

    @override
    def news(self) -> Any:
        if not self._is_new:
            return None
        self._is_new = False
        moves, lost = list(self._moves), self._count - len(self._moves)
        self._moves.clear()
        self._count = 0
        return {"active": dict(self.host.spans.active), "moves": moves, "lost": lost}

    @override
    def close(self) -> None:
        super().close()
        self.host.listeners.discard(self._event)


class LogTopic(RunTopic):
    """Records of hfg's loggers."""

    most_hz = 5.0

    def __init__(self, host: Following) -> None:
        super().__init__(host)
        self._keeper = LogKeeper(self.time)

    @override
    def news(self) -> Any:
        return self._keeper.take()

    @override
    def close(self) -> None:
        self._keeper.close()


# --- by name ---


class Args(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Arguments of a topic."""


class Nothing(Args, frozen=True):
    """No arguments."""


class Nodes(Args, frozen=True):
    """Paths of nodes."""

    nodes: list[str]


class Edges(Args, frozen=True):
    """Keys of edges."""

    edges: list[str]


class Path(Args, frozen=True):
    """A node, port or edge."""

    path: str


class Paths(Args, frozen=True):
    """Paths of ports and edges."""

    paths: list[str]


class Inside(Args, frozen=True):
    """A level: the path of a subgraph, "" for the whole graph."""

    level: str = ""


class Picture(Args, frozen=True):
    """A port or edge with pictures, and how large and good they are to be."""

    path: str
    size: int = 320
    quality: int = 75


class View(Args, frozen=True):
    """A view of a node."""

    path: str
    name: str


class Field(Args, frozen=True):
    """A port or edge, and which part of its values."""

    path: str
    field: str = ""


Topics: TypeAlias = Mapping[str, tuple[type[Args], Callable[[Any, Any], RunTopic]]]

TOPICS: Final[Topics] = {
    "activity": (Nothing, lambda host, _: ActivityTopic(host)),
    "measures": (Nodes, lambda host, args: Measures(host, args.nodes[:MOST_NODES])),
    "flow": (Edges, lambda host, args: Flows(host, args.edges[:MOST_NODES])),
    "node": (Path, lambda host, args: NodeTopic(host, args.path)),
    "load": (Nothing, lambda host, _: LoadTopic(host)),
    "waits": (Inside, lambda host, args: WaitsTopic(host, args.level)),
    "value": (Path, lambda host, args: ValueTopic(host, args.path)),
    "values": (Paths, lambda host, args: Values(host, args.paths[:MOST_VALUES])),
    "image": (
        Picture,
        lambda host, args: ImageTopic(host, args.path, min(max(args.size, 16), 2048), min(max(args.quality, 1), 100)),
    ),
    "history": (Field, lambda host, args: HistoryTopic(host, args.path, args.field)),
    "view": (View, lambda host, args: SceneTopic(host, args.path, args.name)),
    "timeline": (Nothing, lambda host, _: TimelineTopic(host)),
    "log": (Nothing, lambda host, _: LogTopic(host)),
}


def make_topic(host: Following, name: str, args: dict[str, Any], topics: Topics) -> RunTopic:
    """Make the topic of a subscription, one of those that there are.

    Raises:
      HfgError: there is none of this name, or not with these arguments.
    """
    if name not in topics:
        raise Refused("unknown", f'a page subscribes to one of {", ".join(topics)}, got "{name:.40}"')
    fields, make = topics[name]
    try:
        return make(host, msgspec.convert(args, fields))
    except msgspec.ValidationError as error:
        raise Refused(
            "usage", f'"{name}" has {", ".join(fields.__struct_fields__) or "no arguments"}: {error}'
        ) from None
