"""`hfg set`, `edit`, `undo`, `redo`, `reload`, `pause`, `resume`, `step` and `trigger`: steer a run of another process.

They speak the studio's protocol over the local socket of the run, so all checks are the same as in the page (rule L5).
Depends on `sockets` and the studio's messages.
"""

from __future__ import annotations

import json
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from itertools import count
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from hfg.cli import show
from hfg.cli.sockets import Line, find, which
from hfg.engine.face.watching import Question
from hfg.errors import TargetError
from hfg.studio.local import FrameReader

_PATIENCE: Final = 30
"""How often a request waits two seconds for the run to come to it: an edit waits for firings in progress."""

_Run = Annotated[str | None, typer.Argument(help="process id or name of the graph; default: the only running graph")]
_RunNeeded = Annotated[str, typer.Argument(metavar="RUN", help="process id or name of the graph")]


class _Steered:
    """A run of another process; use it in a `with` block."""

    def __init__(self, name: str) -> None:
        self._line = Line(name)
        self._frames = FrameReader()
        self._numbers = count(1)
        self._heard: list[dict[str, Any]] = []
        if self._line.ask(Question("studio")) is None:
            raise TargetError(f"process {name} does not answer: a node blocks its loop")
        self._say({"t": "join"})
        self._next("snapshot")

    def __enter__(self) -> _Steered:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self._line.__exit__(*exc_info)

    def _say(self, message: Mapping[str, Any]) -> None:
        self._line.send(json.dumps(message).encode() + b"\n")

    def _next(self, *kinds: str) -> dict[str, Any]:
        """Wait for a message of one of these kinds."""
        for _ in range(_PATIENCE):
            while self._heard:
                message = self._heard.pop(0)
                if message["t"] in kinds:
                    return message
            heard = self._line.receive()
            if heard is not None:
                self._heard += [json.loads(data) for data, is_binary in self._frames.feed(heard) if not is_binary]
        raise TargetError("the run does not answer: a node blocks its loop, or an edit waits for a long firing")

    def ask(self, t: str, **fields: Any) -> Any:
        """Ask for something, and wait until it is done.

        Raises:
          TargetError: it is refused; the message is that of the run.
        """
        number = next(self._numbers)
        self._say({"t": t, "id": number, **fields})
        while True:
            answer = self._next("ack", "reject", "answer")
            if answer["id"] == number:
                break
        if answer["t"] == "reject":
            raise TargetError(answer["message"])
        return answer.get("value")


def _steer(verb: str, run: str | None, *requests: Mapping[str, Any]) -> int:
    """Carry requests out, one after the other."""
    there = find(run)
    if len(there) > 1:
        return which(verb, there)
    with _Steered(there[0].name) as steered:
        for request in requests:
            value = steered.ask(**request)
            if isinstance(value, dict) and "moved" in value:
                show.write(_moved(value))
    return 0


def _moved(step: Mapping[str, Any]) -> str:
    return f"{', '.join(step['moved'])}\n" if step["moved"] else f"nothing moved: {step['why_not']}\n"


def set(  # noqa: A001 - the verb
    run: _RunNeeded,
    values: Annotated[list[str], typer.Argument(metavar="PATH=VALUE...", help="as in lookup.tolerance=0.2")],
) -> int:
    """Set parameters of a graph that is running in another process; as one step of its history."""
    there = find(run)
    if len(there) > 1:
        return which("set", there)
    with _Steered(there[0].name) as steered:
        commands = []
        for one in values:
            path, equals, text = one.partition("=")
            if not equals:
                raise TargetError(f'"{one}" sets nothing: write PATH=VALUE, as in lookup.tolerance=0.2')
            said = steered.ask("ask", what="read_text", args={"path": path, "text": text})
            commands.append({"do": "SetParameter", "path": path, "value": said["value"]})
        steered.ask("edit", commands=commands)
    return 0


def edit(
    run: _RunNeeded,
    commands: Annotated[
        str | None,
        typer.Argument(
            help='JSON, as in \'[{"do": "Disable", "path": "camera"}]\'; "-": standard input; default: $EDITOR'
        ),
    ] = None,
) -> int:
    """Edit a graph that is running in another process, by commands as hfg.commands writes them. All or none.

    Without commands, $EDITOR opens the graph as a file, and the difference is carried out when the editor ends.
    """
    if commands is None:
        return _edit_text(run)
    text = sys.stdin.read() if commands == "-" else commands
    try:
        listed = json.loads(text)
    except ValueError as error:
        raise TargetError(f"the commands are not JSON: {error}; hfg.commands.encode writes them") from None
    return _steer("edit", run, {"t": "edit", "commands": listed})


