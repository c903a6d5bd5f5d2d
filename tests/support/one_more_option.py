"""What becomes of options that hfg does not have: run as a program, it prints what each path makes of them, as JSON.

It lets the modules of `DECLARED` declare one more option of an edge, a node, a group and a run, before anything imports
them. Nothing else is changed.
"""

from __future__ import annotations

import importlib.machinery
import importlib.util
import inspect
import json
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import CodeType
from typing import Any

GRAPH, RUN = "hfg.graph.structure.options", "hfg.engine.runtime.settings"
DECLARED = (
    (
        GRAPH,
        "class EdgeFields(Fields[EdgeGiven[Any, Any]], kw_only=True):\n",
        "    max_age_s: Annotated[float | None, Option('No signal waits longer.', above=0, only='events', "
        "badge='{:g} s')] = None\n",
    ),
    (
        GRAPH,
        "class NodeFields(Fields[NodeGiven], kw_only=True):\n",
        "    weight: Annotated[int, Option('Its share of the processor.', least=1, badge='weight {}')] = 1\n",
    ),
    (
        GRAPH,
        "class GroupFields(Fields[GroupGiven], kw_only=True):\n",
        "    nice: Annotated[int, Option('As of ours.', least=0)] = 0\n",
    ),
    (
        RUN,
        "class RunFields(Fields[RunGiven], kw_only=True):\n",
        "    lap: Annotated[int, Option('Its number.', least=1, flag='--lap', everywhere=True)] = 1\n",
    ),
)


class _Loader(importlib.machinery.SourceFileLoader):
    def get_code(self, fullname: str) -> CodeType:
        text = Path(self.path).read_text(encoding="utf-8")
        for place, field in [(place, field) for module, place, field in DECLARED if module == self.name]:
            head, found, rest = text.partition(place)
            assert found, f"{place!r} is not in {self.path}"
            docstring, end, body = rest.partition('."""\n')
            text = head + found + docstring + end + field + body
        return compile(text, self.path, "exec")


class _Finder:
    def find_spec(self, name: str, *_: object) -> importlib.machinery.ModuleSpec | None:
        if name not in (GRAPH, RUN):
            return None
        file = Path(__file__).parents[2] / f"{name.replace('.', '/')}.py"
        return importlib.util.spec_from_file_location(name, file, loader=_Loader(name, str(file)))


if __name__ == "__main__":
    sys.meta_path.insert(0, _Finder())

import hfg  # noqa: E402 - with what is declared above
from hfg.cli import run as cli  # noqa: E402
from hfg.cli.options import with_flags  # noqa: E402
from hfg.errors import HfgError  # noqa: E402
from hfg.files import schema, text_of  # noqa: E402
from hfg.files.describing import describe  # noqa: E402
from hfg.graph.flat import cut, flatten  # noqa: E402
from hfg.graph.structure import options  # noqa: E402
from tests.support.option_tables import table  # noqa: E402

commands: Any = hfg.commands  # whose options type checkers do not know
OF_EDGE: Any = {"max_age_s": 2.5}
OF_NODE: Any = {"weight": 3}
OF_GROUP: Any = {"nice": 7}
TWICE = "hfg.testing.nodes:double"


def graph() -> hfg.Graph:
    """An event that leads into an input, with each of the options."""
    found = hfg.Graph("one more")
    found.group("busy", threads=0, **OF_GROUP)
    found.edit(
        commands.Add("hfg.testing.nodes:script", "begin"),
        commands.Add(TWICE, "twice", {}, {"group": "busy", **OF_NODE}),
        commands.Add("hfg.testing.nodes:sink", "end"),
    )
    found.connect("begin.processed", "twice.reset", **OF_EDGE)
    found.connect("begin.out", "twice.value")
    found.connect("twice.out", "end.value")
    return found


def said(of: hfg.Graph, box: str = "") -> list[Any]:
    """The three of them, as the graph has them."""
    (edge,) = [one for one in flatten(of).edges if one.is_event_edge]
    node: Any = of[f"{box}twice"]._options
    group: Any = of.groups["busy"]
    option: Any = edge.options
    return [option.max_age_s, node.weight, group.nice]


def _saved_and_loaded() -> Any:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "graph.hfg.yaml"
        hfg.save(graph(), file)
        loaded = hfg.load(file)
    return [*said(loaded), text_of(describe(loaded)) == text_of(describe(graph()))]


