"""Graph files that say no graph, graphs that no file can say, full disks: all findings at once, nothing lost."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any, cast

import pytest

import hfg
from hfg.base.bounds import GRAPH_FILE_BYTES
from hfg.cli import main
from hfg.files import Document, NodeDocument, build, describe, parsing, read, save, text_of
from tests.files.programs import double, numbers

NUMBERS, DOUBLE = "tests.files.programs:numbers", "tests.files.programs:double"


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def write(text: str | bytes, name: str = "a.hfg.yaml") -> Path:
    path = Path(name)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(textwrap.dedent(text).lstrip("\n").encode() if isinstance(text, str) else text)
    return path


def refusal(text: str | bytes, **options: Any) -> list[str]:
    """What is said about a file that cannot be loaded, a line each."""
    with pytest.raises(hfg.errors.FileError) as refused:
        hfg.load(write(text), **options)
    found = [str(problem) for problem in refused.value.problems]
    assert all("\n" not in one for one in found)
    return found


def test_everything_that_is_wrong_is_told_at_once_with_its_line() -> None:
    assert refusal(
        f"""
        hfg: 1
        nme: typo
        groups:
          side: {{threads: many}}
        nodes:
          camera:
            type: {NUMBERS}
            max_rate_hz: fast
            parameters:
              cuont: 3
              count: 1.5
          lost:
            typ: {DOUBLE}
          blur:
            type: {DOUBLE}
            on_error: skp
            gate:
              by: nobody
        edges:
          - camera.out -> blur.value
          - camera.out -> blur.vlue
          - camera -> lost.value
          - camera.out - blur.value
          - lost.out -> blur.value
        """
    ) == [
        'a.hfg.yaml:2: "nme": nothing here is called "nme"; did you mean "name"?',
        'a.hfg.yaml:4: group "side": threads is a whole number, got the text "many"; correct it, or take it out',
        'a.hfg.yaml:8: "camera.max_rate_hz": max_rate_hz is a number, got the text "fast"; correct it, or take it out',
        'a.hfg.yaml:10: "camera.cuont": there is no parameter "cuont"; did you mean "count"?',
        'a.hfg.yaml:11: "camera.count": must be of type int, got 1.5; correct the value, or remove it',
        'a.hfg.yaml:13: "lost.typ": nothing here is called "typ"; did you mean "type"?',
        'a.hfg.yaml:16: "blur.on_error": on_error is one of disable, restart, skip, stop, got the text "skp"; did you '
        'mean "skip"?',
        'a.hfg.yaml:17: "blur": there is no "nobody": graph "graph" has no node "nobody"; there are "camera", "blur"',
        'a.hfg.yaml:21: "camera.out -> blur.vlue": there is no "blur.vlue": "blur" has no port "vlue"; did you mean '
        '"value"?',
        'a.hfg.yaml:23: "edges[3]": "camera.out - blur.value" is no edge; write source.port -> target.port',
    ]


def test_types_that_are_not_there_are_told_with_what_else_is_wrong() -> None:
    assert refusal(
        """
        hfg: 1
        nodes:
          lost: {type: hfg.testing.nodes:Scrpt}
          numbers: {type: hfg.testing.nodes:Script, parameters: {count: [3]}}
        """
    ) == [
        'a.hfg.yaml:3: "lost": its type is not there: node type "hfg.testing.nodes:Scrpt": module "hfg.testing.nodes" '
        'has no "Scrpt" (did you mean "Script"?); install what has it, or correct it',
        'a.hfg.yaml:4: "numbers.count": must be of type int, got [3]; correct the value, or remove it',
    ]


def test_a_name_of_the_graph_that_would_steer_a_terminal_is_told_with_its_line_and_all_else(
    capsys: pytest.CaptureFixture[str],
) -> None:
    said = "a name is one line without control characters; remove them"
    assert refusal(
        """
        hfg: 1
        name: "g\\e[31m"
        nodes:
          a:
            tpye: x
        """
    ) == [
        f'a.hfg.yaml:2: "name": a graph cannot be named "g\\x1b[31m": {said}',
        'a.hfg.yaml:5: "a.tpye": nothing here is called "tpye"; did you mean "type"?',
    ]
    assert main(["run", "a.hfg.yaml"]) == 2
    assert 'a.hfg.yaml:2: "name"' in capsys.readouterr().err


def test_what_only_the_graph_shows_is_told_with_its_line_too() -> None:
    found = refusal(
        f"""
        hfg: 1
        inputs:
          keys: imt
        nodes:
          camera:
            type: {NUMBERS}
            group: vison
            retries: 2
          blur:
            type: {DOUBLE}
            gate:
              by: nobody
        edges:
          - camera.uot -> blur.value
          - camera.out -> blur.value
          - camera.out -> blur.value
          - camera.out -> blur.factor:
              capacity: 3
        """
    )
    assert [one.split(" ")[0] for one in found] == [f"a.hfg.yaml:{line}:" for line in (3, 8, 11, 14, 16, 17)], found
    assert "there is no imt" in found[0]
    assert "retries" in found[1]
    assert 'there is no "camera.uot"' in found[3]


BOX = "hfg: 1\nnodes:\n  b:\n    graph:\n      parameters:\n        p: "
"""Begins a subgraph with one parameter."""


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (b"", "1: nothing is in it; begin it with a line hfg: 1"),
        (b"# only words\n", "1: nothing is in it"),
        (b"\x00\x01\x02", "1: this is no text"),
        (b"hfg: 1\nname: \xff\n", "2: this is no text in UTF-8"),
        (b"\x89PNG\r\n\x1a\n\x00\x00", "1: this is no text in UTF-8"),
        ("just words", "1: a graph file is a mapping, got the text"),
        ("[1, 2]", "1: a graph file is a mapping, got a list"),
        ("nodes: {}", "1: it does not say which version of the format it has; add a line hfg: 1"),
        ("hfg: 2", "1: version 2 of the format is not known, only 1 is; update hfg"),
        ("hfg: '1'", "1: version '1' of the format is not known"),
        ("hfg: .nan", "1: version nan of the format is not known"),
        ("hfg: 1\nname: [a", "this is no YAML: while parsing a flow sequence"),
        ("hfg: 1\nnodes:\n  a:\n    type: x:y\n   b: 1", "5: this is no YAML"),
        ("hfg: 1\nname: a\nname: b", '3: "name" is here twice, already in line 2; take one out, or rename it'),
        ("hfg: 1\nnodes:\n  a: {type: 'hfg.testing.nodes:sink'}\n  a: {type: 'x:z'}", '4: "a" is here twice'),
        ("hfg: 1\n---\nhfg: 1", "2: a second document begins here"),
        ("hfg: 1\nname: !!python/name:os.system x", '2: "tag:yaml.org,2002:python/name:os.system" is a tag'),
        ("hfg: 1\nnotes: !!python/object/apply:os.system {a: ls}", "2: "),
        ("hfg: 1\nname: *nobody", "2: "),
        ("hfg: 1\nnotes: {1: x}", '2: a key is a text, got 1; write "1" in quotes'),
        ("hfg: 1\nnotes: {true: x}", '2: a key is a text, got true; write "true" in quotes'),
        ("hfg: 1\nnotes: {[1]: x}", "2: a key is a name, not a list or mapping"),
        ("hfg: 1\nname: 12", '2: "name": name is a text, got 12; write it in quotes, "12"'),
        ("hfg: 1\nnodes: [a]", '2: "nodes": nodes is a mapping by name, got a list'),
        ("hfg: 1\nedges: {a: b}", '2: "edges": edges is a list, got a mapping'),
        ("hfg: 1\nedges: [3]", '2: "edges[0]": an edge is a text, got 3'),
        ("hfg: 1\nnodes:\n  a:", '3: "a": it does not say what it is; add a line type: module:name'),
        ("hfg: 1\nnodes:\n  a: text", '3: "a": "a" is a mapping, got the text "text"'),
        ("hfg: 1\nnodes:\n  a: {type: 'x:y', file: b.hfg.yaml}", '3: "a": it has a file and a type'),
        ("hfg: 1\nnodes:\n  a/b: {type: 'hfg.testing.nodes:double'}", '3: "a/b": '),
        ("hfg: 1\nnodes:\n  a: {type: double}", '3: "a": "double" is not a reference to a node type'),
        ("hfg: 1\nnodes:\n  a: {type: 'os:system'}", '3: "a": "os:system" is '),
        ("hfg: 1\nevents: {rang: int}", '2: "rang": a whole graph has no events, only a subgraph has'),
        ("hfg: 1\nedges:\n - start -> stop:\n     through: [reactivex.operators:no]", '3: "start -> stop": '),
        ("hfg: 1\nnodes:\n  a: {type: 'hfg.testing.nodes:Script', max_rate_hz: .nan}", '3: "a": max_rate_hz must be'),
        ("hfg: 1\nnodes:\n  a: {type: 'hfg.testing.nodes:some', parameters: {modulus: .nan}}", '"a.modulus": must be'),
        ("hfg: 1\nnodes:\n  a: {file: b.hfg.yaml}", '3: "a": there is no file "b.hfg.yaml" there'),
        ("hfg: 1\nnodes:\n  a: {file: /etc/passwd}", '3: "a": "/etc/passwd" is outside of the project'),
        ("hfg: 1\nnodes:\n  a: {file: ../../other.hfg.yaml}", '3: "a": "../../other.hfg.yaml" is outside of'),
        ("hfg: 1\nnodes:\n  a: {file: a.hfg.yaml}", '3: "a": files that include each other have no end: a.hfg.yaml'),
        ("hfg: 1\nnodes:\n  a: {type: 'xml.dom.pulldom:x'}", '3: "a.type": module "xml.dom.pulldom" is not one that'),
        ("hfg: 1\ninputs: {a: wave.Wave_read}", '2: "a": module "wave" is not one that this file may import'),
        (BOX + "{type: int, default: 1, choices: [1], labels: [a, b]}", '6: "b.p": labels are what to call the ch'),
        (BOX + "{type: int, default: 1, shown_if: {q: {gtt: 3}}}", '6: "b.p": "gtt" is not a limit; there are gt, ge'),
        (BOX + "{type: int, default: 1, shown_if: q}", 'parameter "p" is shown by "q", which is not a parameter'),
        (BOX + "{type: int, default: 1, shown_if: 3}", "shown_if names parameters of the same node and what they must"),
        (BOX + "{type: int, default: 1, step: 0}", 'parameter "p" has a step of 0'),
        ("hfg: 1\nname: " + "9" * 5000, "2: this number has 5000 digits"),
        ("hfg: 1\nnotes: " + "[" * 300 + "]" * 300, "2: this lies deeper than 200 levels"),
    ],
)  # fmt: skip
def test_a_file_that_says_no_graph_gets_one_sentence(text: str | bytes, sentence: str) -> None:
    (found,) = refusal(text)
    assert sentence in found


@pytest.mark.parametrize("parser", ["libyaml", "python"])
def test_aliases_that_explode_are_refused_in_no_time(parser: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if parser == "python":
        monkeypatch.setattr(parsing, "_Parser", None)
    bomb = "hfg: 1\nnotes:\n  a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n"
    for number in range(1, 30):
        bomb += f"  a{number}: &a{number} [{', '.join([f'*a{number - 1}'] * 10)}]\n"
    (found,) = refusal(bomb)
    assert "this is more than 2,000,000 values, aliases counted" in found
    (found,) = refusal("hfg: 1\nnotes: &a\n  b: *a\n")
    assert 'there is no "&a" before this "*a"' in found
    (found,) = refusal("hfg: 1\nname: [a")
    assert "this is no YAML" in found


def test_a_file_that_is_too_large_is_not_read() -> None:
    with Path("a.hfg.yaml").open("wb") as stream:
        stream.truncate(GRAPH_FILE_BYTES.usual + 1)
    with pytest.raises(hfg.errors.FileError, match="it is too large: the limit is 33,554,432; .* else put large"):
        hfg.load("a.hfg.yaml")


@pytest.mark.parametrize("cut", range(0, 200, 7))
def test_a_file_that_was_cut_off_is_a_graph_or_a_sentence(cut: int) -> None:
    graph = hfg.Graph()
    graph.connect(graph.add(numbers(count=7), max_rate_hz=3).out, graph.add(double()).value)
    path = write(text_of(describe(graph)).encode()[:cut])
    problems: tuple[object, ...] | None = None
    try:
        hfg.load(path)
    except hfg.errors.FileError as error:
        problems = error.problems
    assert problems is None or len(problems) > 0


def test_files_that_include_each_other_are_refused_where_they_do() -> None:
    write("hfg: 1\nnodes:\n  c: {file: parts/c.hfg.yaml}", "b.hfg.yaml")
    write("hfg: 1\nnodes:\n  b: {file: ../b.hfg.yaml}", "parts/c.hfg.yaml")
    (found,) = refusal("hfg: 1\nnodes:\n  b: {file: b.hfg.yaml}")
    ring = "b.hfg.yaml -> c.hfg.yaml -> b.hfg.yaml"
    assert found.startswith(f'parts/../parts/c.hfg.yaml:3: "b": files that include each other have no end: {ring}') or (
        found == f'parts/c.hfg.yaml:3: "b": files that include each other have no end: {ring}; leave one of them out'
    )


def test_what_is_wrong_in_an_included_file_is_told_with_that_file() -> None:
    write("hfg: 1\nnodes:\n  n: {type: 'hfg.testing.nodes:double', parameters: {a: 1}}\nnam: x", "b.hfg.yaml")
    found = refusal("hfg: 1\nnodes:\n  b: {file: b.hfg.yaml}\n  c: {file: b.hfg.yaml}\nnam: y")
    assert [one.split(" ")[0] for one in found] == ["b.hfg.yaml:4:", "a.hfg.yaml:5:"] or sorted(
        one.split(" ")[0] for one in found
    ) == ["a.hfg.yaml:5:", "b.hfg.yaml:4:"]


def test_no_code_is_run_but_that_of_allowed_modules(monkeypatch: pytest.MonkeyPatch) -> None:
    write("raise SystemExit('code ran')", "elsewhere/evil_module.py")
    write("[project]", "project/pyproject.toml")
    monkeypatch.syspath_prepend(str(Path("elsewhere").resolve()))
    file = write(
        """
        hfg: 1
        inputs: {a: 'list[evil_module.T]'}
        nodes:
          n: {type: 'evil_module:n'}
          m: {type: 'evil_module.sub:n'}
          b: {graph: {slots: {s: evil_module.T}}}
        edges:
          - start -> stop:
              through: ['evil_module:op']
        """,
        "project/a.hfg.yaml",
    )
    with pytest.raises(hfg.errors.FileError) as refused:
        hfg.load(file)
    assert [problem.line for problem in refused.value.problems] == [2, 4, 5, 6, 8]  # type: ignore[attr-defined]
    assert all("allow" in problem.remedy for problem in refused.value.problems)
    assert "evil_module" not in sys.modules
    assert read(file).nodes["n"].type == "evil_module:n"


@pytest.mark.rule("L4")
@pytest.mark.parametrize("verb", ["run", "check", "draw", "convert", "record", "play", "tap"])
def test_code_beside_a_file_runs_only_if_it_is_allowed(
    verb: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each verb says what the file would import and from where, and gives the command that allows it."""
    write("[project]", "project/pyproject.toml")
    write("import hfg\n@hfg.node\ndef beside() -> int: return 1\nraise RuntimeError", "project/code_beside.py")
    write("raise RuntimeError", "project/src/code_too/__init__.py")
    write(
        "hfg: 1\nnodes:\n  n: {type: 'code_beside:beside'}\n  m: {type: 'code_too.nodes:other'}", "project/a.hfg.yaml"
    )
    monkeypatch.setattr("sys.path", [*sys.path])
    rest = {"record": ["-o", "x.mcap"], "play": ["--into"], "tap": []}.get(verb, [])
    file = "project/a.hfg.yaml"
    given = (
        ["play", "x.mcap", "--into", file] if verb == "play" else [verb, file, *(["n.out"] if verb == "tap" else rest)]
    )
    code = main(given)
    told = capsys.readouterr()
    assert code == (1 if verb == "check" else 2)
    assert f"(it would come from {Path('project/code_beside.py').resolve()})" in told.out + told.err
    assert f"(it would come from {Path('project/src/code_too').resolve()})" in told.out + told.err
    command = f"hfg {' '.join(given)} --allow code_beside --allow code_too"
    assert told.err.endswith(f"it wants to run code of code_beside, code_too; if you trust that: {command}\n")
    assert not {"code_beside", "code_too"} & set(sys.modules)


