"""The floors of the package hold: imports go down only, and nothing below the engine knows how to wait.

The table says which floor a module or package stands on; every import statement counts, also inside functions and under
`TYPE_CHECKING`, because a floor that only *names* the one above it cannot be read without it either.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping
from pathlib import Path

import pytest

from hfg.graph.flat.order import rings, shortest_ring
from tools import imports
from tools.imports import modules, parsed

ROOT = Path(__file__).resolve().parent.parent

FLOORS = {
    "hfg.errors": 0,
    "hfg.types": 0,
    "hfg.base": 0,
    "hfg.encoding": 0,
    "hfg.images": 0,
    "hfg.geometry": 0,
    "hfg.panels": 0,
    "hfg.trace": 0,
    "hfg.ports": 1,
    "hfg.sharedmemory": 1,
    "hfg.transport": 1,
    "hfg.nodetypes": 2,
    "hfg.registry": 2,
    "hfg.ros": 2,
    "hfg.ros.connection": 5,  # opens a session, which waits
    "hfg.graph": 3,
    "hfg.activity": 4,
    "hfg.analysis": 4,
    "hfg.links": 4,
    "hfg.links.running": 5,
    "hfg.links.pubsub": 5,
    "hfg.links.local": 5,
    "hfg.timeline": 4,
    "hfg.engine": 5,
    "hfg.nodes": 6,
    "hfg.files": 6,
    "hfg.recording": 6,
    "hfg.reporting": 6,
    "hfg.parts": 6,
    "hfg.parts.transports": 5,  # finds them, and knows nothing of parts
    "hfg.catalogue": 6,
    "hfg.monitors": 6,
    "hfg.monitors.reading": 2,  # the language is text and data, which graphs hold
    "hfg.monitors.conditions": 2,
    "hfg.monitors.formulas": 2,
    "hfg.monitors.compiling": 2,
    "hfg.monitors.properties": 2,
    "hfg.monitors.parsing": 2,
    "hfg.monitors.margins": 2,
    "hfg.monitors.violations": 2,
    "hfg.tuning": 6,
    "hfg.comparing": 7,
    "hfg.cli": 7,
    "hfg.studio": 7,
    "hfg.viewers": 7,
    "hfg.composing": 7,  # puts what stands high where lower floors ask for it
    "hfg.__main__": 8,  # the two doors: they may see everything, and nobody sees them
    "hfg": 8,
    "hfg.testing": 8,
}
FIRST_FLOOR_THAT_WAITS = 5
SAME_FLOOR_FREE = {0, 2}  # one vocabulary each: what everybody speaks of, and what a node type is
SAME_FLOOR_PAIRS = {
    ("hfg.cli", "hfg.studio"),
    ("hfg.cli", "hfg.comparing"),
    ("hfg.composing", "hfg.studio"),
    ("hfg.composing", "hfg.viewers"),
    ("hfg.viewers", "hfg.studio"),  # its server, which checks who comes
    ("hfg.engine", "hfg.links.running"),
    ("hfg.links.pubsub", "hfg.links.running"),
    ("hfg.ros.connection", "hfg.parts.transports"),  # finds Zenoh
    ("hfg.parts.transports", "hfg.links.local"),  # the one that is always there
    ("hfg.__main__", "hfg.cli"),
    ("hfg.testing", "hfg"),
    ("hfg.tuning", "hfg.monitors"),  # constraints of a search
    ("hfg.reporting", "hfg.monitors"),  # their violations are part of a page
    ("hfg.nodes", "hfg.recording"),  # a family of it is made there
    ("hfg.nodes", "hfg.tuning"),  # methods of search, and statistics
    ("hfg.files", "hfg.catalogue"),  # which packages a graph file may name
    ("hfg.parts", "hfg.monitors"),  # each part hears for the monitors of the whole
    ("hfg.parts", "hfg.files"),  # a graph goes to another process as the text of a file
}
# The wings of a floor, in the same way: a module imports what lies in its own wing or in a lower one.
WINGS = {
    "hfg.graph": {
        "hfg.graph.structure": 0,
        "hfg.graph.flat": 1,
        "hfg.graph.drawing": 1,  # draws what was said, so it needs no flat graph
        "hfg.graph.checks": 2,
        "hfg.graph.editing": 3,
        "hfg.graph.graph": 4,  # the face, which composes the wings
        "hfg.graph": 5,
    },
    "hfg.engine": {
        "hfg.engine.model": 0,
        "hfg.engine.rules": 1,
        "hfg.engine.fusion": 2,
        "hfg.engine.executing": 3,
        "hfg.engine.runtime": 4,
        "hfg.engine.observing": 5,  # who looks at a run and who changes it know nothing of each other
        "hfg.engine.editing": 5,
        "hfg.engine.face": 6,
        "hfg.engine": 7,
    },
    "hfg.parts": {
        "hfg.parts.model": 0,
        "hfg.parts.transports": 0,
        "hfg.parts.running": 1,
        "hfg.parts.steering": 2,
        "hfg.parts.processes": 3,
        "hfg.parts.hosts": 4,
        "hfg.parts.distribution": 5,  # the face, which composes the wings
        "hfg.parts": 6,
    },
}
WAITING = {"asyncio", "anyio", "trio"}
ORACLE_MUST_NOT_SHARE = ("hfg.ports", "hfg.activity", "hfg.engine")


HFG = modules("hfg", ROOT)
TRANSPORTS = modules("hfg_transports", ROOT / "transports")
ALL = HFG | TRANSPORTS
KNOWN = frozenset(ALL)


def home(module: str, table: Mapping[str, int] = FLOORS) -> str | None:
    """Return the entry of the table that the module belongs to: the longest prefix."""
    parts = module.split(".")
    for length in range(len(parts), 0, -1):
        name = ".".join(parts[:length])
        if name in table and (length > 1 or len(parts) == 1):
            return name
    return None


def imported(module: str, file: Path, *, named: bool = True) -> tuple[tuple[str, int], ...]:
    """Return what the file imports, with the line; without `named`, imports for type checkers only are left out."""
    return imports.imported(module, file, KNOWN, named=named)


def violations(module: str, file: Path) -> list[str]:
    """Return one sentence for each import that goes up, sideways or waits too low."""
    place = home(module)
    if place is None:
        return [f"{module} stands on no floor: give it one in FLOORS of tests/test_layers.py"]
    floor, found = FLOORS[place], []
    for name, line in imported(module, file):
        where = f"{module}:{line} (floor {floor})"
        if name.split(".")[0] in WAITING and floor < FIRST_FLOOR_THAT_WAITS:
            found.append(f"{where} imports {name}: only floor {FIRST_FLOOR_THAT_WAITS} and above may wait")
        if name.split(".")[0] == "hfg_transports":
            found.append(f"{where} imports {name}: the core finds transports by entry point, never by import")
        if name.split(".")[0] != "hfg":
            continue
        other = home(name)
        if other is None:
            found.append(f"{where} imports {name}, which stands on no floor")
        elif other != place and (place, other) not in SAME_FLOOR_PAIRS:
            below = FLOORS[other] < floor or (FLOORS[other] == floor and floor in SAME_FLOOR_FREE)
            if not below:
                found.append(f"{where} imports {name} (floor {FLOORS[other]}): imports go down only")
    return found


@pytest.mark.slow
def test_imports_go_down_only() -> None:
    for module in HFG:
        found = violations(module, HFG[module])
        assert not found, "\n".join(found)


IN_WINGS = [(floor, name) for floor in WINGS for name in HFG if name == floor or name.startswith(f"{floor}.")]


def test_imports_between_the_wings_of_a_floor_go_one_way() -> None:
    """Also those in functions and for type checkers, so each wing can be read without those that stand on it."""
    for floor, module in IN_WINGS:
        wings = WINGS[floor]
        wing = home(module, wings)
        assert wing is not None
        for name, line in imported(module, HFG[module]):
            other = home(name, wings)
            if other is None or other == wing:
                continue
            assert wings[other] < wings[wing], f"{module}:{line} imports {name}: {other} stands on {wing} or beside it"


def test_what_a_graph_keeps_on_its_nodes_is_written_in_one_place() -> None:
    """A place or options that two modules write are soon two truths; a node's own methods write by `self`."""
    for module in [name for name in HFG if name.startswith("hfg.graph.")]:
        for one in ast.walk(parsed(HFG[module])):
            if (
                isinstance(one, ast.Attribute)
                and isinstance(one.ctx, ast.Store | ast.Del)
                and re.match("_[a-z]", one.attr)
            ):
                is_own = isinstance(one.value, ast.Name) and one.value.id == "self"
                assert is_own or module == "hfg.graph.structure.membership", f"{module}:{one.lineno} writes {one.attr}"


