"""`hfg ps`, `hfg deploy`, `hfg logs`, `hfg restart` and `hfg stop`: agents and runs of a realm, from any of its hosts.

Depends on `hfg.parts.hosts.realm`.
"""

from __future__ import annotations

import asyncio
import contextlib
import sys
import uuid
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Annotated, Any, Final, TypeVar

import msgspec
import typer

from hfg.cli import show
from hfg.cli.agent import session_settings
from hfg.cli.options import AllowOption, ArgOption, ParamOption, SettingsOption, TargetArgument, UntilOption
from hfg.cli.part import NAME_OF_MAIN
from hfg.cli.target import load_graph
from hfg.engine.face.watching import Answer, Question
from hfg.engine.observing.encoding import encode
from hfg.errors import HfgError, NoAnswer, QueryRefused, TargetError, TransportError
from hfg.parts.hosts import requests
from hfg.parts.hosts.realm import FINDS_S, AgentIs, Realm, RunIs, agent_place, run_place
from hfg.parts.hosts.requests import Request, ask
from hfg.parts.transports import open_session

_SETTLES_S: Final = 0.3  # how long presences take to arrive after the first one
_LOOKS_AGAIN_S: Final = 0.5
_BEGINS_S: Final = 60.0
_ENDS_S: Final = 15.0
_PATIENCE_S: Final = 2.0  # for one look
_FIRST_INCARNATION: Final = 1

Answered = TypeVar("Answered")
RunArgument = Annotated[
    str, typer.Argument(metavar="RUN", help="name of the run, its first characters, or the name of its graph")
]


class RealmLine:
    """A way to the main part of a run, wherever in the realm; use it in a `with` block.

    Raises:
      TargetError: there is no such run.
      TransportError: the realm cannot be reached.
    """

    def __init__(self, settings: str, name: str | None) -> None:
        self._runner = asyncio.Runner()
        self._stack = AsyncExitStack()
        try:
            self._realm = self._runner.run(self._stack.enter_async_context(_realm(settings)))
            self._run = _find(self._realm, name)
        except BaseException:
            self.__exit__()
            raise

    def ask(self, question: Question) -> Answer | None:
        """Ask and wait for the answer; None if there is none within two seconds.

        Raises:
          TargetError: the run is over.
        """
        look, place = requests.Look(encode(question)), run_place(self._run.run)
        try:
            told = self._runner.run(ask(self._realm.session, place, look, timeout_s=_PATIENCE_S))
        except NoAnswer:
            if place in self._realm.runs:
                return None
            raise TargetError(f'run {self._run.run} of graph "{self._run.graph}" is over') from None
        return msgspec.json.decode(told.answer, type=Answer)

    def __enter__(self) -> RealmLine:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self._runner.run(self._stack.aclose())
        self._runner.close()


# --- the verbs ---


def ps(
    settings: SettingsOption = None,
    json: Annotated[bool, typer.Option("--json", help="Write agents and runs as JSON.")] = False,
) -> int:
    """List the agents, runs and processes of the realm."""
    return asyncio.run(_ps(settings, json))


def deploy(
    target: TargetArgument,
    settings: SettingsOption = None,
    on: Annotated[
        str | None,
        typer.Option("--on", metavar="HOST", help="The host whose agent runs the main part. Default: this host."),
    ] = None,
    until: UntilOption = None,
    param: ParamOption = None,
    arg: ArgOption = None,
    allow: AllowOption = None,
    write: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Start nothing; write a Dockerfile, units of systemd and a manifest for Kubernetes into this folder.",
        ),
    ] = None,
) -> int:
    """Run a graph on an agent; it keeps running when this terminal closes."""
    if write is not None:
        if settings is not None or until is not None:
            raise TargetError("--write starts nothing, so --settings and --until mean nothing to it; leave them out")
        return _write(write, target, on, {"arg": arg, "param": param, "allow": allow})
    arguments = [] if until is None else ["--until", f"{until!r}"]
    for name, values in (("--param", param), ("--arg", arg), ("--allow", allow)):
        for value in values or ():
            arguments += [name, value]
    return asyncio.run(_deploy(settings, target, on, arguments))


def logs(
    run: RunArgument,
    settings: SettingsOption = None,
    follow: Annotated[bool, typer.Option("--follow", "-f", help="Continue until the run is over.")] = False,
) -> int:
    """Print the output of a run's processes on the hosts of agents."""
    try:
        return asyncio.run(_logs(settings, run, follow))
    except KeyboardInterrupt:  # how one leaves it
        return 0


def stop(run: RunArgument, settings: SettingsOption = None) -> int:
    """End a run normally, on whichever host it is."""
    return asyncio.run(_stop(settings, run))


