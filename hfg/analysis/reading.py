"""Reads from the source of a node type which ports its code may send over, without running it.

A *bag* is what one firing or call may send over certain ports. `read` walks the syntax tree of each handler along every
way through branches and loops, and follows calls of the node's own methods. It does not look at conditions, so it may
find bags that never occur, but it never leaves one out. Code that it cannot follow counts as unknown: then any of the
ports may be sent, any number of times. Depends on `walking`.
"""

from __future__ import annotations

import functools
from itertools import chain
from typing import Final

from hfg.analysis.bags import MANY, NOTHING, Bag, Code, Handler, Sent, Unknown, free, loosened, some_of
from hfg.analysis.sources import function_of
from hfg.analysis.walking import Walk
from hfg.analysis.words import makes_tokens
from hfg.nodetypes.description import NodeType

OUTSIDE: Final = ("setup", "ready", "teardown", "on_activated", "do")


@functools.lru_cache(maxsize=4096)
def read(kind: NodeType, ports: frozenset[str]) -> Code:
    """Read what a type's code may send over these ports: outputs, events and parameters."""
    if not isinstance(kind.origin, type):
        return Code(firing=of_function(kind, ports))
    return _Type(kind, ports).code()


def of_function(kind: NodeType, ports: frozenset[str]) -> Handler:
    """A function reaches no ports but by what it returns."""
    whole = "async" not in kind.process_kind
    is_free = makes_tokens(kind) or any(one.token for one in kind.inputs.values())
    sendings = [free(name) if is_free else [(name, None)] for name in kind.outputs if name in ports]
    try:
        return Handler(some_of(sendings), whole)
    except Unknown as why:
        return Handler(frozenset({NOTHING, frozenset((sent, 1) for sent in chain(*sendings))}), False, str(why))


class _Type(Walk):
    """Reads one class."""

    def code(self) -> Code:
        """Read all handlers, then what they hand on."""
        kind = self.kind
        firing = self._handler("process", kind.process_kind) if kind.process_kind != "none" else None
        ending = self._handler("end", "function") if "end" in kind.hooks else None
        slots = {}
        for name, spec in kind.slots.items():
            if spec.handler_name:
                slots[name] = self._handler(spec.handler_name, "async" if spec.is_async else "function", slot=name)
            elif name in self.ports:
                slots[name] = Handler(frozenset({frozenset({((name, None), 1)})}))  # a trigger parameter
        outside: set[Sent] = set()
        for name in OUTSIDE:
            if name in kind.hooks:
                self.in_setup = name == "setup"
                outside |= self._sent_by(name)
        self.in_setup = False
        afterwards = self._sent_by("on_deactivated") if "on_deactivated" in kind.hooks else set()
        read_already: set[str] = set()
        at_once: set[Sent] = set()
        while self.later - read_already:
            name = min(self.later - read_already)
            read_already.add(name)
            sent = self._sent_by(name)
            outside |= sent
            if name in self.inline:
                at_once |= sent
        if self.lost:
            return self._all_unknown(self.lost)
        loose = {sent for name in self.loose & self.ports for sent in self._unseen(name)} | at_once | afterwards
        if loose:
            outside |= loose
            firing = firing and loosened(firing, loose)
            ending = ending and loosened(ending, loose)
            slots = {name: loosened(handler, loose) for name, handler in slots.items()}
        return Code(firing, ending, slots, frozenset(outside))

    def _all_unknown(self, why: str) -> Code:
        kind = self.kind
        everything = Handler(self._anything(), False, why)
        return Code(
            everything if kind.process_kind != "none" else None,
            everything if "end" in kind.hooks else None,
            dict.fromkeys(kind.slots, everything),
            everything.sent,
        )

    def _anything(self) -> frozenset[Bag]:
        unseen = (sent for name in self.ports for sent in self._unseen(name))
        return frozenset(frozenset({(sent, MANY)}) for sent in unseen) | {NOTHING}

    def _handler(self, name: str, runs: str, slot: str = "") -> Handler:
        function = function_of(self.kind, name)
        try:
            if function is None:
                raise Unknown("it is no plain function")
            is_generator = "generator" in runs
            bags = self._method(function, is_process=name == "process", awaited="async" in runs)
        except Unknown as why:
            return Handler(self._anything(), False, str(why))
        bags = {frozenset((sent, 1 if sent[0] in self.outputs else n) for sent, n in bag) for bag in bags}
        if is_generator:  # each firing goes from one yield to the next
            several = {sent for bag in bags for sent, _ in bag}
            whole = len(several) < 2 and all(sent[0] in self.outputs for sent in several)
            return Handler(frozenset(bags) | {NOTHING}, whole and "async" not in runs)
        return Handler(frozenset(bags), "async" not in runs)

    def _sent_by(self, name: str) -> set[Sent]:
        """All that a method sends that runs outside firings and calls."""
        function = function_of(self.kind, name)
        try:
            if function is None:
                raise Unknown("it is no plain function")
            bags = self._method(function, is_process=False, awaited=True)
        except Unknown as why:
            self.lost = self.lost or f"{name}: {why}"
            return set()
        return {sent for bag in bags for sent, _ in bag}
