"""What only the whole shows: one pure function for each check, from the flat graph to what it finds.

checking    all of them, and `check`     edges, flow, nodes  the checks     endless  sources that never end
"""

from hfg.graph.checks.checking import Check, also, check, check_flat

__all__ = ["Check", "also", "check", "check_flat"]
