"""What editors offer comes from the studio: gates, promotions, options of edges, operators, ways out of a subgraph."""

from __future__ import annotations

import ast
import base64
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hfg
from examples.fetch_delivery.mission import build as delivery
from hfg.errors import HfgError
from hfg.nodes.activity import Wait
from hfg.studio.capturing import value_as_file
from tests.studio.page import Page, live, studio_of
from tests.studio.stories.graphs import Drive, mission, workshop


@pytest.mark.rule("A11")
def test_a_gate_can_be_opened_by_the_node_itself_and_all_others_and_each_row_is_an_edit() -> None:
    async def main() -> None:
        page = Page(studio := studio_of(workshop())).join()
        offered = await page.value("gates", path="store")
        paths = [row["path"] for row in offered["rows"]]
        assert paths[0] == "store"
        assert {"drive", "pace/times"} < set(paths)
        await page.edit(*next(row["commands"] for row in offered["rows"] if row["path"] == "drive"))
        await page.edit(
            *next(r["commands"] for r in (await page.value("gates", path="store"))["rows"] if r["path"] == "clock")
        )
        assert [gate.by.place.path for gate in studio.graph.gates] == ["clock"]
        await page.edit(*(await page.value("gates", path="store"))["none"])
        assert list(studio.graph.gates) == []

    live(main)


def edges_of(graph: hfg.Graph) -> set[str]:
    return {edge.label for edge in graph.edges}


@pytest.mark.rule("F10")
def test_what_comes_to_a_muted_node_goes_around_it_until_it_takes_part_again(tmp_path: Path) -> None:
    async def main() -> None:
        graph = mission()
        graph.connect("scale.out", "spare.value", initial=[5])
        before = edges_of(graph)
        page = Page(studio_of(graph, tmp_path)).join()
        await page.edit(*(await page.value("muted", path="scale"))["commands"])
        around = {"numbers.out -> check.value", "numbers.out -> spare.value"}
        assert edges_of(graph) == before - {"scale.out -> check.value", "scale.out -> spare.value"} | around
        assert page.tables["nodes"]["scale"]["enabled"] is False
        assert (await page.ask("save", path="mission.hfg.yaml"))["t"] == "ack"
        page = Page(studio_of(again := hfg.load(tmp_path / "mission.hfg.yaml", allow=["tests"]))).join()
        await page.edit(*(await page.value("muted", path="scale"))["commands"])
        assert edges_of(again) == before
        assert page.tables["edges"]["scale.out -> spare.value"]["options"] == {"initial": [5]}
        assert page.tables["nodes"]["scale"]["notes"] == {}

    live(main)


@pytest.mark.rule("F10")
def test_a_copy_of_a_muted_node_takes_part_again_without_touching_the_edges_of_the_first() -> None:
    async def main() -> None:
        page = Page(studio_of(graph := mission())).join()
        await page.edit(*(await page.value("muted", path="scale"))["commands"])
        around = edges_of(graph)

        async def copy(*paths: str) -> None:
            text = (await page.value("text", paths=paths))["text"]
            assert (await page.edit(*(await page.value("paste", text=text))["commands"]))["t"] == "ack"

        await copy("scale")
        assert edges_of(graph) == around
        alone = page.tables["nodes"]["scale_2"]
        assert (alone["enabled"], "muted" in alone["notes"]) == (False, False)
        await copy("numbers", "scale", "check")
        into = "numbers_2.out -> scale_3.value"
        assert edges_of(graph) == around | {into, "numbers_2.out -> check_2.value"}
        await page.edit(*(await page.value("muted", path="scale_3"))["commands"])
        assert edges_of(graph) == around | {into, "scale_3.out -> check_2.value"}

    live(main)


def test_a_node_without_inputs_that_its_followers_take_cannot_be_muted_and_says_so() -> None:
    async def main() -> None:
        page = Page(studio_of(mission())).join()
        refused = await page.ask("ask", what="muted", args={"path": "numbers"})
        assert refused["message"] == 'nothing that "numbers" receives can go on in its place; disable it instead'

    live(main)


@pytest.mark.rule("G3")
def test_a_promotion_that_does_not_fit_says_why() -> None:
    async def main() -> None:
        graph = hfg.Graph("g")
        box = graph.add(Outside(), name="box")
        page = Page(studio_of(graph)).join()
        (offered,) = await page.value("promotions", path="box/drive")
        rows = {row["name"]: row["message"] for row in offered["rows"]}
        assert rows["speed"] == ""
        assert "takes float" in rows["words"]
        await page.edit(*offered["rows"][0]["commands"])
        box.speed = 2.5
        assert graph["box/drive"].duration == 2.5
        assert (await page.value("promotions", path="box/drive"))[0]["by"] == "speed"

    live(main)


class Outside(hfg.Subgraph):
    """Has a parameter that fits what is inside, and one that does not."""

    speed = hfg.Parameter(1.0)
    words = hfg.Parameter("none")

    def build(self, graph: hfg.Graph) -> None:
        graph.add(Drive(), name="drive")


