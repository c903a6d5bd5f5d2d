"""Carries out the requests of pages and returns the answers. Depends on `following` and `asking`."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from typing import Any, Final, TypeAlias

from hfg.graph.editing import Transaction, history_of
from hfg.graph.editing.commands import Command, Note, decode
from hfg.graph.structure.level import inside, level_of
from hfg.graph.structure.paths import node_at
from hfg.panels import Change
from hfg.studio import messages as m
from hfg.studio.asking import ask
from hfg.studio.following import Following
from hfg.studio.offering import change_of, offered_action, signal_of
from hfg.studio.recorded import Recorded
from hfg.studio.refusing import Refused
from hfg.studio.starters import starter_graph
from hfg.studio.viewing import Viewer
from hfg.studio.words import in_words

__all__ = ["answer", "edit"]

Reply: TypeAlias = m.Ack | m.Answer
Host: TypeAlias = Following


async def answer(host: Any, viewer: Viewer, message: m.Request) -> Reply:
    """Do what a page asks for.

    Raises:
      HfgError: it is refused; nothing was changed.
    """
    if isinstance(message, m.Ask):
        _need_allowed(host, message.what)
        return m.Answer(message.id, await ask(host, message.what, message.args))
    if host.read_only and type(message) not in host.steering.looking:
        raise Refused("read_only", host.read_only)
    value = await _DO[type(message)](host, viewer, message)
    return m.Ack(message.id, host.tables.rev) if value is None else m.Answer(message.id, value)


_BUILDS: Final = ("paste", "amended")  # nodes, whose code runs
_LISTS: Final = ("folder", "start")  # what might be opened


def _need_allowed(host: Any, what: str) -> None:
    """Refuse questions whose answers are of use only to those who may change, or open, something."""
    if what in _BUILDS and host.read_only:
        raise Refused("read_only", host.read_only)
    if what in _LISTS:
        host.may_open()


# --- edits ---


async def _edit(host: Host, viewer: Viewer, message: m.Edit) -> None:
    commands = decode(bytes(message.commands), allow=host.project.allow)
    await edit(host, viewer, commands, message.gesture)


async def edit(host: Host, viewer: Viewer, commands: Any, gesture: str = "") -> None:
    """Carry commands out, update all pages, and add them to the journal."""
    if not commands:
        raise Refused("usage", "an edit has at least one command")
    async with host.turn:
        steps = len(history_of(host.graph).done)
        await host.steering.edit(commands)
        changes = history_of(host.graph).done[-1].changes
        host.attribution.note(host.graph, viewer.number, gesture)
        host.project.journal.edited(commands, joined=len(history_of(host.graph).done) == steps)
        _told(host, changes, viewer, in_words(commands))


def _told(host: Host, changes: Any, viewer: Viewer, text: str) -> None:
    host.refresh(changes, viewer.number, text)


async def _undo(host: Host, viewer: Viewer, message: m.Undo) -> None:
    async with host.turn:
        step: Transaction = history_of(host.graph).next_undo()
        await host.steering.undo()
        host.project.journal.undone(host.graph)
        _told(host, step.changes, viewer, f"undo: {in_words(step.commands)}")


async def _redo(host: Host, viewer: Viewer, message: m.Redo) -> None:
    async with host.turn:
        step: Transaction = history_of(host.graph).next_redo()
        await host.steering.redo()
        host.project.journal.redone(host.graph)
        _told(host, step.changes, viewer, f"redo: {in_words(step.commands)}")


async def _reload(host: Host, viewer: Viewer, message: m.Reload) -> None:
    kinds = {node._type.module for level in level_of(host.graph).walk() for node in level.nodes.values()}
    if message.module not in kinds:
        known = ", ".join(sorted(kinds)) or "none"
        raise Refused("unknown", f'no node type of the graph is from module "{message.module}"; there are {known}')
    async with host.turn:
        await host.steering.reload(message.module)
        host.attribution.note(host.graph, viewer.number, "")
        host.refresh_all(viewer.number, f"reload {message.module}")


async def _arrange(host: Host, viewer: Viewer, message: m.Arrange) -> None:
    root = level_of(host.graph)
    level = root if not message.level else inside(node_at(root, message.level))
    if level is None:
        raise Refused("unknown", f'"{message.level}" is not a subgraph, so nothing is inside it', message.level)
    wanted = None if message.paths is None else set(message.paths)
    paths = [node.place.path for node in level.nodes.values()]
    placed = [one for one in paths if "position" in host.graph.notes(one) and (wanted is None or one in wanted)]
    if placed:
        commands: list[Command] = [Note(one, "position", None) for one in placed]
        await edit(host, viewer, commands)


# --- the run ---


async def _start(host: Host, viewer: Viewer, message: m.Start) -> None:
    async with host.turn:
        host.forget_problems()
        await host.steering.start(stay=message.stay)
    host.refresh_all()


async def _stop(host: Host, viewer: Viewer, message: m.Stop) -> None:
    host.steering.stop()


async def _pause(host: Host, viewer: Viewer, message: m.Pause) -> None:
    host.steering.pause()


async def _proceed(host: Host, viewer: Viewer, message: m.Proceed) -> None:
    host.steering.proceed()


async def _reset(host: Host, viewer: Viewer, message: m.Reset) -> None:
    host.steering.reset()


async def _step(host: Host, viewer: Viewer, message: m.Step) -> dict[str, Any]:
    return await host.steering.step(message.path, back=message.back)


async def _seek(host: Host, viewer: Viewer, message: m.Seek) -> None:
    host.steering.seek(message.at)


async def _trigger(host: Host, viewer: Viewer, message: m.Trigger) -> None:
    await host.steering.trigger(message.path, message.value, message.activity)


async def _act(host: Host, viewer: Viewer, message: m.Act) -> None:
    kind, action = offered_action(host.graph, message.path, message.name)
    if isinstance(action, Change):
        await edit(host, viewer, change_of(message.path, kind, action, message.args))
        return
    value, said = signal_of(message.path, kind, action, message.args)
    await host.steering.trigger(f"{message.path}.{action.slot}", value, None)
    host.attribution.called(said, viewer.number)
    host.singles_changed(viewer.number, said)


async def _break(host: Host, viewer: Viewer, message: m.Break) -> None:
    host.steering.break_at(message.path, message.condition)


async def _unbreak(host: Host, viewer: Viewer, message: m.Unbreak) -> None:
    host.steering.unbreak(message.path)


# --- the file ---


async def _open(host: Any, viewer: Viewer, message: m.Open) -> None:
    async with host.turn:
        host.may_open()
        _need_rest(host)
        if message.path.endswith(".mcap"):
            await _open_recording(host, message)
            return
        project = host.project.graph_project()
        if message.starter:
            project.begin(starter_graph(message.starter), discard=message.discard)
        else:
            project.open(message.path, discard=message.discard)
        if project is host.project:
            host.take_graph(viewer.number, f"open {message.path or host.graph.name}")
        else:
            await host.exchange(project, None)


async def _open_recording(host: Any, message: m.Open) -> None:
    host.project.need_saved(message.discard)
    file = host.project.existing(message.path)
    recorded = await asyncio.to_thread(Recorded, file, None, allow=host.project.allow)
    await host.exchange(host.project.recording(recorded.graph_after(0), file), recorded)


async def _reread(host: Host, viewer: Viewer, message: m.Reread) -> None:
    async with host.turn:
        _need_rest(host)
        host.project.reread()
        host.take_graph(viewer.number, "read the file again")


async def _save(host: Host, viewer: Viewer, message: m.Save) -> None:
    async with host.turn:
        host.project.save(message.path, force=message.force)
        host.singles_changed(viewer.number, "save")


async def _journal(host: Host, viewer: Viewer, message: m.Journal) -> None:
    async with host.turn:
        _need_rest(host)
        try:
            host.project.take_journal(take=message.take)
        finally:
            host.refresh_all(viewer.number, "take up unsaved edits" if message.take else "drop unsaved edits")


def _need_rest(host: Host) -> None:
    if host.steering.run is not None:
        raise Refused("state", "the graph runs, and another one cannot take its place meanwhile; stop it first")


_DO: Final[Mapping[type[m.Request], Callable[[Any, Viewer, Any], Awaitable[Any]]]] = {
    m.Edit: _edit,
    m.Undo: _undo,
    m.Redo: _redo,
    m.Reload: _reload,
    m.Arrange: _arrange,
    m.Start: _start,
    m.Stop: _stop,
    m.Pause: _pause,
    m.Proceed: _proceed,
    m.Reset: _reset,
    m.Step: _step,
    m.Seek: _seek,
    m.Trigger: _trigger,
    m.Act: _act,
    m.Break: _break,
    m.Unbreak: _unbreak,
    m.Open: _open,
    m.Reread: _reread,
    m.Save: _save,
    m.Journal: _journal,
}
