"""One part of a graph that is cut: an engine, and the tokens that leave and enter it (rules L1, L3, R5).

A part is a run like any other, except for its ends: tokens before an `Outlet` go into a link, tokens from a link go
into an `Inlet`, and the whole run decides what it does when nothing moves. It does not depend on transports or
processes. Depends on the engine and `agreement`.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterable, Iterator, Mapping
from contextlib import asynccontextmanager
from functools import partial
from typing import Any, Final, NamedTuple, Protocol

from hfg.base.logs import Log
from hfg.base.token import END, NO_MESSAGE, Token
from hfg.engine.face.composition import Composition
from hfg.engine.rules import quiescence, rings
from hfg.engine.runtime.borders import Hearing, Inlet, Outlet
from hfg.engine.runtime.engine import Engine
from hfg.errors import HfgError, RunError, UsageError
from hfg.graph.flat import CutEdge
from hfg.parts.model.agreement import Account, Answer, Question, Rest
from hfg.parts.model.components import Component, is_synchronous
from hfg.parts.model.inheriting import Arrived, Where
from hfg.parts.model.messages import Untrue
from hfg.parts.running.channels import called
from hfg.parts.running.checkpointing import Checkpointer
from hfg.parts.running.progress import Progress
from hfg.ports.edges import EventEdge

_LOGGER = Log("hfg.parts")
_MOST_LOST: Final = 1_000_000  # of one edge at once; no part holds that many, so a higher number is wrong
_MOST_SAID: Final = 1000  # words that wait for tokens which were sent before them
_REST_S: Final = 0.002  # how long nothing must have moved before others are told; in virtual time they are told at once


class Outgoing(Protocol):
    """The link of a leaving edge."""

    def room(self) -> int:
        """Return how many tokens it would take now."""

    def send(self, tokens: list[Token[Any]]) -> None:
        """Take tokens, oldest first, no more than there is room for."""

    def speaks(self, speaking: bool, total: int) -> None:
        """Report that the producer is enabled from now on, or not, after so many tokens."""

    def begin_at(self, number: int) -> None:
        """The first token to leave has this number; nothing has left in this incarnation."""

    def goes_on(self, number: int) -> None:
        """Report that the next token comes after this number, for a part with previous incarnations."""


class Incoming(Protocol):
    """The link before an edge that comes into it."""

    def taken(self, total: int) -> None:
        """So many tokens have been taken so far, and their consequences in this part are processed."""

    def hears(self, hearing: Hearing, total: int) -> None:
        """Report how the consumer handles tokens from now on, after it has taken so many."""


class _Kinds(NamedTuple):
    """How a part handles its edges to and from others, by label.

    Attributes:
      portions: number of processed tokens after which their producer gets an acknowledgement.
      lossy: edges that may lose tokens.
      drains: edges whose tokens do not inherit positions.
      by_number: incoming edges whose tokens are counted by their numbers, here and by the producer.
      counted_by_number: edges whose tokens are counted by their numbers.
      producers: the part at the other end of each incoming edge.
    """

    portions: dict[str, int]
    lossy: frozenset[str]
    drains: frozenset[str]
    by_number: frozenset[str]
    counted_by_number: frozenset[str]
    producers: dict[str, str]

    @classmethod
    def of(
        cls, name: str, edges: list[CutEdge], inherited: frozenset[str], remembered: frozenset[str], *, keeps: bool
    ) -> _Kinds:
        coming = [edge for edge in edges if edge.target == name]
        counted = remembered - inherited  # by a ledger, whose numbers may be those of a former run
        return cls(
            {edge.label: max(edge.window // 4, 1) for edge in edges},
            frozenset(edge.label for edge in edges if edge.guarantee != "exact"),
            frozenset(edge.label for edge in edges if edge.label not in inherited),
            frozenset(
                edge.label for edge in coming if not keeps and is_synchronous(edge) and edge.label not in counted
            ),
            frozenset(edge.label for edge in edges if is_synchronous(edge) and edge.label not in remembered),
            {edge.label: edge.source for edge in coming},
        )


class Part:
    """One part of a run.

    Attributes:
      name: name of its group.
      composition: its engine, with everything built on it.
      keeper: stores its state, if it has a ledger.
      inherits: whether it has components whose tokens inherit positions.
    """

    def __init__(
        self,
        name: str,
        composition: Composition,
        edges: Iterable[CutEdge],
        *,
        rests: Callable[[Rest], None],
        components: Iterable[Component] = (),
        inherits: bool = False,
        inherited: frozenset[str] = frozenset(),
        remembered: frozenset[str] = frozenset(),
        returns: bool = False,
        keeper: Checkpointer | None = None,
    ) -> None:
        """Make the part; nothing is set up yet.

        Args:
          name: name of its group.
          composition: its engine, not started yet, with everything built on it.
          edges: the edges between it and other parts.
          rests: called when nothing moves in it any more.
          components: components of its nodes.
          inherits: see above.
          inherited: labels of the edges between parts whose tokens inherit positions.
          remembered: labels of the edges whose producer remembers the tokens of its previous incarnations.
          returns: it has previous incarnations.
          keeper: stores its state, if it has a ledger.
        """
        edges = list(edges)
        self.name = name
        self.inherits = inherits
        self.composition = composition
        self.keeper = keeper
        self._rests = rests
        self._numbered = 0
        self._is_at_rest = False
        self._looks_later = False
        engine = self.engine
        self._kinds = kinds = _Kinds.of(name, edges, inherited, remembered, keeps=keeper is not None)
        self.outlets: dict[str, Outlet] = {
            one.port_name: Outlet(
                engine,
                one,
                keeps=one.port_name not in kinds.lossy,
                wake=self._wake,
                drains=one.port_name in kinds.drains,
            )
            for one in engine.core.outlets
        }
        self.inlets: dict[str, Inlet] = {
            worker.port_name: Inlet(engine, worker, self._moved) for worker in engine.core.inlets
        }
        self._outgoing: dict[str, Outgoing] = {}
        self._incoming: dict[str, Incoming] = {}
        self._hearing: dict[str, Hearing] = dict.fromkeys(self.inlets, "open")
        self._speaking = dict.fromkeys(self.outlets, True)
        self._said: list[tuple[str, bool, int]] = []
        self._remembered = remembered
        self._gone: dict[str, int] = {}  # of edges into a ledger: how many were lost before it, and count as come
        self._came_before: dict[str, int] = {}  # how many had arrived when the producer of an edge was restarted
        self._over: set[str] = set()  # edges on which END has come
        # Edges from a ledger, whose numbers may be from a previous run: they count from where their consumer resumes.
        self._fresh: set[str] = set()
        self._returns = returns and keeper is None
        self._progresses = list(self._make_progresses(edges, components))
        self._of: dict[str, Progress] = {
            label: one for one in self._progresses for label in (*one.coming, *one.leaving)
        }
        self._start: dict[str, int] = {}  # where an incarnation other than the first resumes incoming edges
        self._cleared: asyncio.Future[None] | None = None  # set while a caller waits until it is empty
        self._leaving = False
        engine.quiet.leave_to(self._nothing_moves)
        engine.callbacks.begun.append(self._begun)
        engine.callbacks.pumped.append(self._pumped)

    @property
    def engine(self) -> Engine:
        """Its engine."""
        return self.composition.engine

    def _look_whether_clear(self) -> None:
        cleared = self._cleared
        if cleared is not None and not cleared.done() and self._is_clear():
            cleared.set_result(None)

    def _is_clear(self) -> bool:
        return all(self.inlets[label].is_clear for one in self._inheriting() for label in one.coming)

    def _inheriting(self) -> Iterator[Progress]:
        return (progress for progress in self._progresses if progress.inherits)

    def _make_progresses(self, edges: list[CutEdge], components: Iterable[Component]) -> Iterator[Progress]:
        """One for each component, and one for each other edge from an output that comes in: into a slot."""
        delays = {edge.label: len(edge.edge.options.initial) for edge in edges}
        into = {edge.label for edge in edges if edge.target == self.name and is_synchronous(edge)}
        for one in components if self.keeper is None else ():
            inherits = self.inherits and one.answers
            coming = {label: delays[label] for label in one.coming}
            into -= set(coming)
            progress = Progress(
                one.nodes, coming, one.leaving, inherits=inherits, returns=self._returns, source=one.source
            )
            progress.look_for_last(self.engine.core)
            yield progress
        for label in sorted(into) if self._returns else ():
            yield Progress((), {label: 0}, (), inherits=False, returns=self._returns)

    def positions(self, label: str) -> deque[Where] | None:
        """Return the positions of the next tokens of an edge, if they are inherited."""
        progress = self._of.get(label)
        return None if progress is None else progress.positions.get(label)

    def is_by_number(self, label: str) -> bool:
        """Return whether the n-th token of an incoming edge has the number n in all incarnations of its producer."""
        return label in self._kinds.by_number

    def is_aligned(self, label: str) -> bool:
        """Return whether it is known where this incarnation resumes at this end of an edge."""
        progress = self._of.get(label)
        return progress is None or progress.has_begun

    @asynccontextmanager
    async def emptied(self) -> AsyncIterator[None]:
        """Inside the block, no incoming token is left in the part: its nodes and edges may be changed (R4).

        A part whose tokens inherit positions knows by counting what is processed, so it starts a new count after the
        block. Other parts do not need this, and continue meanwhile.

        Raises:
          UsageError: the run is paused.
        """
        if not self.inherits:
            yield
            return
        if self.engine.core.paused:
            raise UsageError(
                f'group "{self.name}" is emptied of tokens before an edit, so that none is lost if its '
                "process dies; but the run is paused: call run.resume() first"
            )
        self.engine.quiet.hold()
        for inlet in self.inlets.values():
            inlet.hold(True)
        try:
            while not self._is_clear():
                self._cleared = asyncio.get_running_loop().create_future()
                self.engine.kick()
                await self._cleared
            yield
            core = self.engine.core
            core.settle_counts()
            for progress in self._inheriting():
                progress.count_anew(core, self.inlets, self.outlets)
        finally:
            self._cleared = None
            for inlet in self.inlets.values():
                inlet.hold(False)
                inlet.lay()
            self.engine.quiet.unhold()
            self.engine.kick()

    def connect(self, outgoing: Mapping[str, Outgoing], incoming: Mapping[str, Incoming]) -> None:
        """Set the links at its ends, by label of the edge."""
        self._outgoing.update(outgoing)
        self._incoming.update(incoming)

    def begin(self) -> None:
        """All parts are set up: start."""
        self.composition.run_lifecycle.begin()

    def _begun(self) -> None:
        """The signals of `start` are on their edges: now comes what has come from other parts meanwhile."""
        if self.keeper is not None:
            self.engine.guard(self.keeper.go_on)
        for inlet in self.inlets.values():
            self.engine.guard(inlet.lay)

    def be_kept(self, number: int) -> None:
        """A request to the ledger is stored: producers may be told, and tokens that waited for it have left."""
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
        """Tokens have come over a link."""
        self.engine.at_once(partial(self._receive, label, tokens))

    def _receive(self, label: str, tokens: list[Arrived]) -> None:
        self._is_at_rest = False
        inlet = self.inlets[label]
        if tokens and label not in self._kinds.lossy:
            inlet.heard = max(inlet.heard, tokens[-1][1][1])
        if self.is_aligned(label):
            if tokens:
                self._lay(label, tokens)
        else:
            progress = self._of[label]
            progress.alignment.hold(label, tokens)
            self._align(progress)
        if self._said:
            self._listen()
        self.engine.kick()

    def _lay(self, label: str, tokens: list[Arrived]) -> None:
        """Lay what has come, silence in place of what is lost, and nothing of what came before."""
        inlet = self.inlets[label]
        tokens = self._in_order(label, inlet, tokens)
        if not tokens:
            return
        inlet.arrive([token for token, _ in tokens])
        if tokens[-1][0][0] is END:
            self._over.add(label)
        if self.keeper is not None:
            self.keeper.came(label, [where for _, where in tokens])
        progress = self._of.get(label)
        if progress is not None and progress.inherits:
            progress.inherit(label, tokens, self.outlets)
        inlet.lay()

    def _in_order(self, label: str, inlet: Inlet, tokens: list[Arrived]) -> list[Arrived]:
        """Return the tokens to put on the edge: the n-th one has the number n."""
        if label in self._fresh or (label not in self._kinds.by_number and label not in self._start):
            return tokens
        following = inlet.received + 1
        if (
            tokens[0][1][1] == following
            and tokens[-1][1][1] == inlet.received + len(tokens)
            and label not in self._over
        ):
            return tokens
        laid: list[Arrived] = []
        lost = passed = 0
        for token, (stream, number) in tokens:
            if label in self._over:
                passed += number >= following
            elif number < following and token[0] is not END:
                lost += number >= self._start.get(label, 0) and label not in self._remembered
            else:
                missing = range(following, number)
                lost += len(missing)
                laid += self._silences(label, missing, stream, token[2])
                laid.append((token, (stream, number)))
                following = max(following, number + 1)
        if lost:
            self._say_lost(label, inlet, lost)
        if passed:
            inlet.skip(passed)
        self._incoming[label].taken(inlet.taken)
        return laid

    def _silences(self, label: str, numbers: range, stream: int, stamp: float) -> list[Arrived]:
        """Return silences in place of lost tokens, so that later tokens meet the tokens that belong to them."""
        if len(numbers) > _MOST_LOST:
            error = RunError(
                f'edge "{label}" continues with number {numbers.stop} after {numbers.start - 1}: so many '
                "tokens cannot be lost"
            )
            self.finish("failed", error)
            return []
        return [((NO_MESSAGE, 0, stamp), (stream, number)) for number in numbers]

    def _say_lost(self, label: str, inlet: Inlet, count: int) -> None:
        """Tokens of an edge are lost with a process: count them, log it at once, and put it into the report."""
        inlet.count_lost(count)
        is_own = (
            self._start.get(label, 0) > inlet.received
        )  # the producer has sent them, and previous incarnations lost them
        whose = self.name if is_own else self._kinds.producers[label]
        tokens = "1 token was" if count == 1 else f"{count} tokens were"
        what = f'edge "{label}": {tokens} lost with a process of {called(whose)}'
        if not is_own and self.keeper is None:
            what += f"; silence takes {'its' if count == 1 else 'their'} place, so that joins stay aligned"
        self._report(what)

    def _report(self, what: str) -> None:
        _LOGGER.warning("%s", what)
        self.engine.core.errors.append(RunError(what))

    def _align(self, progress: Progress) -> None:
        """Go on with a component, as soon as it is known where."""
        start = progress.alignment.start
        if start is None or progress.has_begun:
            return
        self._start |= dict.fromkeys((*progress.coming, *progress.leaving), start)
        progress.begin_at(start)
        for label in progress.leaving:
            self._leave_from(label, start, progress)
            if start > 1 and progress.source:
                again = f'its source "{progress.source}" started over, and repeats up to {start - 1} tokens'
                self._report(f'edge "{label}": {again}')
        for label in progress.coming:
            inlet = self.inlets[label]
            if not progress.leaving and label not in self._fresh and progress.alignment.passed_over(label):
                self._say_lost(label, inlet, progress.alignment.passed_over(label))
            inlet.rebase_to(start - 1)
            self._incoming[label].taken(start - 1)
        for label, held in progress.alignment.let_go().items():
            if held:
                self._lay(label, held)
        self.send()

    def _leave_from(self, label: str, start: int, progress: Progress) -> None:
        """Resume leaving edges with this number; consumers that have fewer tokens are told."""
        outlet, link = self.outlets[label], self._outgoing[label]
        if not progress.inherits:
            link.begin_at(start)
        if outlet.sent < start - 1:
            outlet.rebase(start - 1 - outlet.sent)
        link.goes_on(start - 1)

    def lose(self, label: str, total: int) -> None:
        """Count tokens as lost: those of `total` that were sent here and have not arrived. The edge may lose some."""
        self._is_at_rest = False
        inlet = self.inlets[label]
        inlet.lose(max(total - inlet.received, 0))
        inlet.lay()
        if self._said:
            self._listen()
        self.engine.kick()

    def be_taken(self, label: str, total: int) -> None:
        """So many of the tokens that have left have been taken so far."""
        if total <= self.outlets[label].taken:
            return  # already known in another way, and changes nothing
        self._is_at_rest = False
        self.engine.at_once(partial(self._take, label, total))

    def _take(self, label: str, total: int) -> None:
        self.outlets[label].be_taken(total)
        self.send()

    def speak(self, label: str, speaking: bool, total: int) -> None:
        """The producer of an incoming edge was disabled or enabled, after so many tokens.

        Raises:
          Untrue: it reports this for ever more tokens that do not arrive.
        """
        if sum(one == label for one, _, _ in self._said) >= _MOST_SAID:
            raise Untrue(f'of edge "{label}" for the {_MOST_SAID}th time, after tokens that do not arrive')
        self._is_at_rest = False
        self._said.append((label, speaking, total))
        self._listen()

    def _listen(self) -> None:
        """Apply reports about a later position once its tokens are here."""
        waiting = []
        for label, speaking, total in self._said:
            if self._came(label) < total:
                waiting.append((label, speaking, total))
                continue
            self.inlets[label].speak(speaking)
            self.inlets[label].lay()
        self._said = waiting

    def hear(self, label: str, hearing: Hearing, total: int) -> None:
        """The consumer of a leaving edge handles tokens differently, after it has taken so many.

        Raises:
          Untrue: so many have not left.
        """
        if total > self.outlets[label].sent:
            raise Untrue(f'that {total} tokens were taken from edge "{label}", by which fewer have left')
        self._is_at_rest = False
        if not self._inherits(label):  # otherwise it counts as taken when all its consequences are processed
            self.outlets[label].be_taken(total)
        self.outlets[label].hear(hearing)
        self.send()

    # --- other incarnations ------------------------------------------------------------------------------------------

    def follow(self, label: str, total: int, *, is_known: bool, ended: bool) -> None:
        """This incarnation takes the place of others, which have processed so many tokens of an incoming edge.

        Args:
          label: label of the edge.
          total: how many.
          is_known: the producer knows the number; otherwise it will report where it resumes.
          ended: after these it has sent END, which is processed as well, and which a new incarnation needs to know.
        """
        inlet, progress = self.inlets[label], self._of.get(label)
        inlet.heard = max(inlet.heard, total)
        if progress is None:
            inlet.rebase(total)
            if self.keeper is not None:
                self.keeper.rebased(label, total)
            self.receive(label, [])
            return
        if is_known:
            progress.alignment.done(label, total)
        if ended:
            self.receive(label, [((END, 0, self.engine.now()), (1, total + 1))])
        self.engine.at_once(partial(self._align, progress))

    def goes_on(self, label: str, number: int) -> None:
        """A restarted producer resumes after this number: missing tokens up to there are lost."""
        inlet, progress = self.inlets[label], self._of.get(label)
        inlet.heard = max(inlet.heard, number)
        if progress is not None and not progress.has_begun:
            progress.alignment.done(label, number)
            self.engine.at_once(partial(self._align, progress))
        elif label in self._kinds.by_number and inlet.received < number and label not in self._over:
            self.engine.at_once(partial(self._lose_up_to, label, number))
        elif self.keeper is not None and label in self._kinds.counted_by_number:
            self._lose_before_ledger(label, number)

    def _lose_before_ledger(self, label: str, number: int) -> None:
        """Count tokens lost before the ledger's position.

        The ledger records what has arrived, so nothing takes their place, but both ends count them.
        """
        inlet = self.inlets[label]
        lost = number - self._came_before.get(label, number)  # and not of now: what comes next may overtake the word
        if lost > 0:
            self._is_at_rest = False
            self._gone[label] = self._gone.get(label, 0) + lost
            self._say_lost(label, inlet, lost)
            self._listen()
            self.engine.kick()

    def _came(self, label: str) -> int:
        return self.inlets[label].received + self._gone.get(label, 0)

    def _lose_up_to(self, label: str, number: int) -> None:
        """Count everything up to this number that has not arrived as lost."""
        self._is_at_rest = False
        inlet = self.inlets[label]
        silences = self._silences(label, range(inlet.received + 1, number + 1), 1, self.engine.now())
        if silences:
            self._say_lost(label, inlet, len(silences))
            self._lay(label, silences)
            self.engine.kick()

    def is_over(self, label: str) -> bool:
        """Return whether END has come on an edge."""
        return label in self._over

    def came(self, label: str) -> int | None:
        """Return how many tokens have arrived on an edge, by the numbers of its producer; None: not known yet."""
        return self._came(label) if self.is_aligned(label) else None

    def begun_at(self, label: str) -> int:
        """Return the number with which this incarnation resumes an edge."""
        return self._start.get(label, 1)

    def precede(self, label: str, total: int | None, hearing: Hearing) -> None:
        """This incarnation follows others, of whose tokens on a leaving edge `total` have arrived, if known."""
        self._is_at_rest = False
        outlet, progress = self.outlets[label], self._of.get(label)
        if progress is None or progress.inherits:
            outlet.rebase(max((total or 0) - outlet.sent, 0) if progress is not None else (total or 0))
        else:
            progress.alignment.came(label, total or 0)
            self.engine.at_once(partial(self._align, progress))
        if hearing != outlet.hearing:
            outlet.hear(hearing)
        self.send()
        self.engine.kick()

    def consumer_returns(self, label: str) -> None:
        """The consumer of a leaving edge is restarted."""
        self._is_at_rest = False
        outlet, progress = self.outlets[label], self._of.get(label)
        if progress is not None and not progress.inherits:
            progress.alignment.came(label, 0)  # the part that would have reported it is gone
            self.engine.at_once(partial(self._align, progress))
        if outlet.hearing != "open":
            outlet.hear("open")
        if not outlet.speaking:
            self._outgoing[label].speaks(False, outlet.sent)
        self.send()
        self.engine.kick()

    def producer_returns(self, label: str, *, remembers: bool) -> None:
        """The producer of an incoming edge is restarted.

        Unless it remembers, nothing waits for the tokens that have arrived.
        """
        self._is_at_rest = False
        inlet, progress = self.inlets[label], self._of.get(label)
        self._came_before[label] = self._came(label)
        if progress is not None and not progress.has_begun and label not in self._kinds.by_number:
            self._fresh.add(label)
            progress.alignment.done(label, 0)
            self.engine.at_once(partial(self._align, progress))
        if progress is None or progress.has_begun:
            inlet.heard = inlet.received  # it is told this, and resumes from there
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
        """Tokens were taken: within the pump this is reported for several at once, and the rest at its end."""
        if self.keeper is not None:
            self._settle_kept()
        elif not self._inherits(inlet.label) and (
            not self.engine.core.pumping or inlet.taken - inlet.settled >= self._kinds.portions[inlet.label]
        ):
            self._settle_at(inlet, inlet.taken)

    def _settle_at(self, inlet: Inlet, done: int) -> None:
        """So many of its tokens are processed: report the new ones to the producer."""
        if inlet.settle(done):
            self._incoming[inlet.label].taken(done)

    def _inherits(self, label: str) -> bool:
        progress = self._of.get(label)
        return progress is not None and progress.inherits

    def _settle(self) -> None:
        """Report what is processed in components whose tokens inherit positions."""
        for progress in self._inheriting():
            for label, done in progress.done(self.engine.core, self.inlets, self.outlets).items():
                self._settle_at(self.inlets[label], done)

    def _wake(self) -> None:
        """A token waits before an outlet: it leaves when the engine has finished its current work, see `_pumped`."""
        if not self._leaving and not self.engine.core.pumping:
            self._leaving = True
            self.engine.soon(self._leave)

    def _leave(self) -> None:
        self._leaving = False
        if not self.engine.core.over:
            self.send()

    def _pumped(self) -> None:
        """An iteration is over: tokens that have gathered meanwhile leave together."""
        self._is_at_rest = False
        for label, inlet in self.inlets.items():
            hearing = inlet.hearing
            if hearing != self._hearing[label]:
                self._hearing[label] = hearing
                self._incoming[label].hears(hearing, inlet.taken)
            inlet.lay()
            if self.keeper is None and not self._inherits(label):
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
        """Delay the report of rest.

        A part that only waits for room rests again and again, and each report would cost as much as a token.
        """
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
                {label: self._coming_account(label, one) for label, one in self.inlets.items()},
            )
        )

    def _coming_account(self, label: str, inlet: Inlet) -> Account:
        """Return the account of an incoming edge by the producer's numbers, which may lag behind those of this side."""
        gone = self._gone.get(label, 0)
        heard = inlet.heard if label in self._of else inlet.received + gone
        return self._account(inlet, heard, min(inlet.settled + gone, heard))

    def _account(self, end: Outlet | Inlet, count: int, done: int) -> Account:
        """Return what the two ends of an edge have to agree on.

        If the consumer has ended, all tokens are drained where they are; lossy tokens are not reported.
        """
        settled = (end.hearing == "over" and end.label in self._kinds.drains) or end.label in self._kinds.lossy
        return (count, count if settled else done, end.hearing, end.speaking)

    def answer(self, question: Question) -> Answer:
        """Do what follows from quiet, if the part still rests."""
        engine = self.engine
        if not self._is_at_rest or question.rest != self._numbered or engine.core.over or engine.core.paused:
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
                return engine.quiet.is_held_open()
            case "give_up":
                return engine.quiet.give_up()
            case "complete":
                return engine.quiet.complete_operators() or engine.core.timers > 0
            case "end":
                return engine.quiet.end_events()
            case "stuck":
                return quiescence.stuck(engine.core)
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
        raise Untrue(f'that queue "{label}" should grow, which does not exist here')

    def _finish(self, reasons: list[str]) -> None:
        stalled = quiescence.stalled(reasons) if reasons else None
        self.finish("done" if stalled is None else "stalled", stalled)

    def finish(self, outcome: str, error: HfgError | None) -> None:
        """End the run of this part."""
        self.engine.finish(outcome, error)
