"""Activity, pure: nothing here waits.

rules          what a node becomes by what it takes, and what leaves it (A3-A6)
fsm            StateMachine: its words, its graph
description    machines as data, and what is wrong with one
machine_dicts  machines from dicts          translation   a machine as a graph and back (A13)
states         nodes that are states
analysis       who can ever become active; adds to the checks of graphs
explicit       what the code of a node type shows of that (A4)
"""

from hfg.activity.analysis import ActivityAnalysis
from hfg.activity.description import Transition
from hfg.activity.fsm import StateMachine
from hfg.activity.rules import after_receipt, leaving
from hfg.activity.states import StateNode

__all__ = ["ActivityAnalysis", "StateMachine", "StateNode", "Transition", "after_receipt", "leaving"]
