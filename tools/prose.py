"""Find habits that make English hard to read. The rules, with advice for each, are in `prose.toml`.

    python tools/prose.py                     list all findings by file and line
    python tools/prose.py docs/limits.md      check some files only
    python tools/prose.py --counts            count findings per kind of text (also per 10,000 words) and per rule
    python tools/prose.py --ratchet           fail if a folder has more findings than `prose_baseline.txt` allows
    python tools/prose.py --write-baseline    accept the current findings
    python tools/prose.py --commit FILE       check the subject of a commit message (without FILE: of standard input)

Checks Markdown files and, in Python files, docstrings, error messages and comments. Requires only Python 3.11.

The baseline has one line per folder, and git merges it line by line (`.gitattributes`). If two branches have changed a
line, both versions stay and the smaller number counts.
"""

from __future__ import annotations

import argparse
import ast
import re
import sys
import tokenize
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).resolve().parent
ROOTS = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "docs", "hfg", "transports", "examples", "tests/README.md")
GENERATED = ("docs/nodes/",)
LONGEST_SUBJECT = 72
_HIDDEN = re.compile(r"^ *```.*?^ *```$|`[^`]*`|\]\([^)]*\)|https?://\S+|<!--.*?-->", re.S | re.M)
_ERRORS = re.compile(
    r"(Error|Problem|Refused|Stalled|Missing|Timeout|Limit|Overflow|Refusal|warning|_refuse|problem)\w*$"
)
_WORD = re.compile(r"[A-Za-z\x00][\w'\x00-]*")


class Text(NamedTuple):
    """A paragraph, docstring paragraph, message or comment, with the line at which it starts."""

    kind: str
    line: int
    text: str


class Finding(NamedTuple):
    """A match of a rule: its line within the text, the rule's name, the words found and the advice."""

    offset: int
    rule: str
    match: str
    advice: str


@dataclass(frozen=True)
class Rule:
    """A habit to avoid: a pattern, or the greatest number of words in a sentence."""

    name: str
    say: str
    pattern: re.Pattern[str] | None = None
    words: int = 0
    kinds: tuple[str, ...] = ()
    replacements: Mapping[str, str] = field(default_factory=dict)

    def findings(self, text: str) -> Iterator[Finding]:
        """Yield the findings of this rule in a text."""
        flat = text.replace("\n", " ")
        if self.pattern is None:
            columns = re.search(r"\S {3,}\S", flat)
            for sentence in re.finditer(r"[^.?!:|]+", "" if columns else flat):
                if (length := len(_WORD.findall(sentence.group()))) > self.words:
                    yield Finding(text.count("\n", 0, sentence.start()), self.name, f"{length} words", self.say)
            return
        for match in self.pattern.finditer(flat):
            advice = next(
                (to for word, to in self.replacements.items() if re.fullmatch(word, match.group(), re.I)), self.say
            )
            yield Finding(text.count("\n", 0, match.start()), self.name, match.group().strip(" .:;|"), advice)


def read_rules(path: Path = HERE / "prose.toml") -> list[Rule]:
    """Return the rules of a TOML file."""
    rules = []
    for entry in tomllib.loads(path.read_text(encoding="utf-8"))["rule"]:
        replacements = entry.get("words_to", {})
        source = rf"(?i)\b(?:{'|'.join(replacements)})\b" if replacements else entry.get("match")
        pattern = re.compile(source) if source else None
        words, kinds = entry.get("words", 0), tuple(entry.get("kinds", ()))
        rules.append(Rule(entry["name"], entry["say"], pattern, words, kinds, replacements))
    return rules


def check(kind: str, text: str, rules: Sequence[Rule]) -> Iterator[Finding]:
    """Yield all findings in a text of the given kind."""
    for rule in rules:
        if not rule.kinds or kind in rule.kinds:
            yield from rule.findings(text)


def _hide(text: str) -> str:
    """Blank out code and link targets. Keep offsets and line breaks."""
    return _HIDDEN.sub(lambda match: re.sub(r"[^\n]", "\x00", match.group()), text)


def _markdown(path: Path) -> Iterator[Text]:
    kind = "change" if path.name == "CHANGELOG.md" else "docs"
    block: list[str] = []
    start = 1
    for number, line in enumerate([*_hide(path.read_text(encoding="utf-8")).splitlines(), ""], 1):
        new = not line.strip() or re.match(r"\s*([-*]|\d+\.|\||#)", line)
        if new and block:
            yield Text(kind, start, "\n".join(block))
            block = []
        if line.strip():
            start = start if block else number
            block.append(re.sub(r"^\s*(?:[-*]|\d+\.|#+)\s+", "", line))


