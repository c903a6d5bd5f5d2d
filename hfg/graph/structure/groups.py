"""The groups of a graph: where its nodes run (rule R1). They belong to the whole, wherever they are declared."""

from __future__ import annotations

from typing import TypeAlias

from hfg.base.bounds import GROUPS
from hfg.errors import GraphError
from hfg.graph.structure.options import GroupSpec

GroupsState: TypeAlias = tuple[dict[str, GroupSpec], set[str]]
"""All groups by name, and which of them were declared."""


class Groups:
    """All groups of a whole graph.

    Attributes:
      by_name: "loop" is always there, declared or not.
    """

    __slots__ = ("_declared", "by_name")

    def __init__(self) -> None:
        self.by_name: dict[str, GroupSpec] = {"loop": GroupSpec("loop")}
        self._declared: set[str] = set()

    def declare(self, spec: GroupSpec) -> None:
        """Add a group; declaring the same again is allowed, as subgraphs of one type do.

        Raises:
          GraphError: it is declared otherwise already.
        """
        if spec.name in self._declared and self.by_name[spec.name] != spec:
            raise GraphError(
                f'group "{spec.name}" is declared already, as {self.by_name[spec.name]}; '
                "declare it once, or choose another name"
            )
        self.change(spec)

    def change(self, spec: GroupSpec) -> None:
        """Let a group be declared otherwise, in its place in the order; a new one comes last.

        Raises:
          GraphError: there are too many.
        """
        if spec.name not in self.by_name and len(self.by_name) > GROUPS.most:
            raise GraphError(f'group "{spec.name}" is one too many: {GROUPS.remedy}')
        self._declared.add(spec.name)
        self.by_name[spec.name] = spec

    def remove(self, name: str) -> None:
        """Take a group away."""
        self._declared.discard(name)
        del self.by_name[name]

    def state(self) -> GroupsState:
        """Return what `restore` takes."""
        return dict(self.by_name), set(self._declared)

    def restore(self, state: GroupsState) -> None:
        """Let everything be as it was."""
        by_name, declared = state
        self.by_name, self._declared = dict(by_name), set(declared)