@pytest.mark.rule("L4")
def test_code_beside_a_file_is_found_when_it_is_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    write("[project]", "project/pyproject.toml")
    write("import hfg\n@hfg.node\ndef beside() -> int: return 1\n", "project/code_found.py")
    write("import hfg\n@hfg.node\ndef other() -> int: return 1\n", "project/src/code_found_too.py")
    nodes = "nodes:\n  n: {type: 'code_found:beside'}\n  m: {type: 'code_found_too:other'}"
    file = write(f"hfg: 1\n{nodes}", "project/graphs/a.hfg.yaml")
    monkeypatch.setattr("sys.path", [*sys.path])
    with pytest.raises(hfg.errors.FileError) as refused:
        hfg.load(file, allow=["code_found"])
    assert refused.value.wants == ("code_found_too",)
    assert list(hfg.load(file, allow=["code_found", "code_found_too"]).nodes) == ["n", "m"]
    assert list(hfg.load(file).nodes) == ["n", "m"]  # what the program has imported, it may name


def test_an_allowed_package_is_imported(monkeypatch: pytest.MonkeyPatch) -> None:
    write("import hfg\n@hfg.node\ndef given() -> int: return 1\n", "elsewhere/given_module.py")
    write("[project]", "project/pyproject.toml")
    monkeypatch.syspath_prepend(str(Path("elsewhere").resolve()))
    file = write("hfg: 1\nnodes:\n  n: {type: 'given_module:given'}", "project/a.hfg.yaml")
    with pytest.raises(hfg.errors.FileError, match=r"with --allow given_module or hfg.load\(\.\.\., allow="):
        hfg.load(file)
    assert list(hfg.load(file, allow=["given_module"]).nodes) == ["n"]


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda graph: hfg.load(cast(Any, 3)), "a graph file is named by its path, got 3"),
        (lambda graph: hfg.load("a.hfg.yaml", allow=[cast(Any, 3)]), "allow takes names of packages, got 3"),
        (lambda graph: hfg.save(cast(Any, "a.hfg.yaml"), graph), "save takes a graph, got 'a.hfg.yaml'"),
        (lambda graph: hfg.save(graph, "a.yaml"), "a.yaml is no name of a graph file; call it a.hfg.yaml"),
        (lambda graph: hfg.save(graph, "no/folder/a.hfg.yaml"), "cannot be written (No such file or directory)"),
        (lambda graph: hfg.save(graph["box"].graph, "a.hfg.yaml"), "is saved with the whole graph"),
    ],
)
def test_wrong_uses_of_load_and_save_are_told(call: Any, sentence: str) -> None:
    class Box(hfg.Subgraph): ...

    graph = hfg.Graph()
    graph.add(Box(), name="box")
    with pytest.raises(hfg.errors.UsageError) as refused:
        call(graph)
    assert sentence in str(refused.value)


