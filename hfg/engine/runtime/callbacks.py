"""What an engine notifies higher layers of: its only way up (rules R3, R4, R7).

They add what they want to be called. The engine knows none of them, and without them a run is the same.
`core.RuleCallbacks` has what decisions request of modules above them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field

import msgspec

from hfg.engine.model.running_node import RunningNode
from hfg.nodetypes.node import Node
from hfg.ports.edges import EventEdge

__all__ = ["Callbacks", "Edited"]


class Edited(msgspec.Struct, frozen=True):
    """What an edit has changed.

    Attributes:
      workers: those with another node.
      swapped: nodes that were replaced, with their replacements.
      nodes: those at which something has changed, including removed ones.
    """

    workers: Sequence[RunningNode]
    swapped: Mapping[Node, Node]
    nodes: Set[object]


@dataclass(slots=True)
class Callbacks:
    """Callbacks, in the order in which they were added."""

    # The nodes are set up, `start` is on its edges and the sources may fire, but nothing has moved yet (A10).
    begun: list[Callable[[], None]] = field(default_factory=list)
    pumped: list[Callable[[], None]] = field(default_factory=list)  # a slice of the pump is over
    rested: list[Callable[[], None]] = field(default_factory=list)  # the pump would run, but the run is paused
    finished: list[Callable[[], None]] = field(default_factory=list)  # the run is over; nothing is torn down yet
    edited: list[Callable[[Edited], None]] = field(default_factory=list)  # an edit has taken effect (R4)
    # a glance: the name and verdict of each monitor, and how often it was violated
    glanced: list[Callable[[], Iterable[tuple[str, str, int]]]] = field(default_factory=list)
    joined: list[Callable[[EventEdge], None]] = field(default_factory=list)  # an edge for outside signals was made