def restart(
    part: Annotated[str, typer.Argument(metavar="RUN/GROUP", help="a group of a run that has a process of its own")],
    settings: SettingsOption = None,
) -> int:
    """Restart the process of one group while the rest of the run waits."""
    run, slash, group = part.partition("/")
    if not slash or not run or not group:
        raise TargetError(f'"{part}" names no group of a run: write RUN/GROUP, as hfg ps shows them')
    return asyncio.run(_restart(settings, run, group))


def _write(folder: Path, target: str, on: str | None, options: Mapping[str, list[str] | None]) -> int:
    from hfg.cli.deploying import Deployment, environment_of, write

    graph = load_graph(target, options["arg"], options["allow"])
    what = Deployment(graph, target, on or NAME_OF_MAIN, environment_of(options))
    show.write("".join(f"{file}\n" for file in write(what, folder)))
    for kept in what.kept():
        show.sentence(f'the main part keeps state in "{kept}": see to it that this file outlives its container')
    return 0


# --- who is there ---


@asynccontextmanager
async def _realm(settings: str | None) -> AsyncIterator[Realm]:
    session = await open_session("", **session_settings(settings))
    try:
        realm = Realm(session)
        await realm.until(lambda: realm.agents or realm.runs, FINDS_S)
        await asyncio.sleep(_SETTLES_S if realm.agents or realm.runs else 0.0)
        yield realm
    finally:
        await session.close()


def _find(realm: Realm, name: str | None) -> RunIs:
    """Find a run by what the user calls it; without a name, the only one.

    Raises:
      TargetError: there is none, or more than one.
    """
    name = name or ""
    found = [one for one in realm.runs.values() if one.run == name]
    found = found or [one for one in realm.runs.values() if one.run.startswith(name) or one.graph == name]
    if len(found) == 1:
        return found[0]
    there = ", ".join(f'{one.run} ("{one.graph}" on "{one.host}")' for one in found or realm.runs.values())
    if found:
        raise TargetError(f'"{name}" is {len(found)} runs: name one of {there}')
    raise TargetError(
        f'no run "{name}" is in the realm; there is {there}'
        if there
        else f'no run "{name}" is in the realm, nor any other: hfg deploy starts one, or hfg run with --settings'
    )


async def _parts(realm: Realm, run: RunIs) -> list[requests.PartIs]:
    try:
        return (await ask(realm.session, run_place(run.run), requests.Parts())).parts
    except TransportError:
        return [requests.PartIs("", run.host, run.process, "does not answer", 0, 0.0)]


async def _ps(settings: str | None, json: bool) -> int:
    async with _realm(settings) as realm:
        agents = sorted(realm.agents.values(), key=lambda one: one.host)
        runs = sorted(realm.runs.values(), key=lambda one: (one.graph, one.run))
        parts = await asyncio.gather(*(_parts(realm, run) for run in runs))
    if json:
        told = [{**_plain(run), "parts": [_plain(part) for part in of]} for run, of in zip(runs, parts, strict=True)]
        show.json({"agents": [_plain(agent) for agent in agents], "runs": told})
        return 0
    if not agents and not runs:
        show.sentence("the realm is empty: hfg agent starts an agent")
        return 0
    show.table("agents", ("host", "process", "hfg", "python"), [(a.host, a.process, a.hfg, a.python) for a in agents])
    rows = [
        (run.run, run.graph, part.group or "(main)", part.host, part.process, part.state, part.restarts, _time(part))
        for run, of in zip(runs, parts, strict=True)
        for part in of
    ]
    if rows:
        show.table("runs", ("run", "graph", "group", "host", "process", "state", "restarts", "up"), rows)
    return 0


def _plain(one: Any) -> dict[str, Any]:
    return {name: getattr(one, name) for name in one.__struct_fields__}