def test_there_is_no_such_file_and_one_like_it() -> None:
    write("hfg: 1", "robot.hfg.yaml")
    with pytest.raises(
        hfg.errors.FileError, match=r'rbot.hfg.yaml: there is no such file; did you mean "robot.hfg.yaml"'
    ):
        hfg.load("rbot.hfg.yaml")
    with pytest.raises(hfg.errors.FileError, match=r"house.hfg.yaml: there is no such file; see where it is"):
        hfg.load("house.hfg.yaml")
    Path("b.hfg.yaml").mkdir()
    with pytest.raises(hfg.errors.FileError, match="this is a folder"):
        hfg.load("b.hfg.yaml")


# --- graphs that no file can say ---


def test_all_that_no_file_can_say_is_told_before_anything_is_written() -> None:
    import reactivex
    from reactivex import operators as ops

    class Local(hfg.Node):
        value = hfg.Input(int)
        odd = hfg.Parameter(None, type=object)

    graph = hfg.Graph()
    for name in ("first", "second"):
        graph.add(Local(), name=name)
    graph.add(hfg.node(lambda value: value, inputs={"value": int}, outputs=int)(), name="third")
    source = graph.add(numbers(), name="source")
    graph.connect(source.processed, graph.stop, through=[ops.delay(1)])
    graph.connect(reactivex.of(1), graph.abort)
    path = write("as before")
    with pytest.raises(hfg.errors.FileError) as refused:
        save(graph, path)
    assert [problem.path for problem in refused.value.problems] == [
        "first",
        "second",
        "third",
        "source.processed -> stop",
        "observable -> abort",
    ]
    assert "define it at the top of a module" in str(refused.value)
    assert path.read_text() == "as before"