def _commands() -> Any:
    other = hfg.Graph("one more")
    other.edit(*commands.decode(commands.encode(graph().as_commands())))
    return said(other)


def _edited() -> Any:
    of = graph()
    changed = commands.SetEdge("begin.processed", "twice.reset", max_age_s=9.0)
    declared = commands.ChangeGroup("busy", nice=1)
    of.edit(*commands.decode(commands.encode([changed, declared])))
    found = [said(of)]
    of.undo()
    found.append(said(of))
    of.redo()
    return [*found, said(of)]


def _grouped() -> Any:
    of = graph()
    of.edit(commands.Enclose(("twice", "end"), "box"))
    inside = said(of, "box/")
    of.edit(commands.Dissolve("box"))
    return [inside, said(of)]


def _copied() -> Any:
    of = graph()
    of.edit(commands.Enclose(("begin", "twice"), "box"), commands.Copy("box", "other"))
    of.edit(commands.Remove("box"))
    return said(of, "other/")


def _cut() -> Any:
    of = graph()
    of.group("apart", process=True)
    of.move("begin", group="apart")
    cutting = cut(flatten(of))
    text = text_of(describe(of, same_program=True))
    edges: list[Any] = [edge.options for part in cutting.parts.values() for edge in part.edges if edge.is_event_edge]
    return [[edge.max_age_s for edge in edges], *(f"{one}: " in text for one in ("max_age_s", "weight", "nice"))]


def _drawn() -> Any:
    return [badge in graph().draw(format=kind) for kind in ("svg", "mmd", "dot") for badge in ("2.5 s", "weight 3")]


def _schema() -> Any:
    defs = json.loads(schema())["$defs"]
    node = defs["NodeDocument"]["properties"]["weight"]
    edge = defs["EdgeDocument"]["anyOf"][2]["properties"]["max_age_s"]
    group = defs["GroupDocument"]["properties"]
    return [node["description"], node["minimum"], edge["exclusiveMinimum"], "nice" in group]


def _documented() -> Any:
    row = next(line for line in table(options.EdgeOptions).splitlines() if "max_age_s" in line)
    documented = [hfg.run.__doc__ or "", options.EdgeOptions.__doc__ or ""]
    return [row, "lap: Its number." in documented[0], "max_age_s: No signal waits longer." in documented[1]]


def _refused() -> Any:
    wrong: list[Callable[[], object]] = [
        lambda: graph().connect("begin.processed", "twice.activate", max_age_s=-1),  # type: ignore[call-overload]
        lambda: graph().connect("twice.out", "begin.activate", **OF_EDGE),
        lambda: graph().edit(commands.Add(TWICE, "more", {}, {"weight": 0})),
        lambda: graph().add(hfg.Subgraph(), name="box", **OF_NODE),
        lambda: hfg.run(graph(), lap=0),  # type: ignore[call-arg]
    ]
    return [_refusal(one) for one in wrong]


def _refusal(call: Callable[[], object]) -> str:
    try:
        call()
    except HfgError as error:
        return str(error)
    return "not refused"


def _run() -> Any:
    """The option of a run, in the settings that the engine and other processes have."""
    found: list[Any] = []
    option: Any = {"lap": 5}
    report = hfg.run(graph(), clock="virtual", begin=lambda run: found.append(run._engine.settings), **option)
    return [report.outcome, report.nodes["end"].processed, found[0].lap, found[0].everywhere()["lap"]]


def _on_the_command_line() -> Any:
    flags = inspect.signature(with_flags(cli.run)).parameters
    return [flags["lap"].default, "--lap" in str(vars(flags["lap"].annotation.__metadata__[0]))]


PATHS: dict[str, Callable[[], Any]] = {
    "made": lambda: said(graph()),
    "saved and loaded": _saved_and_loaded,
    "as commands": _commands,
    "edited, undone, redone": _edited,
    "grouped and dissolved": _grouped,
    "copied": _copied,
    "cut into processes": _cut,
    "drawn": _drawn,
    "in the schema": _schema,
    "in the docs": _documented,
    "refused": _refused,
    "run": _run,
    "on the command line": _on_the_command_line,
}

if __name__ == "__main__":
    print(json.dumps({name: path() for name, path in PATHS.items()}))
