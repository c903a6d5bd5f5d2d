"""Tries a node type: fires it with values that its declaration promises to take, and looks whether it keeps its word.

Outputs and events must be of their declared types, and a firing may raise only what the docstring has under `Raises:`.
Sources are fired as sources, async code waits in virtual time, what lives by slots is called by them, subgraphs run in
a little graph. Depends on `values`, `firing` and the catalogue; needs hypothesis. `usable` does it for many types.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any, Final, NoReturn

import msgspec
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import seed as seeded
from hypothesis import strategies as st
from hypothesis.errors import Flaky, ResolutionFailed, Unsatisfiable

import hfg
from hfg.catalogue import TypeDescription, describe_type
from hfg.errors import EndOfStream, NotRunning, RunError, UsageError
from hfg.graph.structure.edge import type_of
from hfg.nodetypes.description import NodeType
from hfg.nodetypes.functions import NodeFunction
from hfg.nodetypes.node import Node
from hfg.ports.specs import REQUIRED
from hfg.registry import find
from hfg.testing.firing import Firing, fire
from hfg.testing.samples import sample_folder
from hfg.testing.values import Alike, values_of, values_of_parameter
from hfg.types import accepts, describe, describe_value

__all__ = ["NotUsable", "Trial", "try_type"]

_EXAMPLES: Final = 5  # nodes with parameters of their own; each is fired several times
_MOST_EXAMPLES: Final = 150  # until one firing goes well
_LONGEST_RUN_S: Final = 60.0  # of a subgraph, in virtual time


class NotUsable(AssertionError):
    """A node type does not keep its word; the message is the program that shows it."""


class Trial(msgspec.Struct, frozen=True):
    """The result of trying a type.

    Attributes:
      fired: how many firings and calls went well.
      refused: how many ended by an error that is declared.
      errors: those errors, each kind once.
      fault: what is wrong with the type; "" for nothing.
    """

    reference: str
    fired: int = 0
    refused: int = 0
    errors: tuple[str, ...] = ()
    fault: str = ""

    @property
    def usable(self) -> bool:
        """Whether a firing went well, and none that should have did not."""
        return self.fired > 0 and not self.fault


def try_type(
    type_: str | type[Node] | NodeFunction[..., Any], *, firings: int = 3, seed: int = 0, shrink: bool = True
) -> Trial:
    """Fire a node type several times, with values generated from the types and limits that it declares.

    Several nodes are made, with default and generated parameters; each fires `firings` times, and slots are called in
    between. The same seed gives the same values. During the trial, the working directory is a folder with a few small
    files, and generated paths point into it.

    Args:
      type_: a reference, "my_robot.nodes:MapLookup", or the type itself.
      firings: number of firings per node.
      seed: seed of the values.
      shrink: search for the simplest values that show the fault.

    Returns:
      The trial: what was tried, and how it went.

    Raises:
      NotUsable: a result has another type than declared, an error is not declared, or no firing succeeded.

    Examples:
      >>> @hfg.node
      ... def half(number: int) -> float:
      ...     '''Halve a number.'''
      ...     return number / 2
      >>> try_type(half).usable
      True
    """
    origin = find(type_) if isinstance(type_, str) else type_
    trying = _Trying(origin, firings)
    phases = [Phase.generate, Phase.shrink] if shrink else [Phase.generate]
    for examples in (_EXAMPLES, _MOST_EXAMPLES):

        @seeded(zlib.crc32(f"{trying.described.reference} {seed} {examples}".encode()))
        @settings(
            max_examples=examples,
            deadline=None,
            database=None,
            phases=phases,
            suppress_health_check=list(HealthCheck),
            report_multiple_bugs=False,
        )
        @given(st.data())
        def attempt(data: st.DataObject) -> None:
            trying.example(data)

        try:
            with sample_folder():
                attempt()
        except (ResolutionFailed, Unsatisfiable) as error:
            raise NotUsable(
                f"{trying.described.reference}: no values can be made of what it declares: {error}; "
                "tell Hypothesis how, by register_type_strategy, or say it by plainer limits"
            ) from error
        except Flaky:
            raise NotUsable(trying.fault) from None  # it fails now and then: with the same values, but not always
        if trying.fired:
            return trying.trial()
    raise NotUsable(
        f"{trying.described.reference}: all of {trying.refused} firings ended by errors that it declares, as "
        f"{trying.last}; say by types and limits what it takes"
    )


class _Trying:
    """One type; counts over all its examples."""

    def __init__(self, origin: Any, firings: int) -> None:
        self.origin = origin
        self.type: NodeType = origin._type
        self.described: TypeDescription = describe_type(origin)
        self.declared = {error.name.rpartition(".")[2] for error in self.described.errors}
        self.firings = firings
        self.fired = 0
        self.refused = 0
        self.errors: dict[str, None] = {}
        self.last = ""
        self.fault = ""

    def trial(self) -> Trial:
        return Trial(self.described.reference, self.fired, self.refused, tuple(self.errors))

    def example(self, data: st.DataObject) -> None:
        """Make a node and fire it a few times; after an error with another one."""
        parameters = self._parameters(data)
        if self.type.is_subgraph:
            self._in_a_graph(data, parameters)
            return
        node: Node | None = None
        alike = data.draw(Alike.strategy())
        for _ in range(self.firings):
            node = self._round(data, node, parameters, alike)
        if node is not None:
            for hook in ("end", "teardown"):
                if hook in self.type.hooks:
                    self._attempt(node, parameters, {}, hook=hook)

    def _round(self, data: st.DataObject, node: Node | None, parameters: dict[str, Any], alike: Alike) -> Node | None:
        """Fire once, or call its slots; give the node if it can go on."""
        if node is None:
            node = self._made(parameters)
            if node is None:
                return None
        own = node._type  # of a type with vectors that of this size
        for slot, spec in own.slots.items():
            if spec.handler_name and (self.type.process_kind == "none" or data.draw(st.booleans())):
                value = {"value": data.draw(values_of(spec.type, alike=alike))} if spec.takes_value else {}
                if not self._attempt(node, parameters, value, slot=slot):
                    return None
        if self.type.process_kind == "none":
            self.fired += not any(spec.handler_name for spec in own.slots.values())  # it has nothing to call
            return node
        if "ready" in own.hooks and not self._is_ready(node, parameters):
            return node
        hints = {name: own.inputs[name].type for name in _chosen(data, own)}
        values = {name: data.draw(values_of(hint, alike=alike)) for name, hint in hints.items()}
        return node if self._attempt(node, parameters, values) else None

    def _is_ready(self, node: Node, parameters: dict[str, Any]) -> bool:
        try:
            return bool(fire(node, hook="ready", debug=False).answer)
        except Exception as error:
            self._judge(error, parameters, {}, "hook='ready'")
            return False

    def _made(self, parameters: dict[str, Any]) -> Node | None:
        try:
            made: Node = self.origin(**parameters)
        except Exception as error:
            self._judge(error, parameters, {}, "")
            return None
        return made

    def _attempt(self, node: Node, parameters: Mapping[str, Any], values: dict[str, Any], **how: Any) -> bool:
        """Fire, call or run a hook; say whether the node can go on."""
        said = ", ".join([f"{key}={word!r}" for key, word in how.items()])
        try:
            done = _fired(node, values, how)
        except (NotRunning, _Waits):
            self._alone(parameters, values)
            return False
        except Exception as error:
            with suppress(Exception):  # it closes what it has opened; the error is reported below
                fire(node, hook="teardown")
            self._judge(error, parameters, values, said)
            return False
        self._check(node, done, parameters, values, said)
        self.fired += "hook" not in how
        return not done.ended

    def _judge(self, error: BaseException, parameters: Mapping[str, Any], values: Mapping[str, Any], how: str) -> None:
        """Let a declared error pass."""
        if isinstance(error, EndOfStream):
            self.fired += 1
            return
        names = {kind.__name__ for kind in type(error).__mro__} - {"Exception", "BaseException", "object"}
        text = " ".join(f"{type(error).__name__}: {error}".split())
        if names & self.declared:
            self.refused += 1
            self.errors.setdefault(type(error).__name__)
            self.last = text
            return
        declared = ", ".join(sorted(self.declared)) or "nothing"
        self._fail(
            f"{self._call(parameters, values, how)} raised {text:.300}; its Raises: declares {declared}: "
            "add it, or say by types and limits what it takes",
            error,
        )

    def _fail(self, fault: str, error: BaseException | None = None) -> NoReturn:
        self.fault = fault
        raise NotUsable(fault) from error

    def _check(
        self, node: Node, done: Firing, parameters: Mapping[str, Any], values: Mapping[str, Any], how: str
    ) -> None:
        sent = [("output", name, type_of(node.ports.outputs[name]), value) for name, value in done.outputs.items()]
        sent += [
            ("event", name, node.ports.events[name].type, value)
            for name, value in done.events
            if name in node._type.events
        ]
        for kind, name, hint, value in sent:
            fits = value is None or (hint is not None and accepts(value, hint))
            if not fits:
                self._fail(
                    f'{self._call(parameters, values, how)} gave {kind} "{name}" {describe_value(value)}, which is '
                    f"declared {describe(hint)}"
                )

    def _call(self, parameters: Mapping[str, Any], values: Mapping[str, Any], how: str) -> str:
        """Say what was done, as a user would write it; what the parameters are by default is left out."""
        given = ", ".join(f"{name}={value!r:.80}" for name, value in parameters.items())
        arguments = [f"{self.described.title}({given})", *([how] if how else [])]
        arguments += [f"{name}={_short(value)}" for name, value in values.items()]
        return f"{self.described.reference}: fire({', '.join(arguments)})"

    # --- parameters ---

    def _parameters(self, data: st.DataObject) -> dict[str, Any]:
        # The simplest is the default, so the first node has all of them.
        return {
            name: data.draw(values_of_parameter(spec))
            for name, spec in self.type.parameters.items()
            if spec.is_given and (spec.default is REQUIRED or data.draw(st.booleans()))
        }

    # --- in a graph ---

    def _in_a_graph(self, data: st.DataObject, parameters: dict[str, Any]) -> None:
        placed = self._placed(parameters)
        if placed is None:
            return
        node = placed[1]
        alike = data.draw(Alike.strategy())
        # A subgraph that iterates takes a collection of what it has inside.
        rows = {
            name: [data.draw(values_of(type_of(node.ports.inputs[name]), alike=alike)) for _ in range(self.firings)]
            for name in _chosen(data, node._type)
        }
        calls = {
            name: [data.draw(values_of(node.ports.slots[name].type, alike=alike)) for _ in range(self.firings)]
            for name in node._type.slots
        }
        self._run(*placed, parameters, rows, calls)

    def _alone(self, parameters: Mapping[str, Any], values: dict[str, Any]) -> None:
        """Run it in a graph: it waits for what only a run can bring, or asks for its run."""
        placed = self._placed(parameters)
        if placed is not None:
            own = placed[1]._type
            calls = {name: [None] for name, spec in own.slots.items() if not spec.takes_value}
            rows = {name: [value] * self.firings for name, value in values.items() if name in own.inputs}
            self._run(*placed, parameters, rows, calls)

    def _placed(self, parameters: Mapping[str, Any]) -> tuple[hfg.Graph, Node] | None:
        graph, node = hfg.Graph("trial"), self._made(dict(parameters))
        if node is None:
            return None
        try:
            graph.add(node, name="tried")  # a subgraph is built here
        except Exception as error:
            self._judge(error, parameters, {}, "")
            return None
        return graph, node

    def _run(
        self,
        graph: hfg.Graph,
        node: Node,
        parameters: Mapping[str, Any],
        rows: Mapping[str, list[Any]],
        calls: Mapping[str, list[Any]],
    ) -> None:
        for name, values in rows.items():
            graph.connect(graph.add(_Given(values=values), name=f"to_{name}").out, node.ports.inputs[name])
        for name, values in calls.items():
            graph.connect(graph.add(_Given(values=values), name=f"calls_{name}").out, node.ports.slots[name])
        heard = [("output", one) for one in node._type.outputs] + [("event", one) for one in node._type.events]
        for kind, name in heard:
            port = node.ports.outputs[name] if kind == "output" else node.ports.events[name]
            graph.connect(port, graph.output(_outlet(kind, name), Any))
        try:
            report = hfg.run(graph, clock="virtual", until_s=_LONGEST_RUN_S)
        except RunError as error:
            self._judge(error.__cause__ or error, parameters, {**rows, **calls}, "")
            return
        for kind, name in heard:
            for value in report.outputs.get(_outlet(kind, name), []):
                done = Firing({name: value}, []) if kind == "output" else Firing({}, [(name, value)])
                self._check(node, done, parameters, {**rows, **calls}, "")
        self.fired += 1


class _Given(Node):
    """Sends the values one by one."""

    out = hfg.Output(Any)
    values = hfg.Parameter([], type=Any)

    def process(self) -> Iterator[Any]:
        yield from self.values


class _Waits(Exception):
    """The firing waits for something that cannot happen without a graph."""


def _fired(node: Node, values: dict[str, Any], how: Mapping[str, Any]) -> Firing:
    try:
        return fire(node, debug=False, **how, **values)
    except UsageError as error:
        if "never comes when it is alone" in str(error):
            raise _Waits from error
        raise


def _chosen(data: st.DataObject, kind: NodeType) -> list[str]:
    """Choose the inputs that have a value: the mandatory ones, or at least one, else it would not fire (rule F4)."""
    names = [name for name, spec in kind.inputs.items() if not spec.optional or data.draw(st.booleans())]
    return names or ([data.draw(st.sampled_from(list(kind.inputs)))] if kind.inputs else [])


def _outlet(kind: str, name: str) -> str:
    """Name the output of the graph by which a port is heard; "values[0]" is not a valid name."""
    return f"{kind}_{name.replace('[', '_').rstrip(']')}"


def _short(value: Any) -> str:
    shape = getattr(value, "shape", None)
    return f"<{describe_value(value)}>" if shape else f"{value!r:.120}"
