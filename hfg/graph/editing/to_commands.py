"""Turns a graph into the commands that build it: carried out on an empty graph they make an equal one (rule R4).

The graph becomes a document, and a graph is made of the document; each step of that is a command. So commands can say
what documents can say, and are known to work. Depends on `to_document` and `from_document`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from typing_extensions import override

from hfg.errors import EncodingError, GraphError, HfgError
from hfg.graph.editing import commands as c
from hfg.graph.editing.from_document import Builder
from hfg.graph.editing.steps import Steps
from hfg.graph.editing.to_document import Describer
from hfg.graph.structure.level import Level, Whole


def as_commands(level: Level) -> list[c.Command]:
    """See `Graph.as_commands`.

    Raises:
      GraphError: part of the graph cannot be expressed by commands.
    """
    if level.owner is not None:
        raise GraphError(
            f'{level.title} is described with the whole graph: write graph.as_commands() of "{level.whole.root.name}"'
        )
    document = _Describer(level).document()
    root = Level(level.name, Whole(level.whole.make_face, level.whole.box_type))
    recording = _Recording(root, Steps(root))
    try:
        recording.build(document)
        recording.finish()
    except HfgError as error:
        raise GraphError(f"the graph cannot be made by commands, because one of them is refused: {error}") from error
    return recording.commands


class _Describer(Describer):
    @override
    def wrong(self, what: str, path: str, sentence: str) -> None:
        raise GraphError(f"{what}: {sentence}")

    @override
    def encoded(self, encode: Callable[[Any], Any], value: object) -> object:
        """Return a value that is not data as it is: the commands work in this process, and cannot be encoded."""
        try:
            return encode(value)
        except EncodingError:
            return value


class _Recording(Builder):
    def __init__(self, root: Level, steps: Steps) -> None:
        super().__init__(root, steps)
        self.commands: list[c.Command] = []

    @override
    def record(self, command: c.Command) -> None:
        self.commands.append(command)
