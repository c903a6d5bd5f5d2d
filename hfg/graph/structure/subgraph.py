"""Boxes: nodes that hold a graph; their ports are relays between outside and inside (rules G1-G4).

Users know them as `hfg.Subgraph`, which is defined next to `hfg.Graph` because it depends on it. Depends on node types.
"""

from __future__ import annotations

from typing import ClassVar, Protocol

from typing_extensions import TypeIs

from hfg.graph.structure.promotions import Promotions
from hfg.nodetypes.node import Node
from hfg.ports import Relaying


class Inside(Protocol):
    """The level inside a box, as far as the box needs it."""

    promotions: Promotions

    @property
    def face(self) -> object:
        """Return the graph that users see of it."""


class Box(Node, Relaying):
    """A node that holds a graph.

    Attributes:
      iterate_over: names of inputs that take collections, whose elements the inside sees one by one; the declared types
        are those inside (rule G4).
    """

    __slots__ = ("_level",)

    iterate_over: ClassVar[tuple[str, ...]] = ()
    _is_base: ClassVar[bool] = False

    _level: Inside  # a `Level`; written by the graph it is added to (`membership`), not there before

    def _build(self) -> None:
        """Make the inside, which is empty."""
        raise NotImplementedError

    def _set_parameter(self, name: str, value: object, *, own: bool = False) -> None:
        """Set it and every parameter inside that it stands for; all of them, or none if one refuses."""
        level: Inside | None = getattr(self, "_level", None)
        standing_for = () if level is None else level.promotions.of(name)
        before = self._parameters.get(name)
        super()._set_parameter(name, value, own=own)
        done = []
        try:
            for port in standing_for:
                done.append((port, port.value))
                port.value = value
        except ValueError:
            done.pop()
            for port, old in done:
                port.value = old
            self._parameters[name] = before
            raise


def is_box(node: object) -> TypeIs[Box]:
    """Return whether a node is a subgraph."""
    return isinstance(node, Box)


def is_unnamed(box: Box) -> bool:
    """Return whether its class only holds the ports and the inside of this one subgraph."""
    return "_is_base" in vars(type(box).__bases__[0])


def iterated(node: object) -> tuple[str, ...]:
    """Return the names of the inputs that a subgraph iterates over (rule G4); none for other nodes."""
    if not isinstance(node, Box) or node._options is None:
        return ()
    names: tuple[str, ...] = node._options.iterate_over
    return names