_SAID: Final = "#! "


def _edit_text(run: str) -> int:
    """Let a person edit the graph as a file, until it is accepted, or nothing is changed any more."""
    there = find(run)
    if len(there) > 1:
        return which("edit", there)
    with _Steered(there[0].name) as steered:
        file = steered.ask("ask", what="file", args={})
    before = shown = file["text"]
    refused = ""
    with tempfile.TemporaryDirectory(prefix="hfg-edit-") as folder:
        path = Path(folder) / file["name"]
        while True:
            path.write_text("".join(f"{_SAID}{line}\n" for line in refused.splitlines()) + shown)
            _run_editor(path)
            after = "".join(line for line in path.read_text().splitlines(keepends=True) if not line.startswith(_SAID))
            if refused and after == shown:
                raise TargetError(f"nothing was edited, because the file was left as it was refused: {refused}")
            if after == before:
                show.write("nothing was edited\n")
                return 0
            try:
                return _amend(there[0].name, before, after)
            except TargetError as error:
                refused, shown = str(error), after


def _amend(name: str, before: str, after: str) -> int:
    """Carry out what differs; the connection is a new one, because a person takes minutes."""
    with _Steered(name) as steered:
        commands = steered.ask("ask", what="amended", args={"before": before, "after": after})["commands"]
        if commands:
            steered.ask("edit", commands=commands)
    show.write(f"edited, by {len(commands)} command{'' if len(commands) == 1 else 's'}\n")
    return 0


def _run_editor(path: Path) -> None:
    """Open a file and wait until the person has left it."""
    editor = os.environ.get("VISUAL") or os.environ.get("EDITOR") or shutil.which("vi")
    if not editor:
        raise TargetError("no editor is set: EDITOR=nano hfg edit ..., or give the commands as JSON")
    try:
        code = subprocess.run([*shlex.split(editor), str(path)], check=False).returncode
    except OSError as error:
        raise TargetError(f'the editor "{editor}" cannot be started: {error}; set EDITOR to another') from None
    if code != 0:
        raise TargetError(f'nothing was edited, because the editor "{editor}" ended with code {code}')


def undo(run: _Run = None) -> int:
    """Undo the last edit of a running graph, whoever made it."""
    return _steer("undo", run, {"t": "undo"})


def redo(run: _Run = None) -> int:
    """Carry out again the edit of a running graph that was undone last."""
    return _steer("redo", run, {"t": "redo"})


def reload(run: _RunNeeded, module: Annotated[str, typer.Argument(help="a module that node types come from")]) -> int:
    """Reload a changed module in a running graph, and replace the nodes whose types it defines."""
    return _steer("reload", run, {"t": "reload", "module": module})


def pause(run: _Run = None) -> int:
    """Pause a running graph: no new firing starts."""
    return _steer("pause", run, {"t": "pause"})


def resume(run: _Run = None) -> int:
    """Continue a graph that is paused."""
    return _steer("resume", run, {"t": "proceed"})


def step(
    run: _Run = None,
    node: Annotated[str, typer.Option(metavar="PATH", help="Step this node only. Default: a wave of all nodes.")] = "",
) -> int:
    """Let a paused graph make one step, and print the nodes that moved."""
    return _steer("step", run, {"t": "step", "path": node})


def trigger(
    run: _RunNeeded,
    path: Annotated[str, typer.Argument(help="a slot or an event, as in wait.begin")],
    value: Annotated[str | None, typer.Argument(help="JSON; default: no value")] = None,
    activity: Annotated[int | None, typer.Option(min=-1, max=1, help="1 gives activity, -1 takes it away.")] = None,
) -> int:
    """Send a signal into a slot of a running graph, or trigger an event."""
    try:
        said = None if value is None else json.loads(value)
    except ValueError:
        said = value
    return _steer("trigger", run, {"t": "trigger", "path": path, "value": said, "activity": activity})
