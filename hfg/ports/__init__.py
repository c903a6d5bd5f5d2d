"""The ends of edges: declarations for class bodies, and the bound ports of one node.

inputs  outputs  events  slots  parameters  states     one file for each kind: declaration and bound port
automatic                                               the ports of rule A9
relays                                                  the inner sides of a subgraph's ports
observable                                              events as reactivex observables
base                                                    Port, and the directions Source and Target

barrier, edges                                          what a run keeps of them: state machines, for the engine only
"""

from hfg.ports.base import Port, Relaying, Source, Target
from hfg.ports.events import Event, EventPort
from hfg.ports.inputs import Input, InputPort
from hfg.ports.outputs import Output, OutputPort
from hfg.ports.parameters import Parameter, ParameterPort, ParameterSpec
from hfg.ports.relays import InnerSource, InnerTarget
from hfg.ports.slots import Slot, SlotPort, slot
from hfg.ports.states import State

__all__ = [
    "Event",
    "EventPort",
    "InnerSource",
    "InnerTarget",
    "Input",
    "InputPort",
    "Output",
    "OutputPort",
    "Parameter",
    "ParameterPort",
    "ParameterSpec",
    "Port",
    "Relaying",
    "Slot",
    "SlotPort",
    "Source",
    "State",
    "Target",
    "slot",
]