def test_a_circle_that_a_function_hides_is_seen(tmp_path: Path) -> None:
    file = tmp_path / "late.py"
    file.write_text(
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import hfg.cli\ndef f():\n    import hfg.graph\n"
    )
    assert [name for name, _ in imported("hfg.late", file, named=False) if name != "typing"] == ["hfg.graph"]


def test_no_modules_import_each_other_in_a_cycle() -> None:
    """Imports inside functions count, as they only hide a cycle, and so do those for type checkers."""
    names = list(HFG)
    number = {name: index for index, name in enumerate(names)}
    successors = [sorted({number[one] for one, _ in imported(name, HFG[name]) if one in number}) for name in names]
    circles = [[names[index] for index in shortest_ring(part, successors)] for part in rings(successors)]
    assert not circles, "\n".join(" -> ".join([*ring, ring[0]]) for ring in circles)


def test_transports_see_floors_0_and_1_only() -> None:
    for module in TRANSPORTS:
        for name, line in imported(module, TRANSPORTS[module]):
            if name.split(".")[0] == "hfg":
                place = home(name)
                assert place is not None, f"{module}:{line} imports {name}, which stands on no floor"
                assert FLOORS[place] <= 1, f"{module}:{line} imports {name} (floor {FLOORS[place]})"


def test_the_oracle_shares_no_code_with_the_accused() -> None:
    for module in [name for name in HFG if name.startswith("hfg.testing.reference")]:
        for name, line in imported(module, HFG[module]):
            shared = name.startswith(ORACLE_MUST_NOT_SHARE)
            assert not shared, (
                f"{module}:{line} imports {name}: an oracle that shares code with the engine proves nothing"
            )


