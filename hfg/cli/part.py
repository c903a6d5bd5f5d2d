"""`hfg part`: one part of a graph that is cut, for systemd, Kubernetes and their like, until SIGTERM.

Depends on `agent` and `hfg.parts.hosts.supervised`.
"""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import Sequence
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from hfg.cli import completing, show
from hfg.cli.agent import ending, session_settings
from hfg.cli.target import load_graph
from hfg.errors import TargetError
from hfg.graph import Graph
from hfg.graph.flat import MAIN, cut, flatten
from hfg.parts.hosts.health import address_of, healthy
from hfg.parts.hosts.hosting import Passing, ThisComputer
from hfg.parts.hosts.supervised import SupervisedPart
from hfg.parts.running.rings import sweep_runs
from hfg.parts.transports import open_session

NAME_OF_MAIN: Final = "main"
"""How users call the main part."""


def part(
    target: Annotated[
        str,
        typer.Argument(
            envvar="HFG_GRAPH", help="module:graph, file.py or another graph", autocompletion=completing.targets
        ),
    ],
    group: Annotated[
        str, typer.Argument(envvar="HFG_GROUP", help="a group with a host; main: everything without one, and the run")
    ],
    settings: Annotated[
        str, typer.Option(metavar="FILE", envvar="HFG_SETTINGS", help="Settings of the realm (TOML) for this part.")
    ],
    health: Annotated[
        str | None,
        typer.Option(
            metavar="HOST:PORT", envvar="HFG_HEALTH", help="Answer GET /live and /ready at this address. Default: none."
        ),
    ] = None,
    arg: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            envvar="HFG_ARG",
            help="Pass an argument to the function that builds the graph. Can be repeated.",
        ),
    ] = None,
    param: Annotated[
        list[str] | None,
        typer.Option(metavar="PATH=VALUE", envvar="HFG_PARAM", help="Set a parameter (main only). Can be repeated."),
    ] = None,
    allow: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PACKAGE",
            envvar="HFG_ALLOW",
            help="Allow a graph file to use this module or package. Can be repeated.",
        ),
    ] = None,
    verbose: Annotated[int, typer.Option("-v", "--verbose", count=True, help="Report each process.")] = 0,
) -> int:
    """Run one part of a graph under a supervisor: wait for the others in any order; SIGTERM ends it."""
    show.Records(max(verbose, 0), debug=False).loaded()
    if health is not None:
        address_of(health)
    graph = load_graph(target, arg, allow)
    name, hosts = chosen(graph, group)
    arguments: list[str] = []
    for option, values in (("--arg", arg), ("--param", param), ("--allow", allow)):
        for value in values or ():
            arguments += [option, value]
    return asyncio.run(_serve(graph.name, name, hosts, session_settings(settings), health, target, arguments))


def hosts_of(graph: Graph) -> dict[str, str]:
    """Return the groups of a graph that run on named hosts, each with its host.

    Raises:
      TargetError: there is none.
    """
    flat = flatten(graph)
    hosts = {one: flat.groups[one].host for one in cut(flat).parts if one != MAIN and flat.groups[one].host}
    if not hosts:
        raise TargetError(
            f'graph "{graph.name}" has no group with a host: write graph.group("arm", host="arm"), or use hfg run'
        )
    if NAME_OF_MAIN in hosts:
        raise TargetError(f'graph "{graph.name}" has a group "main", as the main part is called here: rename the group')
    return hosts


def chosen(graph: Graph, group: str) -> tuple[str, dict[str, str]]:
    """Return the name of a part, and the hosts of all.

    Raises:
      TargetError: there is no such part.
    """
    hosts = hosts_of(graph)
    if group != NAME_OF_MAIN and group not in hosts:
        there = ", ".join(f'"{one}"' for one in [NAME_OF_MAIN, *hosts])
        raise TargetError(f'graph "{graph.name}" has no part "{group:.100}"; its parts are {there}')
    return (MAIN if group == NAME_OF_MAIN else group), hosts


async def _serve(
    graph: str,
    name: str,
    hosts: dict[str, str],
    settings: dict[str, Any],
    health: str | None,
    target: str,
    arguments: Sequence[str],
) -> int:
    sweep_runs()
    async with AsyncExitStack() as stack:
        session = await open_session("", mode="router", **settings)
        stack.push_async_callback(session.close)
        computer = ThisComputer(session, settings, Passing(), Path.cwd(), is_apart=True)
        one = SupervisedPart(session, computer, graph, name, hosts)
        ended = stack.enter_context(ending())
        stack.push_async_callback(one.close)
        await one.open()
        if health is not None:
            await stack.enter_async_context(healthy(health, one.state))
        show.write(f'part "{name or NAME_OF_MAIN}" of graph "{graph}" is there, process {os.getpid()}\n')
        sys.stdout.flush()
        work = asyncio.ensure_future(one.serve() if name else one.run(target, arguments, str(Path.cwd())))
        told = asyncio.ensure_future(ended.wait())
        await asyncio.wait({work, told}, return_when=asyncio.FIRST_COMPLETED)
        told.cancel()
        if work.done():
            work.result()
        work.cancel()
    return 0
