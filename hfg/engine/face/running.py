"""Running a graph to its end, or as long as a block lasts: `run`, `run_async`, `running` (rules R1, R5, R6).

Depends on `run`.
"""

from __future__ import annotations

import asyncio
import contextlib
import inspect
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal, NoReturn, Unpack

from hfg.base.hooks import hooks
from hfg.engine.executing.punctual import PunctualLoop
from hfg.engine.executing.virtual import VirtualTimeLoop
from hfg.engine.face import outside
from hfg.engine.face.composition import Composition
from hfg.engine.face.preconditions import (
    need_begin,
    need_clock,
    need_no_loop,
    need_no_problem,
    need_no_real_clock,
    need_use_of_seed,
    no_graph,
    refuse_endless,
)
from hfg.engine.face.run import Run
from hfg.engine.face.watching import watched
from hfg.engine.observing.report import Report
from hfg.engine.runtime.interrupt import CtrlC
from hfg.engine.runtime.settings import RunFields, RunGiven, Settings
from hfg.errors import HfgError, RunError, UsageError
from hfg.graph import Graph
from hfg.graph.flat import flatten
from hfg.graph.structure.level import level_of
from hfg.graph.structure.naming import suggest
from hfg.graph.structure.option import declared, explaining

__all__ = ["run", "run_async", "running"]


Clock = Literal["real", "virtual"]


def _settings(options: RunGiven, *, allow_idle: bool = False) -> Settings:
    for name in options.keys() - declared(RunFields).keys():
        raise TypeError(f'a run has no option "{name}"; {suggest(name, declared(RunFields))}')
    return Settings(allow_idle=allow_idle, **options)


def _prepare(graph: Graph, clock: Clock, settings: Settings) -> tuple[Run, Composition]:
    """Check the graph and make its running form; nothing has happened yet."""
    if not isinstance(graph, Graph):
        raise no_graph(graph)
    need_clock(clock)
    level = level_of(graph)
    if level.owner is not None:
        raise UsageError(f'{level.title} runs as a part of the whole: run graph "{level.whole.root.name}"')
    if level.whole.run is not None:
        raise UsageError(f'graph "{graph.name}" runs already: a graph has one run at a time; build a second graph')
    is_virtual = isinstance(asyncio.get_running_loop(), VirtualTimeLoop)
    if is_virtual:
        need_no_real_clock(settings)
        settings.watch = False
    elif clock == "virtual":
        raise UsageError(
            'clock="virtual" needs a loop in virtual time: hfg.run(graph, clock="virtual"), or '
            "asyncio.Runner(loop_factory=hfg.VirtualTimeLoop).run(main()) around the whole program"
        )
    flat = flatten(graph)
    need_use_of_seed(flat, settings)
    need_no_problem(flat)
    if settings.until_s is not None and is_virtual:
        refuse_endless(flat)
    others = None
    if settings.settings is not None or any(group.process for group in flat.groups.values()):
        others = hooks.distribute(graph, flat, settings.everywhere(), is_virtual, settings.settings)
    parts = Composition(flat if others is None else others.flat, settings, others)
    run: Run = Run(graph, parts) if others is None else others.face(graph)
    level.whole.begin_run(run)
    return run, parts


async def _run_to_end(
    graph: Graph, clock: Clock, settings: Settings, begin: Callable[[Run], object] | None, ctrl_c: CtrlC | None = None
) -> Report:
    need_begin(begin)
    run, parts = _prepare(graph, clock, settings)
    engine, run_lifecycle = parts.engine, parts.run_lifecycle
    if ctrl_c is not None:
        ctrl_c.task, ctrl_c.run_lifecycle = asyncio.current_task(), run_lifecycle
        ctrl_c.error = lambda: engine.error
    try:
        async with watched(run, settings.watch or False):
            try:
                for worker in engine.core.readers:
                    outside.collect(engine, worker, parts.outputs.setdefault(worker.port_name, []))
                if begin is not None:
                    answer = begin(run)
                    if inspect.iscoroutine(answer):
                        answer.close()
                        need_begin(answer)
                if settings.allow_idle:
                    engine.quiet.hold()
                await parts.start()
                await engine.ending.wait()
            finally:
                await run_lifecycle.close()
    finally:
        level_of(graph).whole.end_run()
    parts.raise_failure()
    return parts.report()


