"""Links: edges whose ends are in two programs, over any transport (rules L1 to L4).

frames                the wire format, written and read; anything malformed is refused there
producer  <- peer     the exact link's sending end: numbers, windows, evidence, probes; its state of each consumer
consumer              the exact link's receiving end: order, repetitions, credits, fencing
bounded               both ends of the link that may lose tokens and counts them
running               the ends in operation: over a session of a transport, on an event loop
local                 directly between processes of one host, in addition to a session
offers                what programs that connect by a name announce, and which of them match
pubsub                these programs: the publishing and the subscribing end

All except `running`, `local` and `pubsub` are plain state machines: frames, tokens and the time go in, frames and
tokens come out.
"""

from hfg.links.bounded import BoundedConsumer, BoundedProducer
from hfg.links.consumer import ExactConsumer
from hfg.links.frames import Outgoing
from hfg.links.producer import ExactProducer, Outbox

__all__ = ["BoundedConsumer", "BoundedProducer", "ExactConsumer", "ExactProducer", "Outbox", "Outgoing"]