def _time(part: requests.PartIs) -> str:
    minutes, seconds = divmod(int(part.up_s), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{seconds:02}"


# --- beginning ---


async def _deploy(settings: str | None, target: str, on: str | None, arguments: Sequence[str]) -> int:
    async with _realm(settings) as realm:
        here = realm.session.host
        host = on or here
        agent = await realm.agent(host)
        run = uuid.uuid4().hex[:12]
        folder = str(Path.cwd()) if host == here else ""
        order = requests.Deploy(f"hfg/{run}", target, list(arguments), folder)
        await _ask_agent(realm, agent, order)
        gone = asyncio.ensure_future(_gone(realm, agent, order.run))
        begun = asyncio.ensure_future(realm.until(lambda: run_place(run) in realm.runs, _BEGINS_S))
        await asyncio.wait({gone, begun}, return_when=asyncio.FIRST_COMPLETED)
        begun.cancel()
        if run_place(run) not in realm.runs:
            has_failed = gone.result() if gone.done() else True  # else it is slow beyond all patience
            gone.cancel()
            told = await _ask_agent(realm, agent, requests.ReadLog(order.run, 0))
            show.write(told.text, to_stderr=True)
            if not has_failed:
                return 0  # it was over before the first look
            show.sentence(f'{target} has not started on host "{host}"; what it wrote is above')
            return 1
        gone.cancel()
    show.write(f"{run}\n")
    show.sentence(f'{target} runs on host "{host}": hfg logs {run}, hfg ps, hfg stop {run}')
    return 0


async def _gone(realm: Realm, agent: AgentIs, run: str) -> bool:
    """Wait until the main part of a run is gone; gives whether it has failed.

    Raises:
      TransportError: the agent is gone.
    """
    while True:
        try:
            told = await _ask_agent(realm, agent, requests.Wait(run, "", _FIRST_INCARNATION), timeout_s=20.0)
        except NoAnswer:
            if agent_place(agent) not in realm.agents:
                raise TransportError(f'the agent of host "{agent.host}" is gone, and the run with it') from None
        else:
            if told.how:
                return "ended with code 0" not in told.how
        await asyncio.sleep(_LOOKS_AGAIN_S)


async def _ask_agent(realm: Realm, agent: AgentIs, request: Request[Answered], *, timeout_s: float = 10.0) -> Answered:
    try:
        return await ask(realm.session, agent_place(agent), request, timeout_s=timeout_s)
    except QueryRefused as error:
        raise TransportError(f'the agent of host "{agent.host}" refuses: {error}') from None


# --- looking and steering ---


async def _logs(settings: str | None, name: str, follow: bool) -> int:
    async with _realm(settings) as realm:
        known = {one.run for one in realm.runs.values()}
        is_hex = len(name) == 12 and all(char in "0123456789abcdef" for char in name)
        run = name if is_hex and name not in known else _find(realm, name).run  # one that is over has its log still
        offsets: dict[str, int] = {}
        seen = False
        while True:
            is_over = run_place(run) not in realm.runs
            new: list[str] = []
            for place, agent in sorted(realm.agents.items(), key=lambda item: item[1].host):
                new += await _read_all(realm, place, agent, run, offsets)
            seen = seen or bool(new)
            show.write("".join(sorted(new, key=_time_of)))
            sys.stdout.flush()
            if not follow or is_over:
                break
            await asyncio.sleep(_LOOKS_AGAIN_S)
    if not seen:
        show.sentence(f'no agent has anything that run "{run}" has written')
    return 0


def _time_of(line: str) -> str:
    return line[:19]


async def _read_all(realm: Realm, place: str, agent: AgentIs, run: str, offsets: dict[str, int]) -> list[str]:
    """Return new lines of one host, each with the name of the host after the time."""
    lines: list[str] = []
    while True:
        try:
            told = await ask(realm.session, place, requests.ReadLog(run, offsets.get(place, 0)))
        except TransportError:
            return lines
        offsets[place] = told.offset
        if not told.text:
            return lines
        lines += [f"{line[:19]} {agent.host}{line[19:]}\n" for line in told.text.splitlines()]


async def _stop(settings: str | None, name: str) -> int:
    async with _realm(settings) as realm:
        run = _find(realm, name)
        place = run_place(run.run)
        try:
            await ask(realm.session, place, requests.Stop())
            if await realm.until(lambda: place not in realm.runs, _ENDS_S):
                return 0
        except NoAnswer:
            _need_permission(run, await _parts(realm, run))
        for agent in realm.of(run.host):  # its main part does not answer: whoever has begun it ends it
            with contextlib.suppress(HfgError):
                await _ask_agent(
                    realm,
                    agent,
                    requests.End(f"hfg/{run.run}", "", _FIRST_INCARNATION),
                    timeout_s=_ENDS_S,
                )
        if await realm.until(lambda: place not in realm.runs, FINDS_S):
            show.sentence(f"run {run.run} did not answer; its process was ended")
            return 1
        show.sentence(
            f"run {run.run} does not answer, and no agent has started it: end process {run.process} on host "
            f'"{run.host}"'
        )
        return 1


def _need_permission(run: RunIs, parts: list[requests.PartIs]) -> None:
    """Check whether a run does not answer because the settings permit only reading.

    Raises:
      TargetError: the run answers requests that only read.
    """
    if parts[0].state != "does not answer":
        raise TargetError(
            f"run {run.run} answers, but is not steered from here: these settings may only look; use a certificate "
            "that write in [access] of the agents names"
        )


async def _restart(settings: str | None, name: str, group: str) -> int:
    async with _realm(settings) as realm:
        run = _find(realm, name)
        try:
            await ask(realm.session, run_place(run.run), requests.Restart(group), timeout_s=_ENDS_S)
        except NoAnswer:
            _need_permission(run, await _parts(realm, run))
            raise
        except QueryRefused as error:
            raise TargetError(str(error)) from None
        show.sentence(f'group "{group}" of run {run.run} is restarted')
    return 0
