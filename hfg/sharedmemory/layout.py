"""The layout of a segment, and of the small segment to which a consumer writes.

    segment          head | generation of each slot | slots, from byte 4096 | a page that is empty
    segment.LANE     head | generation taken of each slot | generation returned

Every number has one writer, which stores it in a single eight-byte write. So there is no lock that a killed process
could leave behind. A consumer maps the slots read-only, so it cannot change what other consumers read. The empty page
is for native code that reads some bytes beyond an array, as vector instructions do.
"""

from __future__ import annotations

import struct
from typing import Final

HEAD: Final = struct.Struct("<8sQQ")
"""Magic number, number of slots, bytes per slot."""
MAGIC: Final = b"hfgring2"
PAGE: Final = 4096
WORDS: Final = 64
"""Offset of the numbers of the slots."""
MOST_SLOTS: Final = (PAGE - WORDS) // 16
LANE_SIZE: Final = PAGE
MOST_LANE: Final = 999_999_999
"""The largest number of a lane, of as many digits as a name may have."""


def pages(size: int) -> int:
    """Round up to whole pages."""
    return -(-size // PAGE) * PAGE


def segment_size(slots: int, slot_size: int) -> int:
    """Return the size of a segment in bytes."""
    return PAGE + slots * slot_size + PAGE
