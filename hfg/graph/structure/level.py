"""One level of a graph: what lies directly in the whole, or directly inside one subgraph, with its own invariants.

`Graph`, which users hold, is the face of a level; everything below the face works on levels. Nothing is checked here:
who adds, connects or edits has done that. Depends on the tables of members, connections, gates and promotions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Protocol

from hfg.base.hooks import hooks
from hfg.errors import UsageError
from hfg.graph.structure.boundary import Boundary
from hfg.graph.structure.connections import Connections
from hfg.graph.structure.gates import Gates
from hfg.graph.structure.groups import Groups
from hfg.graph.structure.history import History
from hfg.graph.structure.members import Members
from hfg.graph.structure.naming import path_of
from hfg.graph.structure.options import MonitorSpec
from hfg.graph.structure.promotions import Promotions
from hfg.graph.structure.subgraph import Box
from hfg.nodetypes.node import Node
from hfg.ports.base import Owner


class HasLevel(Owner, Protocol):
    """A graph, seen from below its face: `Graph` stands above all that works on levels."""

    @property
    def _level(self) -> Level: ...


def inside(node: object) -> Level | None:
    """Return what lies inside a subgraph; None for other nodes, and before it is built."""
    level = getattr(node, "_level", None) if isinstance(node, Box) else None
    return level if isinstance(level, Level) else None


def level_of(graph: HasLevel) -> Level:
    """Return the level of a graph."""
    return graph._level


class Level:
    """The structure of one graph.

    Attributes:
      name: for people; that of the whole.
      whole: what all levels of one graph share.
      owner: the subgraph whose inside this is; None at the root.
      face: the graph that users hold; nodes and ports say it when they are asked where they are.
      nodes: by name, in order of adding; written by `members`.
      edges: in order of connecting; written by `connections`.
      members: the table of `nodes`; `connections`, `gates` and `promotions` are the others.
      ports: those of the whole graph, as far as they are seen here.
    """

    __slots__ = (
        "connections",
        "edges",
        "face",
        "gates",
        "members",
        "name",
        "nodes",
        "owner",
        "ports",
        "promotions",
        "whole",
    )

    def __init__(self, name: str, whole: Whole, *, face: HasLevel | None = None, owner: Box | None = None) -> None:
        """Start empty. The root has a face already; the inside of a subgraph gets a new one."""
        self.name = name
        self.whole = whole
        self.owner = owner
        self.face = whole.make_face(self) if face is None else face
        if owner is None:
            whole.root = self
            self.ports = Boundary(self.face)
        else:
            self.ports = whole.root.ports.for_inside()
        self.members = Members()
        self.connections = Connections()
        self.gates = Gates(whole.gated)
        self.promotions = Promotions()
        self.nodes, self.edges = self.members.nodes, self.connections.edges

    def make_inside(self, owner: Box) -> Level:
        """Make the empty inside of a subgraph that is to lie at this level."""
        return Level(self.name, self.whole, owner=owner)

    # --- where it is ---

    @property
    def path(self) -> str:
        """That of the subgraph whose inside this is; "" at the root."""
        return "" if self.owner is None else path_of(self.owner)

    @property
    def title(self) -> str:
        """What messages call it."""
        return f'graph "{self.name}"' if self.owner is None else f'the graph inside "{self.path}"'

    @property
    def around(self) -> Level | None:
        """The level in which the subgraph lies whose inside this is, if it lies in any."""
        if self.owner is None or self.owner._place is None:
            return None
        return level_of(self.owner._place.graph)

    @property
    def depth(self) -> int:
        """How many subgraphs lie around it."""
        depth, around = 0, self.around
        while around is not None:
            depth, around = depth + 1, around.around
        return depth

    def path_to(self, name: str) -> str:
        """Return the path of a node of this name here."""
        return name if self.owner is None else f"{self.path}/{name}"

    def holds(self, node: Node) -> bool:
        """Return whether a node lies anywhere in the same whole graph."""
        return node._place is not None and level_of(node._place.graph).whole is self.whole

    def walk(self) -> list[Level]:
        """Return this level and all inside it, the outer ones first."""
        found = [self]
        for level in found:  # grows while it is walked through, which is the point: no recursion at any depth
            found += [one for node in level.members.boxes if (one := inside(node)) is not None]
        return found

    # --- by whom it is changed ---

    def need_rest(self, doing: str) -> None:
        """Refuse to change the structure under a run, which would not hear of it; and note that it was by hand.

        Raises:
          UsageError: the graph runs, and no commands are being carried out.
        """
        whole = self.whole
        if whole.takes_commands:
            return
        if whole.run is not None:
            raise UsageError(
                f"{self.title} runs, so {doing} by hand is refused: use commands, which the run follows, as in "
                "await run.edit(hfg.commands.Connect(...)), or stop the run first"
            )
        whole.history.changed_by_hand()

    def check_invariants(self) -> None:
        """Fail if the tables contradict each other; for tests."""
        self.connections.check_invariants()
        self.members.check_invariants()
        for name, node in self.nodes.items():
            assert node._place is not None
            assert (node._place.graph, node._place.path) == (self.face, self.path_to(name))
        if self.owner is None:
            assert self.whole.gated == {gate.target for level in self.walk() for gate in level.gates}


def nodes_within(node: Node) -> Iterator[Node]:
    """Yield a node and all inside it."""
    waiting = [node]
    while waiting:
        one = waiting.pop()
        yield one
        level = inside(one)
        if level is not None:
            waiting += reversed(level.nodes.values())


class Whole:
    """The part of a graph that there is once, however many subgraphs it has.

    Attributes:
      root: the outermost level; it writes itself here.
      make_face: gives the graph that users see of a new level; the face stands above, so it hands this down.
      box_type: that of subgraphs without a type of their own; it comes from above for the same reason.
      gated: nodes that have a gate, of which each has at most one (rule A11); written by the levels' `Gates`.
      run: the run it has, if any; a graph has one at a time.
      takes_commands: commands are being carried out, which a run follows and the history knows.
      facts: what users state about activity; those of removed nodes stay, because an undo brings the nodes back.
        Debug runs are judged by them.
      notes: of editors, by node; None: those about the whole. Nothing else reads them, and they go with their node.
      monitors: what must hold of each run, by name; replaced as a whole.
      on_laws: called when monitors or facts have changed; set by the code that judges the run.
      history: of edits; only the code that edits interprets its objects.
    """

    __slots__ = (
        "box_type",
        "facts",
        "gated",
        "groups",
        "history",
        "make_face",
        "monitors",
        "notes",
        "on_laws",
        "root",
        "run",
        "takes_commands",
    )

    root: Level

    def __init__(self, make_face: Callable[[Level], HasLevel], box_type: type[Box]) -> None:
        self.make_face = make_face
        self.box_type = box_type
        self.groups = Groups()
        self.gated: set[Node] = set()
        self.facts: list[Any] = []
        self.run: object | None = None
        self.takes_commands = False
        self.notes: dict[Node | None, dict[str, Any]] = {}
        self.monitors: Mapping[str, MonitorSpec] = {}
        self.on_laws: Callable[[], None] | None = None
        self.history: History[Any] = History(lambda: self.root.title)

    def begin_run(self, run: object) -> None:
        """From now on only commands change the structure. Monitors judge, and in a debug run facts, too."""
        self.run = run
        try:
            hooks.judge(run, self)
        except BaseException:
            self.end_run()
            raise

    def end_run(self) -> None:
        """It may be changed by hand again."""
        self.run = self.on_laws = None

    def set_monitors(self, monitors: Mapping[str, MonitorSpec]) -> None:
        """Let other monitors judge."""
        self.monitors = monitors
        self.laws_changed()

    def laws_changed(self) -> None:
        """Let the run be judged by the monitors and facts that there are now."""
        if self.on_laws is not None:
            self.on_laws()

    @contextmanager
    def taking_commands(self) -> Iterator[None]:
        """Let what is done inside count as done by commands."""
        before, self.takes_commands = self.takes_commands, True
        try:
            yield
        finally:
            self.takes_commands = before
