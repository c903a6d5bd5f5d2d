"""State machines as values: what they are, and which words they accept.

Stands on `description`, which says what is wrong with one, `machine_dicts`, which reads dicts, and `translation`, which
makes a graph of it and reads it back; nothing here runs.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from hfg.activity.description import Described, Missing, Transition, findings, listed, reject, unreachable
from hfg.activity.machine_dicts import read
from hfg.activity.translation import build, read_out
from hfg.errors import Problem
from hfg.graph import Graph
from hfg.nodetypes.node import Node
from hfg.ports import SlotPort, Source

__all__ = ["StateMachine"]


@dataclass(frozen=True, init=False, slots=True)
class StateMachine:
    """A deterministic state machine; a value, made once and never changed.

    Attributes:
      states: in order.
      initial: the state in which every word begins.
      transitions: in order, each once.
      final: the states in which an accepted word ends.
      missing: what becomes of a letter for which a state has no transition: it leads to a "dead" state that nothing
        leaves, as rule A13 says, or is "ignore"d.

    Examples:
      >>> door = StateMachine(
      ...     ["closed", "open"],
      ...     [("push", "closed", "open"), ("pull", "open", "closed")],
      ...     initial="closed",
      ...     final=["closed"],
      ... )
      >>> door.accepts(["push", "pull"]), door.accepts(["push", "push"])
      (True, False)
      >>> graph = door.graph()
      >>> list(graph.nodes)
      ['closed', 'open', 'dead']
      >>> StateMachine.of(graph) == door
      True
    """

    states: tuple[str, ...]
    initial: str
    transitions: tuple[Transition, ...]
    final: frozenset[str]
    missing: Missing

    def __init__(
        self,
        states: Iterable[str],
        transitions: Iterable[tuple[str, str, str]],
        *,
        initial: str | None = None,
        final: Iterable[str] = (),
        missing: Missing = "dead",
    ) -> None:
        """Make a machine.

        Args:
          states: their names.
          transitions: each (letter, source, target).
          initial: the state in which every word begins.
          final: the states in which an accepted word ends.
          missing: what a letter without a transition does.

        Raises:
          MachineError: it is none; `problems` holds every finding.
        """
        named, ways, ending = listed(states), listed(transitions), listed(final)
        reject("this is no state machine", findings(named, ways, initial, ending, missing))
        put = object.__setattr__
        put(self, "states", tuple(named))
        put(self, "initial", initial)
        put(self, "transitions", tuple(dict.fromkeys(Transition(*one) for one in ways)))
        put(self, "final", frozenset(ending))
        put(self, "missing", missing)

    @classmethod
    def from_dict(cls, description: Mapping[str, Any]) -> StateMachine:
        """Read a dict of the kind that the package `transitions` takes.

        `states` are names or dicts with a `name`; `transitions` are lists [trigger, source, dest] or dicts with these
        keys, where the source may be a list or "*" for all states, and the dest "=" or None for the source itself. The
        triggers are the letters. `final` lists the final states, unless the states say it themselves.

        Raises:
          MachineError: the dict has another shape, says what a description cannot hold (conditions and callbacks are
            code and belong into nodes), or describes no machine; `problems` holds every finding.
        """
        return cls._of(read(description))

    @classmethod
    def of(cls, graph: Graph, nodes: Iterable[Node | str] | None = None, *, final: Iterable[str] = ()) -> StateMachine:
        """Read the machine out of a graph, or out of a region of it: the inverse of `graph`.

        States are the nodes' paths, letters the names of the events that active edges leave by.

        Args:
          graph: a whole graph.
          nodes: the states, as nodes or paths; a subgraph stands for all inside. Without them, every node that an
            active edge leads to or from.
          final: states that are final, beside those whose node says so itself (`StateNode.final`).

        Raises:
          MachineError: it is none, because one signal would make several nodes active, or none would be at the start;
            `problems` holds every finding.
        """
        return cls._of(read_out(graph, nodes, final))

    @classmethod
    def _of(cls, described: Described) -> StateMachine:
        states, transitions, initial, final, missing = described
        return cls(states, transitions, initial=initial, final=final, missing=missing)

    # --- words ---

    def after(self, word: Iterable[str]) -> str | None:
        """Give the state that a word leads to; None is the dead state."""
        ways = {(one.source, one.letter): one.target for one in self.transitions}
        state: str | None = self.initial
        for letter in word:
            if state is not None:
                state = ways.get((state, letter), state if self.missing == "ignore" else None)
        return state

    def accepts(self, word: Iterable[str]) -> bool:
        """Say whether a word leads to a final state."""
        return self.after(word) in self.final

    # --- graphs ---

    def graph(self, name: str = "machine", *, nodes: Mapping[str, Node | SlotPort[Any]] | None = None) -> Graph:
        """Make a graph of it, whose input "letters" takes the words; the arguments are those of `build`."""
        graph = Graph(name)
        self.build(graph, letters=graph.input("letters", str), nodes=nodes)
        return graph

    def build(
        self,
        graph: Graph,
        *,
        letters: Source[str] | None = None,
        begin: Source[Any] | None = None,
        nodes: Mapping[str, Node | SlotPort[Any]] | None = None,
    ) -> dict[str, Node]:
        """Add it to a graph: a node for each state, an active edge for each transition (rule A13).

        Args:
          graph: where to.
          letters: an output or event that says the next letter; the active state hears it, by its slot `read`. Without
            it, states leave by their own events alone.
          begin: whose signal makes the initial state active; by default the graph's `start`.
          nodes: nodes of your own for some of the states, in the graph already or not. The letters they answer are
            events of these names; activity comes in by a slot `enter`, or by the slot that is given in place of the
            node, `{"open": door.begin}`, or else by `activate`. Derive from
            `hfg.activity.StateNode` to get the usual behaviour.

        Returns:
          The node of each state.

        Raises:
          MachineError: a node cannot be the state, or a state's name cannot be that of a node; nothing was changed.
        """
        described = Described(self.states, self.transitions, self.initial, self.final, self.missing)
        return build(described, graph, letters, begin, nodes or {})

    # --- checks ---

    def check(self) -> list[Problem]:
        """Look for what is probably a mistake: states that no word leads to."""
        return list(unreachable(self.states, self.transitions, self.initial))
