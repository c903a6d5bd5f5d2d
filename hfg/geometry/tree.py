"""Frames over time: a tree, whose transforms are known at some stamps and interpolated between them."""

from __future__ import annotations

import bisect
from typing import Any

from hfg.errors import HfgError
from hfg.geometry.records import FrameTransform
from hfg.geometry.transforms import Transform


class FrameError(HfgError, LookupError):
    """It is not known how to get from one frame to another at a stamp, or a frame does not fit into the tree."""


class _Link:
    """Where a frame was in its parent; by stamp."""

    __slots__ = ("parent", "poses", "stamps", "static")

    def __init__(self, parent: str, *, static: bool) -> None:
        self.parent, self.static = parent, static
        self.stamps: list[float] = []
        self.poses: list[Transform] = []

    def put(self, stamp: float, pose: Transform, keep_s: float) -> None:
        """Take in a pose, in the place of one with the same stamp; forget what is too old."""
        at = bisect.bisect_left(self.stamps, stamp)
        same = at < len(self.stamps) and self.stamps[at] == stamp
        self.stamps[at : at + same] = [stamp]
        self.poses[at : at + same] = [pose]
        # one that is older than the memory stays as long as something inside the memory lies between it and the next
        old = max(0, bisect.bisect_right(self.stamps, self.stamps[-1] - keep_s) - 1)
        del self.stamps[:old], self.poses[:old]


class TransformTree:
    """Where frames are, over time.

    Args:
      keep_s: how long transforms are remembered, before the newest of each frame.

    Examples:
      >>> tree = TransformTree()
      >>> tree.add(FrameTransform("map", "base", Transform.of(x=1.0), stamp=0.0))
      >>> tree.add(FrameTransform("map", "base", Transform.of(x=2.0), stamp=1.0))
      >>> tree.add(FrameTransform("base", "laser", Transform.of(x=0.2), static=True))
      >>> tree.lookup("map", "laser", 0.5).translation.round(6).tolist()
      [1.7, 0.0, 0.0]
    """

    def __init__(self, keep_s: float = 10.0) -> None:
        self.keep_s = keep_s
        self._links: dict[str, _Link] = {}

    @property
    def frames(self) -> list[str]:
        """All known frames, sorted."""
        return sorted({*self._links, *(link.parent for link in self._links.values())})

    def add(self, known: FrameTransform) -> None:
        """Take in where a frame is.

        Raises:
          FrameError: the frame has another parent, or it would become an ancestor of itself.
        """
        link = self._links.get(known.child)
        if link is None:
            above = self._ancestors(known.parent)
            if known.child in above:
                ring = [*above[: above.index(known.child) + 1], known.parent]
                raise FrameError(f"frames are a tree, but these are a ring: {_listed(ring[::-1])}")
            link = self._links[known.child] = _Link(known.parent, static=known.static)
        if link.parent != known.parent:
            raise FrameError(
                f'the frame "{known.child}" is in "{link.parent}", and cannot be in "{known.parent}" too at '
                f"{known.stamp:.3f} s; a frame has one parent"
            )
        if link.static or known.static:
            link.static, link.stamps, link.poses = known.static, [], []
        link.put(known.stamp, known.transform, self.keep_s)

    def lookup(self, target: str, source: str, stamp: float, slack_s: float = 0.0) -> Transform:
        """Return the transform that takes coordinates of one frame to those of another one.

        Args:
          target: the frame to go to.
          source: the frame to come from.
          stamp: when; between two known stamps the pose of a frame is interpolated, by slerp.
          slack_s: how far outside of what is known the first or last pose still holds.

        Raises:
          FrameError: a frame is unknown, the two are not connected, or the stamp is too old or too new; the message
            names frame and stamp, and what is known.
        """
        for frame in (target, source):
            if frame not in self._links and not any(link.parent == frame for link in self._links.values()):
                known = _listed(self.frames) if self._links else "none yet"
                raise FrameError(f'the frame "{frame}" is unknown at {stamp:.3f} s; known are: {known}')
        up, down = self._ancestors(source), self._ancestors(target)
        common = next((frame for frame in up if frame in down), None)
        if common is None:
            raise FrameError(
                f'the frames "{source}" and "{target}" are not connected at {stamp:.3f} s: one is in "{up[-1]}", the '
                f'other in "{down[-1]}"; add where one of these is in the other'
            )
        rise = self._climb(up[: up.index(common)], stamp, slack_s)
        fall = self._climb(down[: down.index(common)], stamp, slack_s)
        return fall.inverse() @ rise

    def _ancestors(self, frame: str) -> list[str]:
        found = [frame]
        while found[-1] in self._links:
            found.append(self._links[found[-1]].parent)
        return found

    def _climb(self, frames: list[str], stamp: float, slack_s: float) -> Transform:
        """Return the transform from the first frame to the parent of the last one."""
        whole = Transform.of()
        for frame in frames:
            whole = self._pose(frame, stamp, slack_s) @ whole
        return whole

    def _pose(self, frame: str, stamp: float, slack_s: float) -> Transform:
        link = self._links[frame]
        stamps = link.stamps
        if link.static:
            return link.poses[0]
        first, last = stamps[0], stamps[-1]
        if not first - slack_s <= stamp <= last + slack_s:  # a stamp that is not a number, too
            old = stamp < first
            raise FrameError(
                f'where "{frame}" is in "{link.parent}" is known from {first:.3f} s to {last:.3f} s, not at '
                f"{stamp:.3f} s; {_remedy(self.keep_s) if old else 'wait for it, or allow slack_s'}"
            )
        after = bisect.bisect_left(stamps, stamp)
        if after == len(stamps) or after == 0:
            return link.poses[min(after, len(stamps) - 1)]
        share = (stamp - stamps[after - 1]) / (stamps[after] - stamps[after - 1])
        return link.poses[after - 1].between(link.poses[after], share)


def _remedy(keep_s: float) -> str:
    return f"that is too old: the last {keep_s:g} s are kept (keep_s)"


def _listed(frames: Any) -> str:
    return ", ".join(f'"{frame}"' for frame in frames)