@pytest.mark.rule("P5")
def test_an_edge_offers_only_the_options_it_can_have() -> None:
    async def main() -> None:
        page = Page(studio_of(workshop())).join()
        of_data = await page.value("edge", path="pace.out -> store.value")
        of_signals = await page.value("edge", path="clock.tick -> heard.hear")
        assert [one["name"] for one in of_data["options"]] == ["buffer", "initial", "deadline_s"]
        assert [one["name"] for one in of_signals["options"]] == [
            "capacity",
            "overflow",
            "capacity_limit",
            "initial",
            "through",
            "deadline_s",
        ]
        assert of_data["anew"] == []  # it does not run, so its options can change

    live(main)


@pytest.mark.rule("P9")
def test_every_operator_that_is_offered_can_be_said() -> None:
    async def main() -> None:
        page = Page(studio := studio_of(workshop())).join()
        values = {"int": 1, "float": 0.1}
        for one in await page.value("operators"):
            given = {each["name"]: values[each["kind"]] for each in one["parameters"]}
            said = {"type": one["reference"], "parameters": given}
            answer = await page.edit(
                {"do": "SetEdge", "source": "clock.tick", "target": "heard.hear", "through": [said]}
            )
            assert answer["t"] == "ack", answer
            (edge,) = [each for each in studio.graph.edges if each.options.through]
            assert one["name"] in repr(edge.options.through)

    live(main)


@pytest.mark.rule("G1")
def test_a_subgraph_with_a_type_of_its_own_gets_no_ports_and_the_studio_says_so() -> None:
    async def main() -> None:
        page = Page(studio_of(mission())).join()
        way: dict[str, Any] = await page.value("ways_out", path="errand/there.done")
        assert way["rows"] == []
        assert "its type Errand declares" in way["message"]
        assert (await page.value("ways_out", path="scale.out")) == {"rows": [], "message": ""}

    live(main)


@pytest.mark.rule("R3")
def test_a_condition_is_refused_at_a_node_and_the_breakpoint_that_was_there_stays() -> None:
    async def main() -> None:
        page = Page(studio_of(mission())).join()
        assert (await page.value("stops", path="check"))["comparisons"] == []
        assert (await page.value("stops", path="check.out"))["comparisons"][:2] == ["==", "!="]
        await page.ask("break", path="check")
        refused = await page.ask("break", path="check", condition={"op": ">", "value": 3})
        assert "is a node, and a condition looks at what is sent" in refused["message"]
        assert list(page.tables["breakpoints"]) == ["check"]

    live(main)


def test_the_preview_of_a_type_has_ports_and_an_example_that_is_code() -> None:
    async def main() -> None:
        page = Page(studio_of(mission())).join()
        for reference in ("hfg.nodes.flow:SampleAndHold", "tests.studio.stories.graphs:scaled"):
            shown = await page.value("type", reference=reference)
            assert shown["ports"]
            adds = ast.parse(shown["example"]).body[1]
            assert "graph.add(" in ast.unparse(adds)

    live(main)


def test_values_that_a_file_cannot_hold_are_refused_with_what_can_be_done() -> None:
    as_table = value_as_file([{"x": 1, "y": "a"}, {"x": 2, "z": "b"}], "a.out", "csv")
    assert as_table["name"] == "a.out.csv"
    assert base64.b64decode(as_table["base64"]).decode().splitlines() == ["x,y,z", "1,a,", "2,,b"]
    with pytest.raises(HfgError, match="this is dict; save it as CSV"):
        value_as_file({"x": 1}, "a.out", "npy")
    with pytest.raises(HfgError, match=r"this array has 3 \(2 x 2 x 2\); save it as NPY"):
        value_as_file(np.zeros((2, 2, 2)), "a.out", "csv")


@pytest.mark.rule("A5", "A13")
def test_a_page_gets_the_states_laid_out_with_the_paths_of_the_graph_and_what_is_proved() -> None:
    async def main() -> None:
        graph = delivery()
        page = Page(studio_of(graph)).join()
        found = await page.value("states")
        boxes = {one["id"] for one in found["layout"]["nodes"]}
        states = {one["path"] for one in found["states"]["states"]}
        assert states <= boxes
        assert states <= set(page.tables["nodes"])
        assert {"source": "robot_0/read_cube", "event": "received", "target": "robot_0/lookup"} in found["states"][
            "arrows"
        ]
        assert [region["exactly_one"]["holds"] for region in found["regions"]] == [True]
        assert found["problems"] == []

    live(main)


def test_a_graph_in_which_no_activity_moves_has_no_states_to_lay_out() -> None:
    async def main() -> None:
        found = await Page(studio_of(hfg.Graph("empty"))).join().value("states")
        assert found["states"]["states"] == []
        assert found["layout"] is None

    live(main)


def test_more_states_than_a_page_can_draw_are_counted_with_the_command_that_draws_them() -> None:
    async def main() -> None:
        graph = hfg.Graph("ring")
        nodes = [graph.add(Wait()) for _ in range(301)]
        graph.start.activates(nodes[0].begin)
        for one, other in pairwise(nodes):
            one.done.activates(other.begin)
        found = await Page(studio_of(graph)).join().value("states")
        assert found["layout"] is None
        assert found["states"]["undrawn"] == (
            "The graph has 301 states, and a page draws at most 300: hfg draw GRAPH states.svg --view states draws "
            "them all."
        )

    live(main)
