"""A person changes gates, operators, initial tokens, promotions and conditions in the inspector; the engine follows."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import expect

from hfg.graph import Edge
from tests.studio.stories.bench import Story
from tests.studio.stories.conftest import Open
from tests.studio.stories.graphs import workshop

pytestmark = pytest.mark.slow


@pytest.fixture
def shop(open_studio: Open) -> Story:
    return open_studio(workshop())


def choose_edge(story: Story, key: str) -> None:
    """Click on the wire of an edge, in the middle of its first piece."""
    wire = story.page.locator(f'.wire-group[data-edges="{key}"] .hit')
    x, y = wire.evaluate(
        """path => {
          const at = path.getPointAtLength(path.getTotalLength() / 2), to = path.getScreenCTM();
          return [at.x * to.a + to.e, at.y * to.d + to.f];
        }"""
    )
    story.page.mouse.click(x, y)
    expect(story.page.locator("#side h2").first).to_have_text("Edge")


def edge(story: Story, key: str) -> Edge:
    return next(one for one in story.graph.edges if one.label == key)


@pytest.mark.rule("A11")
def test_a_gate_chosen_in_the_inspector_holds_the_node_until_it_is_taken_away(shop: Story) -> None:
    shop.start()
    shop.moves_on("store")
    shop.select("store")
    shop.page.get_by_label("works while").select_option("drive")
    shop.bench.until(lambda: [gate.by.place.path for gate in shop.graph.gates] == ["drive"])
    expect(shop.node("store").locator(".badge")).to_contain_text("drive")
    expect(shop.page.locator('.wire-group[data-ends*="drive"]')).to_have_count(0)  # no fact of one node is an edge
    seen = shop.bench.node("store").seen
    shop.bench.until(lambda: shop.graph["clock"].ticks > 20)
    assert shop.bench.node("store").seen <= seen + 1
    expect(shop.page.get_by_label("works while")).to_have_value("drive")
    shop.page.get_by_label("works while").select_option("")
    shop.moves_on("store")
    shop.press("Control+z")
    shop.bench.until(lambda: len(shop.graph.gates) == 1)


@pytest.mark.rule("A11")
def test_a_closed_gate_lets_the_node_work_as_often_as_one_says(shop: Story) -> None:
    shop.start()
    shop.select("store")
    shop.page.get_by_label("works while").select_option("drive")
    rate = shop.page.get_by_label("else at most")
    rate.fill("-3")
    shop.press("Enter")
    expect(shop.page.locator(".toast.bad")).to_contain_text("idle_rate_hz must be a number above 0")
    rate.fill("30")
    shop.press("Enter")
    shop.bench.until(lambda: [gate.idle_rate_hz for gate in shop.graph.gates] == [30])
    shop.moves_on("store")


@pytest.mark.rule("P9")
def test_an_operator_on_a_signal_holds_signals_back_until_it_is_taken_away(shop: Story) -> None:
    shop.start()
    key = "clock.tick -> heard.hear"
    choose_edge(shop, key)
    shop.page.get_by_label("operators").select_option(label="skip")
    shop.page.locator("#operator-count").fill("1000000")
    shop.page.get_by_role("button", name="Add skip").click()
    expect(shop.page.get_by_role("alert")).to_contain_text("keeps its through while the graph runs")
    shop.page.get_by_role("button", name="Replace the edge").click()
    shop.bench.until(lambda: [repr(one) for one in edge(shop, key).options.through] == ["skip(count=1000000)"])
    heard, ticks = shop.bench.call(lambda: (shop.graph["heard"].count, shop.graph["clock"].ticks))
    shop.bench.until(lambda: shop.graph["clock"].ticks > ticks + 10)
    assert shop.bench.node("heard").count <= heard + 1
    shop.page.get_by_role("button", name="Take skip away").click()
    shop.page.get_by_role("button", name="Replace the edge").click()
    shop.bench.until(lambda: shop.graph["heard"].count > heard + 5)


@pytest.mark.rule("P9")
def test_an_operator_that_an_active_edge_cannot_have_is_refused_in_the_words_of_the_rule(shop: Story) -> None:
    choose_edge(shop, "clock.tick -> heard.hear")
    shop.press("a")
    shop.bench.until(lambda: edge(shop, "clock.tick -> heard.hear").active)
    shop.page.get_by_label("operators").select_option(label="debounce")
    shop.page.get_by_label("duetime").fill("0.1")
    shop.press("Enter")
    expect(shop.page.get_by_role("alert")).to_contain_text("operators may hold or drop signals")
    assert shop.bench.call(lambda: edge(shop, "clock.tick -> heard.hear").options.through) == ()


@pytest.mark.rule("P7")
def test_initial_tokens_are_on_the_edge_when_the_run_begins(shop: Story) -> None:
    choose_edge(shop, "pace.out -> store.value")
    initial = shop.page.get_by_label("initial")
    initial.fill('["seven"]')
    shop.press("Enter")
    expect(shop.page.get_by_role("alert")).to_contain_text("initial value must be of type int")
    initial.fill("[7777]")
    shop.press("Enter")
    shop.bench.until(lambda: edge(shop, "pace.out -> store.value").options.initial == (7777,))
    shop.start()
    shop.bench.until(lambda: shop.graph["store"].first == 7777)
    shop.moves_on("store")


@pytest.mark.rule("P5")
def test_only_options_that_the_edge_can_have_are_offered(shop: Story) -> None:
    choose_edge(shop, "clock.tick -> heard.hear")
    expect(shop.page.get_by_label("capacity", exact=True)).to_be_visible()
    shop.page.get_by_label("overflow").select_option(label="latest")
    shop.bench.until(lambda: edge(shop, "clock.tick -> heard.hear").overflow == "latest")
    choose_edge(shop, "pace.out -> store.value")
    expect(shop.page.get_by_label("buffer")).to_be_visible()
    expect(shop.page.get_by_label("capacity", exact=True)).to_have_count(0)


@pytest.mark.rule("G3")
def test_a_parameter_inside_is_set_from_outside_once_it_is_promoted(shop: Story) -> None:
    shop.start()
    shop.node("pace").dblclick(position={"x": 12, "y": 28})
    shop.select("pace/times")
    shop.page.locator("#promoted-factor").select_option("rate")
    shop.bench.until(lambda: shop.graph["pace/times"].factor == 3)
    shop.bench.until(lambda: shop.graph["store"].last % 3 == 0 and shop.graph["store"].last > 0)
    shop.page.locator("#canvas").focus()
    shop.press("Escape", "Backspace")
    shop.page.locator("[id='parameter-pace.rate']").fill("5")
    shop.press("Enter")
    shop.bench.until(lambda: shop.graph["pace/times"].factor == 5)


@pytest.mark.rule("G1")
def test_a_port_inside_a_subgraph_is_led_out_of_it(story: Story) -> None:
    story.start()
    story.choose("scale", "check")
    story.press("Control+g")
    story.node("group").wait_for()
    story.settle()
    story.press("Enter")
    story.node("group/scale").wait_for()
    story.select("group/scale")
    story.press("c")
    story.page.get_by_role("option", name=re.compile(r"scale\.out")).click()
    story.page.get_by_role("option", name=re.compile(r"spare\.value")).click()
    story.moves_on("spare")
    story.moves_on("store")
    assert len(story.bench.call(lambda: story.graph["group"].ports.outputs)) == 2
    story.press("Control+z")
    story.bench.until(lambda: len(story.graph["group"].ports.outputs) == 1)


@pytest.mark.rule("R3")
def test_a_breakpoint_with_a_condition_holds_only_when_it_is_true(shop: Story) -> None:
    choose_edge(shop, "pace.out -> store.value")
    shop.page.get_by_label("pauses here").click()
    shop.page.get_by_label("comparison").select_option(">=")
    shop.page.get_by_label("compared with").fill("20")
    shop.page.get_by_role("button", name="Set", exact=True).click()
    shop.bench.until(
        lambda: [one.condition for one in shop.bench.studio.steering.breakpoints().values()] == ["value >= 20"]
    )
    shop.page.get_by_role("button", name="Start").click()
    shop.bench.state("paused")
    assert shop.bench.node("store").last == 18  # 2 by 2: the next is 20


@pytest.mark.rule("R3")
def test_a_condition_that_cannot_be_compared_says_so_and_does_not_hold(shop: Story) -> None:
    choose_edge(shop, "pace.out -> store.value")
    shop.page.get_by_label("pauses here").click()
    shop.page.get_by_label("only if").fill("pose.x")
    shop.page.get_by_label("compared with").fill("20")
    shop.press("Enter")
    shop.start()
    shop.moves_on("store")
    expect(shop.page.locator("#side .par-note")).to_contain_text('has no part "pose"')
