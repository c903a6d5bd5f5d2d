"""Facts about the members of a region, known before the text of its wave is written. Depends on `binding`."""

from __future__ import annotations

from typing import Any

from hfg.engine.fusion.binding import Fusible
from hfg.engine.fusion.schedule import asks_who_hears
from hfg.engine.fusion.tap_writing import TapWriter
from hfg.engine.model import RunningNode
from hfg.ports.edges import AnyEdge, EventEdge, SyncEdge

__all__ = ["Facts"]


class Facts:
    """The lines written so far, and what decides about the next ones; `calls` says which line calls which member."""

    def __init__(self, region: Fusible, measured: bool) -> None:
        self.order = region.order
        self.schedule = region.schedule
        self.outs = region.schedule.outs
        self.position = region.schedule.position
        self.fires_with_slots = region.schedule.fires_with_slots
        self.entries = region.entries
        self.measured = measured
        self.head = self.order[0]
        self.is_source = self.head.is_source
        self.is_generator = self.is_source and self.head.type.process_kind == "generator"
        self.has_border = bool(region.border)
        self.turns = region.takes_turns
        self.is_async = any(worker.is_async for worker in self.order)
        host: Any = region.core.runtime
        self.real = host.time.epoch is not None  # time passes while code runs
        self.loops = self.real and not self.head.paced and (self.is_source or self._one_queue())
        self.called = region.schedule.called
        self.senders = region.activity_senders
        self.single = [self._is_single(worker) for worker in self.order]
        self.over_if_silent: set[int] = set()  # members whose silence ends the wave
        self.taps = TapWriter(self.outs, self.say, real=self.real)
        self.forgets = bool(self._kinds()) and not self.is_async  # who gives way is not the one that was entered last
        self.last_calls = [f"c{len(self.order) - 1}"] if self.fires_with_slots(len(self.order) - 1) else []
        self.pending = {j for k in range(len(self.order)) for j in self.schedule.enables[k] if self._is_pending(k, j)}
        self.lines: list[str] = []
        self.calls: dict[int, int] = {}
        self.indent = 0

    def say(self, text: str, call: int | None = None) -> None:
        """Write a line; `call`: the member whose code it calls."""
        self.lines.append("    " * self.indent + text)
        if call is not None:
            self.calls[len(self.lines)] = call

    # --- what is known of a member ----------------------------------------------------------------------------------

    def _one_queue(self) -> bool:
        return len(self.entries) == 1 and type(self.entries[0]) is EventEdge

    def _is_single(self, worker: RunningNode) -> bool:
        """Whether it returns the value of its one output, or nothing."""
        plain = self.turns or not self._sends_itself(worker)
        return plain and self.position[worker] not in self.called and worker.type.result in ("none", "single")

    def _sends_itself(self, worker: RunningNode) -> bool:
        """Whether its code triggers or sends by itself, so that the worker has to say that it runs."""
        kind = worker.type
        return worker.sends_itself or (not worker.silent_code and (bool(kind.events) or kind.result == "fields"))

    def _kinds(self) -> list[str]:
        return [f"t{k}" for k in range(len(self.order)) if self.single[k] and self.order[k].out_names]

    def _is_pipelined(self, edge: AnyEdge) -> bool:
        return type(edge) is SyncEdge and not edge.sequential

    def _heard_outputs(self, k: int) -> list[int]:
        """Outputs of which each sending is another: who hears it now (T4)."""
        worker = self.order[k]
        return [output for output in range(len(worker.out_edges)) if asks_who_hears(worker, output)]

    def carries(self, k: int) -> bool:
        """Whether member k could give its activity away over one of its edges."""
        return self.order[k] in self.senders

    def _gives(self, k: int) -> list[str]:
        """The values by which activity may leave member k."""
        return list(dict.fromkeys(f"v{k}_{output}" for edge, output, _ in self.outs[k] if edge.active))

    def _gives_inside(self, k: int) -> bool:
        """Whether it may leave to another member: then the local `m` says whether it has."""
        return self.turns and any(edge.active and to is not None for edge, _, to in self.outs[k])

    def _hands_over(self, k: int) -> bool:
        """Whether its activity can only go to the next member, and nothing but A(v) of the two follows (A5, A6).

        No node has a turn between the two, so it makes no difference whether a token was ever on the edge.
        """
        ways = [(edge, to) for edge, _, to in self.outs[k] if edge.active]
        if not self.turns or self.is_async or len(ways) != 1 or ways[0][1] != k + 1 or ways[0][0].tap is not None:
            return False
        if k + 1 in self.called or k + 1 in self.schedule.between or self.fires_with_slots(k + 1):
            return False
        giver, taker = self.order[k], self.order[k + 1]
        if giver.shape.announced or self._sends_itself(giver):
            return False
        return not (giver.watched or taker.watched or taker.listened is not None)

    def _givers(self, k: int) -> list[int]:
        """The members whose activity may come to member k."""
        if not self.turns:
            return []
        edges = self.order[k].slot_edges if k in self.called else self.order[k].live_inputs
        return sorted({self.position[edge.source] for edge in edges if edge.active and k})

    def _may_take(self, k: int) -> bool:
        """Whether a token that member k takes may carry activity, which makes the member busy from then on."""
        return bool(self._givers(k)) or (self.turns and not k and bool(self.entries))

    def _is_pending(self, k: int, j: int) -> bool:
        """Whether others may run between the sending of member k that enables member j, which has slots, and that."""
        if not (self.turns and self.fires_with_slots(j)):
            return False
        return j != k + 1 or j in self.schedule.between or self.fires_with_slots(k) or bool(self._odd_sending(k))

    def _silences_all_behind(self, k: int) -> bool:
        """Whether all members after a silent member k are silent too, and none of these silences is observed outside.

        Silence into a slot outside only adds to a count (T4).
        """
        if len(self.order) == k + 1 or (not self.turns and not self.single[k]):
            return False
        silent = {k}
        for t in range(k + 1, len(self.order)):
            called = t in self.called
            fed = self.order[t].slot_edges if called else [one for one in self.order[t].live_inputs if one.mandatory]
            if any(self.position[edge.source] in silent for edge in fed):
                silent.add(t)
        seen = self.taps.anybody_behind(k) or any(self._heard_outputs(j) for j in range(k, len(self.order)))
        leaves = any(
            to is None and not (self.turns and edge.target_kind == "slot" and edge.tap is None)
            for out in self.outs[k:]
            for edge, _, to in out
        )
        return len(silent) == len(self.order) - k and not seen and not leaves

    def _is_over_by_silence(self, k: int) -> bool:
        """Whether the silence of member k always ends the wave, because it silences all later members."""
        called = any(self.fires_with_slots(j) for j in range(k, len(self.order)))
        return not (called or self._may_take(k) or self._on_its_way(k)) and self._silences_all_behind(k)

    def _on_its_way(self, k: int) -> list[str]:
        """The locals that say whether activity of a member before k lies before one after it, which takes it (A6)."""
        later = {giver for j in range(k + 1, len(self.order)) for giver in self._givers(j)}
        return [f"m{giver}" for giver in sorted(later) if giver < k]

    def _odd_sending(self, k: int) -> str:
        """Whether more than values leaves with the firing."""
        worker = self.order[k]
        if not self.turns:
            return ""
        if worker.shape.announced:
            return "True"
        odd, gives = [], self._gives_away(k)
        if self._sends_itself(worker):
            odd += [f"w{k}.may_carry", f"w{k}.events_due"] if gives else []
        elif self._may_take(k):
            odd.append(f"w{k}.busy")
        if gives:
            met = ["core.trace_changes is not None", *([f"c{k}"] if self.fires_with_slots(k) else [])]
            odd.append(f"{gives} and ({' or '.join(met)})" if self._hands_over(k) else gives)
        return " or ".join(odd)

    def _gives_away(self, k: int) -> str:
        """When activity leaves member k with what it sends (A5)."""
        gives = " or ".join(f"{value} is not None" for value in self._gives(k))
        return f"w{k}.active and ({gives})" if gives else ""