def test_the_table_names_only_what_exists_or_is_planned() -> None:
    planned = {"hfg.files", "hfg.recording"}
    named = {*FLOORS}.union(*WINGS.values())
    missing = {name for name in named if name not in HFG} - planned
    assert not missing, f"FLOORS names modules that are gone: {sorted(missing)}"


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("import asyncio", "only floor 5 and above may wait"),
        ("from anyio.abc import TaskGroup", "only floor 5 and above may wait"),
        ("from ..engine import run", "imports hfg.engine"),
        ("from hfg import engine", "imports hfg.engine"),
        ("def f():\n    import hfg.engine.runtime.plan", "imports hfg.engine.runtime.plan"),
        ("from hfg import Graph", "imports hfg (floor 8)"),
        ("import hfg_transports", "never by import"),
    ],
)
def test_the_walk_sees_every_way_to_import(tmp_path: Path, line: str, sentence: str) -> None:
    """A walk that finds nothing would be green for ever."""
    file = tmp_path / "structure.py"
    file.write_text(line, encoding="utf-8")
    assert sentence in "".join(violations("hfg.graph.graph", file))


def fields_of(module: str, name: str) -> set[str]:
    """Return the fields that a dataclass declares."""
    for one in ast.walk(parsed(HFG[module])):
        if isinstance(one, ast.ClassDef) and one.name == name:
            return {part.target.id for part in one.body if isinstance(part, ast.AnnAssign)}  # type: ignore[union-attr]
    raise AssertionError(f"{module} has no class {name}")


WORKERS_FIELDS = {
    field
    for module, name in (("vertex", "Vertex"), ("node_state", "NodeState"), ("running_node", "RunningNode"))
    for field in fields_of(f"hfg.engine.model.{module}", name)
} - {"path", "index", "type", "events", "core"}
"""Other classes have fields of the names that are left out."""
EDGES_FIELDS = {"token", "held", "sent", "dropped", "drained", "ended", "live", "working", "deepest", "full", "grown"}


HOT = "hfg.engine.fusion.slots"
"""A call of a slot is so short that one more call for each field would cost a tenth of it."""


def test_fast_paths_change_nodes_by_the_names_of_their_transitions() -> None:
    for module in [name for name in HFG if name.startswith("hfg.engine.fusion") and name != HOT]:
        for one in ast.walk(parsed(HFG[module])):
            if isinstance(one, ast.Attribute) and isinstance(one.ctx, ast.Store | ast.Del):
                is_nodes = isinstance(one.value, ast.Name) and one.value.id not in ("self", "core", "edge")
                assert not (is_nodes and one.attr in WORKERS_FIELDS), (
                    f"{module}:{one.lineno} writes {ast.unparse(one)}: give `RunningNode` a transition"
                )


def test_the_rules_change_nodes_and_edges_by_the_names_of_their_transitions() -> None:
    """A field that many modules write is kept in order by none; only listeners count for the edges they stand for."""
    for module in [name for name in HFG if name.startswith("hfg.engine.rules")]:
        if module == "hfg.engine.rules.listening":
            continue
        for one in ast.walk(parsed(HFG[module])):
            if isinstance(one, ast.Attribute) and isinstance(one.ctx, ast.Store | ast.Del):
                is_own = isinstance(one.value, ast.Name) and one.value.id in ("self", "core")
                foreign = one.attr in WORKERS_FIELDS | EDGES_FIELDS | {"missing"}
                assert is_own or not foreign, (
                    f"{module}:{one.lineno} writes {ast.unparse(one)}: give its class a transition"
                )
