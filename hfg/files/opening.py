"""Gives the text of a file that somebody has named, or a finding why there is none.

Files of every kind that hold graphs are opened here, so that all are refused in the same words. Depends on `findings`,
bounds and `whole`.
"""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Final

from hfg.base.bounds import GRAPH_FILE_BYTES
from hfg.base.whole import read_plain
from hfg.files.findings import Findings

SUFFIX: Final = ".hfg.yaml"
"""How the names of graph files end."""


def bytes_of(path: Path, file: str, findings: Findings, *suffixes: str) -> bytes | None:
    """Read a file, no more of it than shows that it is too large.

    Args:
      path: where it is.
      file: what messages call it.
      findings: are given what is wrong.
      *suffixes: how the names of such files end; the first one is what is said.
    """
    try:
        return read_plain(path, GRAPH_FILE_BYTES.most + 1)
    except IsADirectoryError:
        findings.add(file, 0, "", f"this is a folder; name a file in it that ends in {suffixes[0]}")
    except FileNotFoundError:
        findings.add(file, 0, "", f"there is no such file{_nearby(path, suffixes)}")
    except OSError as error:
        findings.add(file, 0, "", f"it cannot be read ({error.strerror}); see what it is, and who may read it")
    except ValueError as error:  # a name with a zero in it
        findings.add(file, 0, "", f"it cannot be read ({error}); correct its name")
    return None


def _nearby(path: Path, suffixes: tuple[str, ...]) -> str:
    try:
        stems = {_stem(one.name, suffixes): one.name for one in path.parent.iterdir() if one.name.endswith(suffixes)}
    except OSError:
        stems = {}
    near = difflib.get_close_matches(_stem(path.name, suffixes), stems, n=1)
    return f'; did you mean "{stems[near[0]]}"?' if near else "; see where it is, and whether its name is right"


def _stem(name: str, suffixes: tuple[str, ...]) -> str:
    return next((name.removesuffix(one) for one in suffixes if name.endswith(one)), name)


def text_in(data: bytes, file: str, findings: Findings, *, small: str, text: str) -> str | None:
    """Decode it.

    Args:
      data: what the file holds.
      file: what messages call it.
      findings: are given what is wrong.
      small: what to do about one that is too large.
      text: what such a file is.
    """
    if len(data) > GRAPH_FILE_BYTES.most:
        findings.add(file, 0, "", f"it is too large: {GRAPH_FILE_BYTES.remedy}, else {small}")
        return None
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        findings.add(file, line, "", f"this is no text in UTF-8; {text}")
        return None
