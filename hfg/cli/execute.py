"""Runs a graph for a verb: on a loop of its own, ended by Ctrl-C, with a live table. Depends on the engine."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from typing import Any

from hfg.cli import show
from hfg.cli.interrupt import Interrupt
from hfg.cli.live import Live, live_table
from hfg.cli.options import Clock, RunFlags
from hfg.cli.settings import set_parameters
from hfg.cli.target import load_graph
from hfg.engine import PunctualLoop, Report, Run, VirtualTimeLoop, run_async
from hfg.engine.runtime.interrupt import named
from hfg.errors import HfgError, TargetError, UsageError
from hfg.graph import Graph
from hfg.parts.processes.rendezvous import Rendezvous


class GraphRun:
    """A graph that a verb runs.

    Attributes:
      graph: the graph.
      clock: its clock; other processes can watch a run on the real one.
      interrupt: handles Ctrl-C.
      report: the report at the end; a failed run may have one, an interrupted run has none.
      error: the error that ended the run.
    """

    def __init__(self, graph: Graph, target: str, flags: RunFlags) -> None:
        self.graph = graph
        self.clock = flags.clock
        self.interrupt = Interrupt.current or Interrupt()
        self.report: Report | None = None
        self.error: HfgError | None = None
        self._target = target
        self._flags = flags
        self._run: Run | None = None

    @classmethod
    def load(
        cls,
        target: str,
        flags: RunFlags,
        *,
        verbose: int = 0,
        prepare: Callable[[Graph], object] = lambda graph: None,
    ) -> GraphRun:
        """Load the target, and set its parameters.

        Args:
          target: as the user wrote it.
          flags: how it is loaded and run.
          verbose: how much is reported.
          prepare: called with the graph before its parameters are set.

        Raises:
          HfgError: the graph cannot be loaded, or a parameter cannot be set.
        """
        show.set_debug(flags.debug)
        records = show.Records(verbose, flags.debug, virtual=flags.clock is Clock.virtual)
        graph = load_graph(target, flags.arg, flags.allow)
        records.loaded()
        prepare(graph)
        set_parameters(graph, flags.param or [])
        return cls(graph, target, flags)

    @contextmanager
    def table(self, wanted: bool) -> Iterator[Live]:
        """Keep a live table on the terminal inside the block, if it is wanted and the clock is the real one."""
        with live_table(wanted and self.clock is Clock.real) as live:
            self.interrupt.before_leaving.append(live.leave)
            yield live

    def run(self, begin: Callable[[Run], Awaitable[None] | None] | None = None, **options: Any) -> None:
        """Run the graph to its end.

        Args:
          begin: called with the run before its nodes are set up. If it returns an awaitable, this is awaited when the
            run is over.
          **options: of `hfg.run_async`, besides those that the flags say.

        Raises:
          TargetError: the options do not fit.
        """
        self.interrupt.before_leaving.append(Rendezvous.leave_all)
        self.interrupt.what = named(self.graph)
        make_loop = VirtualTimeLoop if self.clock is Clock.virtual else PunctualLoop
        try:
            with asyncio.Runner(loop_factory=make_loop) as runner:
                self.report = runner.run(self._main(begin, options))
        except UsageError as error:  # such as an unknown policy: not the run's fault
            raise TargetError(str(error)) from None
        except TargetError:
            raise
        except HfgError as error:
            self.report, self.error = getattr(error, "report", None), error
        except (asyncio.CancelledError, KeyboardInterrupt):
            if not self.interrupt.count:
                raise
            self.error = None if self._run is None else self._run.error

    async def _main(self, begin: Callable[[Run], Awaitable[None] | None] | None, options: dict[str, Any]) -> Report:
        options |= {"clock": self.clock.value, "until_s": self._flags.until, "debug": self._flags.debug}
        task = asyncio.current_task()
        assert task is not None
        waiting: list[Awaitable[None]] = []

        def begun(run: Run) -> None:
            self._run = run
            if begin is not None and (awaited := begin(run)) is not None:
                waiting.append(asyncio.ensure_future(awaited))

        watch = self._target if self.clock is Clock.real else False
        with self.interrupt.cancels(task):
            try:
                return await run_async(self.graph, begin=begun, watch=watch, **options)
            finally:
                for one in waiting:
                    await one

    def ended(self, *, verbose: int = 0, reports: bool = True) -> int:
        """Show how the run has ended. Return the exit code.

        Args:
          verbose: as for the verb.
          reports: show the report of a run that has ended without an error.
        """
        if self.error is not None:
            show.failure(self.error)
        if self.interrupt.count:
            show.sentence(f"{named(self.graph)}: interrupted; what came back is torn down")
        elif reports and self.report is not None and self.error is None:
            show.report(self.graph.name, self.report, verbose)
        return 1 if self.error is not None or self.interrupt.count else 0
