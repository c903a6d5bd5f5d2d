"""A graph that runs in several processes is edited part by part, and nothing on its way is lost (rules R4, L1, L2)."""

from __future__ import annotations

import asyncio
import itertools
from pathlib import Path
from typing import Any

import pytest

import hfg
from hfg import commands as c
from hfg.errors import GraphError, HfgError, RunError, UsageError
from hfg.parts.steering.serving import Serving
from hfg.trace import TokenSent
from tests.parts.mortal import mortal_parts
from tests.parts.test_from_outside import Scaler, through, with_run
from tests.support.edits import drawn

HERE = "tests.parts.test_edits"


@hfg.node
def more(value: int, *, by: int = 100) -> int:
    """Add."""
    return value + by


class Refuses(hfg.Node):
    """Cannot be set up."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def setup(self) -> None:
        raise ValueError("no device")

    def process(self, value: int) -> int:
        return value


def line(*, ledger: bool | str = False) -> hfg.Graph:
    """Two nodes in the main part, three in another one, with edges from each to the next: 2 (v + 1 + 10) + 100."""
    graph = hfg.Graph("line")
    graph.group("far", process=True, ledger=ledger)
    nodes: list[Any] = [
        graph.add(more(by=1), name="a"),
        graph.add(more(by=10), name="b"),
        graph.add(Scaler(), name="scaler", group="far"),
        graph.add(more(by=0), name="mid", group="far"),
        graph.add(more(by=100), name="raised", group="far"),
    ]
    graph.connect(graph.input("in", int), nodes[0].value)
    for one, other in itertools.pairwise(nodes):
        graph.connect(one.out, other.value)
    graph.connect(nodes[-1].out, graph.output("out", int))
    return graph


def between(source: str, target: str, name: str, group: str, by: int) -> tuple[Any, ...]:
    """Put a node that adds between two."""
    return (
        c.Disconnect(f"{source}.out", f"{target}.value"),
        c.Add(f"{HERE}:more", name, parameters={"by": by}, options={"group": group}),
        c.Connect(f"{source}.out", f"{name}.value"),
        c.Connect(f"{name}.out", f"{target}.value"),
    )


IN_MAIN = between("a", "b", "extra", "loop", 1000)
FAR = between("scaler", "mid", "extra", "far", 1000)


@pytest.mark.rule("R4", "L1")
@pytest.mark.parametrize(("commands", "then"), [(IN_MAIN, 2122), (FAR, 1122)], ids=["main", "far"])
def test_a_node_that_comes_works_in_the_part_to_which_it_comes(commands: Any, then: int) -> None:
    async def body(run: hfg.Run) -> list[int]:
        first = await through(run, 0)
        await run.edit(*commands)
        second = await through(run, 0)
        await run.undo()
        third = await through(run, 0)
        await run.redo()
        return first + second + third + await through(run, 0)

    assert with_run(line(), body) == [122, then, 122, then]


@pytest.mark.rule("R4", "L1", "P8")
def test_edits_of_several_parts_are_one_history() -> None:
    async def body(run: hfg.Run) -> list[int]:
        found = []
        await run.edit(*FAR)
        await run.edit(c.SetParameter("extra.by", 2000))
        await run.edit(c.SetParameter("a.by", 0))
        await run.edit(c.Rename("a", "other"))
        found += await through(run, 0)
        for _ in range(4):
            await run.undo()
            found += await through(run, 0)
        for _ in range(4):
            await run.redo()
        run.set("extra.by", 3000)
        run.set("other.by", 1)
        found += await through(run, 0)
        return found

    assert with_run(line(), body) == [2120, 2120, 2122, 1122, 122, 3122]


@pytest.mark.rule("R4", "L1", "L2")
@pytest.mark.parametrize("at", range(1, 12, 2))
def test_tokens_under_way_are_neither_lost_nor_doubled_nor_out_of_order_when_a_part_is_edited(at: int) -> None:
    """Each value goes the old way or the new one, and from some value on all go the new one."""
    sent = list(range(40))

    async def body(run: hfg.Run) -> list[int]:
        found: list[int] = []

        async def read() -> None:
            async for value in run.read("out"):
                found.append(value)
                if len(found) == len(sent):
                    return

        reading = asyncio.create_task(read())
        editing = None
        async with run.feed("in", end=False) as feed:
            for value in sent:
                if value == at:
                    editing = asyncio.create_task(run.edit(*FAR))
                if value == at + 20:
                    assert editing is not None
                    await editing
                    editing = asyncio.create_task(run.undo())
                await feed.send(value)
        assert editing is not None
        await editing
        await reading
        return found

    found = with_run(line(), body)
    plain = [2 * (value + 11) + 100 for value in sent]
    ways = [got - old for got, old in zip(found, plain, strict=True)]
    assert set(ways) == {0, 1000}
    assert [way for way, _ in itertools.groupby(ways)] == [0, 1000, 0]


@pytest.mark.rule("R4", "L1", "L2")
@pytest.mark.parametrize(
    ("commands", "said"),
    [
        ([c.Disconnect("b.out", "scaler.value")], '"b.out -> scaler.value" leads from one process to another'),
        ([c.Connect("a.out", "raised.value")], "."),
        (
            [c.Remove("scaler"), c.Remove("mid"), c.Remove("raised")],
            "leads from one process to another|would have no node left",
        ),
        ([*FAR, c.SetParameter("a.by", 2)], 'concerns group "far" and the main part at once'),
        ([c.Move("b", group="far")], "."),
        ([c.Disable("mid")], "each incoming token yields exactly one on each leaving edge"),
        ([c.Add(f"{HERE}:more", "new", options={"group": "other"})], "."),
        ([c.SetEdge("b.out", "scaler.value", buffer=20)], "leads from one process to another"),
        ([c.Replace("mid", f"{HERE}:Refuses")], "no device"),
        ([c.Replace("raised", f"{HERE}:more")], "leads from one process to another"),
        ([c.Remove("nobody")], "nobody"),
        ([c.Enclose(("mid",), "box")], 'subgraph "box" is known to all processes'),
        ([c.Enclose(("a",), "box")], 'subgraph "box" is known to all processes'),
        ([c.Rename("mid", "middle")], '"mid" is known to other processes by its path'),
        ([c.Copy("mid", "mid2")], '"mid" may have parameter values in another process that are not drawn here'),
    ],
)
def test_what_no_run_in_several_processes_can_follow_is_refused_and_changes_nothing(commands: Any, said: str) -> None:
    async def body(run: hfg.Run) -> list[int]:
        before = run.graph.as_commands()
        with pytest.raises(HfgError, match=said):
            await run.edit(*commands)
        assert run.graph.as_commands() == before
        with pytest.raises(UsageError, match="nothing to undo"):
            await run.undo()
        return await through(run, 0)

    assert with_run(line(), body) == [122]


@pytest.mark.rule("R4", "L2")
def test_the_structure_of_a_part_with_a_ledger_stays_and_its_parameters_do_not(tmp_path: Path) -> None:
    graph = line(ledger=str(tmp_path / "far.ledger"))

    async def body(run: hfg.Run) -> list[int]:
        with pytest.raises(UsageError, match='group "far" has a ledger'):
            await run.edit(*FAR)
        await run.edit(*IN_MAIN)
        await run.edit(c.SetParameter("mid.by", 5))
        return await through(run, 0)

    assert with_run(graph, body) == [2127]


@pytest.mark.rule("R3", "R4", "L2")
def test_a_part_that_is_paused_cannot_be_emptied_for_an_edit() -> None:
    async def body(run: hfg.Run) -> list[int]:
        run.pause()
        await run.wait_paused()
        with pytest.raises(UsageError, match=r'group "far" is emptied of tokens .*run.resume\(\) first'):
            await run.edit(*FAR)
        await run.edit(*IN_MAIN)
        await run.edit(c.SetParameter("raised.by", 0))
        run.resume()
        return await through(run, 0)

    assert with_run(line(), body) == [2022]


@pytest.mark.rule("R4", "L1")
def test_who_is_cancelled_while_another_process_edits_leaves_all_drawings_alike() -> None:
    async def body(run: hfg.Run) -> list[int]:
        editing = asyncio.create_task(run.edit(*FAR))
        await asyncio.sleep(0)
        editing.cancel()
        with pytest.raises(asyncio.CancelledError):
            await editing
        assert "extra" in run.graph.nodes
        found = await through(run, 0)
        await run.undo()
        return found + await through(run, 0)

    assert with_run(line(), body) == [1122, 122]


@pytest.mark.rule("R4", "L1")
def test_an_edit_from_before_the_run_is_not_undone_in_it() -> None:
    graph = line()
    graph.edit(c.SetParameter("a.by", 5))

    async def body(run: hfg.Run) -> None:
        with pytest.raises(UsageError, match="made before the run started"):
            await run.undo()

    with_run(graph, body)


@pytest.mark.rule("R7", "L1")
def test_taps_statistics_and_the_report_know_a_node_that_has_come() -> None:
    async def body(run: hfg.Run) -> None:
        await run.edit(*FAR)
        tap = run.tap("extra.out")
        await through(run, 0, 1)
        await run.refresh()
        assert run.statistics().nodes["extra"].firings == 2
        assert list(run.statistics().nodes)[-1] == "extra"
        seen = await anext(tap)
        assert seen.value == 1022

    with_run(line(), body)


# --- when a process dies ---


@pytest.fixture
def parts(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """The parts of the next run, by name."""
    return mortal_parts(monkeypatch)


@pytest.mark.rule("R4", "L2", "L3")
def test_the_next_life_of_a_part_is_as_it_was_edited(parts: dict[str, Any]) -> None:
    async def body(run: hfg.Run) -> list[int]:
        await run.edit(*FAR)
        await run.edit(*between("a", "b", "more_here", "loop", 1))
        parts["far"].kill()
        found = await through(run, 0)
        with pytest.raises(UsageError, match="before one of its processes did"):
            await run.undo()
        await run.edit(c.SetParameter("extra.by", 0))
        found += await through(run, 0)
        await run.undo()
        return found + await through(run, 0)

    assert with_run(line(), body) == [1124, 124, 1124]


@pytest.mark.rule("R4", "L2", "L3")
@pytest.mark.parametrize("dies_s", [-0.2, -0.11, -0.1, -0.05, -0.001, 0.0, 0.001, 0.003, 0.005, 0.008, 0.012, 0.02])
def test_an_edit_of_a_part_that_dies_was_made_or_not_and_nothing_is_lost(parts: dict[str, Any], dies_s: float) -> None:
    """The values go on meanwhile; each goes the old way or the new one, and whoever asked knows which it is by now."""
    sent = list(range(60))

    async def body(run: hfg.Run) -> tuple[list[int], bool]:
        reading = asyncio.create_task(through(run, *sent))
        await asyncio.sleep(0.05)
        if dies_s < 0:
            parts["far"].kill()
            await asyncio.sleep(-dies_s)
        editing = asyncio.create_task(run.edit(*FAR))
        if dies_s >= 0:
            await asyncio.sleep(dies_s)
            parts["far"].kill()
        async with asyncio.timeout(10.0):
            (error,) = await asyncio.gather(editing, return_exceptions=True)
        done = error is None
        assert done or (isinstance(error, RunError) and "the edit was not made" in str(error))
        assert ("extra" in run.graph.nodes) is done
        found = await reading
        return [*found, *await through(run, 1000)], done

    found, done = with_run(line(), body)
    plain = [2 * (value + 11) + 100 for value in [*sent, 1000]]
    ways = [got - old for got, old in zip(found, plain, strict=True)]
    assert [way for way, _ in itertools.groupby(ways)] in ([[0, 1000], [1000]] if done else [[0]])
    assert ways[-1] == (1000 if done else 0)


@pytest.mark.rule("R4", "P8", "L2")
def test_what_was_set_before_an_edit_does_not_come_back_with_the_next_life(parts: dict[str, Any]) -> None:
    async def body(run: hfg.Run) -> list[int]:
        run.set("mid.by", 5)
        run.set("raised.by", 0)
        await run.edit(c.SetParameter("mid.by", 7))
        found = await through(run, 0)
        parts["far"].kill()
        found += await through(run, 0)
        run.set("mid.by", 9)
        parts["far"].kill()
        return found + await through(run, 0)

    assert with_run(line(), body) == [29, 29, 31]


class Said(hfg.Node):
    """Is told something."""

    @hfg.slot
    def hear(self) -> None:
        """Hear it."""


class Slow(hfg.Node):
    """Takes its time to be torn down, and does not answer each value."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    told = hfg.Event(int)

    def process(self, value: int) -> int:
        self.told.trigger(value)
        return value

    async def teardown(self) -> None:
        await asyncio.sleep(5.0)


