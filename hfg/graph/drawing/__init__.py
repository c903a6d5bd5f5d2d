"""What is to be seen of a graph, where it goes, and its drawing as text.

picture     what is to be seen     layout   where it goes     model   that as plain data     text   how wide letters are
svg         as SVG                 formats  as SVG, Mermaid or DOT, into a file
"""

from hfg.graph.drawing.formats import FORMATS, dot, draw, mermaid, view_of
from hfg.graph.drawing.layout import lay_out
from hfg.graph.drawing.model import Badge, EdgeEnds, Layout, Line, NodeBox, PortSpot, Tag
from hfg.graph.drawing.seen import View
from hfg.graph.drawing.svg import svg

__all__ = [
    "FORMATS",
    "Badge",
    "EdgeEnds",
    "Layout",
    "Line",
    "NodeBox",
    "PortSpot",
    "Tag",
    "View",
    "dot",
    "draw",
    "lay_out",
    "mermaid",
    "svg",
    "view_of",
]
