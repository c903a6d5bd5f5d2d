"""The structure of graphs: what is built, checked and handed to a runner; nothing here runs.

    graph       Graph: the face, which composes the wings
    editing     edits as data: commands, their steps, undo and redo, reloading of modules
    checks      what only the whole shows: of edges, flow, nodes
    drawing     what is to be seen of a graph, as SVG, Mermaid or DOT
    flat        one graph without subgraphs, as a runner and the checks see it
    structure   what a graph is made of: nodes, edges, groups, gates, subgraphs, the ports of the whole

Each wing has a map of its own, and imports only those below it; a test keeps that. Depends on node types and ports.
"""

from hfg.graph.editing import commands
from hfg.graph.graph import Graph, Subgraph
from hfg.graph.structure.boundary import GraphInput, GraphOutput
from hfg.graph.structure.edge import Edge
from hfg.graph.structure.gates import Gate
from hfg.graph.structure.operators import operator
from hfg.graph.structure.options import (
    EdgeGiven,
    EdgeOptions,
    GroupGiven,
    GroupSpec,
    MonitorGiven,
    MonitorSpec,
    NodeGiven,
    NodeOptions,
)

__all__ = [
    "Edge",
    "EdgeGiven",
    "EdgeOptions",
    "Gate",
    "Graph",
    "GraphInput",
    "GraphOutput",
    "GroupGiven",
    "GroupSpec",
    "MonitorGiven",
    "MonitorSpec",
    "NodeGiven",
    "NodeOptions",
    "Subgraph",
    "commands",
    "operator",
]