@explaining(RunFields)
async def run_async(
    graph: Graph,
    *,
    clock: Clock | None = None,
    begin: Callable[[Run], object] | None = None,
    allow_idle: bool = False,
    **options: Unpack[RunGiven],
) -> Report:
    """Run a graph to its end in the running event loop.

    Cancelling the call tears the run down.

    Args:
      graph: the graph; it is checked first.
      clock: "real" or "virtual"; "virtual" needs a loop in virtual time, `VirtualTimeLoop`.
      begin: called with the run before nodes are set up; see `run`.
      allow_idle: keep a quiet graph running; see `run`.
      **options: `until_s`, `debug`, `policy`, `trace` and so on; docs/reference.md lists all options of a run.

    Returns:
      A report; its `outcome` is "done", "stopped" or "until".

    Raises:
      CheckFailed: the graph has errors; nothing was started.
      RunError: a node failed (`NodeError`), the graph stalled (`Stalled`), or it aborted itself (`Aborted`).
      UsageError: the graph is already running, or the loop does not fit the clock.
    """
    settings = _settings(options, allow_idle=allow_idle)
    return await _run_to_end(graph, clock or "real", settings, begin)


@explaining(RunFields)
def run(
    graph: Graph,
    *,
    clock: Clock = "real",
    begin: Callable[[Run], object] | None = None,
    allow_idle: bool = False,
    **options: Unpack[RunGiven],
) -> Report:
    """Run a graph to its end. Blocks until the run is over.

    Args:
      graph: the graph. It is checked first. A graph can have one run at a time; each run starts from scratch.
      clock: "real" or "virtual". Virtual time runs as fast as the machine can and gives the same values and stamps
        every time (R6).
      begin: called with the run, on its loop, before nodes are set up. Use it for `run.tap` and `run.trace`.
      allow_idle: keep a quiet graph running. It then waits for subscribers, `stop` or Ctrl-C.
      **options: `until_s`, `debug`, `policy`, `trace` and so on; docs/reference.md lists all options of a run.

    Returns:
      A report; its `outcome` is "done", "stopped" or "until".

    Raises:
      CheckFailed: the graph has errors; nothing was started.
      RunError: a node failed (`NodeError`), the graph stalled (`Stalled`), or it aborted itself (`Aborted`).
      UsageError: called inside a running event loop, or the graph is already running.
    """
    need_no_loop()
    settings = _settings(options, allow_idle=allow_idle)
    need_clock(clock)
    return _run_blocking(graph, clock, settings, begin)


def _run_blocking(graph: Graph, clock: Clock, settings: Settings, begin: Callable[[Run], object] | None) -> Report:
    """Run it in its own event loop. Ctrl-C ends the run properly and is raised afterwards."""
    factory = VirtualTimeLoop if clock == "virtual" else PunctualLoop
    ctrl_c = CtrlC()
    runner = asyncio.Runner(loop_factory=factory)
    try:
        with ctrl_c.handled(runner.get_loop()), runner:
            report = runner.run(_run_to_end(graph, clock, settings, begin, ctrl_c))
        if not ctrl_c.count:
            return report
    except (asyncio.CancelledError, KeyboardInterrupt, RunError):
        if not ctrl_c.count:
            raise
    raise KeyboardInterrupt(ctrl_c.sentence(graph))


