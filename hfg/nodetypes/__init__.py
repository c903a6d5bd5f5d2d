"""Node types: classes derived from `Node` and decorated functions, and what is read from their code.

Depends on `hfg.ports`; knows no graph and no engine.
"""

__all__: list[str] = []