@pytest.mark.rule("R4", "R7", "X3")
def test_an_edit_is_over_when_it_holds_and_the_trace_is_whole(caplog: pytest.LogCaptureFixture) -> None:
    """Nodes that are gone are torn down behind it; of what has come nothing is seen that nobody can read."""
    graph = hfg.Graph()
    graph.group("far", process=True)
    first: Any = graph.add(more(by=0), name="first", group="far")
    slow: Any = graph.add(Slow(), name="slow", group="far", on_error="skip")
    last: Any = graph.add(more(by=0), name="last", group="far")
    graph.connect(graph.input("in", int), first.value)
    graph.connect(first.out, slow.value)
    graph.connect(slow.out, last.value)
    graph.connect(last.out, graph.output("out", int))
    seen: list[Any] = []

    async def body(run: hfg.Run) -> None:
        run.trace(lambda event: seen.append(event))
        await through(run, 1)
        before = run.elapsed()
        await run.edit(
            c.Remove("slow"),
            c.Add(f"{HERE}:more", "new", options={"group": "far", "on_error": "skip"}),
            c.Connect("first.out", "new.value"),
            c.Connect("new.out", "last.value"),
        )
        assert run.elapsed() - before < 1.0
        await through(run, 2)
        await asyncio.sleep(6.0)

    with_run(graph, body)
    sent = [one for one in seen if isinstance(one, TokenSent) and one.edge == "new.out -> last.value"]
    assert [one.token.value for one in sent] == [102]
    assert "callback" not in caplog.text


