"""Links: edges whose ends are in two programs, over any transport (rules L1 to L4).

frames                what goes over the wire, written and read; whatever is wrong is refused there
producer  <- peer     the exact link's sending end: numbers, windows, evidence, probes; what it knows of each consumer
consumer              the exact link's receiving end: order, repetitions, credits, fencing
bounded               both ends of the link that may lose some and counts them
running               the ends at work: over a session of a transport, on an event loop
local                 straight from one process to another of the same host, beside a session
offers                what programs that meet by a name say of themselves, and who fits whom
meeting               these programs: the publishing and the subscribing end

All but `running`, `local` and `meeting` are plain state machines: frames, tokens and the time go in, frames and tokens
come out.
"""

from hfg.links.bounded import BoundedConsumer, BoundedProducer
from hfg.links.consumer import ExactConsumer
from hfg.links.frames import Outgoing
from hfg.links.producer import ExactProducer, Outbox

__all__ = ["BoundedConsumer", "BoundedProducer", "ExactConsumer", "ExactProducer", "Outbox", "Outgoing"]
