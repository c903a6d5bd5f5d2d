"""What waits: the loop, the code of nodes, threads, clocks, beginning and ending."""

__all__: list[str] = []
