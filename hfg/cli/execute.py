"""Runs a graph on a loop of its own, ended by Ctrl-C, watched by whoever likes. Stands on the engine."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

from hfg.cli.interrupt import Interrupt
from hfg.cli.options import Clock
from hfg.engine import PunctualLoop, Report, Run, VirtualTimeLoop, run_async
from hfg.engine.runtime.interrupt import named
from hfg.errors import HfgError, TargetError, UsageError
from hfg.graph import Graph
from hfg.parts.processes.rendezvous import Rendezvous

__all__ = ["execute"]


def execute(
    graph: Graph,
    target: str,
    clock: Clock,
    interrupt: Interrupt,
    begin: Callable[[Run], Awaitable[None] | None] | None = None,
    **options: Any,
) -> tuple[Report | None, HfgError | None]:
    """Run it to its end; a failed run's report comes with its error, an interrupted run has no report.

    Args:
      graph: it is loaded, and its parameters are set.
      target: what the user called it.
      clock: on the real one, other processes may look at the run.
      interrupt: what Ctrl-C does here.
      begin: called with the run before its nodes are set up. What it gives back is awaited when the run is over.
      options: of `hfg.run_async`.

    Raises:
      TargetError: the options do not fit.
    """
    begun_run: Run | None = None
    interrupt.before_leaving.append(Rendezvous.leave_all)
    interrupt.what = named(graph)

    async def main() -> Report:
        task = asyncio.current_task()
        assert task is not None
        watch = target if clock is Clock.real else False
        with interrupt.cancels(task):
            beside: list[Awaitable[None]] = []

            def begun(run: Run) -> None:
                nonlocal begun_run
                begun_run = run
                if begin is not None and (waits := begin(run)) is not None:
                    beside.append(asyncio.ensure_future(waits))

            try:
                return await run_async(graph, clock=clock.value, begin=begun, watch=watch, **options)
            finally:
                for one in beside:
                    await one

    try:
        with asyncio.Runner(loop_factory=VirtualTimeLoop if clock is Clock.virtual else PunctualLoop) as runner:
            return runner.run(main()), None
    except UsageError as error:  # an unknown policy, for example: not the run's fault
        raise TargetError(str(error)) from None
    except TargetError:
        raise
    except HfgError as error:
        return getattr(error, "report", None), error
    except (asyncio.CancelledError, KeyboardInterrupt):
        if not interrupt.count:
            raise
        return None, None if begun_run is None else begun_run.error
