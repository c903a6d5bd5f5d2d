"""A graph inside a FastAPI application: it runs from the application's start to its end, and requests speak with it.

    GET /temperature            the latest reading, from a tap
    GET /temperatures?count=3   the next readings, as they come
    PUT /target/22              sets a parameter
    GET /health                 200 while the graph runs, 503 with the reason afterwards

If the graph fails, requests get 503 with the graph's own sentence, and the server ends, so that whoever supervises it
starts it again. Run it with `python -m examples.embedding.web` (`pip install fastapi uvicorn`); Ctrl-C ends both.
"""

from __future__ import annotations

import logging
import signal
import sys
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Annotated

import uvicorn
from fastapi import Depends, FastAPI, HTTPException, Query, Request
from fastapi.responses import JSONResponse, StreamingResponse

import hfg
from examples.embedding.thermostat import build
from hfg.errors import HfgError, NotRunning, RunError, UsageError


def leave() -> None:
    """Ask uvicorn to end, as Ctrl-C does."""
    signal.raise_signal(signal.SIGTERM)


def run_of(request: Request, room: str = "room") -> hfg.Run:
    """Return the run of a room, which requests name in their query; raise what ended it if it is over."""
    runs: dict[str, hfg.Run] = request.state.runs
    if room not in runs:
        raise UsageError(f'there is no room "{room}"; there are: {", ".join(runs)}')
    need_running(runs[room])
    return runs[room]


RoomRun = Annotated[hfg.Run, Depends(run_of)]


def application(graphs: Mapping[str, Callable[[], hfg.Graph]], when_failed: Callable[[], object] = leave) -> FastAPI:
    """Make an application with a run of each graph; each start of the application builds its graphs."""

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[dict[str, dict[str, hfg.Run]]]:
        try:
            async with AsyncExitStack() as stack:
                runs = {name: await stack.enter_async_context(hfg.running(graphs[name]())) for name in graphs}
                yield {"runs": runs}
        except RunError as error:  # the server would go on without its graphs
            logging.getLogger("uvicorn.error").error("%s", error)
            when_failed()

    app = FastAPI(lifespan=lifespan)

    @app.exception_handler(HfgError)
    async def refuse(_: Request, error: HfgError) -> JSONResponse:
        return JSONResponse({"detail": str(error)}, 503 if isinstance(error, RunError | NotRunning) else 400)

    @app.get("/temperature")
    async def temperature(run: RoomRun) -> float:
        return await anext(readings(run, 1))

    @app.get("/temperatures")
    async def temperatures(run: RoomRun, count: Annotated[int, Query(ge=1, le=1000)] = 3) -> StreamingResponse:
        return StreamingResponse((f"{one}\n" async for one in readings(run, count)), media_type="text/plain")

    @app.put("/target/{degrees}")
    async def target(run: RoomRun, degrees: float) -> float:
        try:
            run.set("thermostat.target", degrees)
        except ValueError as error:  # beyond the parameter's limits
            raise HTTPException(422, str(error)) from None
        return degrees

    @app.get("/health")
    async def health(request: Request) -> list[str]:
        for run in request.state.runs.values():
            need_running(run)
        return list(request.state.runs)

    return app


def need_running(run: hfg.Run) -> None:
    """Raise what ended the run, if it is over."""
    if run.error is not None:
        raise run.error
    if run.report().outcome != "running":
        raise NotRunning(f'graph "{run.graph.name}" has come to its end')


async def readings(run: hfg.Run, count: int) -> AsyncIterator[float]:
    """Yield the next readings; the tap holds nothing up, and is closed with the request."""
    with run.tap("room.temperature", size=count) as tap:
        async for token in tap:
            if isinstance(token.value, float):
                yield token.value
                count -= 1
            if not count:
                return
    need_running(run)


app = application({"room": build})

if __name__ == "__main__":
    uvicorn.run(app, host="127.0.0.1", port=int(sys.argv[1]) if sys.argv[1:] else 8000)
