"""Parameters that are set from outside: between firings, and never without effect (rule P8).

Stands on `node_lifecycle`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from hfg.base.values import own_copy
from hfg.engine.model.running_node import BACKOFF, BETWEEN_FIRINGS, DISABLED, RunningNode
from hfg.engine.rules import node_lifecycle
from hfg.errors import NotRunning, UsageError
from hfg.graph.structure.level import inside
from hfg.graph.structure.promoting import stands_for
from hfg.nodetypes.description import read_only_refusal
from hfg.nodetypes.node import Node
from hfg.ports import ParameterPort
from hfg.trace import ParameterSet

if TYPE_CHECKING:
    from hfg.engine.runtime.engine import Engine

__all__ = ["need_settable", "refuse_without_effect", "set_parameter", "without_effect"]


def set_parameter(engine: Engine, port: ParameterPort[Any], value: Any) -> None:
    """Set a parameter, and all those inside a subgraph that it stands for, each between firings of its node.

    Raises:
      ValueError: the value is out of the limits of one of them; nothing is changed.
      UsageError: nobody would see it.
    """
    reached = need_settable(engine, port, value)
    value = own_copy(value)  # of now: it may be set a while later
    workers = {worker.node: worker for worker in engine.core.workers if worker.node is not None}
    if any(one.node not in workers for one in reached):
        raise UsageError(f'"{port.path}" is no parameter of this run: its graph is another one, or it was never added')
    refuse_without_effect([(one.node, one.name) for one in reached], workers.values())
    for one in reached:
        write = partial(_write, workers[one.node], one.node, one.name, value)
        if engine.on_loop():
            _between_firings(workers[one.node], write)
        else:  # from a thread
            engine.bring_in(partial(_between_firings, workers[one.node], write))


def need_settable(engine: Engine, port: ParameterPort[Any], value: Any) -> list[ParameterPort[Any]]:
    """Give a parameter and those inside that it stands for, all of which may have this value now.

    Raises:
      ValueError: it is out of the limits of one of them, or set by the node alone.
      NotRunning: the run is over.
    """
    if engine.core.over:
        raise NotRunning(f'the run is over: write node.ports.parameters["{port.name}"].value = ... for the next one')
    reached = list(stands_for(port))
    for one in reached:
        if one.spec.read_only:
            raise ValueError(read_only_refusal(one.path))
        wrong = one.spec.check(value)
        if wrong is not None:
            raise ValueError(f'parameter "{one.path}" {wrong}')
    return reached


def _write(worker: RunningNode, node: Node, name: str, value: Any) -> None:
    """Let the node work with the value from now on."""
    core = worker.core
    node._parameters[name] = own_copy(value)
    if core.trace_changes is not None:
        core.trace_changes(ParameterSet(core.now(), worker.path, name, value))


def _between_firings(worker: RunningNode, write: Callable[[], None]) -> None:
    """Do it now, or as soon as the firing or call under way is over; nobody waits for that."""
    if worker.busy in BETWEEN_FIRINGS and not worker.is_on_fast_path():
        write()
        return

    def in_turn(_worker: RunningNode, over: Callable[[], None]) -> None:
        write()
        over()

    node_lifecycle.when_idle(worker, in_turn, node_lifecycle.nothing)


def refuse_without_effect(parameters: Sequence[tuple[Any, str]], workers: Iterable[RunningNode]) -> None:
    """Refuse a change that none of the code that runs would see.

    Args:
      parameters: nodes and subgraphs, with the names of what is to be set together.
      workers: those that go on with what they do; not those that start afresh, with the new values.

    Raises:
      UsageError: with the remedy.
    """
    running = {worker.node: worker for worker in workers}
    for node, name in parameters:
        inner = inside(node)
        if inner is not None:
            if node in running and not inner.promotions.of(name):
                raise UsageError(
                    f'parameter "{node.place.path}.{name}" stands for none inside, and build() has run: nothing would '
                    f"change; call graph.promote(self.{name}, ...) in build(), or replace the subgraph, "
                    f"{_replacing(node, name)}"
                )
        elif node in running and _has_its_values(running[node]):
            raise without_effect(node, name)


def without_effect(node: Any, name: str) -> UsageError:
    """The refusal to set what a generator function was given when it began."""
    return UsageError(
        f'parameter "{node.place.path}.{name}" belongs to a generator function that was given it when it '
        "began and cannot see a new value: make it a class whose process() yields, or counts in an "
        f"hfg.State, and reads self.{name}; or begin it afresh, {_replacing(node, name)}"
    )


def _has_its_values(worker: RunningNode) -> bool:
    """Whether its code was given the parameters once and for all, and goes on with them."""
    if not worker.type.given_parameters_once or worker.blocked & (DISABLED | BACKOFF):
        return False  # these begin afresh
    return worker.execution.generator is not None or worker.busy == "firing"


def _replacing(node: Any, name: str) -> str:
    reference = node._type.reference or "module:name"
    return f'run.edit(commands.Replace("{node.place.path}", "{reference}", parameters={{"{name}": ...}}))'
