"""`hfg ros list`, `hfg ros type NAME` and `hfg ros echo TOPIC`: a look at a graph of ROS 2, without ROS.

Depends on show and `hfg.nodes.ros`.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable, Coroutine
from typing import Annotated, Any, Final, TypeVar

import typer

from hfg.base.controls import escaped
from hfg.cli import show
from hfg.engine import running
from hfg.engine.observing.encoding import line_of
from hfg.errors import TargetError, TransportError, UsageError
from hfg.graph import Graph
from hfg.ros.connection import Connection, domain_of, router_of
from hfg.ros.graph import RosGraph
from hfg.ros.names import full_name
from hfg.ros.wire import Kind

verbs = typer.Typer()

_WAIT_S: Final = 5.0
_LOOK_S: Final = 0.5
"""How long tokens are collected, as long as `ros2 topic list` does: Zenoh does not report when all have arrived."""
_TOPIC: Final[tuple[Kind, ...]] = ("MP", "MS")
_SERVICE: Final[tuple[Kind, ...]] = ("SS", "SC")

Router = Annotated[
    str, typer.Option(help='address of the Zenoh router, "tcp/localhost:7447"; by default HFG_ROS_ROUTER.')
]
Domain = Annotated[int, typer.Option(help="number of the domain; by default ROS_DOMAIN_ID, or 0.")]


@verbs.callback()
def ros() -> None:
    """List and print topics of ROS 2, over the Zenoh router of rmw_zenoh."""


@verbs.command("list")
def _list(
    router: Router = "",
    domain: Domain = -1,
    nodes: Annotated[bool, typer.Option("--nodes", help="List nodes.")] = False,
    services: Annotated[bool, typer.Option("--services", help="List services.")] = False,
    types: Annotated[bool, typer.Option("-t", "--types", help="Show types as well.")] = False,
) -> int:
    """List topics, or nodes or services."""
    graph = _looked(router, domain)
    if nodes:
        names = sorted({f"{one.namespace.rstrip('/')}/{one.node}" for one in graph if one.kind == "NN"})
        found = {name: set[str]() for name in names}
    else:
        found = graph.types(*(_SERVICE if services else _TOPIC))
    for name, kinds in found.items():
        show.write(escaped(f"{name} [{', '.join(sorted(kinds))}]" if types and kinds else name) + "\n")
    return 0


@verbs.command("type")
def _type(
    name: Annotated[str, typer.Argument(help="a topic or service")], router: Router = "", domain: Domain = -1
) -> int:
    """Print the types of a topic or service, one per line."""
    for kind in _types(_looked(router, domain), name, *_TOPIC, *_SERVICE):
        show.write(escaped(kind) + "\n")
    return 0


@verbs.command("echo")
def _echo(
    topic: Annotated[str, typer.Argument(help="a topic")],
    type_: Annotated[str, typer.Argument(metavar="[TYPE]", help="of its messages; by default as published")] = "",
    router: Router = "",
    domain: Domain = -1,
    limit: Annotated[int | None, typer.Option("-n", "--limit", min=1, help="Stop after N messages.")] = None,
    durability: Annotated[
        str, typer.Option(help='"transient_local": begin with what publishers have kept.')
    ] = "volatile",
    json: Annotated[bool, typer.Option("--json", help="Write each message as a JSON object.")] = False,
) -> int:
    """Print the messages of a topic, one per line, as `hfg tap` does."""
    if not type_:
        kinds = _types(_looked(router, domain), topic, *_TOPIC)
        if len(kinds) > 1:
            raise TargetError(f'"{topic}" has {len(kinds)} types, {" and ".join(kinds)}: name one of them')
        type_ = kinds[0]
    return _run(lambda: _print(topic, type_, router, domain, limit, durability, json))


async def _print(
    topic: str, type_: str, router: str, domain: int, limit: int | None, durability: str, json: bool
) -> int:
    from hfg.nodes.flow import relay
    from hfg.nodes.ros import RosSubscribe  # needs the extra

    graph = Graph("hfg_echo")
    node = graph.add(
        RosSubscribe(
            topic=full_name(topic, "/", "hfg_echo"), type=type_, router=router, domain=domain, durability=durability
        )
    )
    graph.connect(node.out, graph.add(relay()).value)  # only edges can be tapped
    async with running(graph) as run:
        looking = run.tap("ros_subscribe.out", size=1_000)
        printed = 0
        async for token in looking:
            show.write(line_of(token, looking.passed_s, json=json))
            sys.stdout.flush()
            printed += 1
            if printed == limit:
                break
        looking.close()
        missed = node.statistics()["dropped"] + node.statistics()["lost"]
        if missed and limit is None:
            show.sentence(f"{missed} messages were skipped: more came than could be printed")
        run.stop()
    return 0


def _types(graph: RosGraph, name: str, *kinds: Kind) -> list[str]:
    full = full_name(name, "/", "hfg")
    found = sorted({one.type for one in graph.named(full, *kinds)})
    if not found:
        raise TargetError(f'"{full}" is not there: neither published nor subscribed to; hfg ros list shows what is')
    return found


def _looked(router: str, domain: int) -> RosGraph:
    """Return the entities that are there now."""

    async def look() -> RosGraph:
        link = Connection(router_of(router), domain_of(domain))
        try:
            async with asyncio.timeout(_WAIT_S):
                while link.session is None:
                    await link.wait_changed()
            await asyncio.sleep(_LOOK_S)
            return link.graph
        except TimeoutError:
            raise TransportError(f'no router of Zenoh is at "{link.where}"; start it, or name another one') from None
        finally:
            await link.close()

    return _run(look)


_T = TypeVar("_T")


def _run(work: Callable[[], Coroutine[Any, Any, _T]]) -> _T:
    try:
        return asyncio.run(work())
    except UsageError as error:
        raise TargetError(str(error)) from None