def test_values_that_would_not_come_back_are_told() -> None:
    graph = hfg.Graph()
    graph.connect(graph.add(numbers()).out, graph.add(double()).value, initial=[1])
    document = describe(graph)
    document.nodes["numbers"].parameters["count"] = object()
    with pytest.raises(TypeError, match="is no plain data"):
        text_of(document)


def test_a_document_with_a_name_too_long_for_yaml_is_refused() -> None:
    document = Document(nodes={"n" * 2000: NodeDocument(DOUBLE)})
    with pytest.raises(hfg.errors.FileError):
        text_of(document)


# --- types that are not there ---


UNKNOWN = """
hfg: 1
name: graph
inputs:
  keys: int
nodes:
  camera:
    type: tests.files.programs:Camera
    max_rate_hz: 3
    parameters:
      rate:
        - 1
        - deep: "no"
    inside:
      plan:
        enabled: false
    position: [1, 2]
    notes:
      why: because
  other:
    type: hfg.testing.not_there:Other
    gate:
      by: double
  double:
    type: tests.files.programs:double
edges:
  - keys -> camera.rate
  - camera.out -> double.value:
      buffer: 2
  - camera.out.sent -> other.values[0]:
      capacity: 3
  - camera.seen -> other.look:
      overflow: latest
  - double.out -> other.look
  - other.activated -> camera.activate:
      active: true
"""


