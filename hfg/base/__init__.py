"""The vocabulary that every other package uses: tokens, values, limits, clocks, log records, safe files.

Depends on `hfg.errors` and `hfg.types` only, and never waits.
"""

__all__: list[str] = []
