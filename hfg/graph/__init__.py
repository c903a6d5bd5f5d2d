"""The structure of graphs: what is built, checked and handed to a runner; nothing here runs.

    structure   Graph: nodes, edges, groups, gates and the ports of the whole
    subgraph    Subgraph: a node that holds a graph
    edges       Edge, and every reason to refuse one at once
    options     what is said about nodes, edges and groups besides
    naming      names and paths
    boundary    the ports of the whole graph
    flat        one graph without subgraphs, as a runner and the checks see it
    checks      what only the whole shows: of edges, flow, nodes
    order       rings in directed graphs
    picture     what is to be seen of a graph       drawing     the same as Mermaid or DOT
    commands    edits as data                  performing  what carries them out: pointing, making, copying, enclosing
    changes     their steps, to be taken back  editing     transactions, undo and redo        reloading  of modules
    members     what `add` refuses      gates, promotions     the same for theirs
    refusals    kept instead of raised, so that a check tells all

Stands on node types and ports.
"""

from hfg.graph.boundary import GraphInput, GraphOutput
from hfg.graph.edges import Edge
from hfg.graph.gates import Gate
from hfg.graph.options import EdgeOptions, GroupSpec, NodeOptions
from hfg.graph.structure import Graph
from hfg.graph.subgraph import Subgraph

__all__ = ["Edge", "EdgeOptions", "Gate", "Graph", "GraphInput", "GraphOutput", "GroupSpec", "NodeOptions", "Subgraph"]
