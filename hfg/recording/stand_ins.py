"""Node types that play the recording of a node in its place. Depends on `players` and `tracks`."""

from __future__ import annotations

import dataclasses
import itertools
import sys
import types
from collections.abc import Callable
from typing import Any, Final, NamedTuple
from weakref import WeakKeyDictionary

from hfg.graph.structure.level import level_of
from hfg.nodetypes.description import NodeType
from hfg.nodetypes.node import Node
from hfg.recording.players import Player
from hfg.recording.reading import File
from hfg.recording.tracks import Track

_numbers: Final = itertools.count(1)


class How(NamedTuple):
    """Options of playback.

    Attributes:
      file: the recording.
      speed: recorded seconds per second of the run's clock; None: as fast as possible.
      pickle: whether pickled values are read.
      begun: called with the engine of each run that plays.
    """

    file: str
    speed: float | None
    pickle: bool
    begun: Callable[[Any], None]


def stand_in(old: Node, names: dict[str, str], hints: dict[str, Any], how: How) -> str:
    """Make a type with the ports and parameters of a node's type that plays its recording. Return its reference.

    Args:
      old: the node.
      names: paths of recorded ports, and the node's port for each.
      hints: types of these ports.
      how: options of playback.
    """
    kind = old._type
    waits = kind.is_source and kind.process_kind.startswith("async")
    qualname = f"Played{next(_numbers)}"
    body = {
        "__module__": __name__,
        "__qualname__": qualname,
        "setup": _setup(names, hints, how),
        "ready": _ready,
        "process": _process_waiting if waits else _process,
        "teardown": _teardown,
        # the effects of a slot are in the recording
        "_handler": lambda self, name: lambda *value: self._player.called(),
        "_made": lambda cls: _description(cls, old, waits=waits),
    }
    made: Any = types.new_class(qualname, (Node,), {"_made": body.pop("_made")}, lambda names: names.update(body))
    setattr(sys.modules[__name__], qualname, made)
    return f"{__name__}:{qualname}"


def _description(cls: type[Node], old: Node, *, waits: bool) -> NodeType:
    kind = old._type
    return dataclasses.replace(
        kind,
        origin=cls,
        module=__name__,
        qualname=cls.__qualname__,
        doc=f"Plays the recording of {old.place.path}.",
        inputs={},
        states={},
        process_kind="async" if waits else "function",
        result="fields" if kind.outputs else "none",
        fields=(),
        is_function=False,
        hooks=frozenset({"setup", "ready", "teardown"}),
        caller=lambda node: node.process,
    )


def _setup(names: dict[str, str], hints: dict[str, Any], how: How) -> Callable[[Any], None]:
    players: WeakKeyDictionary[Any, tuple[File, Player]] = WeakKeyDictionary()  # per run

    def setup(self: Any) -> None:
        engine: Any = getattr(level_of(self._place.graph).whole.run, "_engine", None)
        if engine in players:  # it was disabled or reset, and continues where it was
            self._recording, self._player = players[engine]
            return
        self._recording = File(how.file)
        track = Track(self._recording, hints, may_pickle=how.pickle)
        self._player = Player(self, track, names, how.speed)
        if engine is not None:
            players[engine] = self._recording, self._player
            how.begun(engine)

    return setup


def _ready(self: Any) -> bool:
    ready: bool = self._player.ready()
    return ready


def _process(self: Any) -> None:
    self._player.play()


async def _process_waiting(self: Any) -> None:
    await self._player.play_waiting()


def _teardown(self: Any) -> None:
    """Close the file after the run, not when the node is disabled or reset: playback continues where it was."""
    player = self._player
    if player.engine is None or player.engine.core.over:
        self._recording.close()