def test_an_unknown_type_keeps_its_place_with_its_data(capsys: pytest.CaptureFixture[str]) -> None:
    path = write(UNKNOWN)
    graph = hfg.load(path)
    save(graph, "b.hfg.yaml")
    assert Path("b.hfg.yaml").read_text() == path.read_text()
    missing = [problem for problem in graph.check() if problem.severity == "error"]
    assert {one.check for one in missing} == {"missing-type"}
    assert [(one.severity, one.path) for one in missing] == [("error", "camera"), ("error", "other")]
    assert (
        missing[0].remedy == "install what has it, or correct a.hfg.yaml, line 7; until then the node keeps its place"
    )
    with pytest.raises(hfg.errors.CheckFailed, match='its type "hfg.testing.not_there:Other" is not there'):
        hfg.run(graph)
    assert main(["check", "a.hfg.yaml"]) == 1
    assert "[missing-type]" in capsys.readouterr().out
    graph.edit(hfg.commands.Rename("camera", "eye"), hfg.commands.Disable("other"))
    save(graph, "b.hfg.yaml")
    assert "  eye:\n    type: tests.files.programs:Camera\n" in Path("b.hfg.yaml").read_text()
    with pytest.raises(hfg.errors.GraphError, match="is not there"):
        graph.edit(hfg.commands.Copy("eye", "camera"))


