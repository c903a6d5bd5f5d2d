"""The parts of a graph, and why something cannot be a part; each call that makes a part checks it.

level        one level of a graph: the whole, or the inside of a subgraph    whole    what all its levels share
members      its nodes by name                    connections  its edges, and which leads into each input
gates        who works while whom is active       promotions   which parameters stand for others inside
facts        how many of some nodes are active, as users state it
boundary     the ports of the whole graph         groups       where nodes run      history  what can be undone
sequence     an order in which places are found without counting, of members and connections
edge         Edge, and what is asked of its ends  subgraph     Subgraph: a node that holds a graph
options      of nodes, edges and groups                                       operators    of edges, by name

adding, connecting, declaring      what changes a level, and refuses what cannot be
membership   where a node is, said to the node    naming, paths    names, and what paths lead to
refusals     kept instead of raised, so that a check tells all
"""

__all__: list[str] = []
