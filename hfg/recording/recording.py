"""Recording a run: which ports, into which file, and the results. Depends on the engine and on `writing`."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from types import TracebackType
from typing import Any, Final

import msgspec

from hfg.base.logs import Log
from hfg.engine import Run
from hfg.engine.model.running_node import DISABLED
from hfg.errors import GraphError, UsageError
from hfg.graph import commands
from hfg.graph.flat import flatten
from hfg.graph.structure.naming import suggest
from hfg.ports import Port
from hfg.ports.automatic import sent_name
from hfg.recording.forms import reference
from hfg.recording.messages import Firings, Images, TokenWriter
from hfg.recording.recorder import Recorder
from hfg.recording.writing import RecordingWriter, open_new
from hfg.types import describe

_LOGGER = Log("hfg.recording")
_PATTERN: Final = frozenset("*?[")
VERSION: Final = 2
"""2: tokens of nodes with several outputs have the number of their firing."""


class Recording:
    """A recording in progress, or its result. Use it with `with` or `async with`, or let it end with the run.

    Attributes:
      path: path of the file.
      when_failed: called on the loop of the run when writing has failed.
    """

    def __init__(self, run: Run, writer: RecordingWriter, recorder: Recorder, select: Sequence[str], how: _How) -> None:
        self.path = writer.path
        self._run = run
        self._writer = writer
        self._recorder = recorder
        self._select = select
        self._how = how
        self._places: dict[Any, TokenWriter] = {}
        self._firings: dict[Any, Firings] = {}  # for nodes with several outputs
        self._told: set[TokenWriter] = set()
        self.when_failed: Callable[[], None] | None = None
        recorder.on_structure = self._look_again
        recorder.on_refused = self._refused
        writer.taken = recorder.thread_waits_for
        writer.failed = self._has_failed
        writer.last_words = self._last_words

    # --- for users ----------------------------------------------------------------------------------------------------

    @property
    def ports(self) -> list[str]:
        """The paths of the ports that are recorded."""
        return [place.path for place in self._places.values()]

    @property
    def error(self) -> BaseException | None:
        """Why writing has stopped; None if there is no error."""
        return self._writer.error

    @property
    def tokens(self) -> int:
        """Number of tokens written, including markers."""
        return sum(place.values + place.markers for place in list(self._places.values()))

    @property
    def bytes_written(self) -> int:
        """Current length of the file."""
        return self._writer.bytes_written

    @property
    def chunks_written(self) -> int:
        """Number of chunks in the file; a recording that was broken off can be read up to the last of them."""
        return self._writer.chunks_written

    @property
    def left_out(self) -> dict[str, int]:
        """Tokens that could not be recorded in time, or at all, by port."""
        found = {place.path: place.left_out + place.refused for place in self._places.values()}
        return {path: count for path, count in found.items() if count}

    @property
    def held_s(self) -> float:
        """How long nodes had to wait for the recording, in seconds."""
        return self._recorder.held_s

    def stop(self) -> None:
        """Stop recording; tokens sent so far are still written. A second call does nothing."""
        self._recorder.stop()

    async def close(self) -> None:
        """Stop recording, and wait until the file is complete."""
        self.stop()
        await self._recorder.written()

    async def __aenter__(self) -> Recording:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        await self.close()

    # --- inside -------------------------------------------------------------------------------------------------------

    def begin(self) -> None:
        """Start observing the selected ports.

        Raises:
          UsageError: no port is selected, or values of a port cannot be recorded.
        """
        for port in self._selected():
            self._add(port)

    def _selected(self) -> list[Any]:
        known = ports_of(self._run)
        found: dict[int, Any] = {}
        for pattern in self._select:
            if not _PATTERN & set(pattern) and pattern not in known and not _inside(pattern, known):
                port = self._named(pattern, known)
                found[id(port)] = port
                continue
            matching = [port for path, port in known.items() if _fits(path, pattern)]
            if not matching:
                raise UsageError(f'no port matches "{pattern}"; the sending ports are {_listed(known)}')
            found |= {id(port): port for port in matching}
        return list(found.values())

    def _named(self, path: str, known: dict[str, Any]) -> Any:
        """Return a port that is not listed: an input, a slot, an automatic event."""
        try:
            port: Any = self._run.graph[path]
        except Exception:  # any error in the path
            port = None
        if not isinstance(port, Port):
            raise UsageError(f'there is no port "{path}" to record; {suggest(path, known)}')
        return port

    def _add(self, port: Any) -> None:
        if port in self._places:
            return
        hint = port.type
        how = self._how
        _need_data(port.path, hint, how.pickle)
        place = TokenWriter(port.path, hint, images=how.images, may_pickle=how.pickle)
        node: Any = getattr(port, "node", None)
        kind = getattr(node, "_type", None)
        place.metadata = {
            "kind": port.kind,
            "type": "None" if hint is None else describe(hint),
            "node": node.place.path if kind is not None else "",
            "port": port.name,
            "node_type": (kind.reference or "") if kind is not None else "",
            "source": str(kind is not None and kind.is_source).lower(),
        }
        if kind is not None and port.kind == "output" and len(kind.outputs) > 1:
            place.firings = self._firings.setdefault(node, Firings())
        typed: TokenWriter = place
        self._recorder.look_at(port, typed)
        self._writer.places.append(place)
        self._places[port] = place

    def _look_again(self) -> None:
        """The graph was edited: start recording new ports that are selected."""
        known = ports_of(self._run)
        for path, port in known.items():
            if any(_fits(path, pattern) for pattern in self._select):
                try:
                    self._add(port)
                except UsageError as error:
                    _LOGGER.warning('"%s" is not recorded: %s', path, error)

    def _has_failed(self, error: BaseException) -> None:
        """Called from the thread."""
        _LOGGER.error("the recording in %s is incomplete, writing has stopped: %s", self.path, error)
        if self.when_failed is not None:
            self._run._engine.from_any_thread(self.when_failed)

    def _refused(self, place: Any, error: Exception) -> None:
        if place not in self._told:
            self._told.add(place)
            _LOGGER.error("%s", _cannot(place.path, error))

    def _last_words(self) -> dict[str, str]:
        left_out = {place.path: place.left_out for place in self._places.values() if place.left_out}
        refused = {place.path: place.refused for place in self._places.values() if place.refused}
        report = self._run.report()
        return {
            "outcome": report.outcome,
            "ended": repr(self._run.now()),
            "left_out": msgspec.json.encode(left_out).decode(),
            "refused": msgspec.json.encode(refused).decode(),
            "held_s": f"{self._recorder.held_s:.3f}",
        }


class _How(msgspec.Struct, frozen=True):
    images: Images
    pickle: bool


def record(
    run: Run,
    file: str | os.PathLike[str],
    *,
    select: str | Iterable[str] = "*",
    lossless: bool = True,
    images: Images = "raw",
    pickle: bool = False,
    force: bool = False,
) -> Recording:
    """Record the tokens of a run's ports in an MCAP file, from now on; `run.record` does the same.

    Args:
      run: the run. To miss nothing, call this before its nodes are set up (`begin=`).
      file: the new file; it can be read at any time, up to its last second.
      select: paths of ports or nodes, or patterns of them, "camera/*"; by default all outputs and events.
      lossless: skip nothing: recorded nodes wait if the disk is slower. Otherwise the graph is never slowed, and
        skipped tokens are counted.
      images: how images are written: "raw", "png" (smaller, slower, lossless), "jpeg" (lossy).
      pickle: write values that are not data with pickle; reading such a file runs code.
      force: overwrite an existing file.

    Raises:
      UsageError: no port matches, a port is in another process or its values cannot be recorded, or the file already
        exists or cannot be made.
      NotRunning: the run is over.
    """
    run._need_running("nothing more will be sent")
    patterns = [select] if isinstance(select, str) else list(select)
    if not patterns:
        raise UsageError('select= is empty; it selects the ports to record, as in select="camera/*"')
    if images not in ("raw", "png", "jpeg"):
        raise UsageError(f'images= must be "raw", "png" or "jpeg", got {images!r}')
    run._need_here(lambda port: any(_fits(port, pattern) for pattern in patterns))
    path = Path(file)
    parts, engine = run._parts, run._engine
    probe = _Probe()
    dry = Recording.__new__(Recording)
    dry._run, dry._select = run, patterns
    for port in dry._selected():  # refuse before the file exists
        _need_data(port.path, port.type, pickle)
        probe.look(parts, port)
    stream = open_new(path, force=force)
    writer = RecordingWriter(path, stream, exact_times=engine.virtual, began=_beginning(run, lossless, images))
    recorder = Recorder(engine, parts.consumers, parts.taps, writer, lossless=lossless)
    recording = Recording(run, writer, recorder, patterns, _How(images, pickle))
    recording.begin()
    writer.start()
    parts.consumers.join(recorder)
    return recording


class _Probe:
    """Looks once, to find out whether observing works."""

    def put(self, token: Any) -> None:
        """Called with a token."""

    def end(self) -> None:
        """Called at the end."""

    def look(self, parts: Any, port: Any) -> None:
        """Refuse ports that cannot be observed."""
        parts.taps.look(port, self)()


def ports_of(run: Run) -> dict[str, Any]:
    """Return the ports that send in a run, by path: outputs with an edge, and events that node types declare.

    If a source has outputs without consumers, its event `processed` shows when it has fired; an output without an edge
    is visible only through its event `sent`.
    """
    found: dict[str, Any] = {}
    taken: set[Any] = set()  # outputs of sources that are always live; by port
    speaking: set[Any] = set()  # the nodes of these
    for edge in run._engine.core.edges:
        if edge.segments and edge.source_port.kind == "output":
            found[edge.source_port.path] = edge.source_port
            if edge.source.is_source and _is_always_live(edge.target):
                taken.add(edge.source_port)
                speaking.add(edge.source)
    for worker in run._engine.core.workers:
        if worker.node is not None and worker.type is not None and worker.scope is None:
            names = list(worker.type.events)
            if worker.is_source:
                outputs = worker.type.outputs
                unsure = [name for name in outputs if worker.node._port("output", name) not in taken]
                names += [name for name in map(sent_name, unsure) if name in worker.events]
                names += [] if worker in speaking else ["processed"]
            for name in names:
                port = worker.node._port("event", name)
                found[port.path] = port
    return found


def _is_always_live(target: Any) -> bool:
    """Return whether nothing in the graph disables a node, or a subgraph around it (F10)."""
    around = [target, *(scope.worker for scope in target.around)]
    return not any(
        worker.blocked & DISABLED
        or (worker.options is not None and worker.options.on_error == "disable")
        or any(edge.port_name in ("disable", "enable") for edge in worker.slot_edges)
        for worker in around
    )


def _fits(path: str, pattern: str) -> bool:
    # "world.odometry[0]" is the path of a port, although brackets have a meaning in patterns
    return path == pattern or fnmatchcase(path, pattern) or _is_inside(pattern, path)


def _is_inside(node: str, path: str) -> bool:
    """Return whether a port belongs to a node, or to one inside it."""
    return path.startswith((f"{node}.", f"{node}/"))


def _inside(pattern: str, known: dict[str, Any]) -> bool:
    return any(_is_inside(pattern, path) for path in known)


def _listed(known: dict[str, Any]) -> str:
    names = [f'"{path}"' for path in known]
    more = len(names) - 12
    return ", ".join(names[:12]) + (f" and {more} more" if more > 0 else "") if names else "none"


def is_recordable(path: str, hint: Any) -> bool:
    """Return whether values of a port can be data, as far as its type tells."""
    try:
        _need_data(path, hint, may_pickle=False)
    except UsageError:
        return False
    return True


def _need_data(path: str, hint: Any, may_pickle: bool) -> None:
    """Refuse a port whose values can never be written."""
    if may_pickle or not isinstance(hint, type) or hint in (object, Any):
        return
    if hint.__module__ == "builtins" or hint.__flags__ & (1 << 20):  # an abstract class: actual values may be data
        return
    if getattr(hint, "_is_protocol", False) or _is_data(hint):
        return
    raise UsageError(_cannot(path, f"{reference(hint)} is not data that JSON can hold"))


def _is_data(hint: type) -> bool:
    import datetime
    import decimal
    import enum
    import pathlib
    import uuid
    from collections import deque

    import numpy as np

    from hfg.recording.forms import fields_of

    known = (
        enum.Enum,
        np.ndarray,
        np.generic,
        datetime.date,
        datetime.time,
        datetime.timedelta,
        decimal.Decimal,
        uuid.UUID,
        pathlib.PurePath,
        deque,
    )
    has_subclasses = bool(hint.__subclasses__())
    return fields_of(hint) is not None or issubclass(hint, known) or has_subclasses


def _cannot(path: str, error: object) -> str:
    return (
        f'values of "{path}" cannot be recorded: {error}; make it a dataclass, record without this port, or allow '
        "pickle=True, which other programs cannot read"
    )


def _beginning(run: Run, lossless: bool, images: str) -> dict[str, str]:
    """Return the description of the run for the start of the file: the graph itself, with the values of parameters."""
    flat = flatten(run.graph)
    nodes = {
        node.path: {
            "type": node.node._type.reference,
            "parameters": {name: _shown(value) for name, value in node.node._parameters.items()},
            "group": node.options.group,
        }
        for node in flat.nodes
    }
    edges = [{"edge": edge.label, "active": edge.active} for edge in flat.edges]
    try:
        made_by = commands.encode(run.graph.as_commands())
    except GraphError:  # types or operators without a name: nodes and edges are listed anyway
        made_by = ""
    return {
        "version": str(VERSION),
        "graph": run.graph.name,
        "clock": "virtual" if run._engine.virtual else "real",
        "began": repr(run.now() - run.elapsed()),
        "lossless": str(lossless).lower(),
        "images": images,
        "nodes": msgspec.json.encode(nodes, enc_hook=repr).decode(),
        "edges": msgspec.json.encode(edges).decode(),
        "commands": made_by,
    }


def _shown(value: Any) -> Any:
    """Return a parameter's value as JSON, or as text if it is not data."""
    try:
        return msgspec.Raw(msgspec.json.encode(value))
    except Exception:
        return repr(value)
