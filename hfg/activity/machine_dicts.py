"""Reads dicts of the kind that the package `transitions` takes into descriptions of state machines.

What such a dict can say besides states and transitions is code (conditions, callbacks) and has its place in nodes here,
so it is refused rather than left out unseen. Depends on `description`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import Enum
from typing import Any, Final

from hfg.activity.description import Described, Missing, error, findings, reject, shape
from hfg.errors import Problem
from hfg.graph.structure.naming import suggest

__all__ = ["read"]

_KEYS: Final = ("states", "transitions", "initial", "final", "ignore_invalid_triggers")
_WITHOUT_MEANING: Final = ("name", "model", "queued", "send_event", "model_attribute")  # here they say nothing
_CODE: Final = frozenset(
    {
        *("conditions", "unless", "before", "after", "prepare", "on_enter", "on_exit", "on_exception", "on_final"),
        *("before_state_change", "after_state_change", "prepare_event", "finalize_event"),
    }
)
_MORE: Final = frozenset({"auto_transitions", "ordered_transitions"})
_NESTED: Final = frozenset({"children", "parallel", "remap"})
_TRANSITION: Final = ("trigger", "source", "dest")
_ALL, _SAME = "*", "="


def read(description: Mapping[str, Any]) -> Described:
    """Read a machine from a dict.

    Raises:
      MachineError: with every finding.
    """
    reading = _Reading(description)
    reject("this is no state machine", reading.problems)
    missing: Missing = "ignore" if reading.ignores else "dead"
    return Described(reading.states, reading.transitions, reading.initial, reading.final, missing)


class _Reading:
    """One dict while it is read; goes on behind every finding."""

    def __init__(self, description: Any) -> None:
        self.problems: list[Problem] = []
        self.final: Any = []
        self.states: Any = []
        self.transitions: Any = []
        self.initial: Any = None
        self.ignores = False
        if not isinstance(description, Mapping):
            example = '{"states": ["closed", "open"], "initial": "closed", "transitions": [...]}'
            self.problems.append(shape("the description", "a dict", description, example))
            return
        self._keys("", description, (*_KEYS, *_WITHOUT_MEANING))
        self.initial = _name(description.get("initial"))
        self.ignores = bool(description.get("ignore_invalid_triggers"))
        self._read_states(description.get("states", []))
        self._read_final(description.get("final"))
        places = self._read_transitions(description.get("transitions", []))
        self.problems += findings(self.states, self.transitions, self.initial, self.final, "dead", places)

    def _keys(self, path: str, found: Mapping[Any, Any], known: tuple[str, ...]) -> None:
        """Report what a dict says that a description cannot hold."""
        for key, value in found.items():
            if key in known or not value:  # what is off, empty or None asks for nothing
                continue
            where = f"{path}.{key}" if path else str(key)
            why, remedy = f"it says nothing to hfg; {suggest(str(key), known)}", "correct the key, or take it out"
            if key in _CODE:
                why = "a description holds no code"
                remedy = "put it into a node of your own for the state: machine.build(graph, nodes={...})"
            elif key in _MORE:
                why, remedy = "it would add transitions that nobody sees", "write them out and leave it off"
            elif key in _NESTED:
                why = "a state of a description holds no other states"
                remedy = "let its node be a subgraph: machine.build(graph, nodes={...})"
            self.problems.append(error(where, f"got {value!r:.80}", why, remedy))

    def _read_states(self, found: Any) -> None:
        if not isinstance(found, list | tuple) and not (isinstance(found, type) and issubclass(found, Enum)):
            self.states = found  # `findings` says what is wrong with it
            return
        for number, one in enumerate(found):
            if isinstance(one, Mapping):
                self._keys(f"states[{number}]", one, ("name", "final"))
                name = _name(one.get("name"))
                if one.get("final") and isinstance(name, str):
                    self.final.append(name)
                self.states.append(name)
            else:
                self.states.append(_name(one))

    def _read_final(self, found: Any) -> None:
        if isinstance(found, list | tuple | set | frozenset):
            self.final += [_name(one) for one in found if _name(one) not in self.final]
        elif found is not None:
            self.final = [found] if isinstance(found, str) else found

    def _read_transitions(self, found: Any) -> list[str]:
        """Fill the transitions; give where each of them stands in the dict."""
        if not isinstance(found, list | tuple):
            self.transitions = found
            return []
        places = []
        for number, one in enumerate(found):
            for transition in self._expanded(f"transitions[{number}]", one):
                places.append(f"transitions[{number}]")
                self.transitions.append(transition)
        return places

    def _expanded(self, path: str, found: Any) -> Iterator[Any]:
        """Give a transition for each source that one entry names."""
        if isinstance(found, Mapping):
            self._keys(path, found, _TRANSITION)
            absent = [key for key in _TRANSITION[:2] if key not in found]
            if absent:
                said = " and ".join(f'"{key}"' for key in absent)
                example = '{"trigger": "push", "source": "closed", "dest": "open"}'
                self.problems.append(error(path, f"{said} is missing", "a transition needs both", f"write {example}"))
                return
            parts = [found.get(key) for key in _TRANSITION]
        elif isinstance(found, list | tuple) and len(found) >= 3:
            parts = list(found[:3])
            if any(found[3:]):
                more = ("conditions", "unless", "before", "after", "prepare")
                self._keys(path, dict(zip(more, found[3:], strict=False)), ())
        else:
            example = '["push", "closed", "open"]'
            self.problems.append(shape(path, "[trigger, source, dest] or a dict with these keys", found, example))
            return
        trigger, source, target = parts
        if source == _ALL:
            sources = list(self.states) if isinstance(self.states, list) else []
        else:
            sources = list(source) if isinstance(source, list | tuple) else [source]
        for one in sources:
            own = target is None or target == _SAME
            yield (_name(trigger), _name(one), _name(one if own else target))


def _name(found: Any) -> Any:
    """Give the name of a member of an enumeration; `transitions` takes both."""
    return found.name if isinstance(found, Enum) else found
