"""Programs that meet by a name: the publishing and the subscribing end, over a session of a transport (rules L1 to L4).

Each publisher has two links of his own, an exact one for consumers that want every value and a bounded one for all
others; a consumer announces that it takes part, and is admitted. Who announces what, and who fits whom, is in
`hfg.links.offers`; here is what follows from it. Programs come in any order, die and return: a watch over the name
tells, within the lease of the transport. Stands on `hfg.links.running` and `offers`.
"""

from hfg.links.meeting.outbox import OutboxFile
from hfg.links.meeting.publication import Absent, Publication, PublicationCounts
from hfg.links.meeting.subscription import Subscription, SubscriptionCounts

__all__ = ["Absent", "OutboxFile", "Publication", "PublicationCounts", "Subscription", "SubscriptionCounts"]
