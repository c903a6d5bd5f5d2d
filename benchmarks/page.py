"""Make the tables of docs/speed.md from the lines that the benchmarks wrote: `python -m benchmarks.page [FOLDER]`.

The lines of the suites found in the folder replace those in docs/speed.jsonl, which stands beside the page as its
source; then everything between `<!-- NAME -->` and `<!-- end -->` is written anew. Prose is not changed, so it must not
contain figures.
"""

from __future__ import annotations

import argparse
import json
import re
import statistics
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from benchmarks import bench_goals, bench_links, bench_start, bench_studio
from benchmarks.figures import Records, caption, cell, figure, measured_on
from benchmarks.goals import Goal, judge
from benchmarks.measure import ROOT, Record, read
from benchmarks.works import WORKS

__all__ = ["PAGE", "SOURCE", "TABLES", "render"]

RESULTS = ROOT / "benchmarks" / "results"
PAGE = ROOT / "docs" / "speed.md"
SOURCE = ROOT / "docs" / "speed.jsonl"
BLOCK = re.compile(r"(?P<begin><!-- (?P<name>[a-z]+) -->\n).*?(?P<end><!-- end -->)", re.DOTALL)
OURS = "hfg, functions"
SIZES = ("100 B", "6.2 MB")
FIGURES = {"rate": "a second", "latency": "one way, µs"}


