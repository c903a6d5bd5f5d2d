"""State machines as values: what they are, and which words they accept.

Depends on `description`, which finds errors in machines, `machine_dicts`, which reads dicts, and `translation`, which
converts machines to graphs and back. Nothing here runs.
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
    """A deterministic state machine as an immutable value.

    Attributes:
      states: the names of the states, in order.
      initial: the state in which every word starts.
      transitions: the transitions, in order, each once.
      final: the states in which an accepted word ends.
      missing: what happens at a letter for which a state has no transition: the machine enters a "dead" state that it
        never leaves, as rule A13 says, or it "ignore"s the letter.

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
        """Create a machine.

        Args:
          states: the names of the states.
          transitions: the transitions, each as (letter, source, target).
          initial: the state in which every word starts.
          final: the states in which an accepted word ends.
          missing: what happens at a letter without a transition: "dead" or "ignore".

        Raises:
          MachineError: this is not a deterministic machine; `problems` lists everything that is wrong.
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
        """Create a machine from a dict in the format of the package `transitions`.

        `states` are names or dicts with a `name`. `transitions` are lists [trigger, source, dest] or dicts with these
        keys. The source may be a list, or "*" for all states; the dest "=" or None is the source itself. The triggers
        are the letters. `final` lists the final states, unless the states are marked as final themselves.

        Args:
          description: the dict.

        Returns:
          The machine.

        Raises:
          MachineError: the dict has another format, does not describe a machine, or contains conditions or callbacks,
            which are code and belong into nodes; `problems` lists everything that is wrong.
        """
        return cls._of(read(description))

    @classmethod
    def of(cls, graph: Graph, nodes: Iterable[Node | str] | None = None, *, final: Iterable[str] = ()) -> StateMachine:
        """Read the machine from a graph, or from a region of it: the inverse of `graph`.

        States are the paths of the nodes; letters are the names of the events at which active edges start.

        Args:
          graph: a whole graph.
          nodes: the states, as nodes or paths; a subgraph represents all nodes inside. Default: every node at either
            end of an active edge.
          final: states that are final, in addition to those whose node is marked as final (`StateNode.final`).

        Returns:
          The machine.

        Raises:
          MachineError: the graph is not a machine, because one signal would activate several nodes, or no node would be
            active at the start; `problems` lists everything that is wrong.
        """
        return cls._of(read_out(graph, nodes, final))

    @classmethod
    def _of(cls, described: Described) -> StateMachine:
        states, transitions, initial, final, missing = described
        return cls(states, transitions, initial=initial, final=final, missing=missing)

    # --- words ---

    def after(self, word: Iterable[str]) -> str | None:
        """Return the state after a word, or None for the dead state.

        Args:
          word: the letters.
        """
        ways = {(one.source, one.letter): one.target for one in self.transitions}
        state: str | None = self.initial
        for letter in word:
            if state is not None:
                state = ways.get((state, letter), state if self.missing == "ignore" else None)
        return state

    def accepts(self, word: Iterable[str]) -> bool:
        """Return whether a word ends in a final state.

        Args:
          word: the letters.
        """
        return self.after(word) in self.final

    # --- graphs ---

    def graph(self, name: str = "machine", *, nodes: Mapping[str, Node | SlotPort[Any]] | None = None) -> Graph:
        """Return a graph that is this machine. Its input "letters" receives the words.

        Args:
          name: the graph's name.
          nodes: nodes of your own for some of the states; see `build`.
        """
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
        """Add the machine to a graph: a node for each state and an active edge for each transition (rule A13).

        Args:
          graph: the graph.
          letters: an output or event that sends the letters; the active state receives them in its slot `read`. Without
            it, states change only by their own events.
          begin: the event or output whose signal activates the initial state. Default: the graph's `start`.
          nodes: nodes of your own for some of the states, whether or not they are in the graph yet. Their letters are
            events of the same names. Activity enters by a slot `enter`, by the slot that is given instead of the node,
            `{"open": door.begin}`, or else by `activate`. Derive from `hfg.activity.StateNode` for the usual behaviour.

        Returns:
          The node of each state, by the state's name.

        Raises:
          MachineError: a node cannot be the state, or a state's name is not allowed for a node; nothing was changed.
        """
        described = Described(self.states, self.transitions, self.initial, self.final, self.missing)
        return build(described, graph, letters, begin, nodes or {})

    # --- checks ---

    def check(self) -> list[Problem]:
        """Return probable mistakes: states that no word reaches."""
        return list(unreachable(self.states, self.transitions, self.initial))
