"""`hfg studio TARGET`: a graph in the browser, to be built, watched and steered. Depends on `target` and the studio."""

from __future__ import annotations

import asyncio
import contextlib
import html
import tempfile
import threading
import webbrowser
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from hfg.cli import show
from hfg.cli.interrupt import Interrupt
from hfg.cli.options import LoadFlags, ParamOption
from hfg.cli.settings import set_parameters
from hfg.cli.sockets import find, which
from hfg.cli.target import load_graph
from hfg.engine import PunctualLoop
from hfg.errors import TargetError, UsageError
from hfg.files.opening import SUFFIX
from hfg.graph import Graph
from hfg.graph.structure.level import inside as structure_of
from hfg.graph.structure.level import level_of
from hfg.graph.structure.paths import node_at
from hfg.studio.project import Project, RecordedProject
from hfg.studio.studio import Studio


def studio(
    flags: LoadFlags,
    target: Annotated[
        str | None,
        typer.Argument(help="module:graph, file.py, file.hfg.yaml or a recording, run.mcap; default: an empty graph"),
    ] = None,
    host: Annotated[str, typer.Option(help="Address to listen at; other than this machine needs TLS.")] = "127.0.0.1",
    port: Annotated[int | None, typer.Option(help="Port; default: the first free one from 8800.")] = None,
    attach: Annotated[
        str | None, typer.Option(metavar="RUN", help="Follow and steer a run of hfg run: its process id or graph.")
    ] = None,
    inside: Annotated[str, typer.Option(metavar="SUBGRAPH", help="Show the inside of a subgraph first.")] = "",
    into: Annotated[
        str | None, typer.Option("--into", metavar="TARGET", help="The graph of a recording that does not describe it.")
    ] = None,
    run: Annotated[bool, typer.Option("--run", help="Start the graph, or play the recording, at once.")] = False,
    read_only: Annotated[bool, typer.Option("--read-only", help="Pages may look, not change.")] = False,
    browser: Annotated[bool, typer.Option(help="Open the page in the browser.")] = True,
    certfile: Annotated[Path | None, typer.Option(help="Certificate for TLS (PEM).")] = None,
    keyfile: Annotated[Path | None, typer.Option(help="Its private key (PEM).")] = None,
    insecure: Annotated[bool, typer.Option("--insecure", help="Let other machines in without TLS.")] = False,
    param: ParamOption = None,
) -> int:
    """Build, watch and steer a graph in the browser."""
    show.set_debug(flags.debug)
    _need_extra()
    tls = {"certfile": certfile and str(certfile), "keyfile": keyfile and str(keyfile)}
    options = {"host": host, "port": port, "insecure": insecure, **tls}
    if attach is not None:
        return _attach(attach, target, options, browser, read_only=read_only)
    if target is not None and target.endswith(".mcap"):
        made = _of_recording(target, into, flags, read_only=_why(read_only))
    elif into is not None:
        raise TargetError(f'--into names the graph of a recording, so "{into}" means nothing here; leave it out')
    else:
        made = _of_graph(target, param, flags, inside=inside, read_only=_why(read_only))
    return _serve(made, options, browser, at_once=run)


def _need_extra() -> None:
    try:
        import hfg.studio.serving  # noqa: F401 - of the extra
    except ImportError as error:
        raise TargetError(f'the studio needs {error.name}: pip install "hfg[studio]"') from None


def _of_graph(target: str | None, param: list[str] | None, flags: LoadFlags, *, inside: str, read_only: str) -> Studio:
    """Make the studio of a graph; without a target, of an empty one."""
    graph = Graph("graph") if target is None else load_graph(target, flags.arg, flags.allow)
    set_parameters(graph, param or [])
    _need_subgraph(graph, inside)
    file = _file_of(target)
    folder = Path.cwd() if file is None else file.resolve().parent
    allow = flags.allow or ()
    name = "" if file is None or target is None else target.removeprefix(str(file)).removeprefix(":")
    project = Project(graph, folder, file, name=name, allow=allow, read=partial(read_target, allow=allow))
    return Studio(project, read_only=read_only, target=target or graph.name, level=inside)