@pytest.mark.rule("G1", "L1")
def test_a_part_without_nodes_is_none_also_if_an_edge_leads_to_an_empty_subgraph_in_its_group() -> None:
    graph = hfg.Graph()
    graph.group("far", process=True)
    graph.edit(c.AddSubgraph("box", options={"group": "far"}))
    box: Any = graph["box"]
    graph.connect(box.activated, graph.add(Said(), name="said").hear)
    assert hfg.run(graph, clock="virtual").outcome == "done"


# --- more than two processes ---


def row() -> hfg.Graph:
    """Two processes in a row, each with two nodes."""
    graph = hfg.Graph("row")
    port: Any = graph.input("in", int)
    for group in ("one", "two"):
        graph.group(group, process=True)
        for name in ("first", "last"):
            node: Any = graph.add(more(by=1), name=f"{name}_{group}", group=group)
            graph.connect(port, node.value)
            port = node.out
    graph.connect(port, graph.output("out", int))
    return graph


@pytest.mark.rule("R4", "L1")
def test_each_of_several_processes_is_edited_and_all_draw_it(monkeypatch: pytest.MonkeyPatch) -> None:
    graphs: list[hfg.Graph] = []
    init = Serving.__init__

    def noted(self: Serving, graph: hfg.Graph, *rest: Any) -> None:
        graphs.append(graph)
        init(self, graph, *rest)

    monkeypatch.setattr(Serving, "__init__", noted)

    def alike(run: hfg.Run) -> bool:
        told = drawn(run.graph, identity=False)
        return [drawn(graph, identity=False) == told for graph in graphs] == [True, True]

    async def body(run: hfg.Run) -> list[int]:
        found = []
        for group, by in (("one", 100), ("two", 1000)):
            await run.edit(*between(f"first_{group}", f"last_{group}", f"mid_{group}", group, by))
            found += await through(run, 0)
            assert alike(run)
        for again in (run.undo, run.undo, run.redo):
            await again()
            found += await through(run, 0)
            assert alike(run)
        return found

    assert with_run(row(), body) == [104, 1104, 104, 4, 104]


@pytest.mark.rule("R4", "L1")
def test_an_edit_that_one_process_cannot_even_draw_is_refused_everywhere(monkeypatch: pytest.MonkeyPatch) -> None:
    async def body(run: hfg.Run) -> list[int]:
        def cannot(graph: hfg.Graph, commands: Any) -> None:
            raise GraphError('node type "tests.parts.test_edits:more" is not installed here')

        monkeypatch.setattr("hfg.parts.steering.serving.try_to_draw", cannot)
        with pytest.raises(GraphError, match="is not installed here"):
            await run.edit(*between("first_one", "last_one", "mid", "one", 100))
        assert "mid" not in run.graph.nodes
        return await through(run, 0)

    assert with_run(row(), body) == [4]
