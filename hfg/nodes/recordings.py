"""Recordings as sources: what passed a port of another run, when it did.

`hfg record` writes them, and `hfg play` plays one into a whole graph.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from annotated_types import Ge

from hfg.errors import UsageError
from hfg.graph.structure.naming import suggest
from hfg.nodetypes.node import Node
from hfg.ports import Event, Output, Parameter
from hfg.recording.players import Player, tell_losses
from hfg.recording.reading import File
from hfg.recording.tracks import Track, recorded_ports

__all__ = ["Playback"]


class Playback(Node):
    """Send what was recorded of one port, when it was: a source.

    Each firing sends one recorded token, with its stamp and modifier, at the time at which it passed, counted from the
    beginning of the run; silence is silence again. Recorded signals of an event leave by `signal`, tokens of an output
    by `out`. It ends with the recording. On the real clock `speed` says how much faster time goes, in virtual time
    nothing is waited for; a `speed` of 0 gives all at once, as fast as the graph takes it.

    Attributes:
      file: the recording, as `hfg record` writes it.
      port: the path of the recorded port, "camera.out"; empty: the only one.
      speed: how many recorded seconds pass in one second; 0: as fast as can be.
      out: what an output has sent.
      signal: what an event has triggered.

    Raises:
      UsageError: the file cannot be read, or has no such port.
    """

    file = Parameter(Path("recording.mcap"))
    port = Parameter("")
    speed = Parameter(1.0, Ge(0.0), step=0.5, unit="1")
    out = Output(Any)
    signal = Event(Any)

    def setup(self) -> None:
        """Open the recording."""
        self._recording = File(self.file)
        known = recorded_ports(self._recording)
        port = next(iter(known)) if not self.port and len(known) == 1 else self.port
        if port not in known:
            raise UsageError(f'no port "{port}" was recorded in {self.file}; {suggest(port, known)}')
        names = {port: "signal" if known[port].metadata.get("kind") == "event" else "out"}
        track = Track(self._recording, {port: Any}, may_pickle=False)
        self._player = Player(self, track, names, self.speed or None)
        tell_losses(self._player, self._recording)

    def ready(self) -> bool:
        """Return whether the next token is due."""
        return self._player.ready()

    def process(self) -> None:
        """Send it."""
        self._player.play()

    def teardown(self) -> None:
        """Close the recording."""
        recording = getattr(self, "_recording", None)
        if recording is not None:
            recording.close()
