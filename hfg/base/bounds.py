"""Limits on the resources that untrusted input may use: one table, docs/howto/untrusted.md (rule L4).

A file of a few kilobytes can ask for gigabytes of memory. Each reader asks here how much it may use, and refuses more
with an error that names the limit. An environment variable with the limit's name changes it, so the limit holds in
every process of a run. No dependencies.
"""

from __future__ import annotations

import os
from typing import Final, NamedTuple


class Bound(NamedTuple):
    """A limit.

    Attributes:
      variable: the environment variable that changes it.
      usual: the default.
      what: the name of what it limits.
    """

    variable: str
    usual: int
    what: str

    @property
    def most(self) -> int:
        """The limit in effect."""
        said = os.environ.get(self.variable, "")
        return int(said) if said.isdecimal() and said.isascii() and len(said) < 20 else self.usual

    @property
    def remedy(self) -> str:
        """What to do about input that needs more."""
        return f"the limit is {self.most:,}; if you trust it, set {self.variable} to a larger number"


ACTIVE_EDGES: Final = Bound("HFG_MOST_ACTIVE_EDGES", 5000, "active edges of a graph whose activity is analysed")
CHUNK_BYTES: Final = Bound("HFG_MOST_CHUNK_BYTES", 256 * 2**20, "bytes of one chunk of a recording, unpacked")
CHUNK_MESSAGES: Final = Bound("HFG_MOST_CHUNK_MESSAGES", 1_000_000, "messages of one chunk of a recording")
FILE_BYTES: Final = Bound("HFG_MOST_FILE_BYTES", 2**30, "bytes of a file, line or array that is read whole")
GRAPH_FILE_BYTES: Final = Bound("HFG_MOST_GRAPH_FILE_BYTES", 32 * 2**20, "bytes of a graph file or .apex file")
GROUPS: Final = Bound("HFG_MOST_GROUPS", 1000, "groups of a graph")
JOURNAL_BYTES: Final = Bound("HFG_MOST_JOURNAL_BYTES", 64 * 2**20, "bytes of the journal of a search for parameters")
JSON_VALUES: Final = Bound("HFG_MOST_JSON_VALUES", 10_000_000, "values in a JSON text, including keys")
NODES_AND_PORTS: Final = Bound(
    "HFG_MOST_NODES_AND_PORTS", 100_000, "nodes of included files, and nodes and ports that copies and vectors make"
)
PICTURE_PIXELS: Final = Bound("HFG_MOST_PICTURE_PIXELS", 2**27, "pixels of one image or video frame")
RECORDING_RATIO: Final = Bound(
    "HFG_MOST_RECORDING_RATIO", 100, "bytes of a recording, unpacked, for each byte of its file, beyond the first 4 GiB"
)
ROS_VALUES: Final = Bound(
    "HFG_MOST_ROS_VALUES", 10_000_000, "values in a message of ROS 2, apart from the numbers of its arrays"
)

BOUNDS: Final = (
    ACTIVE_EDGES,
    CHUNK_BYTES,
    CHUNK_MESSAGES,
    FILE_BYTES,
    GRAPH_FILE_BYTES,
    GROUPS,
    JOURNAL_BYTES,
    JSON_VALUES,
    NODES_AND_PORTS,
    PICTURE_PIXELS,
    RECORDING_RATIO,
    ROS_VALUES,
)
