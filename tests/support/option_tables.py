"""Writes the tables of options in docs/reference.md: `python -m tests.support.option_tables`."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any, Final

from hfg.engine.runtime.settings import RunFields
from hfg.graph import EdgeOptions, GroupSpec, MonitorSpec, NodeOptions
from hfg.graph.structure.option import Fields, declared

PAGE: Final = Path(__file__).parents[2] / "docs" / "reference.md"
_ONLY: Final = {
    "": "",
    "events": "Only on edges from events.",
    "data": "Only on edges from outputs to inputs.",
    "any": "",
    "subgraph": "Only for subgraphs.",
}
KINDS: Final[dict[str, type[Fields[Any]]]] = {
    "an edge": EdgeOptions,
    "a node": NodeOptions,
    "a group": GroupSpec,
    "a monitor": MonitorSpec,
    "a run": RunFields,
}


def table(kind: type[Fields[Any]]) -> str:
    """Return the options of a struct as a table in Markdown."""
    rows = ["| option | values | default | |", "|---|---|---|---|"]
    for one in declared(kind).values():
        option = one.option
        values = one.expects if one.default != () else f"a list, as in `{option.expects}`"
        default = option.usual or (
            ""
            if one.default in (None, (), "")
            else f"`{json.dumps(one.default) if isinstance(one.default, str) else one.default}`"
        )
        means = f"{option.says} {_ONLY[option.only]}".strip()
        rows.append(f"| `{one.name}` | {values} | {default} | {means} |")
    return "\n".join(rows)


def written(text: str) -> str:
    """Return the page with the tables that belong between its markers."""
    for name, kind in KINDS.items():
        begin, end = f"<!-- options of {name} -->", f"<!-- end of the options of {name} -->"
        pattern = re.compile(f"{begin}\n.*?{end}", re.DOTALL)
        if not pattern.search(text):
            raise ValueError(f"{PAGE.name} has no {begin} with its end")
        made = f"{begin}\n\n{table(kind)}\n\n{end}"
        text = pattern.sub(lambda _, made=made: made, text)  # type: ignore[misc]
    return text


if __name__ == "__main__":
    PAGE.write_text(written(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
