"""Values that the code of a node writes to its outputs during a firing (F3, P8, T1, T2)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hfg.base.token import Token
from hfg.base.values import own_copy
from hfg.engine.model.running_node import RunningNode
from hfg.engine.rules import sharing
from hfg.engine.rules.sending import unwrapped
from hfg.errors import UsageError
from hfg.ports.base import need_sendable
from hfg.types import accepts, describe, describe_value

__all__ = ["entry_of", "merge", "write", "writer"]


def merge(
    worker: RunningNode, result: object, written: list[Any] | None, parameters: dict[str, Any] | None = None
) -> list[Any] | None:
    """Join what was returned with what was sent; both for one output is writing twice (F3).

    Args:
      worker: whose firing is over.
      result: the result of its function.
      written: what it has sent, by output.
      parameters: what the node's were in this firing; by default as they are now.
    """
    node_type = worker.type
    if result is not None:
        values = worker.node._split(result)
        if written is None:
            written = [None] * len(worker.out_edges)
        for position, value in enumerate(values):
            if value is None:
                continue
            if written[position] is not None:
                raise UsageError(
                    f'output "{worker.path}.{worker.out_names[position]}" was written twice in one '
                    f"firing: return or send, once"
                )
            if type(value) is Token:
                need_sendable(value, None, None)
            written[position] = unwrapped(value)
    if worker.core.debug:
        _check_values(worker, written)
    if node_type is not None and node_type.parameters:
        written = _add_parameters(worker, written, worker.node._parameters if parameters is None else parameters)
    return written


def _check_values(worker: RunningNode, written: list[Any] | None) -> None:
    """In debug mode: what leaves is of its output's type, and what was taken is as it was (T1)."""
    sharing.need_unchanged(worker)
    for position, (name, spec) in enumerate(worker.type.outputs.items() if written is not None else ()):
        entry = written[position]  # type: ignore[index]
        if entry is None:
            continue
        if not accepts(entry[0], spec.type):
            raise TypeError(
                f'output "{worker.path}.{name}" is declared {describe(spec.type)}, got {describe_value(entry[0])}'
            )
        sharing.need_unwritten(worker, name, entry[0])


def _add_parameters(worker: RunningNode, written: list[Any] | None, parameters: dict[str, Any]) -> list[Any]:
    """P8: a connected parameter sends its value with each firing that is not silent."""
    if written is None:
        written = [None] * len(worker.out_edges)
    for position in range(len(worker.type.outputs), len(worker.out_names)):
        value = parameters[worker.out_names[position]]
        written[position] = (own_copy(value), None, None)  # the node may change its own (T1)
    return written


def writer(worker: RunningNode, position: int) -> Callable[[Any, int | None, float | None], None]:
    """What the `send` of an output does: `write`, with the plain case at hand."""

    def emit(value: Any, activity: int | None, stamp: float | None) -> None:
        if worker.busy == "firing" and worker.written is None and value is not None and type(value) is not Token:
            worker.write(position, (value, activity, stamp))
        else:
            write(worker, position, value, activity, stamp)

    return emit


def write(worker: RunningNode, position: int, value: object, activity: int | None, stamp: float | None) -> None:
    """A node's code writes to an output: it leaves when the firing is over (F3).

    Raises:
      UsageError: outside a firing, which includes slot handlers (F9), or twice in one firing.
    """
    if worker.busy not in ("firing", "ending") and (worker.region is None or not worker.region.is_sending(worker)):
        called = worker.busy == "call" or (not worker.busy and worker.stamp is not None)  # the fast path of calls
        where = "in a slot handler" if called else "outside a firing"
        raise UsageError(
            f'output "{worker.path}.{worker.out_names[position]}" was written {where}: outputs belong to process() and '
            "end(); trigger an event instead"
        )
    entry = entry_of(worker, position, worker.written, value, activity, stamp)
    if entry is not None:
        worker.write(position, entry)


def entry_of(
    worker: RunningNode, position: int, written: list[Any] | None, value: Any, activity: int | None, stamp: float | None
) -> tuple[Any, int | None, float | None] | None:
    """Return the entry of a first value for an output; None is silence (T2).

    Raises:
      UsageError: a value was written before.
    """
    if value is None:
        return None
    if written is not None and written[position] is not None:
        raise UsageError(
            f'output "{worker.path}.{worker.out_names[position]}" was written twice in one firing: it takes one token, '
            "merge the values or use an event"
        )
    return unwrapped(value, activity, stamp)
