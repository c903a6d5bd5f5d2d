"""Passes what is observed at ports of a run to the thread that writes it (rule R7).

On the loop, a token is only put into a list, with the time; values that may change later are copied. The thread takes
batches from the list. If it cannot keep up, recorded nodes start nothing new until it can (lossless: back-pressure, in
which they wait for the "recorder"), or tokens without room are left out and counted. In virtual time, where the result
must not depend on chance, the loop itself waits for the thread.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from functools import partial
from time import monotonic
from types import SimpleNamespace
from typing import Any, Final

from msgspec.structs import replace

from hfg.base.logs import Log
from hfg.base.token import END, NO_MESSAGE, Marker, Token
from hfg.engine.model.running_node import ENDED, RECORDED, RunningNode
from hfg.engine.model.tap import BatchTap, TokenTap
from hfg.engine.observing.consumers import Consumers, Listener
from hfg.engine.observing.taps import Taps
from hfg.engine.rules.agenda import unblock
from hfg.engine.runtime.engine import Engine
from hfg.recording.messages import ITEM, TokensLeftOut, TokenWriter, Told
from hfg.recording.writing import RecordingWriter
from hfg.trace import TraceEvent

_LOGGER = Log("hfg.engine")

MOST_ITEMS: Final = 50_000
"""Tokens that may wait for the thread."""

MOST_BYTES: Final = 128 * 1024 * 1024
"""The memory that their values may take, as far as it is known."""

_WAKE_AFTER: Final = 4000 * ITEM  # the thread looks a few times per second anyway
_JOIN_S: Final = 0.002
_NO_SOURCE: Final = SimpleNamespace(is_source=False)


class _Looker:
    """Observes one place.

    Attributes:
      worker: the node that sends there, if it is known.
      silent: how many of its firings were silent when it last sent.
    """

    __slots__ = ("end", "place", "put", "silent", "worker")

    def __init__(self, place: TokenWriter) -> None:
        self.place = place
        self.put: TokenTap = _no_token
        self.end = _nothing
        self.worker: RunningNode | None = None
        self.silent = 0


class Recorder(Listener):
    """The part of one recording that runs on the loop of the run.

    Attributes:
      held_s: how long nodes had to wait in total.
      times_held: how often they had to.
    """

    def __init__(
        self, engine: Engine, consumers: Consumers, taps: Taps, thread: RecordingWriter, *, lossless: bool
    ) -> None:
        super().__init__(self._seldom_event, consumers, changes_only=True)
        self._engine = engine
        self._taps = taps
        self._thread = thread
        self._lossless = lossless
        self._items = thread.items
        self._lookers: dict[_Looker, Callable[[], None]] = {}
        self._bytes_put = 0
        self._mark = _WAKE_AFTER
        self._full = False
        self._left_out = False  # and nothing was queued since
        self._held: list[RunningNode] = []
        self._held_since: float | None = None
        self._room = threading.Event()
        self.held_s = 0.0
        self.times_held = 0
        self.on_structure: Callable[[], None] = _nothing
        self.on_refused: Callable[[TokenWriter, Exception], None] = _no_word

    @property
    def thread_waits_for(self) -> Callable[[], None]:
        """The function that the thread calls after taking something."""
        return self._taken

    def now(self) -> float:
        """Return seconds on the run's clock."""
        return self._engine.now()

    def look_at(self, what: Any, place: TokenWriter) -> None:
        """Record the tokens that pass there from now on.

        Raises:
          UsageError: nothing passes there.
          GraphError: there is no such path.
        """
        looker = _Looker(place)
        put = self._look(place, answers=getattr(what, "kind", "") == "output")
        if getattr(what, "kind", "") == "event":
            put = partial(self._signal, looker, put)
        elif getattr(getattr(what, "node", None), "_type", _NO_SOURCE).is_source:
            put = partial(self._output_of_source, looker, put)
        # (tokens that leave a fused region's source in a wave are plain, like all others there: no circumstances)
        looker.put = put if place.keep is not None else BatchTap.of(put, place, self._put_wave)
        self._lookers[looker] = self._taps.look(what, looker)
        self._find_sender(looker)

    def _find_sender(self, looker: _Looker) -> None:
        workers = self._taps.workers(looker)
        looker.worker = workers[0] if len(workers) == 1 else None
        looker.silent = 0 if looker.worker is None else looker.worker.counts.silent

    # --- circumstances that tokens do not show ------------------------------------------------------------------------

    def _signal(self, looker: _Looker, put: Callable[[Token[Any]], None], token: Token[Any]) -> None:
        """A signal leaves, in most cases in a firing, whose last token is still to come."""
        worker: Any = looker.worker
        if worker is not None:
            amid, began = worker.busy, worker.stamp
            if amid == "ending" or (amid == "firing" and worker.blocked & ENDED):
                token = _told(token, last=True)
            elif amid != "firing":
                called = amid == "call" or (not amid and began is not None)  # the fast path of calls shows no more
                token = _told(token, call=worker.counts.calls) if called else _told(token, beside=True)
            elif worker.is_source and began is not None and (began != token.stamp or _waited(worker)):
                token = _told(token, began=None if began == token.stamp else began, waited=_waited(worker))
        put(token)

    def _output_of_source(self, looker: _Looker, put: Callable[[Token[Any]], None], token: Token[Any]) -> None:
        """A token that a source has written leaves."""
        worker: Any = looker.worker
        if worker is None:
            put(token)
            return
        if token.value is END:  # which may have waited until the outputs were free
            put(_told(token, waited=True) if worker.busy == "releasing" and _waited(worker) else token)
            return
        began = token.stamp if worker.stamp is None else worker.stamp
        last, silent = bool(worker.blocked & ENDED), worker.counts.silent != looker.silent
        looker.silent = worker.counts.silent
        waited = not last and _waited(worker)
        if last or silent or waited or began != token.stamp:
            began = None if began == token.stamp else began
            put(_told(token, began=began, silent=silent, last=last, waited=waited))
        else:
            put(token)

    def _put_wave(self, items: tuple[Any, ...]) -> None:
        """Queue the values of a wave of a fused region."""
        if self._full:
            for place in items[::ITEM]:
                self._leave_out(place)
            return
        self._items.extend(items)
        if len(self._items) > self._mark:
            self._crowded()

    def _leave_out(self, place: TokenWriter) -> None:
        """There is no room for a token."""
        place.left_out += 1
        if not self._left_out:
            self._left_out = True
            now = self._engine.now()
            self._items.extend((None, TokensLeftOut(now), 0.0, 0, now))

    def _look(self, place: TokenWriter, *, answers: bool) -> Callable[[Token[Any]], None]:
        """Make the tap; `answers`: each token is a firing's, so silence replaces one that cannot be recorded."""
        extend, items, sizes = self._items.extend, self._items, self._thread.sizes
        now = self._engine.now
        real = self._engine.time.epoch is not None
        epoch = self._engine.time.epoch or 0.0
        keep = place.keep

        def put(token: Token[Any]) -> None:
            extend((place, token, 0.0, 0, monotonic() + epoch if real else now()))
            if len(items) > self._mark:
                self._crowded()

        def put_if_there_is_room(token: Token[Any]) -> None:
            if self._full:
                self._leave_out(place)
            else:
                put(token)

        def keep_and_put(token: Token[Any]) -> None:
            if self._full:
                self._leave_out(place)
                return
            value = token.value
            if type(value) is not Marker:
                try:
                    kept, size = keep(value)  # type: ignore[misc]
                except Exception as error:
                    place.refused += 1
                    self.on_refused(place, error)
                    if not answers:
                        return
                    told = token if type(token) is Told else _told(token)
                    token = replace(told, value=NO_MESSAGE, refused=True)
                else:
                    token = replace(token, value=kept)
                    self._bytes_put += size
                    sizes.append(size)
            extend((place, token, 0.0, 0, now()))
            if len(items) > self._mark or self._bytes_put - self._thread.bytes_taken > MOST_BYTES:
                self._crowded()

        if keep is not None:
            return keep_and_put
        return put if self._lossless else put_if_there_is_room

    # --- if the thread is behind --------------------------------------------------------------------------------------

    def _is_full(self) -> bool:
        return len(self._items) > ITEM * MOST_ITEMS or self._bytes_put - self._thread.bytes_taken > MOST_BYTES

    def _has_room(self) -> bool:
        return (
            len(self._items) < ITEM * MOST_ITEMS // 2 and self._bytes_put - self._thread.bytes_taken < MOST_BYTES // 2
        )

    def _crowded(self) -> None:
        """Much waits for the thread."""
        self._mark = len(self._items) + _WAKE_AFTER
        if not self._thread.is_alive():
            self._items.clear()  # it has failed, and reports that itself
            return
        self._thread.wake()
        if not self._is_full() or self._held or not self._open:
            return
        self._room.clear()
        if not self._lossless:
            self._full = True
        elif self._engine.virtual:
            self._wait()
        else:
            self._held = [*dict.fromkeys(one for looker in self._lookers for one in self._taps.workers(looker))]
            self._engine.core.flags.append("recorder")  # which ends the slice of the pump
            self._engine.soon(self._hold)

    def _wait(self) -> None:
        """Let the loop wait, which changes no result in virtual time."""
        began = monotonic()
        while self._thread.is_alive() and not self._has_room():
            self._room.wait(0.1)
            self._room.clear()
        self._note_held(monotonic() - began)

    def _hold(self) -> None:
        """Let the nodes whose ports are recorded start nothing new."""
        core = self._engine.core
        if core.over or self._held_since is not None:
            return
        self._held_since = monotonic()
        core.begin_async()  # so that the run is not quiet meanwhile
        for worker in self._held:
            worker.block(RECORDED)
        if not self.times_held:
            _LOGGER.warning(
                "the recording cannot be written as fast as it comes, so nodes wait for it; record less, or allow that "
                "something is left out, lossless=False"
            )
        self._taken()

    def _taken(self) -> None:
        """Called by the thread when it has taken something."""
        self._mark = _WAKE_AFTER
        if self._full and self._has_room():
            self._full = self._left_out = False
        self._room.set()
        if self._held_since is not None and (self._has_room() or not self._thread.is_alive()):
            self._engine.from_any_thread(self._let_go)

    def _let_go(self) -> None:
        if self._held_since is None:
            return
        self._note_held(monotonic() - self._held_since)
        self._held_since = None
        held, self._held = self._held, []
        if self._engine.core.over:
            return
        self._engine.core.end_async()
        for worker in held:
            unblock(worker, RECORDED)
        self._engine.kick()

    def _note_held(self, seconds: float) -> None:
        self.held_s += seconds
        self.times_held += 1

    # --- other events, and the end ------------------------------------------------------------------------------------

    def _seldom_event(self, event: TraceEvent) -> None:
        self._items.extend((None, event, 0.0, 0, event.time))
        if type(event).__name__ == "StructureChanged":
            self._engine.soon(self._structure_changed)

    def _structure_changed(self) -> None:
        if self._open and not self._engine.core.over:
            for looker in self._lookers:
                self._find_sender(looker)
            self.on_structure()

    def stop(self) -> None:
        """Observe nothing any more; tokens that wait for the thread are still written. Does nothing the second time."""
        if not self._open:
            return
        for remove in self._lookers.values():
            remove()
        self._lookers.clear()
        self.remove()
        self._let_go()
        self._thread.finish()

    async def end(self) -> None:
        """The run is over: the file is complete when this returns."""
        self.stop()
        await self.written()

    async def written(self) -> None:
        """Wait until all is written, while other tasks continue."""
        while self._thread.is_alive():
            self._thread.join(_JOIN_S)
            await asyncio.sleep(0)


def _waited(worker: RunningNode) -> bool:
    """Return whether the firing that has ended had waited: otherwise it ends in its turn."""
    return worker.is_async and not worker.core.pumping


def _told(token: Token[Any], **how: Any) -> Told:
    return Told(token.value, token.activity, token.stamp, token.sequence, **how)


def _nothing() -> None:
    pass


def _no_token(_token: Token[Any]) -> None:
    pass


def _no_word(_place: TokenWriter, _error: Exception) -> None:
    pass
