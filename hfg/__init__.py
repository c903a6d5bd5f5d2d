"""hfg: Activity Flow Graphs for asyncio. Data flow, events and activity in one model.

Functions and classes are node types. A graph connects nodes, and `hfg.run` runs it:

    @hfg.node
    def numbers() -> Iterator[int]:
        yield from range(3)

    @hfg.node
    def show(number: int) -> None:
        print(number)

    graph = hfg.Graph("hello")
    graph.connect(graph.add(numbers()).out, graph.add(show()).number)
    hfg.run(graph)

- Write nodes with `hfg.node` and `hfg.Node`; declare ports with `Input`, `Output`, `Event`, `slot` and `Parameter`.
- Build graphs with `hfg.Graph` and `hfg.Subgraph`; save and load them with `hfg.save` and `hfg.load`.
- Run graphs with `hfg.run`, `hfg.run_async` or `async with hfg.running(graph) as run`.
- Use ready-made nodes from `hfg.nodes`; the command `hfg nodes` lists them.

The tutorial is docs/tutorial.md. `import hfg` is fast, because each name is imported when it is first used.

For developers: these are the layers of the package. Imports go down only. Layers 0 to 3 build graphs without an
engine; code that waits starts in layer 5.

    7  cli      studio    composing   comparing
    6  nodes    files   recording   reporting   parts   catalogue   monitors   tuning   also: testing
    5  engine   links.running                             outside: hfg_transports (imports layers 0-1 only)
    4  activity   analysis   links   timeline
    3  graph
    2  nodetypes   registry
    1  ports                transport   sharedmemory
    0  errors  types  <-  base  <-  encoding  images  panels  trace
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from hfg.base import starting as starting  # before all that takes its time to import

# isort: split
from hfg import composing as composing  # gives lower layers the functions that upper layers provide
from hfg.base.lazy import on_demand

if TYPE_CHECKING:
    from hfg import errors
    from hfg.activity import StateMachine
    from hfg.analysis import analyse_activity
    from hfg.base.clock import elapsed, now
    from hfg.base.logs import log
    from hfg.base.token import END, NO_MESSAGE, Token
    from hfg.base.values import Colour, Span
    from hfg.engine import PunctualLoop, Report, Run, Statistics, VirtualTimeLoop, run, run_async, running
    from hfg.errors import EndOfStream, Failure
    from hfg.files import load, save
    from hfg.graph import Graph, Subgraph, commands, operator
    from hfg.nodes.links import publish, subscribe
    from hfg.nodetypes.functions import node
    from hfg.nodetypes.node import Node
    from hfg.ports import Event, Events, Input, Inputs, Output, Outputs, Parameter, Slots, State, slot
    from hfg.registry import reference_of

__all__ = [
    "END",
    "NO_MESSAGE",
    "Colour",
    "EndOfStream",
    "Event",
    "Events",
    "Failure",
    "Graph",
    "Input",
    "Inputs",
    "Node",
    "Output",
    "Outputs",
    "Parameter",
    "PunctualLoop",
    "Report",
    "Run",
    "Slots",
    "Span",
    "State",
    "StateMachine",
    "Statistics",
    "Subgraph",
    "Token",
    "VirtualTimeLoop",
    "analyse_activity",
    "commands",
    "elapsed",
    "errors",
    "load",
    "log",
    "node",
    "now",
    "operator",
    "publish",
    "reference_of",
    "run",
    "run_async",
    "running",
    "save",
    "slot",
    "subscribe",
]


if not TYPE_CHECKING:
    __getattr__ = on_demand(
        __name__,
        {
            "activity": ("StateMachine",),
            "analysis": ("analyse_activity",),
            "base.clock": ("elapsed", "now"),
            "base.logs": ("log",),
            "base.token": ("END", "NO_MESSAGE", "Token"),
            "base.values": ("Colour", "Span"),
            "engine": ("PunctualLoop", "Report", "Run", "Statistics", "VirtualTimeLoop", "run", "run_async", "running"),
            "errors": ("EndOfStream", "Failure"),
            "files": ("load", "save"),
            "graph": ("Graph", "Subgraph", "commands", "operator"),
            "nodetypes.functions": ("node",),
            "nodetypes.node": ("Node",),
            "ports": ("Event", "Events", "Input", "Inputs", "Output", "Outputs", "Parameter", "Slots", "State", "slot"),
            "nodes.links": ("publish", "subscribe"),
            "registry": ("reference_of",),
        },
    )


def __dir__() -> list[str]:
    return __all__
