"""No name and no value steers a terminal: names have no such characters, and what verbs write is written out."""

from __future__ import annotations

import ast
import json
import logging
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import hfg
from hfg.base.controls import cleaned, escaped
from hfg.cli import show
from hfg.cli.app import main
from hfg.errors import FileError, GraphError
from hfg.links.offers import introduce, read_introduction
from hfg.nodes.display import TextDisplay
from hfg.parts.model.failing import as_error
from hfg.parts.model.messages import Failed
from hfg.testing import fire
from hfg.testing.nodes import double

pytestmark = pytest.mark.rule("L4")

EVIL = "a\x1b[2J\x1b]0;owned\x07\r\x7f\x9b31m\u202ecod.exe\u2066\udc80\u2028\ufeff\U000e0041"
RAW = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufeff\U000e0041]")
CLI = Path(__file__).resolve().parent.parent / "hfg" / "cli"


def test_what_steers_is_written_out_and_letters_stay() -> None:
    assert escaped("a\x1b[2J\n\tb\u202e\x7f") == "a\\x1b[2J\n\tb\\u202e\\u007f"
    assert escaped("Füße, 目標, 👩‍🚀, עברית") == "Füße, 目標, 👩‍🚀, עברית"


def test_words_of_other_programs_are_cleaned_where_they_are_decoded() -> None:
    """Programs log them and raise errors that contain them, so the command's own output is not the only place."""
    evil = EVIL.replace("\udc80", "")  # which no message can have
    heard = read_introduction(introduce(int, evil, lossless=True))
    assert heard is not None
    assert heard.who == escaped(evil)
    error = as_error(Failed("NodeError", EVIL, EVIL, EVIL, EVIL), "another process")
    assert not RAW.search("".join(map(str, (error, *error.__notes__))))


def test_cleaning_keeps_what_is_not_text() -> None:
    said = ([EVIL, 1], {EVIL: (b"\x1b", None)}, 2.5)
    clean = escaped(EVIL)
    assert cleaned(said) == ([clean, 1], {clean: (b"\x1b", None)}, 2.5)


@given(st.text(st.characters(exclude_categories=[]), max_size=40))
def test_nothing_raw_is_left_and_json_stays_json(text: str) -> None:
    assert not RAW.search(escaped(text))
    shown = escaped(json.dumps(text, ensure_ascii=False))
    assert json.loads(shown) == json.loads(json.dumps(text))


@pytest.mark.parametrize("name", ["a\x1b[31m", "a\nb", "a\tb", "\u202egpj", "a\r", "\udc80", "\x85"])
def test_names_have_no_such_characters(name: str) -> None:
    graph = hfg.Graph("x")
    refusals: list[Callable[[], Any]] = [
        lambda: hfg.Graph(name),
        lambda: graph.add(double(), name=name),
        lambda: graph.input(name, int),
        lambda: graph.group(name),
    ]
    for refuse in refusals:
        with pytest.raises(GraphError, match="cannot be named") as caught:
            refuse()
        assert not RAW.search(str(caught.value))
        assert "\n" not in str(caught.value)
    assert not graph.nodes


def test_a_file_with_such_names_is_refused_by_line(tmp_path: Path) -> None:
    file = tmp_path / "evil.hfg.yaml"
    file.write_text('hfg: 1\nname: g\nnodes:\n  "n\\e[31m":\n    type: hfg.nodes.values.constants:ConstantInt\n')
    with pytest.raises(FileError, match="cannot be named") as caught:
        hfg.load(file)
    assert ":4: " in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        'hfg: 1\nname: "g\\e[2J"\n',
        'hfg: 1\nname: g\n"\\e[2J": 1\n',
        'hfg: 1\nname: g\nnodes:\n  "n\\e[31m":\n    type: "x\\e[31m:Y"\n',
        'hfg: 1\nname: g\nnodes:\n  n:\n    type: "\\u202ehfg:Y"\n',
        "hfg: 1\nname: g\nnodes:\n  n:\n    type: hfg.nodes.values.constants:ConstantText\n"
        '    parameters:\n      "va\\x9blue": 1\n',
        'hfg: 1\nname: g\nedges:\n- "a\\e[2J.b -> c.d"\n',
    ],
)
@pytest.mark.parametrize("verb", ["run", "check", "draw", "convert"])
def test_no_verb_writes_what_a_file_says_raw(
    verb: str, text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "evil.hfg.yaml").write_text(text)
    main([verb, str(tmp_path / "evil.hfg.yaml")])
    written = capsys.readouterr()
    assert not RAW.search(written.out + written.err)
    shown = written.out + written.err
    assert "\\x1b" in shown or "\\u" in shown or shown.startswith("flowchart")


def test_sentences_tables_tracebacks_and_json_are_written_out(capsys: pytest.CaptureFixture[str]) -> None:
    show.sentence(EVIL)
    show.table(EVIL, ["a"], [[EVIL]])
    show.user_traceback(SyntaxError(EVIL))
    show.json({"value": EVIL})
    written = capsys.readouterr()
    assert not RAW.search(written.out + written.err)


def test_log_records_are_written_out(capsys: pytest.CaptureFixture[str]) -> None:
    records = show.Records(0, debug=False)
    try:
        logging.getLogger("hfg.node.x").warning("%s", EVIL)
    finally:
        logging.getLogger("hfg").removeHandler(records._handler)
    err = capsys.readouterr().err
    assert "owned" in err
    assert not RAW.search(err)


def test_verbs_write_by_one_door() -> None:
    """What writes to a stream itself is `show`, and what draws a terminal or leaves the process."""
    doors = {"show.py", "terminal.py", "run.py", "interrupt.py", "app.py"}
    found = [
        f"{file.name}:{node.lineno}"
        for file in CLI.glob("*.py")
        if file.name not in doors
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("sys.stdout.write", "sys.stderr.write", "print")
    ]
    assert found == []


def test_what_nodes_print_does_not_steer_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    class Screen:
        def __init__(self) -> None:
            self.text = ""

        def write(self, text: str) -> None:
            self.text += text

        def flush(self) -> None:
            pass

        def isatty(self) -> bool:
            return True

    screen = Screen()
    monkeypatch.setattr("sys.stdout", screen)
    fire(TextDisplay(format="{}"), value=EVIL)
    assert "owned" in screen.text
    assert not RAW.search(screen.text)


def test_drawings_hold_what_they_show(tmp_path: Path) -> None:
    """Quotes and brackets in names draw nothing of their own, in no format."""
    graph = hfg.Graph('x"]; click a href "javascript:1" %%')
    names = [
        'a"] --> b["',
        "end",
        "x]]\\n",
        "<text><script>",
        "<<!--",
        "subgraph",
        "%%{init}%%",
        "a;b",
        "#quot;",
        "{}|",
    ]
    for name in names:
        graph.add(double(), name=name)
    mermaid, dot, svg = (graph.draw(format=one) for one in ("mmd", "dot", "svg"))
    assert len(mermaid.splitlines()) == len(names) + 1
    assert all(re.fullmatch(r'    \w+\["[^"<>]*"\]', line) for line in mermaid.splitlines()[1:])
    assert len(dot.splitlines()) == len(names) + 5
    assert all(re.fullmatch(r'    \w+ \[label="(?:[^"\\]|\\.)*", shape=box\]', line) for line in dot.splitlines()[4:-1])
    assert "<script" not in svg
