"""A person changes a graph while it runs; the engine follows, and everything can be undone."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import expect

from tests.studio.stories.bench import Story

pytestmark = pytest.mark.slow


def edges_of(story: Story) -> set[str]:
    return story.bench.call(lambda: {edge.label for edge in story.graph.edges})


def test_a_node_is_added_where_one_clicks_twice(story: Story) -> None:
    story.start()
    story.page.mouse.dblclick(*story.empty_place())
    story.page.keyboard.type("threshold")
    expect(story.page.locator(".palette li.sel")).to_contain_text("threshold")
    before = set(story.graph.nodes)
    story.press("Enter")
    story.bench.until(lambda: len(story.graph.nodes) == len(before) + 1)
    (added,) = set(story.graph.nodes) - before
    assert "threshold" in added
    expect(story.node(added)).to_be_visible()
    story.moves_on("store")


def test_a_node_that_is_added_where_one_does_not_see_it_comes_into_view(story: Story) -> None:
    canvas = story.page.locator("#canvas").bounding_box()
    assert canvas is not None
    story.page.mouse.dblclick(canvas["x"] + canvas["width"] - 8, canvas["y"] + canvas["height"] / 2)
    story.page.keyboard.type("threshold")
    expect(story.page.locator(".palette li.sel")).to_contain_text("threshold")
    before = set(story.graph.nodes)
    story.press("Enter")
    story.settle()
    (added,) = set(story.graph.nodes) - before

    def is_seen() -> bool:
        box = story.node(added).bounding_box()
        return box is not None and box["x"] > canvas["x"] and box["x"] + box["width"] < canvas["x"] + canvas["width"]

    story.until(is_seen, "the node is in view")


def test_the_palette_shows_what_a_type_is_before_one_adds_it(story: Story) -> None:
    story.start()
    story.page.mouse.dblclick(*story.empty_place())
    story.page.keyboard.type("multiply a number")
    story.settle()
    row = story.page.locator("[id='row-tests.studio.stories.graphs:scaled']")
    row.hover(position={"x": 8, "y": 8})
    row.hover(position={"x": 40, "y": 12})
    preview = story.page.get_by_role("region", name="About the node type")
    expect(preview).to_contain_text("Multiply a number.")
    expect(preview).to_contain_text("factor")
    expect(preview.locator(".example")).to_contain_text("graph.add(scaled())")
    before = set(story.graph.nodes)
    story.press("Enter")
    story.bench.until(lambda: len(story.graph.nodes) == len(before) + 1)
    (added,) = set(story.graph.nodes) - before
    assert story.bench.call(lambda: story.graph[added]._type.qualname) == "scaled"


def test_whoever_presses_enter_before_the_palette_has_answered_gets_the_node(story: Story) -> None:
    before = set(story.graph.nodes)
    story.page.mouse.dblclick(*story.empty_place())
    story.page.locator(".palette li.sel").wait_for()
    with story.bench.held():
        story.page.keyboard.type("threshold")
        story.press("Enter")
    story.bench.until(lambda: len(story.graph.nodes) == len(before) + 1)
    (added,) = set(story.graph.nodes) - before
    assert "threshold" in added
    expect(story.page.locator(".palette")).to_have_count(0)


def test_a_deleted_node_comes_back_by_undo_with_its_edges(story: Story) -> None:
    story.start()
    before = edges_of(story)
    story.select("scale")
    story.press("Delete")
    story.bench.until(lambda: "scale" not in story.graph.nodes)
    expect(story.node("scale")).to_have_count(0)
    story.press("Control+z")
    story.bench.until(lambda: "scale" in story.graph.nodes)
    assert edges_of(story) == before
    story.moves_on("store")


def test_a_muted_node_lets_its_input_go_around_it_until_it_takes_part_again(story: Story) -> None:
    story.start()
    before = edges_of(story)
    story.select("scale")
    story.press("m")
    expect(story.node("scale")).to_have_class(re.compile(r"\bmuted-node\b"))
    assert "numbers.out -> check.value" in edges_of(story)
    story.moves_on("store")
    story.press("m")
    expect(story.node("scale")).not_to_have_class(re.compile(r"\bmuted-node\b"))
    assert edges_of(story) == before
    story.moves_on("store")


def test_a_wire_from_port_to_port_lets_values_flow(story: Story) -> None:
    story.start()
    story.drag("numbers.out", "spare.value")
    story.bench.until(lambda: any(edge.label == "numbers.out -> spare.value" for edge in story.graph.edges))
    story.moves_on("spare")


def test_whoever_drops_a_wire_before_the_studio_has_said_what_takes_it_gets_the_edge(story: Story) -> None:
    start, end = story.middle(story.port("numbers.out")), story.middle(story.port("spare.value"))
    with story.bench.held():
        story.page.mouse.move(*start)
        story.page.mouse.down()
        story.page.mouse.move(*end, steps=3)
        story.page.mouse.up()
    story.settle()
    assert "numbers.out -> spare.value" in edges_of(story)


def test_a_refusal_says_why_before_one_drops(story: Story) -> None:
    story.start()
    before = edges_of(story)
    story.hold("numbers.out", "stamp.write")
    reason = story.page.locator(".reason.no")
    expect(reason).to_contain_text("does not take this")
    expect(reason).to_contain_text("str")
    story.press("Escape")
    story.page.mouse.up()
    expect(story.page.locator("#canvas.wiring")).to_have_count(0)
    assert edges_of(story) == before


def test_ports_that_expect_it_light_up_while_one_drags(story: Story) -> None:
    story.hold("numbers.out", story.empty_place())
    expect(story.port("spare.value")).to_have_class(re.compile(r"\bexpects\b"))
    expect(story.port("stamp.write")).not_to_have_class(re.compile(r"\bexpects\b"))
    expect(story.page.locator(".dragline")).to_contain_text("expect it")
    story.press("Escape")
    story.page.mouse.up()


def test_a_wire_dropped_on_nothing_opens_the_palette_and_connects_what_one_chooses(story: Story) -> None:
    story.start()
    story.drag("numbers.out", story.empty_place())
    expect(story.page.locator(".chipf")).to_contain_text("numbers.out")
    story.page.locator(".palette li.sel").wait_for()
    story.press("Enter")
    before = {"numbers.out -> scale.value", "numbers.out -> draw.value"}
    story.bench.until(lambda: {edge.label for edge in story.graph.edges if "numbers.out" in edge.label} > before)


def test_a_wire_pulled_off_an_input_is_cut(story: Story) -> None:
    story.start()
    story.drag("store.value", story.empty_place())
    story.bench.until(lambda: all(edge.label != "check.out -> store.value" for edge in story.graph.edges))
    story.press("Control+z")
    story.bench.until(lambda: any(edge.label == "check.out -> store.value" for edge in story.graph.edges))
    story.moves_on("store")


def test_a_wire_is_moved_to_another_input(story: Story) -> None:
    story.start()
    story.drag("store.value", "spare.value")
    story.bench.until(lambda: any(edge.label == "check.out -> spare.value" for edge in story.graph.edges))
    assert "check.out -> store.value" not in edges_of(story)
    story.moves_on("spare")


def test_a_node_gets_another_name(story: Story) -> None:
    story.start()
    story.select("scale")
    story.press("F2")
    story.page.get_by_label("Name of the node").fill("larger")
    story.press("Enter")
    story.bench.until(lambda: "larger" in story.graph.nodes)
    expect(story.node("larger")).to_be_visible()
    story.moves_on("store")


def test_a_disabled_node_lets_nothing_through_until_it_is_enabled(story: Story) -> None:
    story.start()
    story.moves_on("store")
    story.select("scale")
    story.press("e")
    expect(story.node("scale")).to_have_class(re.compile(r"\boff\b"))
    assert story.bench.call(lambda: story.bench.studio.tables.of["nodes"]["scale"].enabled) is False
    story.press("e")
    expect(story.node("scale")).not_to_have_class(re.compile(r"\boff\b"))
    story.moves_on("store")


def test_selected_nodes_become_a_subgraph_and_again_nodes(story: Story) -> None:
    story.start()
    story.choose("scale", "check")
    story.press("Control+g")
    story.bench.until(lambda: "scale" not in story.graph.nodes and "group" in story.graph.nodes)
    story.moves_on("store")
    expect(story.node("group")).to_have_class(re.compile(r"\bsub\b"))
    story.settle()
    story.press("Control+Shift+g")
    story.bench.until(lambda: {"scale", "check"} <= set(story.graph.nodes))
    story.moves_on("store")


def test_a_node_is_doubled_and_runs_beside_the_first(story: Story) -> None:
    story.start()
    story.select("scale")
    story.press("Control+d")
    story.bench.until(lambda: len([n for n in story.graph.nodes if n.startswith("scale")]) == 2)


def test_nodes_are_copied_as_text_and_pasted(story: Story) -> None:
    story.start()
    story.select("spare")
    story.press("Control+c")
    expect(story.page.locator(".toast")).to_contain_text("Copied as text")
    assert "Collect" in story.page.evaluate("navigator.clipboard.readText()")
    before = len(story.graph.nodes)
    story.press("Control+v")
    story.bench.until(lambda: len(story.graph.nodes) == before + 1)


def test_a_dragged_node_stays_where_it_was_put(story: Story) -> None:
    x, y = story.middle(story.node("stamp").locator(".t b"))
    story.page.mouse.move(x, y)
    story.page.mouse.down()
    story.page.mouse.move(x + 80, y + 60, steps=5)
    story.page.mouse.up()
    story.bench.until(lambda: "position" in story.bench.studio.tables.of["nodes"]["stamp"].notes)
    story.press("Control+z")
    story.bench.until(lambda: "position" not in story.bench.studio.tables.of["nodes"]["stamp"].notes)


def test_the_history_shows_each_step_and_takes_it_back(story: Story) -> None:
    story.select("spare")
    story.press("Delete")
    story.bench.until(lambda: "spare" not in story.graph.nodes)
    story.page.get_by_role("tab", name="History").click()
    row = story.page.locator(".list li").first
    expect(row).to_contain_text("spare")
    row.get_by_role("button", name="Undo").click()
    story.bench.until(lambda: "spare" in story.graph.nodes)
    story.page.get_by_role("button", name="Redo", exact=True).click()
    story.bench.until(lambda: "spare" not in story.graph.nodes)


def test_two_ports_are_connected_without_a_mouse(story: Story) -> None:
    story.start()
    story.select("numbers")
    story.press("c")
    story.page.get_by_role("option", name=re.compile("numbers.out")).click()
    story.page.get_by_role("option", name=re.compile("spare.value")).click()
    story.moves_on("spare")


def test_a_node_runs_in_the_group_that_one_chooses(story: Story) -> None:
    story.bench.call(lambda: story.graph.group("work", threads=1))
    story.start()
    story.select("scale")
    story.page.locator("#group-of-node").select_option("work")
    story.bench.until(lambda: story.bench.studio.tables.of["nodes"]["scale"].group == "work")
    story.moves_on("store")


def test_a_sentence_stays_while_the_mouse_is_on_it(story: Story) -> None:
    story.select("spare")
    story.press("Delete")
    expect(story.node("spare")).to_have_count(0)
    story.press("Control+z")
    toast = story.page.locator(".toast", has_text="Undone")
    toast.hover()
    story.time_passes()
    expect(toast).to_be_visible()
    story.page.mouse.move(0, 0)
    story.time_passes()
    expect(toast).to_have_count(0)


def test_two_pages_see_the_same(story: Story) -> None:
    other = Story(story.bench, story.page.context.new_page())
    story.select("spare")
    story.press("Delete")
    expect(other.node("spare")).to_have_count(0)
    other.press("Control+z")
    expect(story.node("spare")).to_be_visible()
    story.bench.until(lambda: "spare" in story.graph.nodes)


def test_a_dropped_wire_is_there_before_the_studio_has_answered(story: Story) -> None:
    story.hold("numbers.out", "spare.value")
    with story.bench.held():
        story.page.mouse.up()
        expect(story.page.locator('[data-asked="numbers.out -> spare.value"]')).to_have_count(1)
    expect(story.page.locator('[data-edges*="numbers.out -> spare.value"]')).to_have_count(1)
    expect(story.page.locator("[data-asked]")).to_have_count(0)
    assert "numbers.out -> spare.value" in edges_of(story)
