"""Writes the function that runs one wave of a region: straight-line Python, one line per call.

What is known when the region is formed is text; what depends on the region's objects comes in as closures, so that
regions of one shape share their compiled code. A member's values are locals, `v3_0` for the first output of member 3;
`None` is NO_MESSAGE. After each call comes one guard: the result has the same type as the last one. A raised flag makes
the wave forget these types, so the same guard notices flags (`Flags`). Everything else is a side exit of the region.

Facts that rarely change are checked where the rules check them, by one attribute: whether a gate is open
(`g3_0.active`), whether a member that could pass its activity on has any (`w3.active`), whether calls wait (`c3`). If
so, the region does the rest (see `turns`), and the wave continues.

The line says which call raised, and which one is in progress. Depends on `firing_text`.
"""

from __future__ import annotations

from hfg.engine.fusion.binding import TOOLS
from hfg.engine.fusion.firing_text import FiringText
from hfg.ports.edges import ACTIVITY, EventEdge, SyncEdge

__all__ = ["Writer"]


class Writer(FiringText):
    """Writes the text of one wave; `calls` says afterwards which line calls which member."""

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

    # --- what the text uses again and again -------------------------------------------------------------------------

    def _bindings(self) -> None:
        """Of the run, of each entry, of each member: found once."""
        say = self.say
        say(f"def build(region, names, {TOOLS}):")
        self.indent = 1
        say("core, head, now, epoch, flags = names.core, names.head, names.now, names.epoch, names.flags")
        say("queue, ready, inputs, outputs = names.queue, names.ready, head.inputs, head.outputs")
        say("silent, spread, next_in_wave = region.silent, region.spread, core.next_in_wave")
        if self.turns:
            say("waiting = region.waiting")
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
        """One member: its code, the defaults of absent inputs (P6), where its outputs cross the border, its gates."""
        say, worker = self.say, self.order[k]
        if k or not self.is_generator:
            say(f"f{k} = names.calls[{k}]")
        say(f"w{k} = names.workers[{k}]")
        if self.measured:
            say(f"took{k} = names.took[{k}]")
        if self.fires_with_slots(k):
            say(f"c{k} = names.waiting_calls[{k}]")
        for number in range(len(worker.gates_over)):
            say(f"g{k}_{number} = names.states[{k}][{number}]")
        for at in self._with_default(k):
            say(f"d{k}_{at} = names.unset[{k}][{at}]")
        for output in self._heard_outputs(k):
            say(f"heard{k}_{output} = names.listeners[{k}][{output}]")
        for number, (_, output, to) in enumerate(self.outs[k]):
            if to is None and output not in self._heard_outputs(k):
                say(f"e{k}_{number} = names.edges[{k}][{number}]")

    def _with_default(self, k: int) -> list[int]:
        """Which inputs of a member may be absent; a source that leads has none."""
        worker = self.order[k]
        fed = {edge.position for edge in worker.live_inputs if edge.mandatory}
        return [at for at in range(len(worker.unset)) if at not in fed and (k or not self.is_source)]

    # --- the beginning and the end of a wave ------------------------------------------------------------------------

    def _entrance(self) -> None:
        """May a wave run at all? Else the interpreted way."""
        say = self.say
        say("def step(worker):" if self.is_async else "def wave(worker):")
        self.indent = 2
        if not self.is_async:
            self._nonlocal()
        say(f"if {' or '.join(self._odd())}: return region.decline(worker)")
        say("worker.queued = worker.fireable = False")
        say("region.running = True")
        self._register()
        say("core.running_node = worker")
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

    def _odd(self) -> list[str]:
        """Return the conditions under which the head's next piece of work is not a wave."""
        odd = ["worker.busy", "not worker.fireable"]
        if self.fires_with_slots(0):
            odd.append("(c0 and worker.calls_before)")
        if self.is_generator:
            odd.append("worker.execution.generator is None")
        elif not self.is_source:
            odd.append("inputs.missing")
        for number, edge in enumerate(self.entries):
            if type(edge) is EventEdge:
                odd.append(f"not entry{number}.live")
            if not self.turns:
                odd.append(f"entry{number}.{'token.activity' if type(edge) is SyncEdge else f'queue[0][{ACTIVITY}]'}")
        if not self.turns and self.carries(0):
            odd.append("worker.active")
        if not self._may_be_mute():
            odd.append("worker.special")
        odd.append("not (region.armed or region.arm())")
        if self._may_be_mute():  # the last of all, for from then on nothing tells that the firing is not ordinary
            odd.append("(worker.special and not region.may_go_on())")
        return odd

    def _may_be_mute(self) -> bool:
        """Whether a wave may begin although values are missing at the head; each later member then sees the silence."""
        return self.turns and not self.is_source and all(type(edge) is SyncEdge for edge in self.entries)

    def _nonlocal(self) -> None:
        if self._kinds():
            self.say(f"nonlocal {', '.join(self._kinds())}")

    def _head(self) -> None:
        say = self.say
        if self.is_source:
            say("stamp = monotonic() + epoch" if self.real else "stamp = now()")
            if self.loops:  # the slice is over: the pump is to look round, not to come back at once
                say("if stamp > until and done: flags.append('slice'); break")
            self._firing(0, "next(generator)" if self.is_generator else "f0()", [])
            return
        self._take()
        numbers = range(len(self.entries))
        if len(self.entries) == 1:
            say("stamp = token0.stamp")
        elif self._may_be_mute():
            say(f"stamp = newest(({', '.join(f'token{number}' for number in numbers)}), 0.0)")
        else:
            say(f"stamp = max({', '.join(f'token{number}.stamp' for number in numbers)})")
        given, needed = {}, []
        for number, edge in enumerate(self.entries):
            value = f"token{number}.value"
            absent = f"{value} is NO_MESSAGE"
            needed += [absent] if edge.mandatory else []
            spare = self._may_be_mute() and not edge.mandatory
            given[edge.position] = f"(d0_{edge.position} if {absent} else {value})" if spare else value
        if not needed:
            needed = [" and ".join(f"token{number}.value is NO_MESSAGE" for number in numbers)]
        arguments = [given.get(at, f"d0_{at}") for at in range(len(self.head.unset))]
        self._firing(0, f"f0({', '.join(arguments)})", needed if self._may_be_mute() else [])

    def _take(self) -> None:
        """The head takes what lies before it (F3)."""
        say = self.say
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

    def _end_of_wave(self) -> None:
        """Start the next wave immediately, but only if no other node of the group waits: first in, first out (R2)."""
        say = self.say
        self.taps.emit()
        say("done += 1")
        if not self.loops:
            return
        stop = ["queue", "ready", "flags", "worker.blocked", *self.last_calls]
        stop += ["region.amid"] if self.is_async else []
        if not self.is_source:
            stop += ["inputs.missing", "worker.special", "now() > core.until"]
            stop += [] if self.turns else [f"entry0.queue[0][{ACTIVITY}]"]
        if self.has_border:
            stop += ["outputs.missing", "next_in_wave"]  # whom a buffer has enabled goes before the next wave (R2)
            stop += ["waiting"] if self.turns else []
        say(f"if {' or '.join(stop)}: break")

    def _may_go_on_at_once(self) -> bool:
        """Whether what follows a wave is plain: of a source on the loop whose wave leaves nothing outside."""
        apart = self.head.group.threaded or self.head.paced
        return self.is_source and not (apart or self.is_async or self.measured or self.has_border)

    def _go_on_at_once(self) -> None:
        """Where nothing unusual has come the source has its next turn: what `over` would find, without a call."""
        say = self.say
        odd = ["flags", "worker.blocked", "worker.fireable", "worker.queued", "region.doomed", *self.last_calls]
        say(f"if not ({' or '.join(odd)} or next_in_wave):")
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
