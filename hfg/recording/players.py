"""Plays the steps of a track as the code of one node: its process function, its `ready()`, its slots.

A firing is played when it began, by the clock; what the engine would not yet allow a node of its kind (its outputs, its
rate in a run that is the same to the bit) it does not allow the player either. A slot call is played when that call
comes, by its number, else when it was. Stands on the engine and `tracks`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Any, Final

import msgspec

from hfg.base.logs import Log
from hfg.base.token import NO_MESSAGE
from hfg.engine.model.worker import UNREADY
from hfg.engine.rules.agenda import unblock
from hfg.errors import EndOfStream, HfgError, UsageError
from hfg.graph.structure.level import level_of
from hfg.nodetypes.node import Node
from hfg.recording.reading import File, Loss
from hfg.recording.tracks import Record, Step, Track

__all__ = ["Player", "tell_losses"]

_SAME_MOMENT_S: Final = 1e-9
_LOGGER: Final = Log("hfg.recording")


class Player:
    """Plays the steps of a track.

    Attributes:
      engine: of the run in which it plays; None outside of one.
    """

    def __init__(self, node: Node, track: Track, outputs: Mapping[str, str], speed: float | None) -> None:
        """Begin.

        Args:
          node: it sends.
          track: what.
          outputs: which recorded port is which of its outputs and events.
          speed: how much faster than it was; None: as fast as can be.
        """
        self._node = node
        self._outputs = outputs
        self._track = track
        self._firings = track.firings()
        self._others = track.others()
        self._firing: Step | None = None
        self._other: Step | None = None
        self._read = False
        self._speed = speed
        run: Any = None if node._place is None else level_of(node._place.graph).whole.run
        self.engine: Any = getattr(run, "_engine", None)
        self._worker: Any = None if self.engine is None else self.engine.worker_of(node)
        self._start: float | None = None  # when its graph began to move
        self._waits = self._waits_for_other = False

    def _begin_at(self, start: float) -> None:
        self._start = start
        worker = self._worker
        if not self._is_exact() and worker.options.max_rate_hz:
            # what it had for a rate is in the recording, and would only hold up who plays faster
            worker.options = msgspec.structs.replace(worker.options, max_rate_hz=None)
            worker.paced = bool(worker.gates_over)

    def _is_exact(self) -> bool:
        """Whether each moment is to be the same to the bit."""
        track = self._track
        return self._speed == 1.0 and self.engine.virtual and track.exact and self._start == track.began

    def _look(self) -> None:
        """Read what comes first."""
        if not self._read:
            self._read = True
            self._firing = next(self._firings, None)
            self._other = next(self._others, None)
        if self.engine is not None and self._start is None:
            self._begin_at(self.engine.moving_since)

    # --- firings ------------------------------------------------------------------------------------------------------

    def ready(self) -> bool:
        """Whether a firing is due; if not, it is asked again when it is.

        Raises:
          EndOfStream: there is nothing left.
        """
        self._look()
        self._play_others()
        step = self._firing
        fed = () if self._worker is None else self._worker.live_inputs  # parameters
        while fed and step is not None and step.silent:
            step = self._firing = next(self._firings, None)  # the engine does that by itself, as it did
        if fed and all(edge.contents()[0].is_marker for edge in fed):
            return True  # nor does it ask for the function now
        if step is None:
            if self._other is not None:
                return False
            raise EndOfStream
        begins = step.began if self._takes_its_time() else step.when
        if self.engine is None or self._speed is None:
            return True
        due = self._due(begins)
        now = self.engine.now()
        if due <= now + _SAME_MOMENT_S:
            return True
        if not self._waits:
            self._waits = True
            self.engine.call_at(due, self._now_due)
        return False

    def play(self) -> None:
        """Send what one firing has sent.

        Raises:
          EndOfStream: the stream ended here.
        """
        step = self._begin_firing()
        for signal in step.signals:
            self._trigger(signal)
        self._end_firing(step)

    async def play_waiting(self) -> None:
        """The same for a node whose code waits: it takes as long as it did.

        Raises:
          EndOfStream: the stream ended here.
        """
        step = self._begin_firing()
        for signal in step.signals:
            await self._wait_until(signal.when)
            self._trigger(signal)
        if step.waits:
            await self._wait_until(step.when, always=True)
        self._end_firing(step)

    def _takes_its_time(self) -> bool:
        worker = self._worker
        return worker is not None and bool(worker.is_async)

    def _begin_firing(self) -> Step:
        step = self._firing
        if step is None:
            raise EndOfStream
        self._firing = next(self._firings, None)
        if self._worker is not None:
            # what leaves without a stamp of its own, silence too, has that of then
            self._worker.stamp = step.began if self._track.of_source else _newest_stamp(step)
        return step

    def _end_firing(self, step: Step) -> None:
        written = {self._outputs[path]: token for path, token in reversed(step.sent.items())}
        for name, token in reversed(written.items()):
            if token.value is not NO_MESSAGE:
                self._node._port("output", name).send(token.value, activity=token.activity, stamp=token.stamp)
        if step.ends:
            raise EndOfStream

    async def _wait_until(self, when: float, *, always: bool = False) -> None:
        if self._speed is None or self.engine is None:
            return
        left = self._due(when) - self.engine.now()
        if left > _SAME_MOMENT_S or always:
            await asyncio.sleep(max(left, 0.0))

    def _due(self, when: float) -> float:
        """When on the clock of this run that is which was `when` on that of the recording."""
        assert self._start is not None
        if self._speed == 1.0 and self._start == self._track.began:
            return when  # to the bit
        return self._start + (when - self._track.began) / (self._speed or 1.0)

    def _now_due(self) -> None:
        self._waits = False
        unblock(self._worker, UNREADY)

    # --- slot calls, and what is triggered beside all -----------------------------------------------------------------

    def called(self) -> None:
        """A slot of the node is called."""
        self._look()
        step = self._other
        if step is not None and step.call and self._worker is not None and step.call == self._worker.call_number:
            self._play_other(step)
        self._play_others()

    def _play_others(self) -> None:
        """Trigger what comes next as far as it is due: a call that has not come is behind all others of its moment."""
        while self._other is not None:
            step = self._other
            if self.engine is None or self._speed is None:
                due = now = 0.0
            else:
                due, now = self._due(step.when), self.engine.now()
                due += _GRACE_S if step.call else 0.0
            if due > now + _SAME_MOMENT_S / 2:
                if not self._waits_for_other:
                    self._waits_for_other = True
                    self.engine.call_at(due, self._other_due)
                return
            self._play_other(step)

    def _play_other(self, step: Step) -> None:
        when = step.signals[0].when
        now = [signal for signal in step.signals if signal.when == when]
        later = step.signals[len(now) :]
        self._other = Step(later[0].when, later[0].when, later) if later else next(self._others, None)
        for signal in now:
            self._trigger(signal)

    def _other_due(self) -> None:
        self._waits_for_other = False
        self._play_others()
        if self._other is None:
            unblock(self._worker, UNREADY)

    def _trigger(self, signal: Record) -> None:
        token = signal.token
        port = self._node._port("event", self._outputs[signal.port])
        port.trigger(token.value, activity=token.activity, stamp=token.stamp)


def tell_losses(player: Player, file: File) -> None:
    """Log what of a recording cannot be read, when it is met, and put it into the report of the run: each once."""
    told: list[HfgError] = [] if player.engine is None else player.engine.core.errors

    def tell(loss: Loss) -> None:
        error = UsageError(f"{file.path} is damaged: {loss}")
        if all(str(one) != str(error) for one in told):
            told.append(error)
            _LOGGER.warning("%s", error)

    for loss in file.losses_met():
        tell(loss)
    file.when_lost = tell


_GRACE_S: Final = 2e-9


def _newest_stamp(step: Step) -> float:
    """Of what left in a firing: that of its markers, for values may have one of their own."""
    silent = [token.stamp for token in step.sent.values() if token.value is NO_MESSAGE]
    return max(silent or [token.stamp for token in step.sent.values()] or [step.when])
