"""What is to be seen of a graph, and its drawing as text.

picture     what is to be seen           formats     the same as Mermaid or DOT
"""

from hfg.graph.drawing.formats import FORMATS, dot, draw, mermaid

__all__ = ["FORMATS", "dot", "draw", "mermaid"]
