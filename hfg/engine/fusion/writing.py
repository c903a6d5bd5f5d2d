"""Writes the function that runs one wave of a region: straight-line Python, one line a call.

What is known when the region is formed is text; what depends on the region's objects comes in as closures, so that
regions of one shape share their compiled code. A member's values are locals, `v3_0` for the first output of member 3;
`None` is NO_MESSAGE. Behind each call stands one guard: the type of the result is that of the last one. Who raises a
flag lets the wave forget these types, so the guard notices that, too (`Flags`). Everything else is a side exit of the
region.

Which call raised, and which one is under way, is told by the line; the lines are known to `linecache`, so a traceback
and a debugger show which node it is. Stands on `schedule`.
"""

from __future__ import annotations

import functools
import itertools
import linecache
from collections.abc import Callable
from time import monotonic
from types import CodeType, CoroutineType
from typing import Any, NamedTuple, Protocol

from hfg.base.token import NO_MESSAGE, Token
from hfg.engine.fusion.schedule import Schedule, asks_who_hears
from hfg.engine.fusion.tap_writing import Passed, TapWriter
from hfg.engine.model import Core, RunningNode
from hfg.engine.model.core import Flags
from hfg.engine.rules.firing import take
from hfg.engine.rules.releasing import make_room, release
from hfg.engine.rules.sending import put
from hfg.ports.edges import ACTIVITY, BufferEdge, EventEdge, SyncEdge

__all__ = ["Fusible", "Wave", "Writer", "write_wave"]

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
    activity_senders: list[RunningNode]
    core: Core
    flags: Flags

    @property
    def head(self) -> RunningNode:
        """Whose step runs the wave."""


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


def write_wave(region: Fusible, writer: Writer, *, to: Any = None) -> Wave:
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
    bound = names["build"](to or region, _Names(region, measured, writer.taps), *_TOOLS)
    return Wave(bound[0], writer.calls, bound[1].__code__, writer.taps.untold)


class _Names:
    """What the text of a wave takes from its region, by the number of the member."""

    def __init__(self, region: Fusible, measured: bool, taps: TapWriter) -> None:
        core = region.core
        host: Any = core.runtime
        order = region.order
        self.core = core
        self.head = region.head
        self.now = core.now
        self.epoch = host.epoch
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


def _code_of(worker: RunningNode) -> Any:
    """What a call of the member runs; who measures wraps handlers, and measures functions by the wave."""
    if worker.slot_edges:
        return worker.slot_edges[0].handler
    return worker.process if worker.meter is None else worker.meter.code


def _take_queued(edge: BufferEdge | EventEdge) -> Token[Any]:
    """The oldest token of an edge with a queue, with all that follows from its being taken."""
    token = take(edge)
    make_room(edge)
    return token


def _values(region: Fusible, k: int, result: Any) -> list[Any] | None:
    """What member k has sent, or gives back, by output; None if that is not plain: a modifier or stamp, or twice."""
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
    worker.take_written()
    return values


def _put_heard(listeners: Any, value: Any, stamp: float) -> None:
    """Put a token on the edges of an output to those who hear it now (T4)."""
    for edge in listeners.who_hear():
        put(edge, value, 0, stamp)


_TOOLS = (_EXCEPTIONAL, NO_MESSAGE, Token, monotonic, put, release, _put_heard, _take_queued, _values)
_TOOL_NAMES = "EXCEPTIONAL, NO_MESSAGE, Token, monotonic, put, release, put_heard, take_queued, values_of"


@functools.lru_cache(maxsize=512)
def _compiled(text: str) -> CodeType:
    return compile(text, "<hfg region>", "exec")


def _renamed(code: CodeType, name: str) -> CodeType:
    """The same code under a name of its own, so that its lines can be told from those of other regions."""
    constants = tuple(_renamed(one, name) if isinstance(one, CodeType) else one for one in code.co_consts)
    return code.replace(co_filename=name, co_consts=constants)


def _show(name: str, text: str, calls: dict[int, int], paths: list[str]) -> None:
    """Let tracebacks and debuggers show the lines, each call with the path of its node."""
    shown = text.splitlines(keepends=True)
    for line, member in calls.items():
        shown[line - 1] = f'{shown[line - 1].rstrip()}  # node "{paths[member]}"\n'
    linecache.cache[name] = (len(text), None, shown, name)  # at once: nobody asks a loader for a name in <>
    _shown[name] = None
    while len(_shown) > _KEPT_SOURCES:
        oldest = next(iter(_shown))
        del _shown[oldest]
        linecache.cache.pop(oldest, None)


