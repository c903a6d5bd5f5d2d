"""The nodes of one level by name, in order. Knows nothing of who may be one."""

from __future__ import annotations

from hfg.nodetype import Node

__all__ = ["Members"]


class Members:
    """The nodes of one level.

    Attributes:
      nodes: by name, in order of adding.
    """

    __slots__ = ("_counts", "nodes")

    def __init__(self) -> None:
        self.nodes: dict[str, Node] = {}
        # How many nodes have the default name of their type: else naming ten thousand of a type would try all names.
        self._counts: dict[str, int] = {}

    def free_name(self, base: str) -> tuple[str, int]:
        """Give the type's name, or with _2, _3 in order of adding; and the number to `count` once the node is in."""
        number = self._counts.get(base, 0) + 1
        name = base if number == 1 else f"{base}_{number}"
        while name in self.nodes:  # somebody gave this name by hand
            number += 1
            name = f"{base}_{number}"
        return name, number

    def count(self, base: str, number: int) -> None:
        """Note that the name with this number is in use."""
        self._counts[base] = number

    def position(self, name: str) -> int:
        """Give the place of a node in the order."""
        return list(self.nodes).index(name)

    def append(self, name: str, node: Node) -> None:
        """Add a node behind all others."""
        self.nodes[name] = node

    def insert(self, position: int, name: str, node: Node) -> None:
        """Add a node at its place in the order."""
        behind = list(self.nodes.items())[position:]
        for other, _ in behind:
            del self.nodes[other]
        self.nodes[name] = node
        self.nodes.update(behind)

    def remove(self, name: str) -> None:
        """Take a node out."""
        del self.nodes[name]

    def swap(self, name: str, node: Node) -> None:
        """Put another node in the place of one, under its name."""
        self.nodes[name] = node

    def rename(self, before: str, after: str) -> None:
        """Give a node another name at the same place."""
        position, node = self.position(before), self.nodes.pop(before)
        self.insert(position, after, node)
