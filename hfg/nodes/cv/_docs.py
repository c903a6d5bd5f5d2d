"""Reads the documentation that the wheel of OpenCV carries in its docstrings, and takes the markup off."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

_SIGNATURE = re.compile(r"^\w+\((.*?)\) -> (.+)$")
_TAG = re.compile(
    r"^@(brief|param|return|returns|note|sa|see|overload|code|endcode|snippet|include)\b\s*", re.MULTILINE
)
_DECORATION = re.compile(r"^[*/]+\s*")
"""What some comments begin their lines with."""
_LONGEST = 320


class Documentation(NamedTuple):
    """The documentation of one overload of a function.

    Attributes:
      outputs: names of its results; empty if there is none.
      about: what it does, in one sentence; empty if undocumented.
      arguments: what is said of each argument, and of each output that is one.
      returned: what is said of the value that has no name.
    """

    outputs: tuple[str, ...]
    about: str
    arguments: Mapping[str, str]
    returned: str


def read(function: Any, arguments: Iterable[str]) -> Documentation:
    """Return the documentation of the overload with these arguments, completed from the other overloads."""
    blocks = _blocks(getattr(function, "__doc__", None) or "")
    wanted = tuple(arguments)
    blocks.sort(key=lambda block: block[0] != wanted)  # a stable sort: the one that is asked for comes first
    outputs = blocks[0][1] if blocks else ()
    words: dict[str, str] = {}
    about, returned = "", ""
    for _, _, text in blocks:
        for tag, body in _parts(text):
            if tag == "param":
                name, _, told = body.partition(" ")
                words.setdefault(name, _sentences(told))
            elif tag in ("return", "returns"):
                returned = returned or _sentences(body)
            elif tag == "brief" or (tag == "" and not about):
                about = about or _sentences(body, count=1)
    return Documentation(outputs, about, words, returned)


def _blocks(text: str) -> list[tuple[tuple[str, ...], tuple[str, ...], str]]:
    """Return arguments, outputs and text of each way to call the function."""
    blocks: list[tuple[tuple[str, ...], tuple[str, ...], list[str]]] = []
    for line in text.splitlines():
        signature = None if line.startswith(".") else _SIGNATURE.match(line.strip())
        if signature:
            arguments = tuple(re.findall(r"\w+", signature[1]))
            names = tuple(name.strip() for name in signature[2].split(","))
            blocks.append((arguments, () if names == ("None",) else names, []))
        elif blocks:
            blocks[-1][2].append(_DECORATION.sub("", line.removeprefix(".").strip()).replace("\\brief", "@brief"))
    return [(arguments, outputs, "\n".join(lines)) for arguments, outputs, lines in blocks]


def _parts(text: str) -> list[tuple[str, str]]:
    """Split at the tags; what stands before the first has the tag ""."""
    pieces = _TAG.split(re.sub(r"@code.*?@endcode", "", text, flags=re.DOTALL))
    parts = [("", pieces[0])]
    parts += [(tag, body) for tag, body in zip(pieces[1::2], pieces[2::2], strict=True)]
    return [(tag, body.split("\n\n")[0] if tag in ("", "brief") else body) for tag, body in parts if body.strip()]


def _sentences(text: str, count: int = 3) -> str:
    """Return the first sentences without markup, in one line that is not too long."""
    plain = re.sub(r"\\f\[.*?\\f\]", "", text.split("\n\n")[0], flags=re.DOTALL)
    plain = re.sub(r"\\f\$(.*?)\\f\$", lambda found: _formula(found[1]), plain, flags=re.DOTALL)
    plain = re.sub(r"@cite \w+|\[\[?@?\w*\]?\]\(.*?\)|!\[.*?\]\(.*?\)", "", plain)
    plain = re.sub(r"@ref (\w+)(?: \"(.*?)\")?|@[cpa] (\w+)", lambda found: found[2] or found[1] or found[3], plain)
    plain = re.sub(r"(?<!\w)#(?=\w)|cv::|[`*@]|\\(?=[<>\"])", "", plain)
    plain = " ".join(plain.split()).replace(" ,", ",").replace(" .", ".").strip(" -:")
    sentences = re.split(r"(?<=[a-z0-9)\]]\.) (?=[A-Z])", plain)
    kept = sentences[0]
    for sentence in sentences[1:count]:
        if len(kept) + len(sentence) > _LONGEST:
            break
        kept += " " + sentence
    if len(kept) > 2 * _LONGEST:
        kept = kept[: kept.rfind(" ", 0, 2 * _LONGEST)] + " ..."
    return kept[:1].upper() + kept[1:] if kept else ""


def _formula(text: str) -> str:
    """Make a formula readable as text as far as a few replacements go."""
    text = re.sub(r"\\(?:texttt|mathrm|text|mathbf|boldsymbol)\s*{(.*?)}", r"\1", text)
    text = re.sub(r"\\(?:vecthree|vecthreethree)", "", text)
    for tex, word in (
        ("\\times", "x"),
        ("\\leq", "<="),
        ("\\geq", ">="),
        ("\\le", "<="),
        ("\\ge", ">="),
        ("\\cdot", "*"),
        ("\\pi", "pi"),
    ):
        text = text.replace(tex, word)
    return re.sub(r"[\\{}$]", "", text).strip()
