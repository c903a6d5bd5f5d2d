"""State machines as values: what they are, which words they accept, and what is wrong with a description.

A machine is states, an initial one, transitions by letters, and final states: (Σ, S, s0, Δ, F) of the paper's §5.3.3.
`translation` makes a graph of it and reads it back, `machine_dicts` reads dicts. Stands on problems and errors; nothing
here runs.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

from hfg.errors import MachineError
from hfg.graph.structure.naming import suggest
from hfg.problem import Problem

if TYPE_CHECKING:
    from hfg.graph import Graph
    from hfg.nodetype import Node
    from hfg.ports import Source

__all__ = ["Missing", "StateMachine", "Transition", "both", "error", "findings", "reject", "shape"]

Missing: TypeAlias = Literal["dead", "ignore"]


class Transition(NamedTuple):
    """One transition: in the state `source` the letter leads to the state `target`."""

    letter: str
    source: str
    target: str

    def __str__(self) -> str:
        return f'"{self.letter}" from "{self.source}" to "{self.target}"'


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

    Example:
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
        named, listed, ending = _listed(states), _listed(transitions), _listed(final)
        reject("this is no state machine", findings(named, listed, initial, ending, missing))
        put = object.__setattr__
        put(self, "states", tuple(named))
        put(self, "initial", initial)
        put(self, "transitions", tuple(dict.fromkeys(Transition(*one) for one in listed)))
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
        from hfg.activity.machine_dicts import read

        return read(description)

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
        from hfg.activity.translation import read_out

        return read_out(graph, nodes, final)

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

    def graph(self, name: str = "machine", *, nodes: Mapping[str, Node] | None = None) -> Graph:
        """Make a graph of it, whose input "letters" takes the words; the arguments are those of `build`."""
        from hfg.activity.translation import whole_graph

        return whole_graph(self, name, nodes)

    def build(
        self,
        graph: Graph,
        *,
        letters: Source[str] | None = None,
        begin: Source[Any] | None = None,
        nodes: Mapping[str, Node] | None = None,
    ) -> dict[str, Node]:
        """Add it to a graph: a node for each state, an active edge for each transition (rule A13).

        Args:
          graph: where to.
          letters: an output or event that says the next letter; every state that has a slot `read` hears it. Without
            it, states leave by their own events alone.
          begin: whose signal makes the initial state active; by default the graph's `start`.
          nodes: nodes of your own for some of the states, in the graph already or not. The letters they answer are
            events of these names; activity comes in by a slot `enter` if they have one, else by `activate`. Derive from
            `hfg.activity.StateNode` to get the usual behaviour.

        Returns:
          The node of each state.

        Raises:
          MachineError: a node cannot be the state, or a state's name cannot be that of a node; nothing was changed.
        """
        from hfg.activity.translation import build

        return build(self, graph, letters, begin, nodes or {})

    # --- checks ---

    def check(self) -> list[Problem]:
        """Look for what is probably a mistake: states that no word leads to."""
        return list(_unreachable(self.states, self.transitions, self.initial))


def reject(sentence: str, problems: Iterable[Problem]) -> None:
    """Raise if there are errors among the findings; the sentence says what follows from them.

    Raises:
      MachineError: with all of them, errors first.
    """
    found = sorted(dict.fromkeys(problems), key=lambda problem: problem.severity != "error")
    if found and found[0].severity == "error":
        raise MachineError(sentence, found)


# --- what can be wrong ---


def findings(
    states: Any, transitions: Any, initial: Any, final: Any, missing: Any, places: Sequence[str] = ()
) -> Iterator[Problem]:
    """Give everything that is wrong at once; parts of a wrong shape are left out of the other checks.

    Args:
      states: as given, as are the next four.
      transitions: those of the right shape are checked further.
      initial: None if there is none.
      final: a list.
      missing: one of two words.
      places: where each transition stands, for the path of a finding; by default its place in the list.
    """
    known: dict[str, None] = {}
    if isinstance(states, list):
        yield from _state_names(states)
        known = dict.fromkeys(one for one in states if isinstance(one, str) and one)
    else:
        yield shape("states", "a list of names", states, '["closed", "open"]')
    yield from _first_state(initial, known)
    good: list[Transition] = []
    if isinstance(transitions, list):
        for number, one in enumerate(transitions):
            wrong = list(_transition(places[number] if places else f"transitions[{number}]", one, known))
            yield from wrong
            if not wrong:
                good.append(Transition(*one))
    else:
        yield shape("transitions", "a list", transitions, '[("push", "closed", "open")]')
    yield from _ambiguous(good)
    if isinstance(final, list):
        for one in final:
            if not _is_known(one, known):
                yield _unknown("final", one, known)
    else:
        yield shape("final", "a list of states", final, '["closed"]')
    if missing not in ("dead", "ignore"):
        yield error(
            "missing",
            f"got {missing!r}",
            "a letter without a transition leads to a dead state or is ignored",
            'say "dead" or "ignore"',
        )
    if _is_known(initial, known):
        yield from _unreachable(known, good, initial)


def error(path: str, what: str, why: str, remedy: str) -> Problem:
    """Make a finding for which there is no machine."""
    return Problem(
        path=path,
        severity="error",
        what=what,
        why=why,
        remedy=remedy,
        check="state-machine",
    )


def shape(path: str, expected: str, found: Any, example: str) -> Problem:
    """Make the finding that something is not even written as it should be."""
    return error(path, f"got {found!r:.80}", f"expected {expected}", f"write it as in {example}")


def _listed(given: Any) -> Any:
    """Read several things once; a text alone, or what is no collection, stays as it is and is a finding."""
    return given if isinstance(given, str) or not isinstance(given, Iterable) else list(given)


def _state_names(states: list[Any]) -> Iterator[Problem]:
    if not states:
        yield error("states", "there are none", "a machine is always in one", 'list them, as in ["closed", "open"]')
    seen: set[str] = set()
    for number, one in enumerate(states):
        if not isinstance(one, str) or not one:
            yield error(
                f"states[{number}]", f"got {one!r:.80}", "a state is a name, a text and not empty", "give it a name"
            )
        elif one in seen:
            yield error(f"states[{number}]", f'"{one}" is there twice', "names tell states apart", "take one out")
        else:
            seen.add(one)


def _first_state(initial: Any, known: Mapping[str, None]) -> Iterator[Problem]:
    if initial is None:
        example = next(iter(known), "closed")
        yield error("initial", "there is none", "every word begins in a state", f'say initial="{example}"')
    elif not _is_known(initial, known):
        yield _unknown("initial", initial, known)


def _transition(path: str, found: Any, known: Mapping[str, None]) -> Iterator[Problem]:
    if not isinstance(found, tuple | list) or len(found) != 3:
        yield shape(path, "(letter, source, target)", found, '("push", "closed", "open")')
        return
    letter, source, target = found
    if not isinstance(letter, str) or not letter:
        yield error(path, f"its letter is {letter!r:.80}", "a letter is a text and not empty", "give it a name")
    for state in (source, target):
        if not _is_known(state, known):
            yield _unknown(path, state, known)


def _ambiguous(transitions: Iterable[Transition]) -> Iterator[Problem]:
    ways: dict[tuple[str, str], list[str]] = defaultdict(list)
    for one in dict.fromkeys(transitions):
        ways[one.source, one.letter].append(one.target)
    for (source, letter), targets in ways.items():
        if len(targets) > 1:
            yield error(
                source,
                f'"{letter}" leads to {both(targets)}',
                "then the machine is not deterministic, but a letter leads to one state",
                "keep one of these transitions, or give each a letter of its own",
            )


def _unreachable(states: Iterable[str], transitions: Iterable[Transition], initial: str) -> Iterator[Problem]:
    ways: dict[str, list[str]] = defaultdict(list)
    for one in transitions:
        ways[one.source].append(one.target)
    reached, waiting = {initial}, [initial]
    while waiting:
        for target in ways[waiting.pop()]:
            if target not in reached:
                reached.add(target)
                waiting.append(target)
    for state in states:
        if state not in reached:
            yield Problem(
                path=state,
                severity="warning",
                what="no word leads to this state",
                why=f'no way from "{initial}" arrives there, so it and its transitions never matter',
                remedy="add a transition into it, or take it out",
                check="state-machine",
            )


def _unknown(path: str, found: Any, known: Mapping[str, None]) -> Problem:
    if not isinstance(found, str):
        return error(path, f"got {found!r:.80} for a state", "states are named by texts", "give the name of a state")
    return error(path, f'there is no state "{found}"', suggest(found, known), "correct it, or add it to the states")


def _is_known(state: Any, known: Mapping[str, None]) -> bool:
    return isinstance(state, str) and state in known


def both(names: Iterable[str]) -> str:
    """List names in a sentence."""
    *others, last = [f'"{name}"' for name in names]
    return f"{', '.join(others)} and {last}" if others else last
