"""The ends of edges: declarations for class bodies, and the bound ports of one node.

inputs  outputs  events  slots  parameters  states     one file per kind: declaration and bound port
specs  kinds  conditions                                the description of a parameter, which files and editors read
automatic                                               the ports that every node has (rule A9)
vectors                                                 several ports of one kind; the node is made with their number
relays                                                  the inner sides of a subgraph's ports
observable                                              events as reactivex observables
base                                                    Port, and the directions Source and Target

barrier, edges                                          their state during a run: state machines, for the engine only
"""

from hfg.ports.base import Port, Relaying, Source, Target
from hfg.ports.events import Event, EventPort
from hfg.ports.inputs import Input, InputPort
from hfg.ports.outputs import Output, OutputPort
from hfg.ports.parameters import Parameter, ParameterPort
from hfg.ports.relays import InnerSource, InnerTarget
from hfg.ports.slots import Slot, SlotPort, slot
from hfg.ports.specs import ParameterSpec
from hfg.ports.states import State
from hfg.ports.vectors import Events, Inputs, Outputs, PortVector, Slots

__all__ = [
    "Event",
    "EventPort",
    "Events",
    "InnerSource",
    "InnerTarget",
    "Input",
    "InputPort",
    "Inputs",
    "Output",
    "OutputPort",
    "Outputs",
    "Parameter",
    "ParameterPort",
    "ParameterSpec",
    "Port",
    "PortVector",
    "Relaying",
    "Slot",
    "SlotPort",
    "Slots",
    "Source",
    "State",
    "Target",
    "slot",
]