class _Block(AbstractAsyncContextManager[Run]):
    """The result of `running`: an async context manager, with a clear error for a plain `with`."""

    def __init__(self, block: AbstractAsyncContextManager[Run], name: str) -> None:
        self._block = block
        self._name = name

    async def __aenter__(self) -> Run:
        return await self._block.__aenter__()

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> bool | None:
        return await self._block.__aexit__(kind, error, traceback)

    if not TYPE_CHECKING:

        def __enter__(self) -> NoReturn:
            raise UsageError(
                f'hfg.running(graph) of "{self._name}" is a block of async code: write '
                "`async with hfg.running(graph) as run:` in an async function, or hfg.run(graph) to run it to its end"
            )

        __await__ = __iter__ = __enter__

        def __exit__(self, *exc_info: object) -> None:
            """Never reached; Python looks for it first."""

        def __getattr__(self, name: str) -> NoReturn:
            raise AttributeError(
                f'nothing runs yet, so there is no "{name}": write `async with hfg.running(graph) as run:` first'
            )


@explaining(RunFields)
def running(
    graph: Graph,
    *,
    clock: Clock | None = None,
    **options: Unpack[RunGiven],
) -> AbstractAsyncContextManager[Run]:
    """Run a graph for as long as an `async with` block lasts.

    The block holds the run open: a quiet graph keeps running until the block calls `run.wait_finished` or is left.
    Leaving the block stops the run and tears it down. If the run fails, whatever the block awaits is cancelled, and the
    block raises the run's error.

    Args:
      graph: the graph; it is checked first.
      clock: "real" or "virtual"; "virtual" needs a loop in virtual time, `VirtualTimeLoop`.
      **options: `until_s`, `debug`, `policy`, `trace` and so on; docs/reference.md lists all options of a run.

    Returns:
      A context manager whose value is the `Run`.

    Raises:
      CheckFailed: the graph has errors; nothing was started.
      RunError: the run failed, when the block is left.
      UsageError: the graph is already running, or the loop does not fit the clock.
    """
    return _Block(_running(graph, clock, options), getattr(graph, "name", "graph"))


@asynccontextmanager
async def _running(graph: Graph, clock: Clock | None, options: RunGiven) -> AsyncIterator[Run]:
    settings = _settings(options)
    run, parts = _prepare(graph, clock or "real", settings)
    engine = parts.engine
    guard = _Guard(parts)
    try:
        parts.stay_open()
        async with watched(run, settings.watch or False):
            await parts.start()
            if engine.error is None:
                guard.begin(graph.name)
                yield run
    except asyncio.CancelledError:
        if not guard.has_cancelled():
            engine.finish("cancelled", None)
            parts.run_lifecycle.hurry()
            raise
    finally:
        guard.end()
        if engine.outcome == "running":
            engine.finish("stopped", None)
        try:
            await _quietly(parts.close())
        finally:
            level_of(graph).whole.end_run()
    parts.raise_failure()


class _Guard:
    """Cancels what the block of a run waits for when the run fails."""

    def __init__(self, parts: Composition) -> None:
        body = asyncio.current_task()
        assert body is not None
        self._body = body
        self._parts = parts
        self._cancelled = False
        self._watcher: asyncio.Task[None] | None = None

    def begin(self, name: str) -> None:
        """From now on."""
        self._watcher = asyncio.create_task(self._watch(), name=f"hfg guard of {name}")

    async def _watch(self) -> None:
        await self._parts.engine.ending.wait()
        if self._parts.engine.error is not None and not self._parts.ending:
            self._cancelled = True
            self._body.cancel()

    def has_cancelled(self) -> bool:
        """Whether it was the guard that has cancelled the block."""
        return self._cancelled

    def end(self) -> None:
        """The block is left: whatever it raises, its task is not cancelled any more by the guard."""
        if self._watcher is not None:
            self._watcher.cancel()
        if self._cancelled:
            self._body.uncancel()


async def _quietly(closing: Coroutine[Any, Any, None]) -> None:
    """Tear the run down without raising its failure, which the code that waits for it raises."""
    with contextlib.suppress(HfgError):
        await closing
