"""Draws graphs as text: SVG to look at, Mermaid for pages, DOT for Graphviz.

In Mermaid and DOT active edges are thick or double, edges from events are dashed, subgraphs are boxes; states are
tinted, those that are active in a run have a thick border. Depends on `picture` and `svg`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, cast, get_args

from hfg.base.controls import escaped
from hfg.base.whole import write_whole
from hfg.errors import GraphError, UsageError
from hfg.graph.drawing.picture import picture
from hfg.graph.drawing.seen import EVERYTHING, Arrow, Kind, Picture, Shape, View
from hfg.graph.drawing.svg import svg
from hfg.graph.structure.level import HasLevel, Level, level_of
from hfg.graph.structure.paths import meant, node_at
from hfg.graph.structure.subgraph import is_box
from hfg.nodetypes.node import Node


def draw(
    graph: HasLevel,
    path: str | os.PathLike[str] | None = None,
    *,
    format: str | None = None,  # noqa: A002 - the word users know
    view: View = EVERYTHING,
) -> str:
    """Draw a graph, into a file if one is named; see `Graph.draw`."""
    title = level_of(graph).title
    if path is None:
        return _writer(title, f".{format}", f"format={format!r}")(graph, view) if format else mermaid(graph, view)
    if not isinstance(path, str | os.PathLike):
        raise UsageError(f'{title} is drawn into a file, as in graph.draw("graph.svg"), got {path!r:.80}')
    file = Path(path)
    text = _writer(title, f".{format}" if format else file.suffix, f'"{file}"')(graph, view)
    try:
        write_whole(file, lambda stream: stream.write(text.encode(errors="replace")))
    except (OSError, ValueError) as error:
        said = error.strerror if isinstance(error, OSError) else error
        raise UsageError(
            f'{title} cannot be drawn into "{file}": {said}; name a file in a folder that you can write to'
        ) from error
    return text


def _writer(title: str, ending: str, what: str) -> Callable[[HasLevel, View], str]:
    write = FORMATS.get(ending)
    if write is None:
        endings = " or ".join(FORMATS)
        raise UsageError(f"{title} cannot be drawn into {what}: a drawing ends in {endings}; rename the file")
    return write


def view_of(
    graph: HasLevel,
    depth: int | None,
    fold: Iterable[Node | str],
    active: Iterable[Node | str] | None,
    ports: str,
    kind: str | None = None,
) -> View:
    """Check what the user wants to see.

    Raises:
      GraphError: a node is not in the graph, or a node to fold is not a subgraph.
      UsageError: another argument is invalid.
    """
    level = level_of(graph)
    if depth is not None and (type(depth) is not int or depth < 0):
        raise UsageError(
            f"{level.title}: depth= says how many subgraphs inside each other are shown open, 0 or more, got {depth!r}"
        )
    if ports not in ("used", "all"):
        raise UsageError(f'{level.title}: ports= is "used", those that edges lead to, or "all", got {ports!r}')
    if kind not in (None, *get_args(Kind)):
        kinds = " or ".join(f'"{one}"' for one in get_args(Kind))
        raise UsageError(f"{level.title}: view= is {kinds}, got {kind!r:.80}; leave it out for the clearest one")
    folded = _nodes(level, "fold", fold)
    for node in folded:
        if not is_box(node):
            raise GraphError(
                f'"{node.place.path}" cannot be folded, because it is not a subgraph; leave it out of fold='
            )
    shown = None if active is None else frozenset(_nodes(level, "active", active))
    return View(cast("Kind | None", kind), depth, frozenset(folded), active=shown, all_ports=ports == "all")


def _nodes(level: Level, what: str, given: Iterable[Node | str]) -> list[Node]:
    if isinstance(given, str | Node) or not isinstance(given, Iterable):
        raise UsageError(
            f'{level.title}: {what}= takes a list of nodes or paths, as in {what}=["fetch"], got {given!r:.80}'
        )
    found: list[Node] = []
    for one in given:
        node: Any = meant(level, one, node_at)
        if not isinstance(node, Node) or not level.holds(node):
            raise GraphError(f"{level.title}: {what}= takes its nodes or their paths, got {one!r:.80}; add it first")
        found.append(node)
    return found


# --- Mermaid ---

# Characters that have a meaning inside quotes; `#name;` is how Mermaid writes an entity.
_ENTITIES: Final = str.maketrans(
    {
        "#": "#35;",
        '"': "#quot;",
        "<": "#lt;",
        ">": "#gt;",
        "&": "#amp;",
        "\\": "#92;#8203;",  # with an invisible character; otherwise Mermaid takes a following n for a line break
        "`": "#96;",
        "\n": "<br/>",
        "\r": " ",
        "\t": " ",
    }
)
_SHAPES: Final[Mapping[str, tuple[str, str]]] = MappingProxyType(
    {"node": ("[", "]"), "port": ("([", "])"), "start": ("((", "))"), "stop": ("(((", ")))"), "feed": ("{{", "}}")}
)


def mermaid(graph: HasLevel, view: View = EVERYTHING) -> str:
    """Draw a graph as the text of a Mermaid flowchart."""
    seen = picture(graph, view)
    lines = ["flowchart LR"]
    depth = 0
    for level, item in seen.items:
        lines += [f"{'    ' * (depth - up)}end" for up in range(depth - level)]
        depth = level
        indent = "    " * (depth + 1)
        if item.look == "box":
            lines.append(f"{indent}subgraph {item.id}[{_quoted(item.label)}]")
            depth += 1
        else:
            opening, closing = _SHAPES[item.look]
            lines.append(f"{indent}{item.id}{opening}{_quoted(item.label)}{closing}")
    lines += [f"{'    ' * (depth - up)}end" for up in range(depth)]
    lines += [f"    {_mermaid_arrow(arrow)}" for arrow in seen.arrows]
    lines += _mermaid_styles(seen)
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    return f'"{escaped(text).translate(_ENTITIES)}"'


def _mermaid_arrow(arrow: Arrow) -> str:
    line = "-.-o" if arrow.is_gate else "==>" if arrow.is_active else "-.->" if arrow.is_signal else "-->"
    label = f"|{_quoted(arrow.label)}|" if arrow.label else ""
    return f"{arrow.tail} {line}{label} {arrow.head}"


def _mermaid_styles(seen: Picture) -> list[str]:
    """Tint the states; Mermaid has no line that is both thick and dashed, so those are declared one by one."""
    lines = []
    shapes = [item for _, item in seen.items if item.look != "box"]
    states = [shape.id for shape in shapes if shape.is_state and not shape.is_active]
    active = [shape.id for shape in shapes if shape.is_active]
    if states:
        lines += ["    classDef state fill:#fff3d0,stroke:#b8860b,color:#000", f"    class {','.join(states)} state"]
    if active:
        lines += [
            "    classDef active fill:#ffd24d,stroke:#b8860b,stroke-width:4px,color:#000",
            f"    class {','.join(active)} active",
        ]
    dashed = [str(number) for number, arrow in enumerate(seen.arrows) if arrow.is_active and arrow.is_signal]
    if dashed:
        lines.append(f"    linkStyle {','.join(dashed)} stroke-dasharray:7 4")
    return lines


# --- DOT ---

# A backslash begins an escape of Graphviz, such as the name of the node; an ampersand an entity of HTML.
_ESCAPES: Final = str.maketrans({"\\": "\\\\", '"': '\\"', "&": "&amp;", "\n": "\\n", "\r": " "})
_DOT_SHAPES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "node": "shape=box",
        "port": "shape=box, style=rounded, height=0.3",
        "start": "shape=circle",
        "stop": "shape=doublecircle",
        "feed": "shape=hexagon",
    }
)


def dot(graph: HasLevel, view: View = EVERYTHING) -> str:
    """Draw a graph as the text of a DOT file, for Graphviz."""
    seen = picture(graph, view)
    lines = [
        f"digraph {_escaped(seen.title)} {{",
        '    graph [rankdir=LR, fontname="sans-serif"]',
        '    node [fontname="sans-serif"]',
        '    edge [fontname="sans-serif", fontsize=11]',
    ]
    depth = 0
    for level, item in seen.items:
        lines += [f"{'    ' * (depth - up)}}}" for up in range(depth - level)]
        depth = level
        indent = "    " * (depth + 1)
        if item.look == "box":
            lines.append(f"{indent}subgraph cluster_{item.id} {{")
            lines.append(f"{indent}    label={_escaped(item.label)}")
            depth += 1
        else:
            lines.append(f"{indent}{item.id} [label={_escaped(item.label)}, {_dot_look(item)}]")
    lines += [f"{'    ' * (depth - up)}}}" for up in range(depth)]
    lines += [f"    {arrow.tail} -> {arrow.head} [{_dot_line(arrow)}]" for arrow in seen.arrows]
    return "\n".join([*lines, "}"]) + "\n"


def _escaped(text: str) -> str:
    return f'"{escaped(text).translate(_ESCAPES)}"'


def _dot_look(shape: Shape) -> str:
    look = _DOT_SHAPES[shape.look]
    if shape.is_active:
        return f'{look}, style=filled, fillcolor="#ffd24d", penwidth=4'
    return f'{look}, style=filled, fillcolor="#fff3d0"' if shape.is_state else look


def _dot_line(arrow: Arrow) -> str:
    parts = [f"label={_escaped(arrow.label)}"]
    if arrow.is_gate:
        parts.append("style=dotted, arrowhead=odot, constraint=false")
    else:
        parts += ["style=dashed"] if arrow.is_signal else []
        parts += ['color="black:invis:black"'] if arrow.is_active else []  # the double line of the paper
    return ", ".join(parts)


FORMATS: Final[Mapping[str, Callable[[HasLevel, View], str]]] = MappingProxyType(
    {".svg": svg, ".mmd": mermaid, ".dot": dot}
)