# --- disks ---


@pytest.mark.slow
def test_a_full_disk_leaves_the_old_file_whole() -> None:
    """A process may write no more than a few bytes into a file, as on a full disk."""
    path = write("as before")
    path.chmod(0o640)
    program = """
    import resource, signal, hfg
    from tests.files.programs import numbers
    graph = hfg.Graph()
    for number in range(200):
        graph.add(numbers())
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))
    try:
        hfg.save(graph, "a.hfg.yaml")
    except hfg.errors.UsageError as error:
        print(error)
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout == "a.hfg.yaml cannot be written (File too large); what was there before is as it was\n", (
        done.stderr
    )
    assert path.read_text() == "as before"
    assert [file.name for file in Path().iterdir()] == ["a.hfg.yaml"]


def test_a_kill_while_saving_leaves_the_old_file_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """The new one takes its place in one step, when it is on the disk."""
    path = write("as before")
    steps: list[tuple[str, str]] = []
    sync, replace = os.fsync, os.replace

    def synced(descriptor: int) -> None:
        steps.append(("sync", path.read_text()))
        sync(descriptor)

    def replaced(new: str, target: str, **folders: int) -> None:
        steps.append(("replace", path.read_text()))
        replace(new, target, **folders)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(os, "replace", replaced)
    save(hfg.Graph("new"), path)
    assert steps == [("sync", "as before"), ("replace", "as before"), ("sync", "hfg: 1\nname: new\n")]


def test_who_may_read_a_file_stays_and_a_link_stays_a_link() -> None:
    path = write("as before", "real.hfg.yaml")
    path.chmod(0o640)
    Path("link.hfg.yaml").symlink_to(path)
    save(hfg.Graph("new"), "link.hfg.yaml")
    assert Path("link.hfg.yaml").is_symlink()
    assert path.read_text() == "hfg: 1\nname: new\n"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    before = os.umask(0o027)
    try:
        save(hfg.Graph(), "fresh.hfg.yaml")
    finally:
        os.umask(before)
    assert stat.S_IMODE(Path("fresh.hfg.yaml").stat().st_mode) == 0o640


# --- the command line ---


def test_the_command_tells_each_finding_on_a_line_of_its_own(capsys: pytest.CaptureFixture[str]) -> None:
    write("hfg: 1\nnam: x\nnodes:\n  a: {tpe: 'x:y'}")
    assert main(["run", "a.hfg.yaml"]) == 2
    assert capsys.readouterr().err == (
        "hfg: a.hfg.yaml cannot be loaded, 2 findings:\n"
        '  a.hfg.yaml:2: "nam": nothing here is called "nam"; did you mean "name"?\n'
        '  a.hfg.yaml:4: "a.tpe": nothing here is called "tpe"; did you mean "type"?\n'
    )
    assert main(["check", "a.hfg.yaml"]) == 1
    assert capsys.readouterr().out.endswith("[graph-file]\na.hfg.yaml: 2 errors, no warnings\n")
    assert main(["check", "--json", "a.hfg.yaml"]) == 1
    assert '"line": 4' in capsys.readouterr().out


def test_building_a_document_finds_the_same_without_lines() -> None:
    document = Document(nodes={"n": NodeDocument(DOUBLE, parameters={"facto": 1})})
    with pytest.raises(hfg.errors.FileError, match='"n.facto": there is no parameter "facto"; did you mean "factor"'):
        build(document)