class Writer:
    """Writes the text of one wave; `calls` says afterwards which line calls which member."""

    def __init__(self, region: Fusible, measured: bool) -> None:
        self.order = region.order
        self.schedule = region.schedule
        self.outs = region.schedule.outs
        self.position = region.schedule.position
        self.entries = region.entries
        self.measured = measured
        self.head = self.order[0]
        self.is_source = self.head.is_source
        self.is_generator = self.is_source and self.head.type.process_kind == "generator"
        self.has_border = bool(region.border)
        self.carries = self.head in region.activity_senders
        self.is_async = any(worker.is_async for worker in self.order)
        host: Any = region.core.runtime
        self.real = host.epoch is not None  # time goes on while code runs
        self.loops = self.real and not self.head.paced and (self.is_source or self._one_queue())
        self.called = region.schedule.called
        self.single = [self._is_single(worker) for worker in self.order]
        self.over_if_silent: set[int] = set()  # behind whose silence no code of the wave runs
        self.taps = TapWriter(self.outs, self.say, real=self.real)
        self.forgets = bool(self._kinds()) and not self.is_async  # who gives way is not the one that was entered last
        self.lines: list[str] = []
        self.calls: dict[int, int] = {}
        self.indent = 0

    def _one_queue(self) -> bool:
        return len(self.entries) == 1 and type(self.entries[0]) is EventEdge

    def _is_single(self, worker: RunningNode) -> bool:
        """What it gives back is the value of its one output, or nothing."""
        return not worker.slot_edges and not self._sends_itself(worker) and worker.type.result in ("none", "single")

    def _sends_itself(self, worker: RunningNode) -> bool:
        """Whether its code triggers or sends by itself, so that the worker has to say that it runs."""
        kind = worker.type
        return worker.sends_itself or (not worker.silent_code and (bool(kind.events) or kind.result == "fields"))

    def say(self, text: str, call: int | None = None) -> None:
        """Write a line; `call`: the member whose code it calls."""
        self.lines.append("    " * self.indent + text)
        if call is not None:
            self.calls[len(self.lines)] = call

    # --- the parts, in the order of the text --------------------------------------------------------------------------

    def write(self) -> str:
        """The whole text."""
        self._bindings()
        self._entrance()
        self.say("try:")
        self.indent += 1
        if self.loops:
            self.say("while True:")
            self.indent += 1
        self._head()
        for k in range(1, len(self.order)):
            self._member(k)
        self._end_of_wave()
        self._exit()
        return "\n".join(self.lines) + "\n"

    def _bindings(self) -> None:
        """What the text uses again and again is found once: of the run, of each entry, of each member."""
        say = self.say
        say(f"def build(region, names, {_TOOL_NAMES}):")
        self.indent = 1
        say("core, head, now, epoch, flags = names.core, names.head, names.now, names.epoch, names.flags")
        say("queue, ready, inputs, outputs = names.queue, names.ready, head.inputs, head.outputs")
        say("silent, spread = region.silent, region.spread")
        if self.is_async:
            say("start = region.start")
        for number in range(len(self.entries)):
            say(f"entry{number} = names.entries[{number}]")
        for number, edge in enumerate(self.entries):
            if self._is_pipelined(edge):
                say(f"pipelined{number} = (entry{number},)")
        for k in range(len(self.order)):
            self._bindings_of(k)
        self.taps.bind()
        kinds = self._kinds()
        if kinds:
            say(" = ".join([*kinds, "None"]))  # the types of the last results
        if self.forgets:
            say("def forget():")
            say(f"    nonlocal {', '.join(kinds)}")
            say(f"    {' = '.join([*kinds, 'None'])}")

    def _bindings_of(self, k: int) -> None:
        """One member: its code, the defaults of absent inputs (P6), and where its outputs cross the border."""
        say, worker = self.say, self.order[k]
        if k or not self.is_generator:
            say(f"f{k} = names.calls[{k}]")
        if self._sends_itself(worker) or k in self.called:
            say(f"w{k} = names.workers[{k}]")
        elif not self.single[k]:
            say(f"split{k} = names.splits[{k}]")
        if self.measured:
            say(f"took{k} = names.took[{k}]")
        for at in self._with_default(k):
            say(f"d{k}_{at} = names.unset[{k}][{at}]")
        for output in range(len(worker.out_edges)):
            if asks_who_hears(worker, output):
                say(f"heard{k}_{output} = names.listeners[{k}][{output}]")
        for number, (_, output, to) in enumerate(self.outs[k]):
            if to is None and not asks_who_hears(worker, output):
                say(f"e{k}_{number} = names.edges[{k}][{number}]")

    def _with_default(self, k: int) -> list[int]:
        """Which inputs of a member may be absent; a source that leads has none."""
        worker = self.order[k]
        fed = {edge.position for edge in worker.live_inputs if edge.mandatory}
        return [at for at in range(len(worker.unset)) if at not in fed and (k or not self.is_source)]

    def _kinds(self) -> list[str]:
        return [f"t{k}" for k in range(len(self.order)) if self.single[k] and self.order[k].out_names]

    def _is_pipelined(self, edge: Any) -> bool:
        return type(edge) is SyncEdge and not edge.sequential

    def _entrance(self) -> None:
        """May a wave run at all? Else the interpreted way."""
        say = self.say
        if self.is_async:
            say("def step(worker):")
        else:
            say("def wave(worker):")
        self.indent = 2
        if not self.is_async:
            self._nonlocal()
        odd = ["worker.special", "worker.busy", "not worker.fireable"]
        odd += ["worker.active"] if self.carries else []
        if self.is_generator:
            odd.append("worker.execution.generator is None")
        elif not self.is_source:
            odd.append("inputs.missing")
        for number, edge in enumerate(self.entries):
            if type(edge) is SyncEdge:
                odd.append(f"entry{number}.token.activity")
            else:
                odd += [f"not entry{number}.live", f"entry{number}.queue[0][{ACTIVITY}]"]
        say(f"if {' or '.join(odd)} or not (region.armed or region.arm()): return region.decline(worker)")
        say("worker.queued = worker.fireable = False")
        say("region.running = True")
        self._register()
        say("core.running_node = worker")
        if self.head.paced:
            say("worker.rate.start(now(), worker.options.max_rate_hz)")
        if self.is_async:
            say("return start(waves(worker))")
            self.indent = 1
            say("async def waves(worker):")
            self.indent = 2
            self._nonlocal()
        say("done = 0")
        if self.is_generator:
            say("generator = worker.execution.generator")
            say("generator = getattr(generator, 'measured', generator)  # a wave measures by itself")
        if self.is_source and self.loops:
            say("until = core.until")

    def _register(self) -> None:
        """From here on flags let this wave forget; one that was raised just before did not."""
        if self.forgets:
            self.say("flags.forget = forget")
            self.say("if flags: forget()")

    def _nonlocal(self) -> None:
        if self._kinds():
            self.say(f"nonlocal {', '.join(self._kinds())}")

    def _head(self) -> None:
        say = self.say
        if self.is_source:
            say("stamp = monotonic() + epoch" if self.real else "stamp = now()")
            if self.loops:  # the slice is over: the pump is to look round, not to come back at once
                say("if stamp > until and done: flags.append('slice'); break")
            self._call(0, "next(generator)" if self.is_generator else "f0()")
            return
        for number, edge in enumerate(self.entries):
            if type(edge) is SyncEdge:
                say(f"token{number} = entry{number}.token")
                say(f"entry{number}.token = None")
            else:
                say(f"token{number} = take_queued(entry{number})")
            if self._is_pipelined(edge):  # in the order of the inputs, as the others are freed (F5)
                say(f"release(pipelined{number})")
        synchronous = sum(type(edge) is SyncEdge for edge in self.entries)
        if synchronous:
            say(f"inputs.missing += {synchronous}")
        if len(self.entries) == 1:
            say("stamp = token0.stamp")
        else:
            say(f"stamp = max({', '.join(f'token{number}.stamp' for number in range(len(self.entries)))})")
        given = {edge.position: f"token{number}.value" for number, edge in enumerate(self.entries)}
        arguments = [given.get(at, f"d0_{at}") for at in range(len(self.head.unset))]
        self._call(0, f"f0({', '.join(arguments)})")

    def _member(self, k: int) -> None:
        """One member: silent if what it needs is (F4), else a call."""
        if k in self.called or self.order[k].is_async or self._sends_itself(self.order[k]):
            self.taps.emit()  # its code may send something itself, or others may have a turn
        if k in self.called:
            self._slot_call(k)
            return
        say = self.say
        worker = self.order[k]
        edges = {edge.position: edge for edge in worker.live_inputs}
        arguments = [self._argument(k, at, edges.get(at)) for at in range(len(worker.unset))]
        call = f"f{k}({', '.join(arguments)})"
        needed = [self.schedule.local(edge) for edge in worker.live_inputs if edge.mandatory]
        if needed:
            tests = [f"{value} is None" for value in needed if self._may_be_silent(value)]
            silence = " or ".join(dict.fromkeys(tests))
        else:
            silence = " and ".join(f"{self.schedule.local(edge)} is None" for edge in worker.live_inputs)
        if not silence:
            self._call(k, call)
            return
        told = self.taps.branch()
        say(f"if {silence}:")
        self.indent += 1
        outputs = [f"v{k}_{output}" for output in range(max(1, len(worker.out_names)))]
        say(" = ".join([*outputs, "None"]))
        say(f"silent[{k}] += 1")
        self._put(k)
        self.indent -= 1
        self.taps.other_branch(told)
        say("else:")
        self.indent += 1
        self._call(k, call, within=True)
        self.indent -= 1

    def _slot_call(self, k: int) -> None:
        """A slot that an output feeds: a marker is processed at once, the handler is not called (T4, F6)."""
        say, value = self.say, self.schedule.local(self.order[k].slot_edges[0])
        say(f"if {value} is not None:")
        self.indent += 1
        say(f"core.running_node = w{k}; w{k}.busy = 'call'; w{k}.stamp = stamp")
        say(f"r{k} = f{k}({value})", k)
        say(f"w{k}.busy = {self._amid()}; w{k}.stamp = None")
        unusual = f"flags{self._unusual()} or type(r{k}) in EXCEPTIONAL or w{k}.may_carry or w{k}.events_due"
        say(f"if {unusual}: return region.leave({k}, locals())")
        self.indent -= 1
        say(f"else: silent[{k}] += 1")

    def _argument(self, k: int, at: int, edge: Any) -> str:
        """P6: an absent optional input takes its default."""
        if edge is None:
            return f"d{k}_{at}"
        value = self.schedule.local(edge)
        return value if edge.mandatory else f"(d{k}_{at} if {value} is None else {value})"

    def _may_be_silent(self, value: str) -> bool:
        """Whether the wave can go on with this value missing; else it has ended for all behind it."""
        return int(value[1:].partition("_")[0]) not in self.over_if_silent

    def _silences_all_behind(self, k: int) -> bool:
        """If it is silent, so is everybody behind it, and nothing of theirs or its own leaves the region or is seen."""
        if not self.single[k]:
            return False
        silent = {k}
        for t in range(k + 1, len(self.order)):
            fed = self.order[t].slot_edges or [edge for edge in self.order[t].live_inputs if edge.mandatory]
            if any(self.position[edge.source] in silent for edge in fed):
                silent.add(t)
        seen = self.taps.anybody_behind(k) or any(to is None for out in self.outs[k:] for _, _, to in out)
        return len(silent) == len(self.order) - k and not seen

    def _call(self, k: int, call: str, *, within: bool = False) -> None:
        """Call a member, look at what it gives back, and let that leave."""
        worker = self.order[k]
        self.taps.before_call(k)
        if self._sends_itself(worker):
            self._announce(k)
        if self.measured:
            self.say("began = monotonic()")
        if worker.is_async:
            call = f"await {call}"
        self.say(f"{'v' if self.single[k] else 'r'}{k}{'_0' if self.single[k] else ''} = {call}", k)
        if self.measured:
            self.say("ended = monotonic()")
            delay = "" if self.is_source and not k else ", ended + epoch - stamp" if self.real else ", now() - stamp"
            if worker.is_async:  # while it waited others ran: that kept nobody busy
                delay = f"{delay or ', None'}, 0.0 if region.detached or region.amid else None"
            self.say(f"took{k}(ended - began{delay})")
        if not self.single[k]:
            self._spread_out(k)
        elif worker.out_names:
            self._guard(k, within)
        else:
            self.say(f"if v{k}_0 is not None or flags{self._unusual()}: return region.leave({k}, locals())")
        self._put(k)

    def _announce(self, k: int) -> None:
        """What the member's code sends by itself is to find that the worker runs."""
        self.say(f"core.running_node = w{k}; w{k}.busy = 'firing'; w{k}.stamp = stamp")

    def _unusual(self) -> str:
        return " or region.detached or region.called_off" if self.is_async else ""

    def _amid(self) -> str:
        """What a member is when its call is over: busy with all others, if the wave gives way."""
        return "region.amid" if self.is_async else "''"

    def _guard(self, k: int, within: bool) -> None:
        say, value = self.say, f"v{k}_0"
        asked = "" if self.forgets else f" or flags{self._unusual()}"
        say(f"if type({value}) is not t{k}{asked}:")
        self.indent += 1
        say(f"if flags or type({value}) in EXCEPTIONAL{self._unusual()}: return region.leave({k}, locals())")
        say(f"if {value} is not None: t{k} = type({value})")
        if not within and self._silences_all_behind(k) and len(self.order) > k + 1:
            self.over_if_silent.add(k)
            say("else:")
            self.indent += 1
            say(f"spread[{k}] += 1")
            told = self.taps.branch()
            if self.loops:
                self._end_of_wave()
                say("continue")
            else:
                self.taps.emit()
                say("return region.over(1)")
            self.taps.other_branch(told)
            self.indent -= 1
        self.indent -= 1

    def _spread_out(self, k: int) -> None:
        """Several outputs, or sent by the code itself."""
        say, worker = self.say, self.order[k]
        if self._sends_itself(worker):
            say(f"if flags or w{k}.may_carry{self._unusual()}: return region.leave({k}, locals())")
        else:
            say(f"if flags{self._unusual()}: return region.leave({k}, locals())")
        if worker.out_names:
            say(f"values = values_of(region, {k}, r{k})", k)
            say(f"if values is None: return region.leave({k}, locals())")
        else:
            say(f"if r{k} is not None: return region.leave({k}, locals())")
        if self._sends_itself(worker):
            say(f"w{k}.busy = {self._amid()}; w{k}.stamp = None")
        for output in range(len(worker.out_names)):
            say(f"v{k}_{output} = values[{output}]")

    def _put(self, k: int) -> None:
        """Over the border of the region; who looks at an edge inside sees a token, which nobody else needs."""
        heard: set[int] = set()
        for number, (edge, output, to) in enumerate(self.outs[k]):
            value = f"v{k}_{output}"
            if asks_who_hears(self.order[k], output):
                if output not in heard:
                    heard.add(output)
                    self.taps.emit()
                    self.say(f"put_heard(heard{k}_{output}, NO_MESSAGE if {value} is None else {value}, stamp)")
            elif to is None:
                if edge.tap is not None:
                    self.taps.emit()
                self.say(f"put(e{k}_{number}, NO_MESSAGE if {value} is None else {value}, 0, stamp)")
            else:
                self.taps.passed(k, number, output)
        if self.is_async and (heard or any(to is None for _, _, to in self.outs[k])):
            self.say("if region.amid: region.sent_on()")

    def _end_of_wave(self) -> None:
        """Is there another wave at once? Only if nobody else waits for the group: waves are first in, first out."""
        say = self.say
        self.taps.emit()
        say("done += 1")
        if not self.loops:
            return
        stop = ["queue", "ready", "flags", "worker.blocked"]
        stop += ["region.amid"] if self.is_async else []
        if not self.is_source:
            stop += ["inputs.missing", "worker.special", f"entry0.queue[0][{ACTIVITY}]", "now() > core.until"]
        if self.has_border:
            stop += ["outputs.missing", "core.next_in_wave"]  # whom a buffer has enabled goes before the next wave (R2)
        say(f"if {' or '.join(stop)}: break")

    def _may_go_on_at_once(self) -> bool:
        """Whether what follows a wave is plain: of a source on the loop whose wave leaves nothing outside."""
        apart = self.head.group.threaded or self.head.paced
        return self.is_source and not (apart or self.is_async or self.measured or self.has_border)

    def _go_on_at_once(self) -> None:
        """Where nothing unusual has come the source has its next turn: what `over` would find, without a call."""
        say = self.say
        say("if not (flags or worker.blocked or worker.fireable or region.doomed or core.next_in_wave):")
        self.indent += 1
        say("region.running = False")
        say("region.waves += done")
        say("worker.fireable = worker.queued = True")
        say("push = worker.push")
        say("return push(worker)")
        self.indent -= 1

    def _exit(self) -> None:
        say = self.say
        self.indent = 2
        say("except BaseException as error:")
        say("    return region.caught(error, locals())")
        if self._may_go_on_at_once():
            self._go_on_at_once()
        say("return region.over(done)")
        self.indent = 1
        say("return (step, waves)" if self.is_async else "return (wave, wave)")