def read_target(target: str, allow: Sequence[str] | None = None) -> Graph:
    """Read another file while the studio serves; code imports what it likes, so `allow` is for graph files."""
    return load_graph(target, [], allow if target.endswith((".yaml", ".yml")) else None)


def _why(read_only: bool) -> str:
    return "You may look, not change: the studio was started with --read-only." if read_only else ""


def _need_subgraph(graph: Graph, path: str) -> None:
    if path and structure_of(node_at(level_of(graph), path)) is None:
        raise TargetError(f'"{path}" is not a subgraph, so nothing is inside it; name another one by --inside')


def _of_recording(file: str, into: str | None, flags: LoadFlags, *, read_only: str) -> Studio:
    """Make the studio of a recording."""
    from hfg.studio.recorded import Recorded

    graph = None if into is None else load_graph(into, flags.arg, flags.allow)
    try:
        recorded = Recorded(file, graph, allow=flags.allow or ())
    except UsageError as error:
        raise TargetError(str(error)) from None
    project = RecordedProject(recorded.graph_after(0), Path(file), allow=flags.allow or ())
    return Studio(project, recorded=recorded, read_only=read_only)


def _serve(made: Studio, options: Mapping[str, Any], browser: bool, *, at_once: bool) -> int:
    """Serve pages of a graph of this process, until Ctrl-C."""
    from hfg.studio.palette import warm_up
    from hfg.studio.serving import Server, StudioDoor

    async def main() -> None:
        server = Server(StudioDoor(asyncio.get_running_loop(), made), **options)
        server.start()
        threading.Thread(target=warm_up, name="hfg studio palette", daemon=True).start()
        try:
            with _shown(server.address, browser):
                if at_once:
                    await made.steering.start(stay=False)
                await asyncio.Event().wait()
        finally:
            await made.close()
            await server.stop()

    return _until_interrupted(main)


@contextlib.contextmanager
def _shown(address: str, browser: bool) -> Iterator[None]:
    """Write the address, and open it in the browser.

    All users of the computer can read the command line of the browser, and the address holds the token. So the browser
    is given a page in a private folder that leads there.
    """
    show.write(f"{address}\n")
    with contextlib.ExitStack() as stack:
        if browser:
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="hfg-studio-"))
            page = Path(folder) / "open.html"
            page.write_text(f'<!doctype html><meta http-equiv="refresh" content="0; url={html.escape(address)}">\n')
            webbrowser.open(page.as_uri())
        yield


def _attach(name: str, target: str | None, options: Mapping[str, Any], browser: bool, *, read_only: bool) -> int:
    """Serve pages of a run in another process."""
    from hfg.studio.attaching import AttachedDoor
    from hfg.studio.serving import Server

    if target is not None or read_only:
        what = "--read-only" if read_only else f'"{target}"'
        raise TargetError(f"--attach follows a run as it is, so {what} means nothing to it; leave it out")
    there = find(name)
    if len(there) > 1:
        return which("studio --attach", there)

    async def main() -> None:
        server = Server(AttachedDoor(there[0].name), **options)
        server.start()
        try:
            with _shown(server.address, browser):
                await asyncio.Event().wait()
        finally:
            await server.stop()

    return _until_interrupted(main)


def _until_interrupted(main: Callable[[], Awaitable[None]]) -> int:
    interrupt = Interrupt.current or Interrupt()
    interrupt.what = "the studio"

    async def guarded() -> None:
        task = asyncio.current_task()
        assert task is not None
        with interrupt.cancels(task):
            await main()

    try:
        with asyncio.Runner(loop_factory=PunctualLoop) as runner:
            runner.run(guarded())
    except (asyncio.CancelledError, KeyboardInterrupt):
        if not interrupt.count:
            raise
    return 0


def _file_of(target: str | None) -> Path | None:
    """The file that a target names, if it is one."""
    if target is None:
        return None
    place = target.partition(":")[0] if not target.endswith(SUFFIX) else target
    return Path(place) if place.endswith((SUFFIX, ".yaml", ".yml", ".py")) and Path(place).is_file() else None
