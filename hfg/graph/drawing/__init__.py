"""What is to be seen of a graph, and its drawing as text.

formats     as SVG, Mermaid or DOT, into a file     svg     as SVG
picture     what is to be seen                      sheet   where it goes, by `layout`     text   how wide letters are
"""

from hfg.graph.drawing.formats import FORMATS, dot, draw, mermaid, view_of
from hfg.graph.drawing.svg import svg

__all__ = ["FORMATS", "dot", "draw", "mermaid", "svg", "view_of"]
