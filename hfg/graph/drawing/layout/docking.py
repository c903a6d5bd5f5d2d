"""Where the docks of one block are, and on which tracks above and below it lines turn that meet its top or bottom."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from typing import Final, Literal, NamedTuple, TypeAlias

from hfg.graph.drawing.layout.blocks import Block, Side

__all__ = ["ENDS", "TRACK", "Docked", "Turn", "Way", "docked"]

TRACK: Final = 9.0  # between two lines beside each other
ENDS: Final = ""  # lines of all kinds meet where they end
_ABOVE: Final = 20.0  # from the lowest track above a block to the block: an arrow's head and a port
_UNDER: Final = 13.0  # from a block to the first track below it

Way: TypeAlias = Literal["E", "W"]
"""The side of its block on which a line goes."""

Turn: TypeAlias = tuple[int, Way, str]
"""Lines that run together at a block: from which dock, on which side, and of which kind."""


class Docked(NamedTuple):
    """A block with its tracks.

    Attributes:
      at: of each dock, how far from the left or upper corner.
      upper: how far tracks reach above the block.
      height: of the block with all its tracks.
      meets: how far down from the highest track lines leave to their side.
    """

    at: list[float]
    upper: float
    height: float
    meets: dict[Turn, float]


def docked(block: Block, used: Set[Turn], partners: Mapping[int, float]) -> Docked:
    """Choose where docks on top and bottom are, and the tracks of their lines.

    Args:
      block: the block.
      used: what lines begin or end at its docks.
      partners: how far down the lines of a dock lead, where that is known.
    """
    ways: dict[int, set[Way]] = {}
    for index, way, _ in used:
        ways.setdefault(index, set()).add(way)
    at = [dock.at for dock in block.docks]
    over, over_depth = _tracks(_placed(block, "top", at, ways, partners), used, ways)
    under, under_depth = _tracks(_placed(block, "bottom", at, ways, partners), used, ways)
    upper = _ABOVE + over_depth if over else 0.0
    lower = _UNDER + under_depth if under else 0.0
    meets: dict[Turn, float] = {}
    for turn in used:
        if turn in over:
            meets[turn] = upper - _ABOVE - over[turn] * TRACK
        elif turn in under:
            meets[turn] = upper + block.height + _UNDER + under[turn] * TRACK
        else:
            meets[turn] = upper + at[turn[0]]
    return Docked(at, upper, upper + block.height + lower, meets)


def _placed(
    block: Block, side: Side, at: list[float], ways: Mapping[int, Set[Way]], partners: Mapping[int, float]
) -> list[int]:
    """Give the docks of a side from left to right, in the places that they get unless they are fixed."""
    docks = [index for index, dock in enumerate(block.docks) if dock.side == side]
    if any(block.docks[index].is_fixed for index in docks):
        return sorted(docks, key=lambda index: block.docks[index].at)
    docks.sort(key=lambda index: _rank(side, ways.get(index, set()), partners.get(index, 0.0)))
    spare = (block.width - sum(block.docks[index].room for index in docks)) / (len(docks) + 1)
    x = spare
    for index in docks:
        at[index] = round(x + block.docks[index].room / 2)
        x += block.docks[index].room + spare
    return docks


def _rank(side: Side, ways: Set[Way], partner: float) -> tuple[int, float]:
    """Order docks on top or bottom from left to right, so that no lines to or from them cross.

    Lines to the left belong to those on the left; and of those that turn to one side, the outer ones turn nearest to
    the block, so on top what comes from below belongs outside, and at the bottom what leads up.
    """
    is_outside_low = (side == "top") == (ways == {"W"})
    return ("E" in ways) - ("W" in ways), -partner if is_outside_low else partner


def _tracks(docks: Sequence[int], used: Set[Turn], ways: Mapping[int, Set[Way]]) -> tuple[dict[Turn, int], float]:
    """Count tracks from the block away, and say how far the last one is behind the first."""
    turns = sorted(turn for turn in used if turn[0] in docks)
    west = [turn for index in docks for turn in turns if turn[0] == index and turn[1] == "W"]
    east = [turn for index in reversed(docks) for turn in turns if turn[0] == index and turn[1] == "E"]
    # Two docks with lines to both sides: those to the one side would cross those to the other on the same tracks.
    is_tangled = sum(len(ways.get(index, ())) > 1 for index in docks) > 1
    lowest_east = len(west) if is_tangled else 0
    found = {turn: track for track, turn in enumerate(west)}
    found |= {turn: track for track, turn in enumerate(east, lowest_east)}
    return found, max(found.values(), default=0) * TRACK
