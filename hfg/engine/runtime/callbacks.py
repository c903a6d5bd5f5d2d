"""What an engine tells those who stand on it: the only way from here up (rules R3, R4, R7).

They put in what they want to be called; the engine knows none of them, and without them a run is the same. What the
deciding modules ask of those above them, and need an answer to, is another table: `core.RuleCallbacks`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Set

import msgspec

from hfg.engine.model.running_node import RunningNode
from hfg.nodetypes.node import Node
from hfg.ports.edges import EventEdge

__all__ = ["Callbacks", "Edited"]


class Edited(msgspec.Struct, frozen=True):
    """What an edit has changed.

    Attributes:
      workers: have another node.
      swapped: nodes that were replaced, and by what.
      nodes: at which something is not as it was, also those that are gone.
    """

    workers: Sequence[RunningNode]
    swapped: Mapping[Node, Node]
    nodes: Set[object]


class Callbacks:
    """What is called, in the order in which it was put in.

    Attributes:
      begun: the nodes are set up, `start` is on its edges and the sources may fire, but nothing has moved yet (A10).
      pumped: a slice of the pump is over.
      rested: the pump would go on now, but the run is paused.
      finished: the run is over; nothing is torn down yet.
      edited: an edit has taken effect (R4).
      joined: an edge by which signals come from outside was made.
    """

    __slots__ = ("begun", "edited", "finished", "joined", "pumped", "rested")

    def __init__(self) -> None:
        self.begun: list[Callable[[], None]] = []
        self.pumped: list[Callable[[], None]] = []
        self.rested: list[Callable[[], None]] = []
        self.finished: list[Callable[[], None]] = []
        self.edited: list[Callable[[Edited], None]] = []
        self.joined: list[Callable[[EventEdge], None]] = []
