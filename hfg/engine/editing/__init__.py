"""What changes or holds a run while it goes on: edits, pause, steps, breakpoints."""

__all__: list[str] = []
