"""What a run is made of: its nodes, subgraphs and ready queues, and the state they share."""

__all__: list[str] = []
