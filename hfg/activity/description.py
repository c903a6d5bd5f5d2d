"""Descriptions of state machines as data, and what is wrong with one.

A machine is states, an initial one, transitions by letters, and final states: (Σ, S, s0, Δ, F) of the paper's §5.3.3.
Everything that reads or translates machines speaks in descriptions; `StateMachine` is one that is known to be right.
Depends on errors only.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple, TypeAlias

from hfg.errors import MachineError, Problem
from hfg.graph.structure.naming import suggest

__all__ = [
    "Described",
    "Missing",
    "Transition",
    "both",
    "error",
    "findings",
    "listed",
    "reject",
    "shape",
    "unreachable",
]

Missing: TypeAlias = Literal["dead", "ignore"]


class Transition(NamedTuple):
    """One transition: in the state `source` the letter leads to the state `target`."""

    letter: str
    source: str
    target: str

    def __str__(self) -> str:
        return f'"{self.letter}" from "{self.source}" to "{self.target}"'


class Described(NamedTuple):
    """The description of a machine; the fields are those of `StateMachine`."""

    states: Sequence[str]
    transitions: Sequence[Transition]
    initial: str
    final: Collection[str]
    missing: Missing


def reject(sentence: str, problems: Iterable[Problem]) -> None:
    """Raise if there are errors among the problems.

    Args:
      sentence: the first line of the message.
      problems: what was found.

    Raises:
      MachineError: with all problems, errors first.
    """
    found = sorted(dict.fromkeys(problems), key=lambda problem: problem.severity != "error")
    if found and found[0].severity == "error":
        raise MachineError(sentence, found)


# --- what can be wrong ---


def findings(
    states: Any, transitions: Any, initial: Any, final: Any, missing: Any, places: Sequence[str] = ()
) -> Iterator[Problem]:
    """Yield everything that is wrong. Parts of a wrong shape are not checked further.

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
        yield from unreachable(known, good, initial)


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


def listed(given: Any) -> Any:
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


def unreachable(states: Iterable[str], transitions: Iterable[Transition], initial: str) -> Iterator[Problem]:
    """Give the states that no word leads to."""
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
