"""What a run is made of: its nodes, subgraphs and ready queues, and the state they share.

vertex    one node in the plan: its code and its edges      shape     what these say about each of its firings
worker    one node while it runs                            core      one run, and what it needs of those above
scopes    subgraphs, gates      groups    nodes that run one at a time      policies  who of them is next
iteration   the border of a subgraph that iterates (G4)
tasks     what a node's code has started beside its firings
sharing   who uses which values, in debug mode
"""

__all__: list[str] = []
