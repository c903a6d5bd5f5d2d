"""One graph without subgraphs, as a runner and the checks see it (rule G1).

flat_graph  what it is: plain data       flattening  makes it       order  rings in directed graphs
"""

from hfg.graph.flat.flat_graph import ROOT, End, EndKind, FlatEdge, FlatGate, FlatGraph, FlatNode, Scope, scope_end
from hfg.graph.flat.flattening import EdgeFollower, flatten

__all__ = [
    "ROOT",
    "EdgeFollower",
    "End",
    "EndKind",
    "FlatEdge",
    "FlatGate",
    "FlatGraph",
    "FlatNode",
    "Scope",
    "flatten",
    "scope_end",
]
