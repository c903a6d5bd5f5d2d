"""One graph without subgraphs, as a runner and the checks see it (rule G1).

flat_graph  what it is: plain data       flattening  makes it       order  rings in directed graphs
cutting     into parts for processes    deadlines   of ways from sources
"""

from hfg.graph.flat.cutting import MAIN, CutEdge, Cutting, cut
from hfg.graph.flat.flat_graph import (
    LINK,
    ROOT,
    End,
    EndKind,
    FlatEdge,
    FlatGate,
    FlatGraph,
    FlatNode,
    Scope,
    scope_end,
)
from hfg.graph.flat.flattening import EdgeFollower, flatten

__all__ = [
    "LINK",
    "MAIN",
    "ROOT",
    "CutEdge",
    "Cutting",
    "EdgeFollower",
    "End",
    "EndKind",
    "FlatEdge",
    "FlatGate",
    "FlatGraph",
    "FlatNode",
    "Scope",
    "cut",
    "flatten",
    "scope_end",
]
