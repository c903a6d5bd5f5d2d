"""The base of all commands, and commands as JSON (rule R4). `commands` has the commands themselves."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Union, cast

import msgspec

from hfg.base.hooks import hooks
from hfg.encoding import TAG
from hfg.errors import GraphError


class _Sentence(msgspec.StructMeta):
    """Makes wrong calls of commands raise an error of hfg that shows the call to write."""

    if not TYPE_CHECKING:  # type checkers know it of the fields

        def __call__(self, *values: object, **named: object) -> object:
            try:
                return super().__call__(*values, **named)
            except TypeError as error:
                words = str(error)
                fields = [
                    one.name if one.required else f"{one.name}=..." for one in msgspec.structs.fields(cast(Any, self))
                ]
                name = f"commands.{self.__name__}"
                raise GraphError(f"{name}: {words[:1].lower()}{words[1:]}; write {name}({', '.join(fields)})") from None


class Command(
    msgspec.Struct,
    metaclass=_Sentence,
    frozen=True,
    tag=True,
    tag_field="do",
    forbid_unknown_fields=True,
    omit_defaults=True,
):
    """One edit. Paths are those of the whole graph: "fetch/go_to", "fetch/go_to.goal", "fetch.person.inner"."""

    def references(self) -> Iterable[str]:
        """Return the references of the code that it names."""
        return ()

    def types(self) -> Iterable[str]:
        """Return the types of ports that it names."""
        return ()


def encode(commands: Iterable[Command]) -> str:
    """Return commands as one line of JSON.

    Raises:
      GraphError: a value is not data.

    Examples:
      >>> from hfg.graph.editing.commands import Connect
      >>> encode([Connect("camera.out", "show.value", active=True)])
      '[{"do":"Connect","source":"camera.out","target":"show.value","active":true}]'
    """
    listed = list(commands)
    try:
        return msgspec.json.encode(listed).decode()
    except (TypeError, ValueError) as error:
        raise GraphError(f"commands are plain data, and these hold something else: {error}") from error


def decode(data: str | bytes, *, allow: Iterable[str] = ()) -> Sequence[Command]:
    """Read commands that may come from another program.

    When they are applied, they import the modules that they name. So they may name only what a graph file may: modules
    of hfg, of packages with node types, modules that are already imported, and those that are allowed here.

    Args:
      data: one line of JSON.
      allow: further packages whose code they may run.

    Raises:
      GraphError: it is not JSON, or not a list of commands, and where; or they name another module.
    """
    commands = read(data)
    references = [one for command in commands for one in command.references()]
    values = [one for command in commands for one in _in_values(command)]
    types = [text for command in commands for text in command.types()]
    why = hooks.refusal(references, values, types, allow)
    if why is not None:
        raise GraphError(f"these commands are refused: {why}")
    return commands


def _in_values(command: Command) -> Iterator[str]:
    """Yield the code that values with a tag name: `{"$type": "my_robot.types:Pose", "value": ...}`."""
    left = [msgspec.to_builtins(command)]
    while left:
        one = left.pop()
        if isinstance(one, dict):
            if TAG in one:
                named = one.get("value") if one[TAG] == "reference" else one[TAG]
                if isinstance(named, str) and ":" in named:
                    yield named
            left += one.values()
        elif isinstance(one, list | tuple):
            left += one


def read(data: str | bytes) -> Sequence[Command]:
    """Read commands from a source that may run any code here anyway.

    Raises:
      GraphError: it is not JSON, or not a list of commands; the message says where.
    """
    try:
        return _decoder().decode(data)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise GraphError(f"this is not a list of commands: {error}") from error


@functools.cache
def _decoder() -> msgspec.json.Decoder[list[Command]]:
    return msgspec.json.Decoder(list[Union[tuple(Command.__subclasses__())]])  # type: ignore[misc]  # noqa: UP007
