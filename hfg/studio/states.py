"""The states of a graph for a page: which nodes can be active, what leads where, and what is proved.

A page asks for `states` without arguments, at any time, even while the graph runs. The value has

    states   {states: [{path, passes_on}], arrows: [{source, event, target}], limits: {path: seconds}};
             `source` is "" for the start of the run, `target` "" where activity leaves the graph;
             `undrawn` says why there is no layout of so many
    layout   the state diagram laid out, in the form of the table `layouts`; its paths are those of the
             graph, so what is active can be marked; null if no activity moves
    regions  per part of the graph: its nodes, and whether at most one and exactly one is active; `holds`
             is true, false (with `steps`), or null if it is not known

and `facts`, `unread`, `leaves_within_s`, `without_limit` and `problems` as in `ActivityReport`.

Depends on the analysis of activity and the drawing.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any, Final

import msgspec

from hfg.analysis import analyse_activity
from hfg.errors import HfgError
from hfg.graph import Graph, drawing
from hfg.graph.drawing import View

__all__ = ["states_of"]

_MOST_STATES: Final = 5_000  # of a region; a page waits for the answer
_MOST_DRAWN: Final = 300  # that takes about three seconds


async def states_of(graph: Graph, revision: Callable[[], int]) -> dict[str, Any]:
    """Return the report of the analysis as data, its problems, and the layout of the state diagram.

    Args:
      graph: the graph, which an edit may change while it is read: then the analysis starts over.
      revision: says which one it is.

    Raises:
      GraphError: the graph is too large.
    """
    while True:
        before = revision()
        try:
            found = await asyncio.to_thread(_read, graph)
        except HfgError:
            raise
        except Exception:
            if revision() == before:
                raise
            continue
        if revision() == before:
            return found


def _read(graph: Graph) -> dict[str, Any]:
    report = analyse_activity(graph, max_states=_MOST_STATES)
    diagram = report.diagram()
    layout, undrawn = None, ""
    if len(diagram.states) > _MOST_DRAWN:
        undrawn = (
            f"The graph has {len(diagram.states):,} states, and a page draws at most {_MOST_DRAWN}: "
            "hfg draw GRAPH states.svg --view states draws them all."
        )
    elif diagram.states:
        layout = msgspec.to_builtins(drawing.lay_out(diagram.graph(), View("activity")))
    found = report.as_data()
    found["states"]["undrawn"] = undrawn
    return {**found, "problems": msgspec.to_builtins(report.problems), "layout": layout}
