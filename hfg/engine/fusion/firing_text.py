"""The text of one firing in a wave: whether it is silent, what it runs, and what it sends. Depends on `facts`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hfg.engine.fusion.facts import Facts

__all__ = ["FiringText"]


class FiringText(Facts):
    """Writes the lines of members."""

    # --- a member ---------------------------------------------------------------------------------------------------

    def _member(self, k: int) -> None:
        """One member: outsiders before it, then its firing or call."""
        if k in self.called or self.order[k].is_async or self._sends_itself(self.order[k]):
            self.taps.emit()  # its code may send something itself, or others may have a turn
        if k in self.schedule.between:
            self.taps.emit()
            self._stops_if("waiting", f"region.turns({k})", k)
        if k in self.called:
            self._slot_call(k)
            return
        if self.fires_with_slots(k) and not self.schedule.behind[k]:
            self.taps.emit()
            self._stops_if(f"w{k}.fireable" if k in self.pending else f"c{k}", f"region.calls_first({k})", k)
        if k in self.pending:
            self.say(f"w{k}.queued = False")
        worker = self.order[k]
        edges = {edge.position: edge for edge in worker.live_inputs}
        arguments = [self._argument(k, at, edges.get(at)) for at in range(len(worker.unset))]
        needed = [self.schedule.local(edge) for edge in worker.live_inputs if edge.mandatory]
        if needed:
            silences = [f"{value} is None" for value in dict.fromkeys(needed) if self._may_be_silent(value)]
        else:
            silences = [" and ".join(f"{self.schedule.local(edge)} is None" for edge in worker.live_inputs)]
        self._firing(k, f"f{k}({', '.join(arguments)})", silences)

    def _stops_if(self, asked: str, call: str, p: int) -> None:
        """Others move before member p; they may raise a flag, or run a wave of their own, which flags mean then."""
        self.say(f"if {asked}:")
        self.indent += 1
        self.say(f"if {call}: return region.stop({p}, locals())")
        self._register()
        self.indent -= 1

    def _register(self) -> None:
        """From here on flags let this wave forget; one that was raised just before did not."""
        if self.forgets:
            self.say("flags.forget = forget")
            self.say("if flags: forget()")

    def _slot_call(self, k: int) -> None:
        """A slot that an output feeds: a marker is processed at once, the handler is not called (T4, F6)."""
        say, value = self.say, self.schedule.local(self.order[k].slot_edges[0])
        say(f"if {value} is not None:")
        self.indent += 1
        say(f"core.running_node = w{k}; w{k}.busy = 'call'; w{k}.stamp = stamp")
        for giver in self._givers(k):
            say(f"if m{giver}: region.receive({k}, stamp, 'call')")
        self.taps.before_call(k)
        say(f"r{k} = f{k}({value})", k)
        say(f"w{k}.busy = {self._amid()}; w{k}.stamp = None")
        told = f"w{k}.may_carry or w{k}.events_due"
        unusual = f"flags{self._unusual()} or type(r{k}) in EXCEPTIONAL"
        say(f"if {unusual if self.turns else f'{unusual} or {told}'}: return region.leave({k}, locals())")
        if self.turns:
            say(f"if {told}: region.finish({k})")
        self.indent -= 1
        say(f"else: silent[{k}] += 1")

    def _argument(self, k: int, at: int, edge: Any) -> str:
        """P6: an absent optional input takes its default."""
        if edge is None:
            return f"d{k}_{at}"
        value = self.schedule.local(edge)
        return value if edge.mandatory else f"(d{k}_{at} if {value} is None else {value})"

    def _may_be_silent(self, value: str) -> bool:
        """Whether the wave can continue with this value missing; otherwise it has ended before this member."""
        return int(value[1:].partition("_")[0]) not in self.over_if_silent

    # --- a firing ---------------------------------------------------------------------------------------------------

    def _firing(self, k: int, call: str, silences: Sequence[str]) -> None:
        """A firing is silent (F4, A11) or a call; what it takes acts in both (A6), after the gate was looked at."""
        say, worker = self.say, self.order[k]
        gates = [] if worker.is_source else [f"not g{k}_{number}.active" for number in range(len(worker.gates_over))]
        silence = " or ".join([*silences, *gates])
        if self._may_take(k) and gates:
            say(f"quiet = {silence}")
            silence = "quiet"
        self._receive(k)
        if not silence:
            self._call(k, call, within=False)
            self._fired(k)
            return
        told = self.taps.branch()
        say(f"if {silence}:")
        self.indent += 1
        ends = self._be_silent(k)
        self.indent -= 1
        self.taps.other_branch(told)
        if ends:
            self._call(k, call, within=False)
        else:
            say("else:")
            self.indent += 1
            self._call(k, call, within=True)
            self.indent -= 1
        self._fired(k)

    def _receive(self, k: int) -> None:
        """A6: what carries activity acts when it is taken."""
        if not self._may_take(k):
            return
        if k:
            asked = " or ".join(f"m{giver}" for giver in self._givers(k))
            self.say(f"if {asked}: region.receive({k}, stamp)")
        else:
            tokens = [f"token{number}" for number in range(len(self.entries))]
            asked = " or ".join(f"{token}.activity" for token in tokens)
            self.say(f"if {asked}: region.receive_at(0, ({', '.join(tokens)},), stamp)")

    def _be_silent(self, k: int) -> bool:
        """Write a silent firing. Return whether it ends the wave, because all later members are silent too."""
        say, worker = self.say, self.order[k]
        self._meet(k, "mute")
        if self._silences_all_behind(k) and not self.fires_with_slots(k):
            count = f"spread[{k - 1}] += 1" if k else "silent[0] += 1; spread[0] += 1"
            self._over_by_silence(k, count, [f"w{k}.busy"] if self._may_take(k) else [])
            if self._is_over_by_silence(k):
                return True
        say(" = ".join([*(f"v{k}_{output}" for output in range(max(1, len(worker.out_names)))), "None"]))
        say(f"silent[{k}] += 1")
        if self._gives_inside(k):
            say(f"m{k} = False")
        self._put(k, silent=True)
        if self._odd_sending(k):
            self.taps.emit()  # as the call does before it sends: the lines after both know nothing that is not told
        self._enable(k)
        if self._may_take(k):
            say(f"if w{k}.busy: region.finish({k})")
        return False

    def _over_by_silence(self, k: int, count: str, odd: list[str]) -> None:
        """The wave is over, because all members after k are silent.

        Unless calls wait there, which have their turns, or activity lies there, which is taken in silence too.

        Args:
          k: the member.
          count: the line that counts it.
          odd: what else keeps the wave from being over.
        """
        say = self.say
        odd = [*odd, *self._on_its_way(k)]
        odd += [f"c{j}" for j in range(k + 1, len(self.order)) if self.fires_with_slots(j)]
        if odd:
            say(f"if not ({' or '.join(odd)}):")
            self.indent += 1
        say(count)
        for t in range(k, len(self.order)):
            for number, (edge, _, to) in enumerate(self.outs[t]):
                if to is None and edge.target_kind == "slot":  # silence passes it without a trace but its number (T4)
                    say(f"e{t}_{number}.sent += 1")
        told = self.taps.branch()
        if self.loops:
            self._end_of_wave()
            say("continue")
        else:
            self.taps.emit()
            say("return region.over(done + 1)")
        self.taps.other_branch(told)
        if odd:
            self.indent -= 1

    def _call(self, k: int, call: str, *, within: bool) -> None:
        """Call a member, check its result, and send it."""
        worker = self.order[k]
        if not k and self.head.options.max_rate_hz and not self.head.group.threaded:  # silent ones do not count (F11)
            self.say("worker.rate.start(now(), worker.options.max_rate_hz)")
        self.taps.before_call(k)
        if self._sends_itself(worker):
            self._announce(k)
        if self.measured:
            self.say("began = monotonic()")
        if worker.is_async:
            call = f"await {call}"
        self.say(f"{'v' if self.single[k] else 'r'}{k}{'_0' if self.single[k] else ''} = {call}", k)
        if self.measured:
            self._measure(k)
        if not self.single[k]:
            self._spread_out(k)
        elif worker.out_names:
            self._guard(k, within=within)
        else:
            self.say(f"if v{k}_0 is not None or flags{self._unusual()}: return region.leave({k}, locals())")
        self._meet(k, "leave")
        self._send(k)

    def _measure(self, k: int) -> None:
        self.say("ended = monotonic()")
        delay = "" if self.is_source and not k else ", ended + epoch - stamp" if self.real else ", now() - stamp"
        if self.order[k].is_async:  # while it waited, others ran, so it kept none of them waiting
            delay = f"{delay or ', None'}, 0.0 if region.detached or region.amid else None"
        self.say(f"took{k}(ended - began{delay})")

    def _announce(self, k: int) -> None:
        """Say that the member runs, because its code may send by itself."""
        self.say(f"core.running_node = w{k}; w{k}.busy = 'firing'; w{k}.stamp = stamp")

    def _unusual(self) -> str:
        return " or region.detached or region.called_off" if self.is_async else ""

    def _amid(self) -> str:
        """What a member is when its call is over: busy with all others, if the wave gives way."""
        return "region.amid" if self.is_async else "''"

    def _guard(self, k: int, *, within: bool) -> None:
        """One value or none; code that sends by itself may have written it instead."""
        say, value = self.say, f"v{k}_0"
        asked = "" if self.forgets else f" or flags{self._unusual()}"
        writes = self._sends_itself(self.order[k])
        say(f"if type({value}) is not t{k}{asked}{f' or w{k}.written is not None' if writes else ''}:")
        self.indent += 1
        say(f"if flags or type({value}) in EXCEPTIONAL{self._unusual()}: return region.leave({k}, locals())")
        if writes:
            say(f"if w{k}.written is not None:")
            say(f"    values = values_of(region, {k}, {value})", k)
            say(f"    if values is None: return region.leave({k}, locals())")
            say(f"    {value} = values[0]; w{k}.written = None")
        say(f"if {value} is not None: t{k} = type({value})")
        if not within:
            self._end_if_silent(k)
        self.indent -= 1

    def _end_if_silent(self, k: int) -> None:
        """The member is silent, which silences all later members."""
        worker = self.order[k]
        if worker.shape.announced or self.fires_with_slots(k) or not self._silences_all_behind(k):
            return
        odd = [f"w{k}.may_carry", f"w{k}.events_due"] if self._sends_itself(worker) else []
        odd += [f"w{k}.busy"] if self._may_take(k) and not odd else []
        self.say("else:")
        self.indent += 1
        if self._sends_itself(worker):
            self.say(f"if not ({' or '.join(odd)}):")
            self.say(f"    w{k}.busy = ''; w{k}.stamp = None")
        self._over_by_silence(k, f"spread[{k}] += 1", odd)
        if self._is_over_by_silence(k) and not odd:
            self.over_if_silent.add(k)
        self.indent -= 1

    def _spread_out(self, k: int) -> None:
        """Several outputs, or sent by the code itself."""
        say, worker = self.say, self.order[k]
        told = f" or w{k}.may_carry" if self._sends_itself(worker) and not self.turns else ""
        say(f"if flags{told}{self._unusual()}: return region.leave({k}, locals())")
        if worker.out_names:
            say(f"values = values_of(region, {k}, r{k})", k)
            say(f"if values is None: return region.leave({k}, locals())")
        else:
            say(f"if r{k} is not None: return region.leave({k}, locals())")
        for output in range(len(worker.out_names)):
            say(f"v{k}_{output} = values[{output}]")

    # --- what leaves ------------------------------------------------------------------------------------------------

    def _meet(self, k: int, how: str) -> None:
        """F9: calls that wait where member k enables a firing come first; while others have turns before, by rules."""
        met = [f"c{j}" for j in self.schedule.enables[k] if self.fires_with_slots(j) and self.schedule.behind[j]]
        if how == "leave":
            outputs = [
                output for number, (_, output, _) in enumerate(self.outs[k]) if (k, number) in self.schedule.calls
            ]
            met += [f"v{k}_{output} is not None" for output in dict.fromkeys(outputs)]
        if met:
            self.say(f"if {' or '.join(met)}: return region.{how}({k}, locals())")

    def _end_of_wave(self) -> None:
        """Is there another wave at once?"""
        raise NotImplementedError

    def _send(self, k: int) -> None:
        """Send the results of a firing; the region does it where activity leaves too or events follow."""
        say, worker = self.say, self.order[k]
        writes = self._sends_itself(worker)
        if writes and worker.out_names and not self.single[k]:
            say(f"w{k}.written = None")  # after the last guard: a side exit would not find it
        odd = self._odd_sending(k)
        if not odd:
            self._put(k)
            self._enable(k)
        else:
            self.taps.emit()
            values = ", ".join(f"v{k}_{output}" for output in range(len(worker.out_names)))
            gives_inside = self._gives_inside(k)
            say(f"if {odd}:")
            self.indent += 1
            told = self.taps.branch()
            say(f"{f'm{k} = ' if gives_inside else ''}region.send({k}, ({values}{',' if values else ''}), stamp, done)")
            self.indent -= 1
            self.taps.other_branch(told)
            say("else:")
            self.indent += 1
            self._put(k)
            self.taps.emit()
            say(f"m{k} = False" if gives_inside else "pass")
            self._enable(k)
            if self._hands_over(k):
                say(f"if {self._gives_away(k)}:")
                say(f"    w{k}.active = w{k}.node._active = False")
                say(f"    w{k + 1}.active = w{k + 1}.node._active = True")
            self.indent -= 1
        if writes:
            self._finish(k)

    def _finish(self, k: int) -> None:
        """Its firing is over: its automatic events follow, and the right of A3 ends."""
        if self.turns and not self._odd_sending(k):
            self.say(f"if w{k}.events_due: region.finish({k})")
            self.say(f"w{k}.may_carry = False")
        self.say(f"w{k}.busy = {self._amid()}; w{k}.stamp = None")

    def _put(self, k: int, *, silent: bool = False) -> None:
        """Put tokens on the edges that leave the region. Inside, only a tap gets one."""
        heard: set[int] = set()
        for number, (_, output, to) in enumerate(self.outs[k]):
            value = "NO_MESSAGE" if silent else f"NO_MESSAGE if v{k}_{output} is None else v{k}_{output}"
            if output in self._heard_outputs(k):
                if output not in heard:
                    heard.add(output)
                    self.taps.emit()
                    how = f"region.put_heard({k}, {output}, " if self.turns else f"put_heard(heard{k}_{output}, "
                    self.say(f"{how}{value}, stamp)")
            elif to is None:
                self._put_out(k, number, value)
            else:
                self.taps.passed(k, number, output)
        if self.is_async and (heard or any(to is None for _, _, to in self.outs[k])):
            self.say("if region.amid: region.sent_on()")

    def _put_out(self, k: int, number: int, value: str) -> None:
        """Over one edge; silence into a slot leaves no more than a number (T4)."""
        say = self.say
        edge, output, _ = self.outs[k][number]
        if edge.tap is not None:
            self.taps.emit()
        elif self.turns and edge.target_kind == "slot":
            if value == "NO_MESSAGE":
                say(f"e{k}_{number}.sent += 1")
                return
            say(f"if v{k}_{output} is None: e{k}_{number}.sent += 1")
            say("else:")
            self.indent += 1
            self._put_token(k, number, f"v{k}_{output}")
            self.indent -= 1
            return
        self._put_token(k, number, value)

    def _put_token(self, k: int, number: int, value: str) -> None:
        self.say(f"put(e{k}_{number}, {value}, 0, stamp)")
        if self.turns and self.outs[k][number][0].depth_first:
            self.say(f"if next_in_wave: region.note({k}, {number})")

    def _enable(self, k: int) -> None:
        """Those that the sending has enabled have their places from now on."""
        say = self.say
        for j in self.schedule.enables[k]:
            if j not in self.pending:
                continue
            if not self.schedule.behind[j]:  # else that was a side exit
                say(f"if c{j}: region.expect({j})")
                say(f"else: w{j}.queued = True")
            else:
                say(f"w{j}.queued = True")  # calls that come now have their turn after its firing (F9)

    def _fired(self, k: int) -> None:
        """The firing is over: calls that came meanwhile have their places."""
        if not self.fires_with_slots(k):
            return
        self.taps.emit()
        if k + 1 < len(self.order):  # after the last one, the head goes first, because its outputs are free then (F5)
            self._stops_if(f"c{k}", f"region.call_again({k})", k + 1)
