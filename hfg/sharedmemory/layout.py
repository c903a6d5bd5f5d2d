"""What lies where in a segment, and in the small one beside it that a consumer writes to.

    segment          head | generation of each slot | slots, from byte 4096
    segment.LANE     head | what the consumer has taken of each slot | what it has given back

Every number has one writer, which stores it in one step of eight bytes; so there is no lock that a killed process could
leave behind. A consumer maps the slots read-only, so nothing that it does can change what others read.
"""

from __future__ import annotations

import struct
from typing import Final

__all__ = ["HEAD", "LANE_SIZE", "MAGIC", "MOST_SLOTS", "PAGE", "WORDS", "pages"]

HEAD: Final = struct.Struct("<8sQQ")
"""Magic, slots, bytes of a slot."""
MAGIC: Final = b"hfgring1"
PAGE: Final = 4096
WORDS: Final = 64
"""Where the numbers of the slots begin."""
MOST_SLOTS: Final = (PAGE - WORDS) // 16
LANE_SIZE: Final = PAGE


def pages(size: int) -> int:
    """Round up to whole pages."""
    return -(-size // PAGE) * PAGE
