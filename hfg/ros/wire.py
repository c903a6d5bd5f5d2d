"""What rmw_zenoh writes: keys of topics and services, tokens of the graph, attachments, quality of service.

Pure text and bytes, without Zenoh. Source: the design document in https://github.com/ros2/rmw_zenoh, from versions 0.6
(Kilted) and 0.2.4 (Jazzy) on. Depends on names and errors.
"""

from __future__ import annotations

import struct
from typing import Final, Literal, TypeAlias

import msgspec

from hfg.ros.names import dds_name, ros_name

Kind: TypeAlias = Literal["NN", "MP", "MS", "SS", "SC"]
"""Of what is in the graph: node, publisher, subscription, server of a service, client of one."""

KINDS: Final[tuple[Kind, ...]] = ("NN", "MP", "MS", "SS", "SC")
GID: Final = 16
"""Bytes of an identity."""

_SPACE: Final = "@ros2_lv"
_LONGEST_TOKEN: Final = 4_000  # characters; a name has at most 255
_WITHOUT_TOPIC, _WITH_TOPIC = 9, 13  # chunks; newer versions add more, which are passed over
_ATTACHED: Final = struct.Struct("<qqB16s")
_MOST_DOMAINS: Final = 232

Reliability: TypeAlias = Literal["reliable", "best_effort"]
Durability: TypeAlias = Literal["volatile", "transient_local"]


class Qos(msgspec.Struct, frozen=True):
    """Quality of service, as far as rmw_zenoh acts on it.

    Attributes:
      reliability: whether a publisher waits when the connection has no room.
      durability: whether who joins later gets the last messages.
      depth: how many messages are kept; 0: all.
    """

    reliability: Reliability = "reliable"
    durability: Durability = "volatile"
    depth: int = 10

    @property
    def text(self) -> str:
        """As in a token; parts that are rmw_zenoh's defaults are left out.

        Examples:
          >>> Qos().text, Qos("best_effort", "transient_local", 5).text
          ('::,10:,:,:,,', '2:1:,5:,:,:,,')
        """
        reliability = "2" if self.reliability == "best_effort" else ""
        durability = "1" if self.durability == "transient_local" else ""
        history = "2," if not self.depth else f",{'' if self.depth == _DEFAULT_DEPTH else self.depth}"
        return f"{reliability}:{durability}:{history}:,:,:,,"


_DEFAULT_DEPTH: Final = 42


def read_qos(text: str) -> Qos | None:
    """Read the quality of service in a token; None if the text cannot be read."""
    groups = text.split(":")
    if len(groups) < 3:
        return None
    history, _, depth = groups[2].partition(",")
    if not all(part.isascii() and (part.isdigit() or not part) for part in (groups[0], groups[1], history, depth)):
        return None
    if len(depth) > 18:
        return None
    return Qos(
        "best_effort" if groups[0] == "2" else "reliable",
        "transient_local" if groups[1] == "1" else "volatile",
        0 if history == "2" else int(depth or _DEFAULT_DEPTH),
    )


class Entity(msgspec.Struct, frozen=True):
    """A node, publisher, subscription, server or client, as others see it.

    Attributes:
      domain: the number of the domain.
      session: Zenoh's id of the session.
      node_id, id: numbers in the session; a node's are the same.
      kind: see `Kind`.
      namespace, node: of the node, "/" for none.
      name: full name of the topic or service; empty for a node.
      type: of its messages, "std_msgs/msg/String"; empty for a node.
      hash: of the type, "RIHS01_...".
      qos: see `Qos`.
    """

    domain: int
    session: str
    node_id: int
    id: int
    kind: Kind
    namespace: str
    node: str
    name: str = ""
    type: str = ""
    hash: str = ""
    qos: Qos = Qos()

    @property
    def token(self) -> str:
        """The key of its liveliness token."""
        who = f"{_SPACE}/{self.domain}/{self.session}/{self.node_id}/{self.id}/{self.kind}"
        node = f"{who}/%/{_mangled(self.namespace)}/{self.node}"
        if self.kind == "NN":
            return node
        return f"{node}/{_mangled(self.name)}/{dds_name(self.type)}/{self.hash}/{self.qos.text}"

    @property
    def key(self) -> str:
        """The key of its messages, or of its requests."""
        return f"{self.domain}/{self.name.strip('/')}/{dds_name(self.type)}/{self.hash}"

    @property
    def gid(self) -> bytes:
        """The identity that its messages carry: XXH3 of its token, 128 bits, the low half first."""
        import xxhash

        return xxhash.xxh3_128_intdigest(self.token.encode()).to_bytes(GID, "little")


