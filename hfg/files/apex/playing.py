"""Which source of files a FileImporter of CS::APEX is: it depends on what it reads.

Pictures are read by `files.ImageFiles`. Of all other files there are paths, and whoever reads the graph puts a node
behind that reads them. Depends on `document` and `table`.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import PurePosixPath
from typing import Any, Final

import msgspec

from hfg.files.apex.document import ApexParameter
from hfg.files.apex.table import TypeRule

_PICTURES: Final = (".bmp", ".jpeg", ".jpg", ".pbm", ".pgm", ".png", ".ppm", ".tif", ".tiff", ".webp")
_ALL: Final = ("", ".*")


def file_importer(rule: TypeRule, said: Mapping[str, ApexParameter]) -> TypeRule:
    """Return the rule of a FileImporter with these parameters."""
    of_directory = _said(said, "import directory") is True
    seen = str(_said(said, "directory/current_file" if of_directory else "path") or "")
    reads_pictures = PurePosixPath(seen).suffix.lower() in _PICTURES
    why = ["the stream ends behind the last file"]
    if not reads_pictures:
        why.append("it gives the paths of files: put files.read_text, or what reads such files, behind it")
    used = {"import directory", *([] if of_directory else ["path"])}
    settings: dict[str, Any] = {}
    if of_directory:
        settings = _directory(said, used)
    elif _said(said, "path"):
        settings["pattern"] = _said(said, "path")
    ignored = {name for name in said if name.startswith("directory/") or name in ("directory", "recursive import")}
    used |= {"path"} if of_directory else ignored
    return msgspec.structs.replace(
        rule,
        type="hfg.nodes.files:ImageFiles" if reads_pictures else rule.type,
        outputs=["image" if reads_pictures else "path"],
        same={**rule.same, **{name: _said(said, name) for name in used}},
        set={**rule.set, **{name: _unbraced(value) for name, value in settings.items()}},
        differs="; ".join(why),
    )


def _directory(said: Mapping[str, ApexParameter], used: set[str]) -> dict[str, Any]:
    """Return the settings of one that reads a directory; what says the same elsewhere is added to `used`."""
    deep = _said(said, "recursive import") is True
    settings: dict[str, Any] = {"pattern": f"{_said(said, 'directory') or '.'}/{'**/' if deep else ''}*"}
    settings["order"] = "number" if _said(said, "directory/sort_numerically") is True else "name"
    settings["loop"] = _said(said, "directory/loop") is not False
    settings["playing"] = _said(said, "directory/play") is not False
    used |= {"directory", "recursive import", "directory/sort_numerically", "directory/loop", "directory/play"}
    used |= {"directory/current", "directory/current_file"}  # where it was
    if _said(said, "directory/filter") in _ALL:
        used.add("directory/filter")
    return settings


def _said(said: Mapping[str, ApexParameter], name: str) -> Any:
    return said[name].value if name in said else None


def _unbraced(value: Any) -> Any:
    """Let a text be itself where "{name}" stands for the node's name."""
    return value.replace("{", "{{").replace("}", "}}") if isinstance(value, str) else value
