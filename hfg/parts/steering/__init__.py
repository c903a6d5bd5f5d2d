"""Control and observation from outside of a run whose nodes are in several parts.

run       the interface to such a run
asking    requests to other parts, on the side of the main part
serving   and on the side of the part that is asked
reports   the report of the whole run
crossing  values brought in and observed, as data
"""

__all__: list[str] = []
