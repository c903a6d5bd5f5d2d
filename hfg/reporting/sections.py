"""Contents that users add to a page: sections with text, tables, pictures, videos and drawings of their graphs.

Everything is turned into HTML when it is added. So errors are raised in the call that adds it, and files may be deleted
afterwards. Names and texts are escaped; pictures and videos are embedded in the page. Depends on `pictures` and the
drawing.
"""

from __future__ import annotations

import base64
import math
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final, TypeGuard

import numpy as np

from hfg.errors import UsageError
from hfg.graph import Graph
from hfg.graph.drawing.text import escaped
from hfg.reporting.pictures import is_picture, png

_PICTURES: Final = {".png": "png", ".jpg": "jpeg", ".jpeg": "jpeg", ".gif": "gif", ".webp": "webp", ".svg": "svg+xml"}
_VIDEOS: Final = {".webm": "webm", ".mp4": "mp4", ".ogv": "ogg"}
_MOST_BYTES: Final = 64 * 2**20  # bytes of a file: pages with more open slowly


class Sections:
    """Sections in the order in which they were first named; `RunPage` documents the arguments of the methods."""

    def __init__(self, title: str) -> None:
        """`title` names the page, for error messages."""
        self._title = title
        self._parts: dict[str, list[str]] = {}

    def add_text(self, section: str, text: str) -> None:
        """Add paragraphs, separated by empty lines."""
        self._need_text("text", text)
        for paragraph in text.split("\n\n"):
            self._add(section, f"<p>{escaped(paragraph)}</p>\n")

    def add_table(self, section: str, heads: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
        """Add a table that readers can sort."""
        rows = [tuple(row) for row in rows]
        for row in rows:
            if len(row) != len(heads):
                raise UsageError(
                    f"{self._title}: a row needs as many cells as the table has heads, {len(heads)}, got {row!r:.80}"
                )
        numbers = [all(_is_number(row[column]) for row in rows) and bool(rows) for column in range(len(heads))]
        text = ['<div class="table"><table><thead><tr>']
        for head, is_number in zip(heads, numbers, strict=True):
            kind = ' class="number"' if is_number else ""
            text.append(f'<th scope="col"{kind}><button type="button">{escaped(str(head))}</button></th>')
        text.append("</tr></thead><tbody>\n")
        for row in rows:
            cells = (
                f'<td class="number" data-by="{cell!r}">{escaped(_shown(cell))}</td>'
                if is_number
                else f"<td>{escaped(_shown(cell))}</td>"
                for cell, is_number in zip(row, numbers, strict=True)
            )
            text.append(f"<tr>{''.join(cells)}</tr>\n")
        text.append("</tbody></table></div>\n")
        self._add(section, "".join(text))

    def add_picture(self, section: str, picture: object, *, caption: str = "", at_s: float | None = None) -> None:
        """Add pixels, the text of an SVG drawing, or a file."""
        self._need_text("caption", caption)
        if isinstance(picture, str) and picture.lstrip().startswith("<"):
            kind, data = "svg+xml", picture.encode("utf-8", "replace")
        elif isinstance(picture, str | os.PathLike):
            kind, data = self._read(Path(picture), _PICTURES)
        elif isinstance(picture, np.ndarray) and is_picture(picture):
            kind, data = "png", png(picture)
        else:
            kind_of_array = (
                f" of shape {picture.shape} and type {picture.dtype}" if isinstance(picture, np.ndarray) else ""
            )
            raise UsageError(
                f"{self._title}: a picture must be an 8-bit image, the text of an SVG drawing or a file, got "
                f"{type(picture).__name__}{kind_of_array}"
            )
        time = ""
        if at_s is not None:
            self._need_number("at_s", at_s)
            time = f' data-time="{at_s:.6f}"'
        says = escaped(caption)
        self._add(
            section,
            f'<figure{time}><img src="data:image/{kind};base64,{base64.b64encode(data).decode()}" alt="{says}">'
            f"<figcaption>{says}</figcaption></figure>\n",
        )

    def add_video(
        self,
        section: str,
        file: str | os.PathLike[str],
        *,
        caption: str = "",
        starts_s: float = 0.0,
        speed: float = 1.0,
    ) -> None:
        """Add a video. The page's clock and the video follow each other."""
        self._need_text("caption", caption)
        self._need_number("starts_s", starts_s)
        self._need_number("speed", speed)
        if speed <= 0:
            raise UsageError(f"{self._title}: speed= of a video must be above 0, got {speed!r}")
        kind, data = self._read(Path(file), _VIDEOS)
        says = escaped(caption)
        self._add(
            section,
            f'<figure class="video"><video controls muted playsinline preload="auto" data-starts="{starts_s:.6f}" '
            f'data-speed="{speed:.6f}" aria-label="{says}" src="data:video/{kind};base64,'
            f'{base64.b64encode(data).decode()}"></video><figcaption>{says}</figcaption></figure>\n',
        )

    def add_drawing(
        self, section: str, graph: Graph, *, caption: str = "", depth: int | None = None, fold: Iterable[str] = ()
    ) -> None:
        """Add the drawing of a graph, or of a subgraph's inside; active nodes are marked as of the page's clock."""
        self._need_text("caption", caption)
        drawn = graph.draw(format="svg", active=(), depth=depth, fold=fold)
        self._add(section, f'<div class="picture">{drawn}</div>\n<p class="caption">{escaped(caption)}</p>\n')

    def sections(self) -> list[str]:
        """Return the sections as HTML."""
        found = []
        for name, parts in self._parts.items():
            found += [f'<section class="own"><h2>{escaped(name)}</h2>\n', *_in_galleries(parts), "</section>\n"]
        return found

    def _add(self, section: str, part: str) -> None:
        self._need_text("section", section)
        self._parts.setdefault(section, []).append(part)

    def _read(self, file: Path, kinds: dict[str, str]) -> tuple[str, bytes]:
        kind = kinds.get(file.suffix.lower())
        if kind is None:
            raise UsageError(f'{self._title}: "{file}" ends in none of {", ".join(kinds)}, which browsers show')
        try:
            size = file.stat().st_size
            data = b"" if size > _MOST_BYTES else file.read_bytes()
        except (OSError, ValueError) as error:
            said = error.strerror if isinstance(error, OSError) else error
            raise UsageError(f'{self._title}: "{file}" cannot be read: {said}') from error
        if size > _MOST_BYTES:
            raise UsageError(
                f'{self._title}: "{file}" has {size / 2**20:.0f} MB, but a page takes at most '
                f"{_MOST_BYTES // 2**20} MB per file; mention its name in a text instead"
            )
        return kind, data

    def _need_text(self, name: str, value: object) -> None:
        if not isinstance(value, str):
            raise UsageError(f"{self._title}: {name} must be a string, got {value!r:.80}")

    def _need_number(self, name: str, value: object) -> None:
        if not _is_number(value) or not math.isfinite(value):
            raise UsageError(f"{self._title}: {name}= must be a number of seconds, got {value!r:.80}")


def _in_galleries(parts: list[str]) -> list[str]:
    """Put consecutive pictures side by side."""
    found, within = [], False
    for part in parts:
        picture = part.startswith(("<figure>", "<figure data-time"))
        if picture != within:
            found.append('<div class="gallery">\n' if picture else "</div>\n")
            within = picture
        found.append(part)
    return [*found, "</div>\n"] if within else found


def _is_number(value: object) -> TypeGuard[int | float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _shown(cell: object) -> str:
    if isinstance(cell, float):
        return f"{cell:,.4g}"
    return f"{cell:,}" if isinstance(cell, int) and not isinstance(cell, bool) else str(cell)
