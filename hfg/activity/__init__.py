"""Activity as plain functions and values; nothing here waits.

rules          the effect of received tokens, and what senders pass on (A3-A6)
fsm            StateMachine: its words, its graph
description    machines as data, and errors in them
machine_dicts  machines from dicts          translation   a machine as a graph and back (A13)
states         nodes that are states
"""

from hfg.activity.description import Transition
from hfg.activity.fsm import StateMachine
from hfg.activity.rules import after_receipt, leaving
from hfg.activity.states import StateNode

__all__ = ["StateMachine", "StateNode", "Transition", "after_receipt", "leaving"]
