"""Node types: classes derived from `Node` and decorated functions, and the description that is read from their code.

Depends on `hfg.ports`, not on graphs or the engine.
"""

__all__: list[str] = []