def _message(node: ast.expr) -> str:
    """Return the text of a string expression, with X for each placeholder."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=values):
            return "".join(str(part.value) if isinstance(part, ast.Constant) else "X" for part in values)
        case ast.BinOp(left=left, right=right):
            return _message(left) + _message(right)
        case ast.IfExp(body=body, orelse=other):
            return f"{_message(body)} {_message(other)}"
    return ""


def _docstrings(tree: ast.Module) -> Iterator[Text]:
    for node in ast.walk(tree):
        if not isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        kept = re.sub(r"^\s*(>>>|\.\.\.).*$", "", ast.get_docstring(node) or "", flags=re.M)
        for paragraph in re.finditer(r"(?:[^\n]+\n?)+", _hide(kept)):
            line = node.body[0].lineno + kept.count("\n", 0, paragraph.start())
            yield Text("docstring", line, paragraph.group().strip("\n"))


def _messages(tree: ast.Module) -> Iterator[Text]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and _ERRORS.search(ast.unparse(node.func)):
            for argument in [*node.args, *(keyword.value for keyword in node.keywords)]:
                if (text := _message(argument)).count(" ") > 2:
                    yield Text("error", argument.lineno, text)


def _comments(path: Path) -> Iterator[Text]:
    with path.open("rb") as file:
        for token in tokenize.tokenize(file.readline):
            if token.type == tokenize.COMMENT and not re.match(r"#\s*(---|type:|noqa|!)", token.string):
                yield Text("comment", token.start[0], token.string.lstrip("# "))


def texts(path: Path) -> Iterator[Text]:
    """Yield everything in a Markdown or Python file that people read as English."""
    if path.suffix == ".md":
        yield from _markdown(path)
        return
    tree = ast.parse(path.read_text(encoding="utf-8"))
    yield from _docstrings(tree)
    yield from _messages(tree)
    yield from _comments(path)


def _files(names: Sequence[str], root: Path) -> Iterator[tuple[str, Path]]:
    """Yield each file to check, with its name relative to the root."""
    for name in names or ROOTS:
        path = root / name
        for file in sorted(path.rglob("*")) if path.is_dir() else [path] * path.exists():
            inside = file.relative_to(root).as_posix() if file.is_relative_to(root) else file.as_posix()
            if file.suffix in (".md", ".py") and not inside.startswith(GENERATED):
                yield inside, file


def folder_of(name: str) -> str:
    """Return the folder to which the baseline counts a file: at most two levels, "." for files at the top."""
    return "/".join(name.split("/")[:-1][:2]) or "."


def read_baseline(path: Path) -> dict[str, int]:
    """Return how many findings each folder may have: the smallest number if a merge has left several lines."""
    allowed: dict[str, int] = {}
    for line in path.read_text(encoding="utf-8").splitlines():
        if line and not line.startswith("#"):
            folder, _, count = line.rpartition(" ")
            allowed[folder] = min(int(count), allowed.get(folder, int(count)))
    return allowed


def write_baseline(path: Path, counts: Mapping[str, int]) -> None:
    """Accept the current number of findings per folder."""
    lines = [f"{folder} {count}\n" for folder, count in sorted(counts.items()) if count]
    path.write_text(
        "# Findings of tools/prose.py that are still allowed, per folder.\n" + "".join(lines), encoding="utf-8"
    )


def check_subject(subject: str, rules: Sequence[Rule]) -> list[str]:
    """Return what is wrong with the subject of a commit message."""
    if re.match(r"(Merge|Revert|fixup!|squash!) ", subject):
        return []
    problems = [f"{found.rule}: {found.match!r}: {found.advice}" for found in check("commit", subject, rules)]
    if len(subject) > LONGEST_SUBJECT:
        problems.append(f"{len(subject)} characters, at most {LONGEST_SUBJECT}: move the reason into the body")
    return problems


@dataclass
class Result:
    """All findings, and their counts."""

    lines: list[str] = field(default_factory=list)
    per_folder: Counter[str] = field(default_factory=Counter)
    per_rule: Counter[str] = field(default_factory=Counter)
    per_kind: Counter[str] = field(default_factory=Counter)
    words: Counter[str] = field(default_factory=Counter)

    def table(self) -> str:
        """Return the counts per kind of text and per rule."""
        kinds = [
            f"{self.per_kind[kind]:6} {kind:10} {words:7} words {10_000 * self.per_kind[kind] / words:6.1f} per 10,000"
            for kind, words in sorted(self.words.items())
        ]
        rules = [f"{count:6} {name}" for name, count in self.per_rule.most_common()]
        return "\n".join([*kinds, "", *rules, f"{self.per_rule.total():6} in all"])


def check_files(names: Sequence[str], root: Path, rules: Sequence[Rule]) -> Result:
    """Check files and folders, by default all that the project has."""
    result = Result()
    for name, path in _files(names, root):
        for kind, line, text in texts(path):
            result.words[kind] += len(_WORD.findall(text))
            for found in check(kind, text, rules):
                result.per_folder[folder_of(name)] += 1
                result.per_rule[found.rule] += 1
                result.per_kind[kind] += 1
                where = f"{name}:{line + found.offset}"
                result.lines.append(f"{where}: {kind}: {found.rule}: {found.match!r}: {found.advice}")
    return result


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command. Return 1 if there are findings that are not allowed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*")
    parser.add_argument("--root", type=Path, default=HERE.parent)
    parser.add_argument("--baseline", type=Path, default=HERE / "prose_baseline.txt")
    modes = parser.add_mutually_exclusive_group()
    for mode in ("--counts", "--ratchet", "--write-baseline", "--commit"):
        modes.add_argument(mode, action="store_true")
    chosen = parser.parse_args(arguments)
    rules = read_rules()
    if chosen.commit:
        message = Path(chosen.files[0]).read_text(encoding="utf-8") if chosen.files else sys.stdin.read()
        problems = check_subject(message.partition("\n")[0], rules)
        print(*(f"commit subject: {problem}" for problem in problems), sep="\n", end="\n" * bool(problems))
        return bool(problems)
    result = check_files(chosen.files, chosen.root, rules)
    if chosen.write_baseline:
        write_baseline(chosen.baseline, result.per_folder)
        return 0
    if chosen.counts:
        print(result.table())
        return 0
    if chosen.ratchet:
        allowed = read_baseline(chosen.baseline)
        worse = {folder: count for folder, count in result.per_folder.items() if count > allowed.get(folder, 0)}
        for folder, count in sorted(worse.items()):
            print(f"{folder}: {count} findings of tools/prose.py, at most {allowed.get(folder, 0)} allowed")
        return bool(worse)
    print(*result.lines, sep="\n", end="\n" * bool(result.lines))
    return bool(result.lines)


if __name__ == "__main__":
    sys.exit(main())
