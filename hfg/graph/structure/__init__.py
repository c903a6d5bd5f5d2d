"""What a graph is made of, and why something cannot be part of it; each thing is refused where it is said.

options     what is said about nodes, edges and groups besides
naming      names and paths                         boxes       which nodes hold a graph
members     what `add` refuses                      gates, promotions     the same for theirs
edges       Edge, and every reason to refuse one at once
boundary    the ports of the whole graph            subgraph    Subgraph: a node that holds a graph
refusals    kept instead of raised, so that a check tells all
"""

__all__: list[str] = []
