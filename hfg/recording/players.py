"""Plays the steps of a track as the code of one node: its process function, its `ready()`, its slots.

A firing is played when it started, by the clock. If the engine would not yet allow a node of its kind to fire (its
outputs, its rate in a bit-identical run), it does not allow the player either. A slot call is played when that call
arrives, by its number; otherwise at its recorded time. Depends on the engine and `tracks`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Any, Final

import msgspec

from hfg.base.logs import Log
from hfg.base.token import NO_MESSAGE
from hfg.engine.model.running_node import UNREADY
from hfg.engine.rules.agenda import unblock
from hfg.errors import EndOfStream, HfgError, UsageError
from hfg.graph.structure.level import level_of
from hfg.nodetypes.node import Node
from hfg.recording.reading import File, Loss
from hfg.recording.tracks import Record, Step, Track

_SAME_MOMENT_S: Final = 1e-9
_LOGGER: Final = Log("hfg.recording")


class Player:
    """Plays the steps of a track.

    Attributes:
      engine: engine of the run in which it plays; None outside a run.
    """

    def __init__(self, node: Node, track: Track, outputs: Mapping[str, str], speed: float | None) -> None:
        """Start.

        Args:
          node: the node that sends.
          track: the steps to play.
          outputs: the node's output or event for each recorded port.
          speed: factor of the recorded speed; None: as fast as possible.
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
        self._start: float | None = None  # when its graph started to run
        self._waits = self._waits_for_other = False

    def _begin_at(self, start: float) -> None:
        self._start = start
        worker = self._worker
        if not self._is_exact() and worker.options.max_rate_hz:
            # the recording reflects the node's original rate limit, which would only slow down faster playback
            worker.options = msgspec.structs.replace(worker.options, max_rate_hz=None)
            worker.paced = bool(worker.gates_over)

    def _is_exact(self) -> bool:
        """Return whether each moment must be bit-identical."""
        track = self._track
        return self._speed == 1.0 and self.engine.virtual and track.exact and self._start == track.began

    def _look(self) -> None:
        """Read the next step."""
        if not self._read:
            self._read = True
            self._firing = next(self._firings, None)
            self._other = next(self._others, None)
        if self.engine is not None and self._start is None:
            self._begin_at(self.engine.moving_since)

    # --- firings ------------------------------------------------------------------------------------------------------

    def ready(self) -> bool:
        """Return whether a firing is due; if not, the engine calls it again when one is.

        Raises:
          EndOfStream: no step is left.
        """
        self._look()
        self._play_others()
        step = self._firing
        fed = () if self._worker is None else self._worker.live_inputs  # parameters
        while fed and step is not None and step.silent:
            # the engine does this itself, as it did during the recording
            step = self._firing = next(self._firings, None)
        if fed and all(edge.contents()[0].is_marker for edge in fed):
            return True  # the engine does not call the function in this case either
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
        """Send the tokens of one firing.

        Raises:
          EndOfStream: the stream ended here.
        """
        step = self._begin_firing()
        for signal in step.signals:
            self._trigger(signal)
        self._end_firing(step)

    async def play_waiting(self) -> None:
        """Do the same for a node whose code waits; the firing takes as long as it did.

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
            # tokens without a stamp of their own, including silence, get the firing's stamp
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
        """Return the time on this run's clock for a time on the recording's clock."""
        assert self._start is not None
        if self._speed == 1.0 and self._start == self._track.began:
            return when  # bit for bit
        return self._start + (when - self._track.began) / (self._speed or 1.0)

    def _now_due(self) -> None:
        self._waits = False
        unblock(self._worker, UNREADY)

    # --- slot calls, and what is triggered beside all -----------------------------------------------------------------

    def called(self) -> None:
        """Count a call of a slot of the node."""
        self._look()
        step = self._other
        if step is not None and step.call and self._worker is not None and step.call == self._worker.counts.calls:
            self._play_other(step)
        self._play_others()

    def _play_others(self) -> None:
        """Trigger the next signals that are due. A call that has not arrived comes after all others of its moment."""
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
    """Log each loss in a recording when it is reached, and put it into the report of the run, once."""
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
    """Return the newest stamp of a firing's markers; values may have stamps of their own."""
    silent = [token.stamp for token in step.sent.values() if token.value is NO_MESSAGE]
    return max(silent or [token.stamp for token in step.sent.values()] or [step.when])
