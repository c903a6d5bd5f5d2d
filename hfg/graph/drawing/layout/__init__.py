"""Where everything of a drawing goes: layers from left to right, few crossings, lines with right angles.

blocks      what is laid out, and what comes of it     columns     which block is in which column
ordering    who is above whom in a column              placing     how far down
channels    where lines run between two columns        arranging   all of it together

It is the method of Sugiyama, Tagawa and Toda, with ports on all four sides as in the layered layout of ELK. It is
written here because no library of pure Python has such ports, or boxes inside of boxes: grandalf and networkx place
points. Nothing here knows graphs; it stands on nothing.
"""

from hfg.graph.drawing.layout.arranging import arrange
from hfg.graph.drawing.layout.blocks import Block, Dock, Label, Line, Plan

__all__ = ["Block", "Dock", "Label", "Line", "Plan", "arrange"]
