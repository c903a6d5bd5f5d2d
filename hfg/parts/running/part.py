"""One part of a graph that is cut: an engine, and the tokens that leave it and come in (rules L1, L3, R5).

A part is a run like any other, but for its ends: what lies before an `Outlet` goes into a link, what comes out of one
goes into an `Inlet`, and what it does when nothing moves is for the whole to say. It knows neither transports nor
processes. Stands on the engine and `agreement`.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from contextlib import asynccontextmanager
from functools import partial
from typing import Any, Final, Protocol

from hfg.engine.face.composition import Composition
from hfg.engine.model.worker import ENDED, Worker
from hfg.engine.rules import quiet, rings
from hfg.engine.runtime.borders import Hearing, Inlet, Outlet
from hfg.engine.runtime.engine import Engine
from hfg.errors import HfgError, UsageError
from hfg.graph.flat import CutEdge
from hfg.parts.model.agreement import Account, Answer, Question, Rest
from hfg.parts.model.inheriting import UNKNOWN, Alignment, Arrived, Inheritance, Where
from hfg.parts.model.messages import Untrue
from hfg.parts.running.keeping import Keeper
from hfg.ports.edges import EventEdge
from hfg.token import END, Token

__all__ = ["Incoming", "Outgoing", "Part"]

_MOST_SAID: Final = 1000  # words that wait for tokens which were sent before them
_REST_S: Final = 0.002  # how long nothing has moved before that is said to others; in virtual time it is said at once


class Outgoing(Protocol):
    """The link behind an edge that leaves the part."""

    def room(self) -> int:
        """How many tokens it would take now."""

    def send(self, tokens: list[Token[Any]]) -> None:
        """Take tokens, oldest first, no more than there is room for."""

    def speaks(self, speaking: bool, total: int) -> None:
        """Say that the producer is enabled from now on, or not, behind so many tokens."""

    def goes_on(self, last: Where) -> None:
        """Say that what comes next is behind that position, of a part that inherits positions and has lived before."""


class Incoming(Protocol):
    """The link before an edge that comes into it."""

    def taken(self, total: int) -> None:
        """So many tokens were taken until now, and what came of them in this part is done."""

    def hears(self, hearing: Hearing, total: int) -> None:
        """What the consumer does with tokens from now on, when it has taken so many."""


class Part:
    """One part of a run.

    Attributes:
      name: of its group.
      composition: its engine, and what stands on that.
      keeper: keeps what it does, if it has a ledger.
      inherits: whether what it sends inherits the positions of what comes in, and a token that came in is done when all
        that came of it is; else it is done when it was taken.
      positions: of what it will send next, by label of the edge, if it inherits them.
    """

    def __init__(
        self,
        name: str,
        composition: Composition,
        edges: Iterable[CutEdge],
        *,
        rests: Callable[[Rest], None],
        inheriting: frozenset[str] = frozenset(),
        returns: bool = False,
        keeper: Keeper | None = None,
    ) -> None:
        """Make it; nothing is set up yet.

        Args:
          name: of its group.
          composition: its engine, not begun yet, and what stands on that.
          edges: those between it and other parts.
          rests: told when nothing moves in it any more.
          inheriting: the parts whose tokens inherit positions.
          returns: it has lived before.
          keeper: keeps what the part does, if it has a ledger.
        """
        edges = list(edges)
        self.name = name
        self.inherits = inherits = name in inheriting
        self.composition = composition
        self.keeper = keeper
        self._rests = rests
        self._numbered = 0
        self._is_at_rest = False
        self._looks_later = False
        engine = self.engine
        keeps = {edge.label: edge.guarantee == "exact" for edge in edges}
        self.outlets: dict[str, Outlet] = {
            one.port_name: Outlet(engine, one, keeps=keeps[one.port_name], wake=self._wake, drains=not inherits)
            for one in engine.core.outlets
        }
        self.inlets: dict[str, Inlet] = {
            worker.port_name: Inlet(engine, worker, self._moved) for worker in engine.core.inlets
        }
        self._outgoing: dict[str, Outgoing] = {}
        self._incoming: dict[str, Incoming] = {}
        self._portions = {edge.label: max(edge.window // 4, 1) for edge in edges}
        self._lossy = frozenset(label for label, kept in keeps.items() if not kept)
        self._drains = frozenset(edge.label for edge in edges if edge.source not in inheriting)
        self._hearing: dict[str, Hearing] = dict.fromkeys(self.inlets, "open")
        self._speaking = dict.fromkeys(self.outlets, True)
        self._said: list[tuple[str, bool, int]] = []
        self.positions: dict[str, deque[Where]] = {label: deque() for label in self.outlets} if inherits else {}
        coming = [edge.label for edge in edges if edge.target == name and _is_synchronous(edge)]
        self._inheritance = Inheritance(coming)
        self._origin = dict.fromkeys(self.inlets, 0)  # how many tokens came to former lives, or were skipped
        self._alignment = Alignment(coming if returns and keeper is None else [])
        self._returns = returns
        self._owes_behind = returns and inherits  # its consumers wait to be told where it goes on
        self._last = self._find_last()
        self._before: dict[Any, int] = {}  # what the ends had done when the part was edited last
        self._cleared: asyncio.Future[None] | None = None  # somebody waits until nothing is in it
        self._leaving = False
        engine.leave_quiet_to(self._nothing_moves)
        engine.callbacks.begun.append(self._begun)
        engine.callbacks.pumped.append(self._pumped)

    @property
    def engine(self) -> Engine:
        """What runs it."""
        return self.composition.engine

    def _look_whether_clear(self) -> None:
        cleared = self._cleared
        if cleared is not None and not cleared.done() and self._is_clear():
            cleared.set_result(None)

    def _is_clear(self) -> bool:
        return all(inlet.is_clear for inlet in self.inlets.values())

    def _find_last(self) -> list[Worker]:
        """Who fires and sends nothing on; what stands for a subgraph never fires."""
        core = self.engine.core
        return [w for w in core.by_path.values() if w.scope is None and not any(w.all_out_edges())]

    @asynccontextmanager
    async def emptied(self) -> AsyncIterator[None]:
        """Inside the block nothing that came in is still in the part: its nodes and edges may be changed (R4).

        A part whose tokens inherit positions knows what is done by counting; so it counts anew behind the block. Any
        other needs none of this, and goes on meanwhile.

        Raises:
          UsageError: it is paused.
        """
        if not self.inherits:
            yield
            return
        if self.engine.core.held:
            raise UsageError(
                f'group "{self.name}" is emptied of tokens before it is edited, so that none of them is lost when its '
                "process dies; it is paused: run.resume() first"
            )
        self.engine.hold()
        for inlet in self.inlets.values():
            inlet.hold(True)
        try:
            while not self._is_clear():
                self._cleared = asyncio.get_running_loop().create_future()
                self.engine.kick()
                await self._cleared
            yield
            self._last = self._find_last()
            self.engine.core.settle_counts()
            self._before = {worker: worker.firings for worker in self._last}
            self._before |= {outlet: outlet.finished for outlet in self.outlets.values()}
            self._origin = {label: inlet.taken for label, inlet in self.inlets.items()}
        finally:
            self._cleared = None
            for inlet in self.inlets.values():
                inlet.hold(False)
                inlet.lay()
            self.engine.unhold()
            self.engine.kick()

    def connect(self, outgoing: Mapping[str, Outgoing], incoming: Mapping[str, Incoming]) -> None:
        """Give the links at its ends, by label of the edge."""
        self._outgoing.update(outgoing)
        self._incoming.update(incoming)

    def begin(self) -> None:
        """All parts are set up: go."""
        self.composition.lifetime.begin()

    def _begun(self) -> None:
        """The signals of `start` are on their edges: now comes what has come from other parts meanwhile."""
        if self.keeper is not None:
            self.engine.guard(self.keeper.go_on)
        for inlet in self.inlets.values():
            self.engine.guard(inlet.lay)

    def be_kept(self, number: int) -> None:
        """What was asked to be kept is kept: producers may hear of it, and what waited for it has left."""
        if self.keeper is not None and self.keeper.be_kept(number):
            self._is_at_rest = False
            self._settle_kept()
            self.send()
            self.engine.kick()

    def _settle_kept(self) -> None:
        assert self.keeper is not None
        for label, inlet in self.inlets.items():
            self._settle_at(inlet, min(inlet.taken, self.keeper.safe(label)))

    # --- tokens -----------------------------------------------------------------------------------------------------

    def receive(self, label: str, tokens: list[Arrived]) -> None:
        """Tokens have come over a link, or it was told where they go on."""
        self.engine.at_once(partial(self._receive, label, tokens))

    def _receive(self, label: str, tokens: list[Arrived]) -> None:
        self._is_at_rest = False
        for one, (skipped, later) in self._alignment.arrive(label, tokens).items():
            inlet = self.inlets[one]
            if skipped:
                inlet.skip(skipped)
                self._origin[one] += skipped
            inlet.arrive([token for token, _ in later])
            if self.keeper is not None:
                self.keeper.came(one, [where for _, where in later])
            if self.inherits and later:
                self._inherit(one, later)
            inlet.lay()
        if self._owes_behind:
            self._say_behind()
        if self._said:
            self._listen()
        self.engine.kick()

    def _inherit(self, label: str, tokens: list[Arrived]) -> None:
        """What will be sent has the positions of what has come."""
        ended = tokens[-1][0][0] is END
        inherited = self._inheritance.arrive(label, [where for _, where in tokens], ended=ended)
        for outlet, positions in self.positions.items():
            if not self.outlets[outlet].is_over:
                positions.extend(inherited)

    def _say_behind(self) -> None:
        """Consumers wait to be told where this life goes on: as soon as it knows."""
        if self.behind != UNKNOWN:
            self._owes_behind = False
            for link in self._outgoing.values():
                link.goes_on(self.behind)

    def lose(self, label: str, total: int) -> None:
        """Of so many tokens that have left for here, those that have not come are lost: the edge may lose some."""
        self._is_at_rest = False
        inlet = self.inlets[label]
        inlet.lose(max(total - inlet.received, 0))
        inlet.lay()
        if self._said:
            self._listen()
        self.engine.kick()

    def be_taken(self, label: str, total: int) -> None:
        """So many of the tokens that have left were taken until now."""
        if total <= self.outlets[label].taken:
            return  # which was told in another way already, and moves nothing
        self._is_at_rest = False
        self.engine.at_once(partial(self._take, label, total))

    def _take(self, label: str, total: int) -> None:
        self.outlets[label].be_taken(total)
        self.send()

    def speak(self, label: str, speaking: bool, total: int) -> None:
        """The producer of an edge that comes in was disabled or enabled, behind so many tokens.

        Raises:
          Untrue: it says so of more and more tokens that do not come.
        """
        if sum(one == label for one, _, _ in self._said) >= _MOST_SAID:
            raise Untrue(f'of edge "{label}" for the {_MOST_SAID}th time, behind tokens that do not come')
        self._is_at_rest = False
        self._said.append((label, speaking, total))
        self._listen()

    def _listen(self) -> None:
        """What was said behind tokens holds when those are here."""
        waiting = []
        for label, speaking, total in self._said:
            if self.inlets[label].received < total:
                waiting.append((label, speaking, total))
                continue
            self.inlets[label].speak(speaking)
            self.inlets[label].lay()
        self._said = waiting

    def hear(self, label: str, hearing: Hearing, total: int) -> None:
        """The consumer of an edge that leaves does otherwise with tokens, from when it has taken so many.

        Raises:
          Untrue: so many have not left.
        """
        if total > self.outlets[label].sent:
            raise Untrue(f'that {total} tokens were taken from edge "{label}", by which fewer have left')
        self._is_at_rest = False
        if not self.inherits:  # else it is taken when all that came of it is done
            self.outlets[label].be_taken(total)
        self.outlets[label].hear(hearing)
        self.send()

    # --- other lives ------------------------------------------------------------------------------------------------

    def follow(self, label: str, total: int, last: Where) -> None:
        """This life takes the place of others, of whose tokens on an edge that comes in so many were done."""
        self.inlets[label].rebase(total)
        if self.keeper is not None:
            self.keeper.rebased(label, total)
        self._origin[label] += total
        self.goes_on(label, last)

    def goes_on(self, label: str, last: Where) -> None:
        """What comes next on an edge is behind that position."""
        self._alignment.goes_on(label, last)
        self.receive(label, [])

    @property
    def behind(self) -> Where:
        """The position behind which this life goes on with what comes, and so with what it sends; or `UNKNOWN`."""
        return self._alignment.behind if self._returns else (0, 0)

    def came(self, label: str) -> int:
        """How many tokens have come on an edge, also those that wait to be told where others go on."""
        return self.inlets[label].received + self._alignment.held(label)

    def precede(self, label: str, total: int, hearing: Hearing) -> None:
        """This life takes the place of others, of whose tokens on an edge that leaves so many have come."""
        self._is_at_rest = False
        outlet = self.outlets[label]
        outlet.rebase(total)
        if hearing != outlet.hearing:
            outlet.hear(hearing)
        self.send()
        self.engine.kick()

    def consumer_returns(self, label: str) -> None:
        """The consumer of an edge that leaves begins anew."""
        self._is_at_rest = False
        outlet = self.outlets[label]
        if outlet.hearing != "open":
            outlet.hear("open")
        if not outlet.speaking:
            self._outgoing[label].speaks(False, outlet.sent)
        self.send()
        self.engine.kick()

    def producer_returns(self, label: str, *, remembers: bool) -> None:
        """The producer of an edge that comes in begins anew; unless it remembers, nobody waits for what has come."""
        self._is_at_rest = False
        inlet = self.inlets[label]
        if not remembers:
            inlet.orphan()
        self._said = [said for said in self._said if said[0] != label]
        if not inlet.speaking:
            inlet.speak(True)
        self.engine.kick()

    def room(self, label: str) -> None:
        """A link takes tokens again."""
        self._wake()

    def send(self) -> None:
        """Let go what is to leave."""
        for label, outlet in self.outlets.items():
            link = self._outgoing[label]
            if outlet.speaking != self._speaking[label]:
                self._speaking[label] = outlet.speaking
                link.speaks(outlet.speaking, outlet.sent)
            if outlet.has_more:
                tokens = outlet.leave(link.room())
                if tokens:
                    link.send(tokens)

    def _moved(self, inlet: Inlet) -> None:
        """Tokens were taken: amid the pump that is told for several at once, and what is left at the end of it."""
        if self.keeper is not None:
            self._settle_kept()
        elif not self.inherits and (
            not self.engine.core.pumping or inlet.taken - inlet.settled >= self._portions[inlet.label]
        ):
            self._settle_at(inlet, inlet.taken)

    def _settle_at(self, inlet: Inlet, done: int) -> None:
        """So many of its tokens are done: the producer hears of those that were not before."""
        if inlet.settle(done):
            self._incoming[inlet.label].taken(done)

    def _settle(self) -> None:
        """Each token gives one everywhere: so many are done as have passed every end, and their firings are over.

        Who has ended holds nobody up, once that is done which came before: whatever still comes is drained (F12).
        """
        before = self._before
        ends = [outlet.finished - before.get(outlet, 0) for outlet in self.outlets.values() if outlet.holds_up]
        if self._last:
            self.engine.core.settle_counts()
            ends += [
                worker.firings - before.get(worker, 0) - (worker.busy == "firing")
                for worker in self._last
                if worker.busy or not worker.blocked & ENDED
            ]
        for label, inlet in self.inlets.items():
            self._settle_at(inlet, min([inlet.taken, *(self._origin[label] + count for count in ends)]))

    def _wake(self) -> None:
        """Something lies before an outlet: it leaves when the engine is done with what it does now, see `_pumped`."""
        if not self._leaving and not self.engine.core.pumping:
            self._leaving = True
            self.engine.soon(self._leave)

    def _leave(self) -> None:
        self._leaving = False
        if not self.engine.core.over:
            self.send()

    def _pumped(self) -> None:
        """A slice is over: what has gathered meanwhile leaves together."""
        self._is_at_rest = False
        for label, inlet in self.inlets.items():
            hearing = inlet.hearing
            if hearing != self._hearing[label]:
                self._hearing[label] = hearing
                self._incoming[label].hears(hearing, inlet.taken)
            inlet.lay()
            if self.keeper is None and not self.inherits:
                self._settle_at(inlet, inlet.taken)
        self.send()
        if self.inherits:
            self._settle()
            self._look_whether_clear()
        if self.keeper is not None:
            self.keeper.look()

    # --- quiet ------------------------------------------------------------------------------------------------------

    def _nothing_moves(self) -> None:
        if self._is_at_rest or any(outlet.has_more for outlet in self.outlets.values()):
            return
        if self.keeper is not None and self.keeper.is_behind:
            self.keeper.look()  # it will rest when that is kept
            return
        self._is_at_rest = True
        self._numbered += 1
        if self.engine.virtual:
            self._say_rest()
        elif not self._looks_later:
            self._look_later()

    def _look_later(self) -> None:
        """A part that only waits for room rests again and again; to say so each time would cost as much as a token."""
        self._looks_later = True
        self.engine.loop.call_later(_REST_S, self._look, self._numbered)

    def _look(self, rest: int) -> None:
        self._looks_later = False
        if self.engine.core.over or not self._is_at_rest:
            return
        if rest == self._numbered:
            self._say_rest()
        else:
            self._look_later()

    def _say_rest(self) -> None:
        self._rests(
            Rest(
                self.name,
                self._numbered,
                {label: self._account(one, one.sent, one.taken) for label, one in self.outlets.items()},
                {label: self._account(one, self.came(label), one.settled) for label, one in self.inlets.items()},
            )
        )

    def _account(self, end: Outlet | Inlet, count: int, done: int) -> Account:
        """Give what the two ends of an edge have to agree on.

        Of one whose consumer has ended all tokens are drained where they are; and nobody is told what becomes of those
        that may be lost.
        """
        settled = (end.hearing == "over" and end.label in self._drains) or end.label in self._lossy
        return (count, count if settled else done, end.hearing, end.speaking)

    def answer(self, question: Question) -> Answer:
        """Do what follows from quiet, if the part still rests."""
        engine = self.engine
        if not self._is_at_rest or question.rest != self._numbered or engine.core.over or engine.core.held:
            return Answer(self.name, question.step, question.rest, moved=True)
        return Answer(self.name, question.step, question.rest, value=self._do(question))

    def _do(self, question: Question) -> Any:
        engine = self.engine
        match question.step:
            case "rests" | "missing":
                return None
            case "lose":
                return self._lose(question.value)
            case "fullest":
                edge = rings.smallest_at_rest(engine.core)
                return None if edge is None else (edge.capacity, edge.index, edge.label)
            case "grow":
                return self._grow(question.value)
            case "held":
                return engine.is_held_open()
            case "give_up":
                return engine.give_up()
            case "complete":
                return engine.complete_operators() or engine.core.timers > 0
            case "end":
                return engine.end_events()
            case "stuck":
                return quiet.stuck(engine.core)
            case "finish":
                return self._finish(question.value)

    def _lose(self, missing: dict[str, int]) -> None:
        for label, total in missing.items():
            if label in self.inlets:
                self.lose(label, total)
            elif label in self.outlets:
                end = self.outlets[label].last_word()
                if end is not None:
                    self._is_at_rest = False
                    self._outgoing[label].send([end])
                    self.engine.kick()

    def _grow(self, label: str) -> None:
        for edge in self.engine.core.edges:
            if edge.label == label and isinstance(edge, EventEdge):
                rings.grow_queue(self.engine.core, edge)
                return
        raise Untrue(f'that queue "{label}" is to grow, which is none here')

    def _finish(self, reasons: list[str]) -> None:
        stalled = quiet.stalled(reasons) if reasons else None
        self.finish("done" if stalled is None else "stalled", stalled)

    def finish(self, outcome: str, error: HfgError | None) -> None:
        """End the run of this part."""
        self.engine.finish(outcome, error)


def _is_synchronous(edge: CutEdge) -> bool:
    return edge.guarantee == "exact" and not edge.edge.is_event_edge
