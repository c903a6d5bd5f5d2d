"""What lies where in a segment, and in the small one beside it that a consumer writes to.

    segment          head | generation of each slot | slots, from byte 4096 | a page that is empty
    segment.LANE     head | what the consumer has taken of each slot | what it has given back

Every number has one writer, which stores it in one step of eight bytes; so there is no lock that a killed process could
leave behind. A consumer maps the slots read-only, so nothing that it does can change what others read. The
empty page is for native code that reads some bytes beyond an array, as vector instructions do.
"""

from __future__ import annotations

import struct
from typing import Final

__all__ = ["HEAD", "LANE_SIZE", "MAGIC", "MOST_SLOTS", "PAGE", "WORDS", "pages", "segment_size"]

HEAD: Final = struct.Struct("<8sQQ")
"""Magic, slots, bytes of a slot."""
MAGIC: Final = b"hfgring2"
PAGE: Final = 4096
WORDS: Final = 64
"""Where the numbers of the slots begin."""
MOST_SLOTS: Final = (PAGE - WORDS) // 16
LANE_SIZE: Final = PAGE


def pages(size: int) -> int:
    """Round up to whole pages."""
    return -(-size // PAGE) * PAGE


def segment_size(slots: int, slot_size: int) -> int:
    """Give the bytes of a segment."""
    return PAGE + slots * slot_size + PAGE
