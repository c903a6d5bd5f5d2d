"""What became of the parts of a file of CS::APEX. Depends on nothing."""

from __future__ import annotations

from typing import Literal

import msgspec

State = Literal["mapped", "approximated", "missing"]


class Converted(msgspec.Struct, omit_defaults=True):
    """The result for a node or a connection.

    Attributes:
      source: its path in the file; of a connection "from -> to".
      kind: of a node, its type there.
      state: "mapped" does the same, "approximated" differs as `why` says, "missing" does nothing here.
      target: its path here, or the edge; "" if it is only in `notes`.
      type: of a node, its type here.
      why: differences and missing parts, one sentence each.
    """

    source: str
    state: State = "mapped"
    kind: str = ""
    target: str = ""
    type: str = ""
    why: list[str] = []

    def differs(self, why: str) -> None:
        """It is approximated, at best."""
        if self.state == "mapped":
            self.state = "approximated"
        self.why.append(why)

    def lost(self, why: str) -> None:
        """It is missing."""
        self.state = "missing"
        self.why.append(why)

    def __str__(self) -> str:
        became = {"mapped": "is", "approximated": "is about", "missing": "is missing"}[self.state]
        kind = f" ({self.kind})" if self.kind else ""
        what = self.type or self.target
        target = f" {what}" if what and self.state != "missing" else ""
        return f"{self.source}{kind} {became}{target}{': ' if self.why else ''}{'; '.join(self.why)}"


class ConversionReport(msgspec.Struct):
    """What became of a file.

    Attributes:
      file: its name.
      nodes: each, in the order of the file, those in a subgraph behind it.
      connections: each.
      notes: how many notes for people became notes of the graph.
      remarks: on the file as a whole.
    """

    file: str
    nodes: list[Converted] = []
    connections: list[Converted] = []
    notes: int = 0
    remarks: list[str] = []

    def count(self, state: State) -> tuple[int, int]:
        """Return how many nodes and connections are so."""
        return (
            sum(one.state == state for one in self.nodes),
            sum(one.state == state for one in self.connections),
        )

    def __str__(self) -> str:
        states: tuple[State, ...] = ("mapped", "approximated", "missing")
        lines = [f"{self.file}: {_many(len(self.nodes), 'node')}, {_many(len(self.connections), 'connection')}, "]
        lines[0] += _many(self.notes, "note")
        for state in states:
            nodes, connections = self.count(state)
            lines.append(f"  {state}: {_many(nodes, 'node')}, {_many(connections, 'connection')}")
        told = [one for one in (*self.nodes, *self.connections) if one.why]
        return "\n".join([*lines, *(f"  {one}" for one in told), *(f"  {one}" for one in self.remarks)])


def _many(number: int, what: str) -> str:
    return f"{number or 'no'} {what}{'' if number == 1 else 's'}"
