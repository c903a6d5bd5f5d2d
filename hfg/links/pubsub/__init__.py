"""Programs that connect by a name: the publishing and the subscribing end (rules L1 to L4).

They use a session of a transport. Each publisher has two links of its own, an exact one for consumers that want every
value and a bounded one for all others. A consumer announces that it wants to take part, and is admitted.
`hfg.links.offers` defines the announcements and the matching; this package acts on them. Programs start in any order,
die and return: a watch over the name reports this within the lease of the transport. Depends on `hfg.links.running` and
`offers`.
"""

from hfg.links.pubsub.outbox import OutboxFile
from hfg.links.pubsub.publication import Absent, Publication, PublicationCounts
from hfg.links.pubsub.subscription import Subscription, SubscriptionCounts

__all__ = ["Absent", "OutboxFile", "Publication", "PublicationCounts", "Subscription", "SubscriptionCounts"]
