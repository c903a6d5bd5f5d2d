"""Node types as classes: `Node`, with its interface for users and for runners.

A node is a type, parameters and options, and nothing else. It can always be made again from its reference and
parameters, which is why copies, files, workers and reload work. Data that all nodes of a type share is in its
`NodeType`; a node holds only its parameters and the ports that were used. Depends on ports, `declaration` and
`description`, not on graphs or runners.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Coroutine
from typing import TYPE_CHECKING, Any, ClassVar, Final, TypeVar

import msgspec

from hfg.base.logs import Log, Logger, node_log
from hfg.base.token import Token
from hfg.base.values import own_copy
from hfg.errors import DeclarationError, EngineInternalError, Failure, NotRunning, UsageError, shown
from hfg.nodetypes.declaration import declare
from hfg.nodetypes.description import NodeType as NodeType  # also named from here by code of upper layers
from hfg.nodetypes.description import parameter_values, read_only_refusal, unknown_parameter
from hfg.nodetypes.vectors import Vectors
from hfg.ports.automatic import (
    AUTOMATIC_EVENTS,
    AUTOMATIC_SLOTS,
    SUBGRAPH_EVENTS,
    SUBGRAPH_SLOTS,
    automatic_event,
    automatic_slot,
    sent_of,
)
from hfg.ports.base import Kind, Port, Source, Target
from hfg.ports.events import Event, EventPort
from hfg.ports.inputs import InputPort
from hfg.ports.outputs import OutputPort
from hfg.ports.parameters import ParameterPort
from hfg.ports.slots import SlotPort
from hfg.ports.views import Ports

Other = TypeVar("Other")

_NO_PARAMETERS: Final[
    dict[str, Any]
] = {}  # shared by all nodes that have none; never written because there is no name to write
_NOTHING: Final[frozenset[str]] = frozenset()


class Place(msgspec.Struct, frozen=True):
    """The place of a node: its graph, its name there, and its path from the root, "subgraph/node"."""

    graph: Any
    name: str
    path: str


class Node:
    """Base of node types that are classes; see `hfg.node` for functions.

    Ports, parameters and state are declared in the class body (`hfg.Input`, `Output`, `Event`, `slot`, `Parameter`,
    `State`); without declared ports, the arguments and the return annotation of `process` declare them. A type without
    `process` never fires; it only has slots. There is no `__init__`: open resources in `setup()`.

    Examples:
      >>> class Count(Node):
      ...     '''Count the values.'''
      ...     def process(self, value: object) -> int:
      ...         self.total = getattr(self, "total", 0) + 1
      ...         return self.total
      >>> Count().ports
      <ports <inputs ['value']> <outputs ['out']> <events []> <slots []> <parameters []>>
    """

    # Slots keep hfg's own data apart from attributes that users write on `self`: to reset a node, a run only looks at
    # the instance's dictionary.
    __slots__ = (
        "__dict__",
        "__weakref__",
        "_active",
        "_options",
        "_outdated",
        "_parameters",
        "_path_log",
        "_place",
        "_start_task",
        "_written_before",
    )

    _type: ClassVar[NodeType]
    _active: bool  # A(v) during a run; written by the runner
    _written_before: frozenset[str] | None  # attributes that users set before the first run; None until then
    _path_log: Log | None
    _options: Any  # written by the graph
    _parameters: dict[str, Any]  # the live values; change them by `_set_parameter`
    # while there is a do-activity: whether it is the one that asks and is about to end (A15)
    _outdated: Callable[[], bool] | None
    _place: Place | None  # written by the graph
    _start_task: Callable[[Coroutine[Any, Any, Any]], None] | None  # set while a runner runs the node

    activated: Event[None] = automatic_event("activated")
    deactivated: Event[None] = automatic_event("deactivated")
    processed: Event[None] = automatic_event("processed")
    failed: Event[Failure] = automatic_event("failed")
    timeout: Event[None] = automatic_event("timeout")
    completed: Event[Any] = automatic_event("completed")
    enable = automatic_slot("enable")
    disable = automatic_slot("disable")
    activate = automatic_slot("activate")
    deactivate = automatic_slot("deactivate")
    reset = automatic_slot("reset")

    def __init__(self, *positional: Any, **parameters: Any) -> None:
        """Make a node; parameters are passed by keyword only.

        Raises:
          TypeError: a value has no name, the type has no such parameter, or a parameter without a default is missing.
          ValueError: a value violates the parameter's limits.
        """
        self._active = False
        self._outdated = None
        self._written_before = None
        self._path_log = None
        self._options = None
        self._place = None
        self._start_task = None
        if positional:
            raise TypeError(_positional(self._type))
        self._parameters = (
            parameter_values(self._type, parameters) if parameters or self._type.parameters else _NO_PARAMETERS
        )

    def __init_subclass__(cls, *, _made: Callable[[type[Node]], NodeType] | None = None, **arguments: Any) -> None:
        super().__init_subclass__(**arguments)
        if cls.__init__ is not Node.__init__:
            raise DeclarationError(
                f"node type {cls.__name__}: __init__ cannot be overridden because a node is made from its "
                "parameters only; declare hfg.Parameter and hfg.State, and open resources in setup()"
            )
        if cls.__eq__ is not object.__eq__ or cls.__hash__ is not object.__hash__:
            raise DeclarationError(
                f"node type {cls.__name__}: __eq__ and __hash__ cannot be overridden because a node is equal "
                "only to itself; compare its contents in a method of another name"
            )
        hidden = next((name for name in vars(cls) if name in _HIDDEN), None)
        if hidden is not None and not cls.__module__.startswith("hfg."):
            raise DeclarationError(
                f'node type {cls.__name__}: "{hidden}" is used by hfg itself; choose a name without the underscore'
            )
        cls._type = declare(cls, Node) if _made is None else _made(cls)
        if _made is None and cls._type.vectors:
            cls._stand_for_sizes()

    @classmethod
    def _stand_for_sizes(cls) -> None:
        """Let the class make nodes of the size that they are asked for (`vectors`).

        Its type serves as their pattern.
        """
        vectors = Vectors(cls, cls._type)
        setattr(cls, "__new__", vectors.make)  # noqa: B010 - type checkers would take it for that of every node
        cls._type = vectors.shown

    # --- for users ---

    def setup(self) -> Any:
        """Open resources for a run; called before the first firing and after `reset`. May be async, like all hooks."""

    def process(self, *inputs: Any, **parameters: Any) -> Any:
        """Work on one token from every input. A node that does not override it never fires."""

    def ready(self) -> Any:
        """Return whether the node may fire now; called last (rule F1)."""
        return True

    def end(self) -> Any:
        """Return the last outputs when the inputs have ended (rule F4)."""

    def teardown(self) -> Any:
        """Close what `setup` opened; called in every case."""

    async def do(self) -> Any:
        """Work for as long as the node is active (rule A15).

        If overridden, it starts when A(v) becomes 1, after `on_activated`. It is cancelled when A(v) becomes 0, or when
        the node is disabled or torn down. If it returns first, the event `completed` is triggered with its result. It
        may trigger events and await anything, but cannot write to outputs: outputs belong to firings.

        Examples:
          >>> import asyncio
          >>> class Approach(Node):
          ...     async def do(self) -> str:
          ...         await asyncio.sleep(2)
          ...         return "there"
        """

    def on_activated(self) -> Any:
        """Called when A(v) becomes 1."""

    def on_deactivated(self) -> Any:
        """Called when A(v) becomes 0."""

    def start_soon(self, coroutine: Coroutine[Any, Any, Any]) -> None:
        """Start a coroutine as a child task of this node, concurrently with its firings.

        Call it in setup(), process(), slots and hooks; nodes in thread groups cannot use it. Errors are handled by the
        node's `on_error`. The run does not end before the task does. The task is cancelled when the node is torn down
        or disabled (rules X1, X3, R5). It may trigger events, but it cannot write to outputs: outputs belong to
        firings.

        Args:
          coroutine: the coroutine object, as in `self.start_soon(self.listen())`.

        Raises:
          NotRunning: the node is not part of a run.
          TypeError: the argument is not a coroutine.

        Examples:
          >>> import asyncio
          >>> class Beacon(Node):
          ...     beat = Event(int)
          ...     def setup(self) -> None:
          ...         self.start_soon(self.beats(3))
          ...     async def beats(self, count: int) -> None:
          ...         for number in range(count):
          ...             await asyncio.sleep(1)
          ...             self.beat.trigger(number)
        """
        path = _name(self)
        if not isinstance(coroutine, Coroutine):
            raise TypeError(
                f'start_soon of "{path}" takes a coroutine, got {coroutine!r:.80}; call the function that '
                f"makes it: self.start_soon({_called(coroutine)})"
            )
        if self._start_task is not None:
            self._start_task(coroutine)
            return
        coroutine.close()
        what = f'"{path}" cannot start_soon({_called(coroutine)})'
        if self._type.is_subgraph:
            raise UsageError(f"{what} because a subgraph runs no code of its own; call it in a node inside")
        raise NotRunning(
            f"{what} because it is not part of a run; call it in setup(), process() or a slot, while its graph runs"
        )

    @property
    def ports(self) -> Ports:
        """All ports, by kind and name."""
        return Ports(self)

    @property
    def place(self) -> Place:
        """Graph, name and path.

        Raises:
          UsageError: the node is not in a graph.
        """
        if self._place is None:
            raise UsageError(
                f'node "{_name(self)}" is not in a graph, so it has no place: add it first, with graph.add(node)'
            )
        return self._place

    @property
    def active(self) -> bool:
        """A(v) of the paper; False outside a run.

        Code in a thread sees each change at once, except under the virtual clock, where it sees the value at its start
        (R6). A cancelled `do` never sees an activity that is newer than its own (A15).
        """
        return self._active and (self._outdated is None or not self._outdated())

    @property
    def log(self) -> Logger:
        """The logger "hfg.node." plus the node's path, with dots for slashes; its records have the attribute `path`.

        A log handler that raises does not harm the node. In functions, use `hfg.log()`.
        """
        path = _name(self)
        if self._path_log is None or self._path_log.path != path:  # the node has been added or moved since
            self._path_log = node_log(path)
        return self._path_log

    @property
    def inner(self) -> Any:
        """Not available: ports have inner sides, nodes do not."""
        raise UsageError(
            f'node "{_name(self)}" has no inner side; .inner belongs to the ports of a subgraph: self.port.inner'
        )

    if not TYPE_CHECKING:  # type checkers report missing attributes themselves

        def __call__(self, *values: Any, **named: Any) -> Any:
            """Not available: a node is not a function."""
            function = f", the function itself is {self._type.qualname}.function" if self._type.is_function else ""
            raise UsageError(
                f'"{_name(self)}" is a node, which its graph fires{function}: make one firing with '
                "hfg.testing.fire(node, name=value), or pass parameters where the node is made"
            )

    def __rshift__(self, other: Other) -> Other:
        """Connect the only sending port to a target, or to the only free target of a node. Return `other`."""
        return self._free_source() >> other

    def __repr__(self) -> str:
        values = ", ".join(f"{name}={value!r}" for name, value in self._parameters.items())
        where = f' at "{self._place.path}"' if self._place is not None else ""
        return f"<{self._type.qualname}({values}){where}>"

    # --- for whoever runs, draws or stores nodes ---

    def _without(self, name: str) -> str:
        """Return the message for an unknown attribute, with the known names."""
        kind = self._type
        ports = dict.fromkeys([*kind.vectors, *kind.inputs, *kind.outputs, *kind.events, *kind.slots, *kind.parameters])
        known = [port for port in ports if port.isidentifier()]
        near = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
        has = f"its ports and parameters are {', '.join(known)}" if known else "it has no ports"
        return f'node "{_name(self)}" has no "{name}"; ' + (f'did you mean "{near[0]}"? ' if near else "") + has

    def _port(self, kind: Kind, name: str) -> Any:
        """Return the bound port. It is made at the first call and stored where attribute access finds it."""
        key = f"{name} {kind}" if name in self._type.shared else name
        port = self.__dict__.get(key)
        if port is None:
            port = self.__dict__[key] = self._make_port(kind, name)
        elif not isinstance(port, Port):
            raise UsageError(
                f'"{_name(self)}.{name}" is a port, but the node\'s code wrote {port!r} over it; '
                f"write self.{name}.send(...) or use another name"
            )
        return port

    def _make_port(self, kind: Kind, name: str) -> Port:
        type_ = self._type
        match kind:
            case "input" if name in type_.inputs:
                return InputPort(self, name, type_.inputs[name].type)
            case "output" if name in type_.outputs:
                return OutputPort(self, name, type_.outputs[name].type)
            case "event" if name in type_.events:
                return EventPort(self, name, type_.events[name].type)
            case "slot" if name in type_.slots:
                return SlotPort(self, name, type_.slots[name].type)
            case "parameter" if name in type_.parameters and type_.parameters[name].is_port:
                return ParameterPort(self, name, type_.parameters[name])
            case "event" if name == "completed" and "do" in type_.hooks:
                return EventPort(self, name, type_.completes)
            case "event" if name == "completed":
                raise UsageError(
                    f'"{_name(self)}" has no event "completed": its type {type_.name} has no do-activity; write '
                    "`async def do(self)` in its class (rule A15)"
                )
            case "event" if name in AUTOMATIC_EVENTS and (not type_.is_subgraph or name in SUBGRAPH_EVENTS):
                return EventPort(self, name, AUTOMATIC_EVENTS[name])
            case "slot" if name in AUTOMATIC_SLOTS and (not type_.is_subgraph or name in SUBGRAPH_SLOTS):
                return SlotPort(self, name, object)
            case "event" if (output := sent_of(name)) and output in type_.outputs and not type_.is_subgraph:
                return EventPort(self, name, type_.outputs[output].type)
        if type_.is_subgraph and (sent_of(name) or "") in type_.outputs:
            raise UsageError(
                f'subgraph "{_name(self)}" has no {kind} "{name}": outputs of a subgraph only forward tokens; '
                "declare a separate event, and in build() connect to its inner side the .sent of the node "
                "that the output belongs to"
            )
        if type_.is_subgraph and name in (*AUTOMATIC_EVENTS, *AUTOMATIC_SLOTS):
            raise UsageError(
                f'subgraph "{_name(self)}" has no {kind} "{name}" because it does not fire itself; connect '
                f"the {kind} of an inner node, or declare a separate {kind}"
            )
        raise UsageError(f'node type {type_.name} has no {kind} "{name}"')

    def _process_call(self) -> Callable[..., Any]:
        """Return the function for one firing, with one positional argument for each input in order.

        It returns the raw result, coroutine or iterator.
        """
        if self._type.caller is None:
            raise EngineInternalError(f'node "{_name(self)}" has no process function to call')
        return self._type.caller(self)

    def _handler(self, name: str) -> Callable[..., Any] | None:
        """Return the bound handler of a slot, or None if it has none."""
        spec = self._type.slots.get(name)
        if spec is None or not spec.handler_name:
            return None
        handler: Callable[..., Any] = self._type.declared[name].handler.__get__(self)
        return handler

    def _slot_call(self, name: str) -> Callable[[Token[Any]], Any]:
        """Return the function for one call of a declared slot with a token.

        For an async handler it returns the coroutine.
        """
        spec = self._type.slots[name]
        handler = self._handler(name)
        if handler is None:
            trigger = self._port("event", name).trigger
            return lambda _token: trigger()  # a trigger has no value, whatever the signal carries
        run = handler
        if spec.token:
            return run
        if spec.takes_value:
            return lambda token: run(token.value)
        return lambda token: run()

    def _hook(self, name: str) -> Callable[..., Any] | None:
        """Return a hook if the type overrides it, otherwise None."""
        return getattr(self, name) if name in self._type.hooks else None

    def _split(self, result: Any) -> list[Any]:
        """Split the result of the process function into one value per output, in order of declaration."""
        type_ = self._type
        if type_.result == "single":
            return [result]
        if result is None:
            return [None] * len(type_.outputs)
        if type_.layout:
            result = self._spread(result)
        names = ", ".join(f'"{name}"' for name in type_.outputs)
        if type_.result == "none":
            raise TypeError(
                f"{type_.name} has no output but returned {shown(result)}; declare an output (annotate the "
                "result), or return nothing"
            )
        if isinstance(result, tuple | list):
            if len(result) != len(type_.outputs):
                raise TypeError(
                    f"{type_.name} returned {len(result)} values, but has {len(type_.outputs)} outputs: "
                    f"{names}; return one for each"
                )
            return list(result)
        if type_.fields and all(hasattr(result, name) for name in type_.fields):
            return [getattr(result, name) for name in type_.fields]
        raise TypeError(
            f"{type_.name} returned {shown(result)}, but has the outputs {names}; return a tuple with one "
            "value for each"
        )

    def _spread(self, result: Any) -> list[Any]:
        """Replace the result for a vector of outputs by its values."""
        type_ = self._type
        parts = [result] if len(type_.layout) == 1 else result
        if not isinstance(parts, tuple | list) or len(parts) != len(type_.layout):
            raise TypeError(
                f"{type_.name} returned {shown(result)}, but has {len(type_.layout)} outputs and vectors of "
                "outputs; return a tuple with one value for each, and a list for each vector"
            )
        values: list[Any] = []
        for part, count in zip(parts, type_.layout, strict=True):
            if count is None:
                values.append(part)
            elif part is None:
                values += [None] * count
            elif not isinstance(part, tuple | list) or len(part) != count:
                raise TypeError(
                    f"{type_.name} returned {shown(part)} for a vector of {count} outputs; return a list with "
                    "one value for each, None for silence"
                )
            else:
                values += part
        return values

    def _set_parameter(self, name: str, value: Any, *, own: bool = False) -> None:
        """Change a parameter. A value that is refused changes nothing.

        Args:
          name: name of the parameter.
          value: the new value; a list, a set, a dict or an array is copied.
          own: the call comes from the node's code, which is the only one to set read-only parameters.
        """
        spec = self._type.parameters.get(name)
        if spec is None or spec.trigger:
            raise ValueError(unknown_parameter(self._type, name))
        if spec.size:
            raise ValueError(
                f'"{_name(self)}.{name}" is a vector of {self._parameters[name]} ports, and the ports of a '
                f"node are fixed: make another node, {self._type.qualname}({name}={value!r}), or replace it "
                "by an edit"
            )
        if spec.read_only and not own:
            raise ValueError(read_only_refusal(f"{_name(self)}.{name}"))
        wrong = spec.check(value)
        if wrong is not None:
            raise ValueError(f'parameter "{_name(self)}.{name}" {wrong}')
        self._parameters[name] = kept = own_copy(value)
        if spec.read_only:
            tell = self._port("parameter", name)._tell
            if tell is not None:
                tell(kept)

    def _reset_states(self) -> None:
        """Reset the node for a run: state is new, and attributes that an earlier run wrote are removed.

        Attributes from before the first run stay.
        """
        own = self.__dict__
        states = self._type.states
        if self._written_before is None:
            # Ports belong to the node and stay, too; state is set below.
            self._written_before = (
                frozenset(name for name, value in own.items() if not isinstance(value, Port) and name not in states)
                or _NOTHING
            )
        else:
            for name in [
                name for name, value in own.items() if name not in self._written_before and not isinstance(value, Port)
            ]:
                del own[name]
        for name, state in states.items():
            own[name] = state.fresh()
        for name, spec in self._type.parameters.items():
            if spec.read_only:
                self._parameters[name] = own_copy(spec.default)

    def _copy(self) -> Node:
        """Return a node of the same type and parameters that is not in a graph."""
        specs = self._type.parameters
        return type(self)(**{name: value for name, value in self._parameters.items() if specs[name].is_given})

    def _free_source(self) -> Source[Any]:
        """Find the only port that sends."""
        candidates = [*self.ports.outputs.values(), *self.ports.events.values()]
        source: Source[Any] = _only(self, candidates, "output or event")
        return source

    def _free_target(self) -> Target[Any]:
        """Find the only port that receives and is free: inputs without an edge, and slots."""
        candidates = [*self.ports.inputs.values(), *self.ports.slots.values()]
        if len(candidates) > 1 and self._place is not None:
            is_taken = self._place.graph._is_taken
            candidates = [port for port in candidates if not is_taken(port)]
        target: Target[Any] = _only(self, candidates, "free input or slot")
        return target


def _only(node: Node, candidates: list[Any], what: str) -> Any:
    if len(candidates) == 1:
        return candidates[0]
    if not candidates:
        raise UsageError(f'node "{_name(node)}" has no {what} for >>; write graph.connect(source, target)')
    names = " and ".join(f'{port.kind} "{port.path}"' for port in candidates)
    raise UsageError(f"ambiguous >>: it could mean {names}; name the port, as in graph.connect(source, target)")


def _name(node: Node) -> str:
    return node._type.name if node._place is None else node._place.path


def _called(one: Any) -> str:
    """Return how to write a call that makes a coroutine."""
    return f"{getattr(one, '__name__', 'work')}(...)"


def _positional(type_: NodeType) -> str:
    example = next((f"{name}=..." for name, spec in type_.parameters.items() if spec.is_given), "")
    if type_.is_function:
        return f"{type_.qualname}(...) makes a node; the function itself is {type_.qualname}.function"
    return f"{type_.qualname}({example}) takes its parameters by keyword only; values for inputs come from connections"


_HIDDEN: Final = frozenset(name for name in vars(Node) if name.startswith("_") and not name.endswith("__"))
"""Names that a user's class must not define by accident; only hfg's own classes may."""

Node._type = NodeType("node", Node, Node.__module__, Node.__qualname__, "")