def tokens_of(domain: int) -> str:
    """Return the pattern of all tokens of a domain."""
    return f"{_SPACE}/{domain}/**"


def read_token(token: str) -> Entity | None:
    """Read a token of another program; None if it cannot be read."""
    if len(token) > _LONGEST_TOKEN:
        return None
    parts = token.split("/")
    if len(parts) < _WITHOUT_TOPIC or parts[0] != _SPACE or parts[5] not in KINDS:
        return None
    kind: Kind = parts[5]
    if not all(part.isascii() and part.isdigit() and len(part) <= 18 for part in (parts[1], parts[3], parts[4])):
        return None
    numbers = int(parts[1]), parts[2], int(parts[3]), int(parts[4])
    namespace, node = _plain(parts[7]) or "/", _plain(parts[8])
    if kind == "NN":
        return Entity(*numbers, kind, namespace, node)
    if len(parts) < _WITH_TOPIC:
        return None
    type_, qos = ros_name(parts[10]), read_qos(parts[12])
    if type_ is None or qos is None:
        return None
    return Entity(*numbers, kind, namespace, node, _plain(parts[9]), type_, parts[11], qos)


def _mangled(name: str) -> str:
    return name.replace("/", "%") or "%"


def _plain(part: str) -> str:
    return "" if part == "%" else part.replace("%", "/")


class Attachment(msgspec.Struct, frozen=True):
    """The data that every message, request and answer carries.

    Attributes:
      sequence: counts the messages of a publisher from 1; of an answer: that of the request.
      stamp_ns: when it was sent, in ns of Unix time.
      gid: who has sent it; of an answer: who has asked.
    """

    sequence: int
    stamp_ns: int
    gid: bytes

    def encode(self) -> bytes:
        """Return the 33 bytes."""
        return _ATTACHED.pack(self.sequence, self.stamp_ns, GID, self.gid)


def read_attachment(data: bytes) -> Attachment | None:
    """Read an attachment; None if it cannot be read, as those of versions before April 2025."""
    if len(data) != _ATTACHED.size:
        return None
    sequence, stamp_ns, size, gid = _ATTACHED.unpack(data)
    return Attachment(sequence, stamp_ns, gid) if size == GID else None


class Gaps:
    """Counts the messages that publishers have sent and a subscription has not received.

    Attributes:
      lost: how many.
    """

    _MOST: Final = 1_000  # publishers that are counted separately

    def __init__(self) -> None:
        self.lost = 0
        self._last: dict[bytes, int] = {}

    def note(self, attachment: Attachment) -> int:
        """Note a message, and return how many are missing right before it."""
        last = self._last.pop(attachment.gid, None)
        if last is None and len(self._last) >= self._MOST:
            del self._last[next(iter(self._last))]  # who has been silent for longest
        self._last[attachment.gid] = attachment.sequence if last is None else max(last, attachment.sequence)
        missing = 0 if last is None else max(0, attachment.sequence - last - 1)
        self.lost += missing
        return missing


def need_domain(number: int) -> int:
    """Return the number of a domain.

    Raises:
      ValueError: ROS 2 has no such domain.
    """
    if not 0 <= number <= _MOST_DOMAINS:
        raise ValueError(f"there is no domain {number}: take 0 to {_MOST_DOMAINS}")
    return number
