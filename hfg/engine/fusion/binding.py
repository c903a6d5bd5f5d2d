"""Compiles the text of a wave, and binds it to what its region consists of.

Regions of one shape share their compiled code. The lines are known to `linecache`, so a traceback and a debugger show
which node it is. Depends on `schedule` and `tap_writing`.
"""

from __future__ import annotations

import functools
import itertools
import linecache
from collections.abc import Callable
from time import monotonic
from types import CodeType, CoroutineType
from typing import Any, Final, NamedTuple, Protocol

from hfg.base.token import NO_MESSAGE, Token
from hfg.engine.fusion.schedule import Schedule, is_only_called
from hfg.engine.fusion.tap_writing import Passed, TapWriter
from hfg.engine.model import Core, RunningNode
from hfg.engine.model.flags import Flags
from hfg.engine.rules.firing import newest_stamp, take
from hfg.engine.rules.putting import put
from hfg.engine.rules.releasing import make_room, release
from hfg.ports.edges import BufferEdge, EventEdge

__all__ = ["TOOLS", "Fusible", "Text", "Wave", "bind"]

_EXCEPTIONAL = frozenset({Token, CoroutineType})
"""Results that do not simply leave: a token passed on, code that is still to be awaited."""

_KEPT_SOURCES = 256
_numbers = itertools.count(1)
_shown: dict[str, None] = {}  # names of the newest sources that linecache knows


class Fusible(Protocol):
    """What is to be known of a region before the text of its wave is written; see `region.Region`."""

    order: list[RunningNode]
    schedule: Schedule
    entries: tuple[Any, ...]
    border: list[Any]
    takes_turns: bool
    activity_senders: list[RunningNode]
    core: Core
    flags: Flags

    @property
    def head(self) -> RunningNode:
        """Whose step runs the wave."""


class Text(Protocol):
    """The writer of a wave's text."""

    measured: bool
    calls: dict[int, int]
    taps: TapWriter

    def write(self) -> str:
        """The whole text."""


class Wave(NamedTuple):
    """The code of a region's wave.

    Attributes:
      step: runs a wave, or several; the step of the head.
      calls: which line calls which member.
      code: of the function in which the calls stand.
      untold: what has passed before the call of each member, and who looks was not told yet.
    """

    step: Callable[[RunningNode], None]
    calls: dict[int, int]
    code: CodeType
    untold: dict[int, list[Passed]]


def bind(region: Fusible, writer: Text, *, to: Any = None) -> Wave:
    """Compile and bind what is written for a region.

    Args:
      region: whose members are called.
      writer: of the text.
      to: what the wave turns to when it is over, and at its exits; the region, unless it runs elsewhere.
    """
    measured = writer.measured
    text = writer.write()
    name = f"<hfg region {next(_numbers)}> from {region.head.path}"  # (linecache passes over what ends with ">")
    _show(name, text, writer.calls, [worker.path for worker in region.order])
    names: dict[str, Any] = {}
    exec(_renamed(_compiled(text), name), names)
    bound = names["build"](to or region, _Names(region, measured, writer.taps), *_TOOLS.values())
    return Wave(bound[0], writer.calls, bound[1].__code__, writer.taps.untold)


class _Names:
    """Objects of the region that the text of a wave uses, by the number of the member."""

    def __init__(self, region: Fusible, measured: bool, taps: TapWriter) -> None:
        core = region.core
        host: Any = core.runtime
        order = region.order
        self.core = core
        self.head = region.head
        self.now = core.now
        self.epoch = host.time.epoch
        self.flags = region.flags
        self.queue = region.head.group.policy
        self.ready = core.ready_groups  # asked for by a wave at each of its ends
        self.entries = region.entries
        self.workers = order
        self.calls = [_code_of(worker) for worker in order]
        self.unset = [worker.unset for worker in order]
        self.edges = [[edge for edge, _, _ in out] for out in region.schedule.outs]
        self.looks = taps.looks
        self.batch = taps.batch
        self.listeners = [worker.listeners for worker in order]
        self.took = [worker.meter.took if measured else None for worker in order]
        self.splits = [worker.node._split for worker in order]
        self.states = [[gate.state for gate in worker.gates_over] for worker in order]
        self.waiting_calls = [worker.calls if worker.caller is None else worker.caller.queue for worker in order]


def _code_of(worker: RunningNode) -> Any:
    """Return the function that a call of the member runs.

    Statistics wrap handlers; functions are measured by the wave itself.
    """
    if is_only_called(worker):
        return worker.slot_edges[0].handler
    return worker.process if worker.meter is None else worker.meter.code


def _take_queued(edge: BufferEdge | EventEdge) -> Token[Any]:
    """The oldest token of an edge with a queue, with all that follows from its being taken."""
    token = take(edge)
    make_room(edge)
    return token


def _values(region: Fusible, k: int, result: Any) -> list[Any] | None:
    """Return the values that member k sent or returned, by output.

    None if they are not plain: one has a modifier or a stamp, or an output was written twice.
    """
    worker = region.order[k]
    written = worker.written
    if written is None:
        values = [None] * len(worker.out_edges) if result is None else list(worker.node._split(result))
        return None if any(type(value) in _EXCEPTIONAL for value in values) else values
    if result is not None:
        return None
    values = []
    for entry in written:  # (a loop, for generators would cost as much as the node)
        if entry is None:
            values.append(None)
            continue
        value, modifier, stamp = entry
        if modifier is not None or stamp is not None or type(value) in _EXCEPTIONAL:
            return None
        values.append(value)
    return values


def _put_heard(listeners: Any, value: Any, stamp: float) -> None:
    """Put a token on the edges of an output to those who hear it now (T4)."""
    for edge in listeners.who_hear():
        put(edge, value, 0, stamp)


_TOOLS = {
    "EXCEPTIONAL": _EXCEPTIONAL,
    "NO_MESSAGE": NO_MESSAGE,
    "Token": Token,
    "monotonic": monotonic,
    "newest": newest_stamp,
    "put": put,
    "put_heard": _put_heard,
    "release": release,
    "take_queued": _take_queued,
    "values_of": _values,
}
TOOLS: Final = ", ".join(_TOOLS)
"""Names of what the text of every wave may use."""


@functools.lru_cache(maxsize=512)
def _compiled(text: str) -> CodeType:
    return compile(text, "<hfg region>", "exec")


def _renamed(code: CodeType, name: str) -> CodeType:
    """Return the same code under its own name, which distinguishes its lines from those of other regions."""
    constants = tuple(_renamed(one, name) if isinstance(one, CodeType) else one for one in code.co_consts)
    return code.replace(co_filename=name, co_consts=constants)


def _show(name: str, text: str, calls: dict[int, int], paths: list[str]) -> None:
    """Let tracebacks and debuggers show the lines, each call with the path of its node."""
    shown = text.splitlines(keepends=True)
    for line, member in calls.items():
        shown[line - 1] = f'{shown[line - 1].rstrip()}  # node "{paths[member]}"\n'
    linecache.cache[name] = (len(text), None, shown, name)  # now: linecache asks no loader for a name in <>
    _shown[name] = None
    while len(_shown) > _KEPT_SOURCES:
        oldest = next(iter(_shown))
        del _shown[oldest]
        linecache.cache.pop(oldest, None)