def table(head: list[str], rows: list[list[str]]) -> str:
    """A Markdown table; all columns but the first are figures."""
    lines = [head, ["---", *["---:"] * (len(head) - 1)], *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def matrix(records: Records, write: Callable[[Record], str] = cell) -> str:
    """Rows and columns from the names of the cases."""
    names = [case.split(" | ") for case in records]
    rows = list(dict.fromkeys(row for row, _ in names))
    columns = [work for work in WORKS if any(column == work for _, column in names)]
    body = [
        [row, *(write(records[case]) if (case := f"{row} | {work}") in records else "" for work in columns)]
        for row in rows
    ]
    return table(["", *(WORKS[work].title for work in columns)], body)


def kinds(records: Records) -> str:
    """Each kind of node and edge."""
    return f"{matrix(records)}\n\n{caption(records)}"


def peers(records: Records) -> str:
    """All participants at the works they can do."""
    return f"{matrix(records)}\n\n{caption(records)}"


def ratios(records: Records) -> str:
    """The others' times divided by those of hfg's functions, or of its states, in the same run."""
    own: dict[str, float] = {}
    for case, record in records.items():  # the first of hfg's rows that does the work
        row, work = case.split(" | ")
        if row.startswith("hfg"):
            own.setdefault(work, record.median)
    others = {case: record for case, record in records.items() if case.split(" | ")[0] != OURS}
    return matrix(others, lambda record: figure(record.median / own[record.case.split(" | ")[1]]))


def shape(records: Records) -> str:
    """From one node to many."""
    names = [case.split(" | ") for case in records]
    lengths = list(dict.fromkeys(length for _, length in names))
    rows = [
        [
            f"{what}, {records[f'{what} | {first}'].unit.replace('us', 'µs')}",
            *(cell(found) if (found := records.get(f"{what} | {length}")) else "" for length in lengths),
        ]
        for what, first in dict(reversed(names)).items()
    ]
    return f"{table(['nodes', *(f'{int(length):,}' for length in lengths)], rows[::-1])}\n\n{caption(records)}"


def threads(records: Records) -> str:
    """One thread group against two."""
    one, two = records.values()
    rows = [[name, cell(record)] for name, record in records.items()]
    rows.append(["how many times as fast", figure(one.median / two.median)])
    return f"{table(['', 's'], rows)}\n\n{caption(records)}"


def goals(records: Records, of: Sequence[Goal] = bench_goals.GOALS) -> str:
    """What is to be reached: in each round ours over the other's, the median of that, and whether it is enough."""
    rows = []
    for goal in of:
        if all(side.case in records for side in goal.sides):
            verdict = judge(goal, records)
            sign = " %" if goal.alone else ""
            ends = f"{figure(min(verdict.judged))} to {figure(max(verdict.judged))}"
            rows.append([goal.name, figure(verdict.median) + sign, ends, f"{goal.at_most:.3g}{sign}"])
    return f"{table(['ours / theirs', 'median', 'lowest to highest', 'at most'], rows)}\n\n{caption(records)}"


def links(records: Records) -> str:
    """From one process to another, nothing lost."""
    return crossing(records, "")


def leaky(records: Records) -> str:
    """From one process to another, without waiting."""
    return crossing(records, "leaky, ")


def crossing(records: Records, kind: str) -> str:
    """Return how many arrive a second, and how old they are when they come slowly: two columns for each size."""
    titles = {f"{size}, {what}": f"{size}: {title}" for size in SIZES for what, title in FIGURES.items()}
    named = {tuple(case.split(" | ")): record for case, record in records.items()}
    columns = [kind + column for column in titles if any(found == kind + column for _, found in named)]
    rows = list(dict.fromkeys(row for row, column in named if column in columns))
    body = [
        [row, *(arrival(found) if (found := named.get((row, column))) else "" for column in columns)] for row in rows
    ]
    head = ["", *(titles[column.removeprefix(kind)] for column in columns)]
    shown = {case: record for case, record in records.items() if case.split(" | ")[1] in columns}
    return f"{table(head, body)}\n\n{caption(shown)}"


def arrival(record: Record) -> str:
    """A rate with its spread and, where nobody waits, how old they are; or a latency; and what was lost, if any was."""
    figures = {name: statistics.median(values) for name, values in record.figures.items()}
    if "wall" in figures:
        text = f"{1e6 / figures['wall']:,.0f} ({record.spread:.0%})"
    else:
        text = f"{figure(figures['p50'])} / {figure(figures['p99'])} ({record.spread:.0%})"
    if figures["lost"] <= 0:
        return text
    age = f", {figure(figures['p50'])} µs old" if "wall" in figures else ""
    return f"{text}{age}; {figures['lost']:.1f} % lost"


def apart(records: Records) -> str:
    """Heavy work on two cores, and activity over a cut."""
    work = records["examples/three_processes.py | seconds"]
    moves = records["activity over an edge that is cut | one way"]
    one = statistics.median(work.figures["one process"])
    times = statistics.median(b / a for a, b in zip(work.values, work.figures["one process"], strict=True))
    rows = [
        [f"{work.size} pictures in three processes, s", cell(work)],
        ["the same graph in one process, s", figure(one)],
        ["how many times as fast", figure(times)],
        ["activity over an edge that is cut, one way, µs", cell(moves)],
    ]
    return f"{table(['', ''], rows)}\n\n{caption({record.case: record for record in (work, moves)})}"


def budgets(records: Records) -> str:
    """What the page of the studio takes, and what it may take."""
    rows = []
    for goal in bench_studio.GOALS:
        if goal.ours.case in records:
            verdict, unit = judge(goal, records), records[goal.ours.case].unit
            rows.append([goal.name, f"{figure(verdict.ours)} {unit}", f"{figure(verdict.peer)} {unit}"])
    return f"{table(['', 'measured', 'at most'], rows)}\n\n{caption(records)}"


def seconds(records: Records) -> str:
    """Cases in seconds: a day of virtual time, graph files."""
    return f"{table(['', 's'], [[name, cell(record)] for name, record in records.items()])}\n\n{caption(records)}"


def profile(records: Records) -> str:
    """Shares of the hop, and the parts that can be measured separately."""
    parts = [record for record in records.values() if record.unit == "%"]
    times = [record for record in records.values() if record.unit != "%"]
    hop = times[0].median
    rows = [
        [
            part.case,
            f"{part.median:.1f} %",
            f"{min(part.values):.1f} to {max(part.values):.1f}",
            figure(part.median / 100 * hop),
        ]
        for part in sorted(parts, key=lambda part: -part.median)
    ]
    note = (
        f"*{measured_on(times[0])}; fresh processes: {len(times[0].values)}, of about {parts[0].size:,} samples each.*"
    )
    alone = table(["measured beside it", "µs"], [[record.case, cell(record)] for record in times])
    shares = table(["part", "share", "in all runs", "µs a hop"], rows)
    return f"{shares}\n\n{alone}\n\n{note}"


TABLES: dict[str, tuple[str, Callable[[Records], str]]] = {
    "kinds": ("bench_kinds", kinds),
    "peers": ("bench_peers", peers),
    "ratios": ("bench_peers", ratios),
    "shape": ("bench_shape", shape),
    "threads": ("bench_threads", threads),
    "goals": ("bench_goals", goals),
    "start": ("bench_start", seconds),
    "startgoals": ("bench_start", lambda records: goals(records, bench_start.GOALS)),
    "day": ("bench_virtual_day", seconds),
    "files": ("bench_files", seconds),
    "profile": ("profile_hop", profile),
    "links": ("bench_links", links),
    "leaky": ("bench_links", leaky),
    "linkgoals": ("bench_links", lambda records: goals(records, bench_links.GOALS)),
    "studio": ("bench_studio", budgets),
    "apart": ("bench_links", apart),
}
"""What may stand in `<!-- NAME -->`: the suite it needs, and who writes it."""


def render(page: str, suites: Mapping[str, Records]) -> str:
    """Return the page with new tables; a table whose suite was not measured is unchanged."""

    def block(match: re.Match[str]) -> str:
        suite, write = TABLES[match["name"]]
        if suite not in suites:
            return match[0]
        return f"{match['begin']}\n{write(suites[suite])}\n\n{match['end']}"

    return BLOCK.sub(block, page)


def main() -> int:
    """Take over what was measured and write the page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.page", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folder", nargs="?", type=Path, default=RESULTS, help="where --json wrote; benchmarks/results")
    folder = parser.parse_args().folder
    found = sorted(folder.glob("*.jsonl"))
    if not found:
        parser.error(f'there is no .jsonl in "{folder}": run `make bench` first')
    shown = {suite for suite, _ in TABLES.values()}
    lines = [line for file in found for line in file.read_text(encoding="utf-8").splitlines()]
    fresh = [line for line in lines if json.loads(line)["suite"] in shown]
    replaced = {json.loads(line)["suite"] for line in fresh}
    before = SOURCE.read_text(encoding="utf-8").splitlines() if SOURCE.exists() else []
    kept = [line for line in before if json.loads(line)["suite"] not in replaced]
    SOURCE.write_text("".join(f"{line}\n" for line in kept + fresh), encoding="utf-8")
    PAGE.write_text(render(PAGE.read_text(encoding="utf-8"), read(kept + fresh)), encoding="utf-8")
    print(f"{PAGE.relative_to(ROOT)}: {', '.join(sorted(replaced))} made anew")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
