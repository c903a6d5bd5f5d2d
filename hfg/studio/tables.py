"""The tables of a studio and their revisions: changes become numbered patches, which are kept for pages that reconnect.

One mechanism for all that a page shows lastingly: whoever changes something gives the new records, and the difference
is found here. Depends on `messages`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from typing import Any, Final

from hfg.studio.messages import Patch, Snapshot, encode

__all__ = ["Tables"]

_KEPT: Final = 1000
"""Patches for pages that were away for a moment; together at most `_KEPT_BYTES`."""

_KEPT_BYTES: Final = 8 << 20

NAMES: Final = (
    "nodes",
    "edges",
    "gates",
    "groups",
    "ports",
    "types",
    "annotations",
    "layouts",
    "problems",
    "breakpoints",
    "studio",
)


class Tables:
    """All records by table and key.

    Attributes:
      rev: number of the last patch.
      of: the tables.
    """

    def __init__(self) -> None:
        self.rev = 0
        self.of: dict[str, dict[str, Any]] = {name: {} for name in NAMES}
        self._patches: deque[tuple[int, bytes]] = deque()
        self._bytes = 0

    def replace(self, tables: Mapping[str, Mapping[str, Any]], by: int = 0, text: str = "") -> bytes | None:
        """Let whole tables be these; return the patch for those who had the others, None if nothing has changed."""
        ops: list[tuple[str, str, Any]] = []
        for name, records in tables.items():
            before = self.of[name]
            ops += [(name, key, None) for key in before if key not in records]
            ops += [(name, key, record) for key, record in records.items() if before.get(key) != record]
        return self._tell(ops, by, text)

    def put(self, name: str, key: str, record: object, by: int = 0, text: str = "") -> bytes | None:
        """Let one record be this, or gone if it is None; return the patch."""
        if self.of[name].get(key) == record:
            return None
        return self._tell([(name, key, record)], by, text)

    def _tell(self, ops: Iterable[tuple[str, str, Any]], by: int, text: str) -> bytes | None:
        ops = list(ops)
        if not ops:
            return None
        for name, key, record in ops:
            if record is None:
                self.of[name].pop(key, None)
            else:
                self.of[name][key] = record
        self.rev += 1
        patch = encode(Patch(self.rev, ops, by, text))
        self._patches.append((self.rev, patch))
        self._bytes += len(patch)
        while len(self._patches) > _KEPT or self._bytes > _KEPT_BYTES:
            self._bytes -= len(self._patches.popleft()[1])
        return patch

    def since(self, rev: int) -> list[bytes] | None:
        """Return the patches after a revision; None if they are not all there any more."""
        if not 0 <= rev <= self.rev or (rev < self.rev and (not self._patches or self._patches[0][0] > rev + 1)):
            return None
        return [patch for number, patch in self._patches if number > rev]

    def snapshot(self) -> bytes:
        """Return everything."""
        return encode(Snapshot(self.rev, self.of))
