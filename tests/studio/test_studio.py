"""The studio as pages see it: tables and patches, edits with undo, the run, what is refused."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from typing import Annotated, Any

import pytest
from annotated_types import Ge

import hfg
from hfg.graph.structure.level import level_of
from hfg.studio.layouts import Layouts
from hfg.studio.viewing import Shown
from tests.limits import patience
from tests.studio.page import Page, live, studio_of, tables_of
from tests.studio.stories.graphs import mission

HERE = "tests.studio.test_studio"


@hfg.node
def numbers(*, count: int = 3) -> Iterator[int]:
    """Yield numbers."""
    yield from range(count)


@hfg.node
def scaled(value: int, *, factor: Annotated[int, Ge(0)] = 2) -> int:
    """Multiply."""
    return value * factor


@hfg.node
def words(value: str) -> None:
    """Take words."""


@hfg.node
def broken(value: int) -> int:
    """Fail."""
    raise ValueError("no luck")


class Count(hfg.Node):
    """Count calls."""

    calls = hfg.State(0)

    @hfg.slot
    def call(self, value: int) -> None:
        self.calls += 1


class Endless(hfg.Node):
    """Its setup does not end."""

    async def setup(self) -> None:
        await asyncio.Event().wait()


class Ticking(hfg.Node):
    """Send a number whenever it is asked to; never by itself."""

    out = hfg.Event(int)

    @hfg.slot
    def tick(self, value: int) -> None:
        self.out.trigger(value)


def doubling() -> hfg.Graph:
    graph = hfg.Graph("doubling")
    source = graph.add(numbers(), name="source")
    graph.connect(source.out, graph.add(scaled(), name="scaled").value)
    return graph


def ticking() -> hfg.Graph:
    graph = hfg.Graph("ticking")
    graph.connect(graph.add(Ticking(), name="clock").out, graph.add(Count(), name="count").call)
    return graph


def add(path: str, kind: str = "scaled") -> dict[str, Any]:
    return {"do": "Add", "type": f"{HERE}:{kind}", "path": path}


# --- tables and patches ---


def test_a_page_that_joins_gets_all_tables() -> None:
    async def main() -> None:
        page = Page(studio_of(doubling())).join()
        assert page.hello["v"] == 1
        assert page.snapshots == 1
        assert page.agrees()
        node = page.tables["nodes"]["scaled"]
        assert node["parameters"] == {"factor": 2}
        assert [port["path"] for port in node["ports"] if port["used"]] == ["scaled.value"]
        assert page.run["state"] == "rest"

    live(main)


def test_a_page_that_left_before_it_joined_takes_nothing_from_the_next() -> None:
    async def main() -> None:
        studio = studio_of(ticking())
        Page(studio).cut()
        waits = Page(studio)
        await studio.steering.start(stay=True)
        page = Page(studio).join()
        assert page.agrees()
        assert waits.join().agrees()
        await studio.close()

    live(main)


def test_two_pages_see_an_edit_as_the_same_patch_before_it_is_acknowledged() -> None:
    async def main() -> None:
        studio = studio_of(doubling())
        one, other = Page(studio).join(), Page(studio).join()
        answer = await one.edit(add("more"), {"do": "Connect", "source": "scaled.out", "target": "more.value"})
        assert answer == {"t": "ack", "id": 1, "rev": one.rev}
        assert other.rev == one.rev
        assert one.patches[-1] == other.patches[-1]
        assert one.patches[-1]["by"] == one.viewer.number
        assert one.agrees()
        assert other.tables["edges"]["scaled.out -> more.value"]["signal"] is False

    live(main)


def test_a_page_that_was_away_gets_only_what_it_has_missed() -> None:
    async def main() -> None:
        studio = studio_of(doubling())
        one, other = Page(studio).join(), Page(studio).join()
        other.cut()
        await one.edit(add("more"))
        other.come_back()
        assert other.snapshots == 1
        assert other.agrees()

    live(main)


def test_a_page_of_a_studio_that_was_started_again_gets_everything() -> None:
    async def main() -> None:
        graph = doubling()
        page = Page(studio_of(graph)).join()
        await page.edit(add("more"))
        page.cut()
        page.come_back(studio_of(graph))
        assert page.snapshots == 2
        assert page.agrees()

    live(main)


def test_patches_that_are_not_kept_any_more_are_a_snapshot(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hfg.studio.tables._KEPT", 2)

    async def main() -> None:
        studio = studio_of(doubling())
        one, other = Page(studio).join(), Page(studio).join()
        other.cut()
        for value in range(5):
            await one.edit({"do": "SetParameter", "path": "scaled.factor", "value": value})
        other.come_back()
        assert other.snapshots == 2
        assert other.agrees()

    live(main)


def test_a_parameter_that_is_set_changes_the_record_of_its_node_alone() -> None:
    async def main() -> None:
        page = Page(studio_of(doubling())).join()
        await page.edit({"do": "SetParameter", "path": "scaled.factor", "value": 7})
        changed = [(table, key) for table, key, _ in page.patches[-1]["ops"]]
        assert changed == [("nodes", "scaled"), ("studio", "history"), ("studio", "file")]
        assert page.agrees()

    live(main)


def test_what_a_program_edits_in_a_run_is_seen_by_pages() -> None:
    async def main() -> None:
        graph = ticking()
        async with hfg.running(graph) as run:
            studio = studio_of(graph, run=run)
            page = Page(studio).join()
            await run.edit(hfg.commands.Add(f"{HERE}:Count", "more"))
            await page.until(lambda: "more" in page.tables["nodes"])
            assert page.agrees()
            assert page.tables["studio"]["history"]["done"][-1]["by"] == 0
            assert (await page.ask("start"))["code"] == "state"
            await studio.close()

    live(main)


# --- edits ---


def test_undo_and_redo_belong_to_all_pages_and_say_what_they_did() -> None:
    async def main() -> None:
        studio = studio_of(doubling())
        one, other = Page(studio).join(), Page(studio).join()
        await one.edit(add("more"))
        assert other.tables["studio"]["history"]["done"][-1]["text"] == "add more (scaled)"
        assert (await other.ask("undo"))["t"] == "ack"
        assert "more" not in one.tables["nodes"]
        assert one.patches[-1]["text"] == "undo: add more (scaled)"
        assert [step["by"] for step in one.tables["studio"]["history"]["undone"]] == [one.viewer.number]
        await one.ask("redo")
        assert "more" in other.tables["nodes"]
        assert other.agrees()

    live(main)


def test_a_drag_is_one_step_of_the_history() -> None:
    async def main() -> None:
        page = Page(studio_of(doubling())).join()
        for value in (3, 4, 5):
            await page.edit({"do": "SetParameter", "path": "scaled.factor", "value": value}, gesture="drag-1")
        done = page.tables["studio"]["history"]["done"]
        assert [step["text"] for step in done] == ["set scaled.factor to 5"]
        await page.ask("undo")
        assert page.tables["nodes"]["scaled"]["parameters"]["factor"] == 2
        await page.ask("redo")
        assert page.tables["nodes"]["scaled"]["parameters"]["factor"] == 5

    live(main)


def test_drags_of_two_pages_stay_apart() -> None:
    async def main() -> None:
        studio = studio_of(doubling())
        one, other = Page(studio).join(), Page(studio).join()
        await one.edit({"do": "SetParameter", "path": "scaled.factor", "value": 3}, gesture="drag")
        await other.edit({"do": "SetParameter", "path": "scaled.factor", "value": 4}, gesture="drag")
        assert len(one.tables["studio"]["history"]["done"]) == 2

    live(main)


@pytest.mark.parametrize(
    ("command", "code", "says"),
    [
        ({"do": "Remove", "path": "nobody"}, "refused", 'no node "nobody"'),
        ({"do": "SetParameter", "path": "scaled.factor", "value": -1}, "refused", "must be >= 0, got -1"),
        ({"do": "Add", "type": "antigravity:fly", "path": "x"}, "refused", "these commands are refused"),
        ({"do": "Dance", "path": "x"}, "refused", "not a list of commands"),
        ({"do": "Connect", "source": "source.out", "target": "scaled.value"}, "refused", "already"),
    ],
)
def test_a_refused_edit_changes_nothing_and_says_why(command: dict[str, Any], code: str, says: str) -> None:
    async def main() -> None:
        page = Page(studio_of(doubling())).join()
        before = tables_of(page.studio.graph)
        answer = await page.edit(add("more"), command)
        assert (answer["t"], answer["code"]) == ("reject", code)
        assert says in answer["message"]
        assert tables_of(page.studio.graph) == before

    live(main)


def test_types_that_do_not_fit_are_refused_with_their_parts() -> None:
    async def main() -> None:
        page = Page(studio_of(doubling())).join()
        await page.edit(add("words", "words"))
        answer = await page.edit({"do": "Connect", "source": "scaled.out", "target": "words.value"})
        assert answer["code"] == "types"
        assert (answer["path"], answer["expected"], answer["sent"]) == ("words.value", "str", "int")
        assert answer["remedy"] == "put a node between them that converts, or change one of the types"

    live(main)


def test_read_only_pages_may_look_and_not_change() -> None:
    async def main() -> None:
        page = Page(studio_of(doubling(), read_only="You may look, not change.")).join()
        assert page.hello["read_only"] == "You may look, not change."
        for message in ({"t": "edit", "commands": [add("x")]}, {"t": "undo"}, {"t": "start"}, {"t": "save"}):
            assert (await page.ask(**message))["code"] == "read_only"
        for what, args in (
            ("paste", {"text": "graph: hfg.nodes.flow:Pass"}),
            ("amended", {"before": "", "after": ""}),
            ("folder", {"path": ""}),
            ("start", {}),
        ):
            assert (await page.ask("ask", what=what, args=args))["code"] == "read_only"
        assert await page.value("targets", port="source.out")

    live(main)


def test_positions_that_users_gave_are_taken_away_by_arranging_in_one_step() -> None:
    async def main() -> None:
        page = Page(studio_of(doubling())).join()
        note = {"do": "Note", "path": "scaled", "name": "position", "value": [8, 16]}
        await page.edit(note)
        assert page.tables["nodes"]["scaled"]["notes"] == {"position": [8, 16]}
        assert (await page.ask("arrange", level=""))["t"] == "ack"
        assert page.tables["nodes"]["scaled"]["notes"] == {}
        await page.ask("undo")
        assert page.tables["nodes"]["scaled"]["notes"] == {"position": [8, 16]}

    live(main)


# --- targets ---


def by_port(found: Any) -> dict[str, Any]:
    """By port, how an edge fits."""
    return {port: one for one in found["fits"] for port in one["ports"]}


def test_each_port_says_before_the_drop_whether_an_edge_may_lead_there() -> None:
    async def main() -> None:
        graph = doubling()
        graph.add(words(), name="words")
        graph.add(scaled(), name="free")
        page = Page(studio_of(graph)).join()
        found = await page.value("targets", port="source.out")
        assert found["sends"] == "int"
        said = by_port(found)
        assert said["free.value"]["fit"] == "expects"
        assert said["stop"]["fit"] == "takes"
        refused = said["words.value"]
        assert (refused["expected"], refused["sent"]) == ("str", "int")
        assert said["scaled.value"]["fit"] == "refused"
        moving = await page.value("targets", port="source.out", moving="source.out -> scaled.value")
        assert by_port(moving)["scaled.value"]["fit"] == "expects"

    live(main)


def test_what_is_said_of_a_target_is_what_happens_at_the_drop() -> None:
    async def main() -> None:
        graph = doubling()
        kinds: list[hfg.Node] = [words(), scaled(), Count(), Ticking(), broken()]
        for number, node in enumerate(kinds):
            graph.add(node, name=f"n{number}")
        page = Page(studio_of(graph)).join()
        for source in ("source.out", "scaled.out", "n3.out", "start"):
            said = by_port(await page.value("targets", port=source))
            edges = {edge.partition(" -> ")[2]: edge.partition(" -> ")[0] for edge in page.tables["edges"]}
            for target, fit in said.items():
                answer = await page.edit({"do": "Connect", "source": source, "target": target})
                if answer["t"] == "ack":
                    assert fit["fit"] != "refused"
                    await page.ask("undo")
                elif fit["fit"] == "refused":
                    reason = fit["reason"].replace("{port}", f'"{target}"')
                    assert reason.replace("{from}", f'"{edges.get(target)}"') in answer["message"]
                    assert answer["message"].endswith(fit["remedy"])
                else:  # only the whole shows it: a circle in which nothing could ever fire
                    assert answer["message"].startswith("the edit is refused because it would break the graph"), target

    live(main)


def test_a_wire_from_an_input_asks_where_it_may_come_from() -> None:
    async def main() -> None:
        graph = doubling()
        graph.add(scaled(), name="free")
        page = Page(studio_of(graph)).join()
        found = await page.value("targets", port="free.value")
        assert found["expects"] == "int"
        assert by_port(found)["source.out"]["fit"] == "expects"
        assert "free.value" not in by_port(found)

    live(main)


def test_what_is_said_of_the_targets_of_many_nodes_is_short() -> None:
    async def main() -> None:
        graph = hfg.Graph("many")
        source = graph.add(numbers(), name="source")
        before = source.out
        for _ in range(500):
            node = graph.add(scaled())
            graph.connect(before, node.value)
            before = node.out
        page = Page(studio_of(graph)).join()
        found = await page.value("targets", port="source.out")
        assert len(by_port(found)) >= 500
        assert len(found["fits"]) <= 6
        assert len(json.dumps(found)) < 25 * len(by_port(found))

    live(main)


# --- the run ---


def test_a_run_goes_from_rest_to_its_end() -> None:
    async def main() -> None:
        page = Page(studio_of(doubling())).join()
        assert (await page.ask("start"))["t"] == "ack"
        await page.state("ended")
        assert (page.run["outcome"], page.run["number"]) == ("done", 1)
        assert (await page.ask("start"))["t"] == "ack"
        await page.state("ended")
        assert page.run["number"] == 2

    live(main)


def test_a_graph_is_edited_while_it_runs_and_stays_so_afterwards() -> None:
    async def main() -> None:
        page = Page(studio_of(ticking())).join()
        await page.ask("start", stay=True)
        assert page.run["state"] == "running"
        answer = await page.edit(add("more", "Count"), {"do": "Connect", "source": "clock.out", "target": "more.call"})
        assert answer["t"] == "ack"
        assert (await page.ask("trigger", path="clock.tick", value=3))["t"] == "ack"
        run = page.studio.steering.run
        assert run is not None
        await run.wait_quiet()
        assert page.studio.graph["more"].calls == 1
        await page.ask("stop")
        await page.state("ended")
        await page.ask("undo")
        assert "more" not in page.tables["nodes"]
        assert page.agrees()

    live(main)


def test_a_paused_run_makes_steps() -> None:
    async def main() -> None:
        page = Page(studio_of(ticking())).join()
        assert (await page.ask("step"))["code"] == "state"
        await page.ask("start", stay=True)
        assert (await page.ask("step"))["code"] == "state"
        await page.ask("pause")
        assert page.run["state"] == "paused"
        await page.ask("trigger", path="clock.tick", value=1)
        assert (await page.ask("step", path="clock"))["value"] == {"moved": ["clock"], "why_not": ""}
        assert (await page.ask("step"))["value"]["moved"] == ["count"]
        stuck = (await page.ask("step", path="count"))["value"]
        assert stuck["moved"] == []
        assert stuck["why_not"]
        await page.ask("proceed")
        assert page.run["state"] == "running"
        await page.studio.close()

    live(main)


class Slowly(hfg.Node):
    """Take its time."""

    done = hfg.State(0)

    @hfg.slot
    async def work(self, number: int) -> None:
        """Work."""
        await asyncio.sleep(0)
        self.done += number


def test_whoever_asks_for_steps_faster_than_they_are_made_gets_all_of_them() -> None:
    async def main() -> None:
        graph = hfg.Graph("slow")
        graph.add(Slowly(), name="slowly")
        page = Page(studio_of(graph)).join()
        await page.ask("start", stay=True)
        await page.ask("pause")
        for _ in range(3):
            await page.ask("trigger", path="slowly.work", value=1)
        steps = await asyncio.gather(*(page.ask("step", path=path) for path in ("", "slowly", "")))
        assert [step["value"]["moved"] for step in steps] == [["slowly"]] * 3
        assert graph["slowly"].done == 3
        assert page.run["state"] == "paused"
        await page.studio.close()

    live(main)


def test_a_breakpoint_holds_where_its_condition_holds_and_survives_the_run() -> None:
    async def main() -> None:
        page = Page(studio_of(ticking())).join()
        condition = {"op": ">", "value": 4}
        assert (await page.ask("break", path="clock.out", condition=condition))["t"] == "ack"
        assert page.tables["breakpoints"]["clock.out"]["condition"] == "value > 4"
        for _ in range(2):
            await page.ask("start", stay=True)
            for value in (3, 7):
                await page.ask("trigger", path="clock.tick", value=value)
            await page.state("paused")
            assert page.run["why"] == "clock.out"
            assert page.tables["breakpoints"]["clock.out"]["holds"]
            await page.ask("stop")
            await page.state("ended")
        await page.ask("unbreak", path="clock.out")
        assert page.tables["breakpoints"] == {}
        assert (await page.ask("break", path="nobody"))["code"] == "refused"

    live(main)


def test_a_failure_names_the_node_and_offers_commands_that_may_help() -> None:
    async def main() -> None:
        page = Page(studio_of(doubling())).join()
        await page.edit({"do": "Replace", "path": "scaled", "type": f"{HERE}:broken"})
        await page.ask("start")
        await page.state("ended")
        assert page.run["outcome"] == "failed"
        error = page.run["error"]
        assert (error["path"], error["what"]) == ("scaled", "firing 1")
        assert "no luck" in error["traceback"]
        (problem,) = page.tables["problems"].values()
        assert problem["path"] == "scaled"
        disable = next(fix["message"] for fix in problem["fixes"] if fix["text"] == "Disable scaled")
        assert (await page.ask(**disable))["t"] == "ack"
        assert page.tables["nodes"]["scaled"]["enabled"] is False

    live(main)


def test_a_graph_whose_setup_does_not_end_can_be_stopped() -> None:
    async def main() -> None:
        graph = hfg.Graph()
        graph.add(Endless(), name="endless")
        page = Page(studio_of(graph)).join()
        starting = asyncio.ensure_future(page.ask("start"))
        await page.state("starting")
        assert "setting up" in (await page.ask("pause"))["message"]
        assert (await page.ask("stop"))["t"] == "ack"
        assert (await starting)["message"] == "the run was stopped as it began"
        assert (page.run["state"], page.run["outcome"]) == ("ended", "stopped")
        assert (await page.edit({"do": "Remove", "path": "endless"}))["t"] == "ack"

    live(main)


def test_a_graph_that_cannot_run_says_so_and_stays_at_rest() -> None:
    async def main() -> None:
        graph = hfg.Graph()
        graph.add(scaled(), name="lonely")
        graph.connect(graph.add(scaled(), name="a").out, graph["lonely"].value)
        graph.connect(graph["lonely"].out, graph["a"].value)
        page = Page(studio_of(graph)).join()
        answer = await page.ask("start")
        assert answer["t"] == "reject"
        assert page.run["state"] == "ended"
        assert (await page.edit({"do": "Remove", "path": "lonely"}))["t"] == "ack"

    live(main)


def test_mistakes_are_found_without_being_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hfg.studio.following._CHECK_S", 0.0)

    async def main() -> None:
        graph = hfg.Graph()
        graph.connect(graph.add(scaled(), name="a").out, graph.add(scaled(), name="b").value)
        graph.connect(graph["b"].out, graph["a"].value)
        page = Page(studio_of(graph)).join()
        await page.until(lambda: bool(page.tables["problems"]))
        assert {one["source"] for one in page.tables["problems"].values()} == {"check"}
        await page.edit({"do": "Disconnect", "source": "b.out", "target": "a.value"})
        await page.until(lambda: not any(one["severity"] == "error" for one in page.tables["problems"].values()))

    live(main)


def test_the_studio_ends_its_run_and_sends_pages_away() -> None:
    async def main() -> None:
        studio = studio_of(ticking())
        page = Page(studio).join()
        await page.ask("start", stay=True)
        await studio.close()
        assert page.closed == (1001, "the studio has ended")
        assert level_of(studio.graph).whole.run is None
        assert asyncio.all_tasks() == {asyncio.current_task()}

    live(main)


# --- text, names ---


def test_nodes_are_copied_as_text_and_pasted_under_free_names() -> None:
    async def main() -> None:
        page = Page(studio_of(doubling())).join()
        text = (await page.value("text", paths=["source", "scaled"]))["text"]
        commands = (await page.value("paste", text=text))["commands"]
        assert (await page.edit(*commands))["t"] == "ack"
        assert "source_2.out -> scaled_2.value" in page.tables["edges"]
        assert await page.value("free_name", name="scaled") == {"name": "scaled_3"}

    live(main)


def test_a_type_is_described_with_its_widgets() -> None:
    async def main() -> None:
        page = Page(studio_of(doubling())).join()
        found = await page.value("type", reference=f"{HERE}:scaled")
        (factor,) = found["parameters"]
        assert (factor["kind"], factor["low"], factor["default"]) == ("int", 0, 2)
        assert found["ports"][0]["name"] == "value"
        answer = await page.ask("ask", what="type", args={"reference": "antigravity:fly"})
        assert answer["code"] == "refused"

    live(main)


# --- layout ---


def test_a_level_that_a_page_shows_is_laid_out_and_follows_edits() -> None:
    async def main() -> None:
        page = Page(studio_of(doubling()), levels=[""]).join()
        await page.until(lambda: ":" in page.tables["layouts"])
        layout = page.tables["layouts"][":"]
        assert {node["id"] for node in layout["nodes"]} == {"source", "scaled"}
        assert layout["lines"][0]["edges"][0]["label"] == "source.out -> scaled.value"
        note = {"do": "Note", "path": "scaled", "name": "position", "value": [800, 160]}
        await page.edit(note)
        await page.until(lambda: page.tables["layouts"][":"]["fixed"] == ["scaled"])
        (scaled,) = [node for node in page.tables["layouts"][":"]["nodes"] if node["id"] == "scaled"]
        assert (scaled["x"], scaled["y"]) == (800, 160)
        page.say(t="level", path="", open=False)
        assert page.tables["layouts"] == {}

    live(main)


def test_a_level_is_laid_out_even_if_it_is_wanted_just_when_another_one_is_done() -> None:
    async def main() -> None:
        studio = studio_of(mission())
        Page(studio).join()  # now the graph is described
        done: asyncio.Queue[str] = asyncio.Queue()

        class Host:
            tables, graph = studio.tables, studio.graph

            def take_layout(self, key: str, record: object) -> None:
                if done.empty():  # the task ends now, and nobody has seen it yet
                    asyncio.get_running_loop().call_soon(layouts.want, [Shown(), Shown("errand")])
                done.put_nowait(key)

        layouts = Layouts(Host())
        layouts.want([Shown()])
        async with asyncio.timeout(patience(10)):
            assert [await done.get(), await done.get()] == [":", ":errand"]

    live(main)


def test_each_view_of_a_subgraph_is_a_layout_of_its_own() -> None:
    async def main() -> None:
        graph = doubling()
        graph.edit(hfg.commands.Enclose(("scaled",), "box"))
        page = Page(studio_of(graph)).join()
        page.say(t="level", path="box", view="all")
        page.say(t="level", path="gone")
        await page.until(lambda: "all:box" in page.tables["layouts"])
        assert {node["id"] for node in page.tables["layouts"]["all:box"]["nodes"]} == {"box/scaled"}
        await page.edit({"do": "Dissolve", "path": "box"})
        await page.until(lambda: "all:box" not in page.tables["layouts"])

    live(main)


# --- hostile pages ---


def test_a_page_that_asks_for_too_much_has_to_wait_and_others_have_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hfg.studio.budget._SHARE", 0.0)  # nothing is paid back during the test
    monkeypatch.setattr("hfg.studio.budget._MOST_S", 0.01)

    async def main() -> None:
        studio = studio_of(doubling())
        greedy, other = Page(studio).join(), Page(studio).join()
        answers = [await greedy.ask("ask", what="targets", args={"port": "source.out"}) for _ in range(300)]
        assert answers[0]["t"] == "answer"
        assert answers[-1]["code"] == "busy"
        assert (await other.ask("ask", what="targets", args={"port": "source.out"}))["t"] == "answer"

    live(main)


@pytest.mark.parametrize("again", [True, False])
def test_a_page_says_join_first_and_once(again: bool) -> None:
    async def main() -> None:
        page = Page(studio_of(doubling()))
        if again:
            page.join().say(t="join")
        else:
            page.say(t="visible", on=True)
        assert page.closed == (1008, "hfg.studio.v1 begins with one join")

    live(main)


def test_requests_that_are_not_answered_yet_are_bounded() -> None:
    async def main() -> None:
        page = Page(studio_of(ticking())).join()
        async with page.studio.turn:
            asked = [asyncio.ensure_future(page.ask("undo")) for _ in range(150)]
            await asyncio.sleep(0)
        answers = await asyncio.gather(*asked)
        assert {answer["code"] for answer in answers} == {"busy", "usage"}

    live(main)


def test_markup_in_names_and_values_is_only_text() -> None:
    async def main() -> None:
        markup = "<img src=x onerror=alert(1)>"
        page = Page(studio_of(doubling())).join()
        note = {"do": "Note", "path": "scaled", "name": "comment", "value": markup}
        assert (await page.edit(note))["t"] == "ack"
        assert page.tables["nodes"]["scaled"]["notes"] == {"comment": markup}
        assert (await page.edit(add(markup)))["t"] == "ack"
        assert page.tables["nodes"][markup]["name"] == markup

    live(main)
