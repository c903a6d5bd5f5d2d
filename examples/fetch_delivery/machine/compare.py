"""Count and measure both robots, that with the activity graph and that with the state machine.

    python -m examples.fetch_delivery.machine.compare                  both tables, in Markdown; takes minutes
    python -m examples.fetch_delivery.machine.compare --minutes 0      what can be counted without a run
    python -m examples.fetch_delivery.machine.compare --page FILE      both, into the page docs/machine-or-activity.md

Every mission runs in a process of its own, one after another. Processor time is that of the whole process: arena,
cameras and perception, which are the same for both, and mission control.
"""

from __future__ import annotations

import argparse
import ast
import inspect
import io
import re
import tokenize
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Final, Literal, TypeAlias

import hfg
from examples.fetch_delivery import judging, laws
from examples.fetch_delivery.machine import driving as plain_driving
from examples.fetch_delivery.machine import mission as machine_mission
from examples.fetch_delivery.machine import robot as machine_robot
from examples.fetch_delivery.mission import build, bundles, driving, errands, looking, robot, visiting
from examples.fetch_delivery.perception import following, planning
from hfg.graph.flat import ROOT, FlatEdge, flatten
from hfg.tuning import Evaluation, Finished, mean_of, paired, sweep

Sort: TypeAlias = Literal["activity", "machine"]
KINDS: Final[dict[Sort, type[robot.Robot]]] = {"activity": robot.Robot, "machine": machine_robot.Robot}
SEEDS: Final = (1, 2, 3, 4)
_LAWS: Final = ("MoveRobot", "PositionToTarget", "MoveToObstacle")  # nodes of mission.driving; the rest of it is order


# --- lines ---


def code_lines(module: ModuleType, only: Iterable[str] = (), without: Iterable[str] = ()) -> int:
    """Count lines that hold code, as they stand in the file: no comments, no docstrings, nothing blank, no imports.

    Args:
      module: whose lines.
      only: classes, functions and variables that count; by default all.
      without: those that do not.

    Raises:
      ValueError: if the module has no such name.
    """
    source = inspect.getsource(module)
    tree = ast.parse(source)
    named = {name: statement for statement in tree.body for name in _names(statement)}
    for name in (*only, *without):
        if name not in named:
            raise ValueError(f"{module.__name__} has no {name}")
    counted = [named[name] for name in only] or [
        statement
        for statement in tree.body
        if not isinstance(statement, ast.Import | ast.ImportFrom) and not set(_names(statement)) & set(without)
    ]
    skipped = {line for node in ast.walk(tree) for line in _docstring(node)}
    code = {line for token in _tokens(source) for line in range(token.start[0], token.end[0] + 1)} - skipped
    return sum(len(code & set(_span(statement))) for statement in counted)


def _names(statement: ast.stmt) -> list[str]:
    if isinstance(statement, ast.Assign):
        return [target.id for target in statement.targets if isinstance(target, ast.Name)]
    if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
        return [statement.target.id]
    return [statement.name] if isinstance(statement, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) else []


def _docstring(node: ast.AST) -> range:
    if not isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
        return range(0)
    return _span(node.body[0]) if ast.get_docstring(node) is not None else range(0)


def _span(statement: ast.stmt) -> range:
    decorators: list[ast.expr] = getattr(statement, "decorator_list", [])
    first = min([statement.lineno, *(one.lineno for one in decorators)])
    return range(first, (statement.end_lineno or first) + 1)


def _tokens(source: str) -> list[tokenize.TokenInfo]:
    idle = (tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER)
    return [token for token in tokenize.generate_tokens(io.StringIO(source).readline) if token.type not in idle]


def lines(sort: Sort) -> dict[str, int]:
    """Count the code of mission control: how the robot drives in a step, and all else, what comes when and why."""
    if sort == "machine":
        drives = code_lines(laws) + code_lines(plain_driving)
        order, wiring = code_lines(machine_mission), code_lines(machine_robot)
        return {"how it drives": drives, "what it does when, and wiring": order + wiring}
    drives = code_lines(laws) + code_lines(driving, only=_LAWS) + code_lines(planning, only=["PlanPath"])
    drives += code_lines(following, only=["FollowPath", "Queue"])
    order = code_lines(driving, without=_LAWS) + code_lines(looking) + code_lines(bundles)
    order += code_lines(visiting) + code_lines(errands)
    order += code_lines(robot, only=["Robot", "NumberWhen"])
    return {"how it drives": drives, "what it does when, and wiring": order}


# --- structure ---


