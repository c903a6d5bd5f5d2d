"""The oracle.

The behaviour of a graph according to the rules, written slowly and obviously, as a machine whose every decision is made
from outside.

    structure      a graph as plain data, subgraphs dissolved
    waiting        an event loop turned by hand, for async node code
    operators      reactivex operators on edges
    state          one moment of a run, and the questions the rules ask about it
    sending        tokens that leave, and what follows at once
    running_code   functions, coroutines and generators of nodes
    firing  calls  one firing, one slot call
    machine        permitted moves, and what is done when it is quiet
    report         a run under a schedule

It shares nothing with ports, activity rules or engine: an oracle that shares code with the system under test is
useless.
"""

from hfg.testing.reference.machine import Move, ReferenceMachine
from hfg.testing.reference.report import ReferenceReport, reference_run

__all__ = ["Move", "ReferenceMachine", "ReferenceReport", "reference_run"]
