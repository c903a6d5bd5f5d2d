"""The groups of a graph: where its nodes run (rule R1). They belong to the whole, wherever they are declared."""

from __future__ import annotations

from hfg.errors import GraphError
from hfg.graph.structure.options import GroupSpec

__all__ = ["Groups"]


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
        """Add a group; the same may be said again, as subgraphs of one type do.

        Raises:
          GraphError: it is declared otherwise already.
        """
        if spec.name in self._declared and self.by_name[spec.name] != spec:
            raise GraphError(
                f'group "{spec.name}" is declared already, as {self.by_name[spec.name]}; '
                "declare it once, or choose another name"
            )
        self._declared.add(spec.name)
        self.by_name[spec.name] = spec

    def state(self) -> tuple[dict[str, GroupSpec], set[str]]:
        """Give what `restore` takes."""
        return dict(self.by_name), set(self._declared)

    def restore(self, state: tuple[dict[str, GroupSpec], set[str]]) -> None:
        """Let everything be as it was."""
        self.by_name, self._declared = state