def structure(sort: Sort) -> dict[str, int]:
    """Count what mission control consists of: all of a robot but its perception."""
    flat = flatten(build(kind=KINDS[sort]))
    control = {
        node.index: node
        for node in flat.nodes
        if node.path.startswith("robot_0/") and not node.path.startswith("robot_0/perception/")
    }
    edges = [edge for edge in flat.edges if edge.source.node in control or edge.target.node in control]
    kinds = Counter(_kind(edge) for edge in edges)
    subgraphs = [scope for scope in flat.scopes if set(scope.members) <= control.keys()]
    found = {
        "nodes": len(control),
        "subgraphs": len(subgraphs),
        "edges of data": kinds["data"],
        "edges of signals": kinds["signal"],
        "gates": sum(gate.target in control for gate in flat.gates),
    }
    if sort == "activity":
        states = {end.node for edge in edges if edge.active for end in (edge.source, edge.target)} - {ROOT}
        options = [node.options for node in control.values()] + [scope.options for scope in subgraphs]
        return found | {
            "states": len(states & control.keys()),
            "states around others": sum(bool(states & set(scope.members)) for scope in subgraphs),
            "transitions": kinds["transition"],
            "time-outs": sum(one.active_for_s is not None for one in options),
        }
    found["edges of signals"] += kinds["transition"]  # the one that begins the mission
    machine = machine_mission.Mission().machine
    names = set(machine.get_nested_state_names())
    around = {name for name in names if any(other.startswith(f"{name}/") for other in names)}
    return found | {
        "states": len(names - around),
        "states around others": len(around),
        "transitions": len(machine.get_nested_transitions()),
        "time-outs": sum(name.endswith(limit) for name in names - around for limit in machine_mission.LIMITS),
    }


def _kind(edge: FlatEdge) -> str:
    if edge.active:
        return "transition"
    return "data" if edge.source.kind == "output" and edge.target.kind in ("input", "parameter") else "signal"


# --- missions ---

SCORES: Final[dict[str, Callable[[Finished], float]]] = {
    "cubes delivered": judging.delivered,
    "delivered wrong": judging.wrong,
    "contact, s": judging.contact_s,
    "lamp on while driving, s": judging.lamp_while_driving_s,
    "pictures a minute": judging.pictures_a_minute,
    "firings a minute without perception": judging.firings_a_minute,
    "processor time a minute, s": judging.processor_s_a_minute,
}


def missions(seeds: Sequence[int], minutes: float) -> dict[Sort, Evaluation]:
    """Let one robot of each sort work by itself with each seed, one run after another."""
    builds: dict[Sort, Callable[[], hfg.Graph]] = {"activity": judging.robot, "machine": judging.machine}
    return {
        sort: sweep(build_one, scores=list(SCORES.values()), seeds=seeds, until_s=60 * minutes, processes=1)
        .rows[0]
        .evaluation
        for sort, build_one in builds.items()
    }


# --- tables ---


def counted() -> str:
    """Return the table of what can be counted."""
    columns: dict[Sort, dict[str, int]] = {}
    for sort in KINDS:
        parts = lines(sort)
        columns[sort] = structure(sort) | {f"lines: {name}": count for name, count in parts.items()}
        columns[sort]["lines in all"] = sum(parts.values())
    rows = [(name, *(str(columns[sort][name]) for sort in KINDS)) for name in columns["activity"]]
    return _table(("mission control", "activity flow graph", "state machine in a node"), rows)


def measured(runs: Mapping[Sort, Evaluation], minutes: float) -> str:
    """Return the table of missions: means, and the difference of runs with the same seed, with 95 % intervals."""
    rows = []
    for number, name in enumerate(SCORES):
        activity, machine = (runs[sort].scores(number) for sort in KINDS)
        rows.append((name, *map(str, (mean_of(activity), mean_of(machine), paired(activity, machine)))))
    seeds = ", ".join(map(str, runs["activity"].runs))
    head = f"one robot, {minutes:g} simulated minutes, seeds {seeds}"
    return _table((head, "activity flow graph", "state machine in a node", "difference"), rows)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, ["---", *["---:"] * (len(head) - 1)], *rows))


def put_into(page: str, name: str, table: str) -> str:
    """Put a table into a page, between its marks.

    Raises:
      ValueError: if the page has no such marks.
    """
    marked = re.compile(rf"(<!-- {name} -->\n).*?(<!-- end -->)", re.DOTALL)
    if not marked.search(page):
        raise ValueError(f"the page has no place for the table {name!r}: <!-- {name} --> and, further on, <!-- end -->")
    return marked.sub(lambda found: f"{found[1]}{table}\n{found[2]}", page, count=1)


def main() -> None:
    arguments = argparse.ArgumentParser(prog="python -m examples.fetch_delivery.machine.compare", description=__doc__)
    arguments.add_argument("--minutes", type=float, default=10.0, help="simulated minutes of each mission; 0 runs none")
    arguments.add_argument("--seeds", type=int, nargs="+", default=SEEDS)
    arguments.add_argument("--page", type=Path, help="write the tables into this page instead of printing them")
    given = arguments.parse_args()
    tables = {"counted": counted()}
    if given.minutes > 0:
        tables["measured"] = measured(missions(given.seeds, given.minutes), given.minutes)
    if given.page is None:
        print("\n\n".join(tables.values()))
        return
    page = given.page.read_text(encoding="utf-8")
    for name, table in tables.items():
        page = put_into(page, name, table)
    given.page.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
