"""A visitor watches the delivery robot live, lets things go wrong, and sees what its mission does."""

from __future__ import annotations

import math
import re
from typing import Any

import pytest
from playwright.sync_api import expect

from examples.fetch_delivery.mission import build
from examples.fetch_delivery.world.robots import Robot
from hfg.engine.observing.taps import Tap
from tests.studio.stories.bench import Story
from tests.studio.stories.conftest import Open

pytestmark = pytest.mark.slow


class Arena:
    """The studio of one robot, and the world behind it."""

    def __init__(self, story: Story) -> None:
        self.story = story
        self.bench = story.bench
        self.page = story.page
        story.start()
        self.bench.until(lambda: self.world.simulation is not None and self.world.simulation.now_s > 0.2)

    @property
    def world(self) -> Any:
        return self.bench.graph["world"]

    @property
    def body(self) -> Robot:
        body: Robot = self.world.simulation.robots[0]
        return body

    def until(self, true: Any, what: str) -> None:
        self.bench.until(true, what)

    def ask_for(self, action: str) -> None:
        """Choose an action in the menu."""
        self.page.get_by_role("button", name="Actions").click()
        self.page.get_by_role("menuitem", name=action).click()

    def do(self, action: str) -> None:
        """Carry out the action whose form is open."""
        self.page.get_by_role("dialog", name=action).get_by_role("button", name=action).click()
        self.page.get_by_role("dialog", name=action).wait_for(state="hidden")


@pytest.fixture
def arena(open_studio: Open) -> Arena:
    return Arena(open_studio(build(seed=1)))


def test_the_views_show_the_arena_and_what_the_robot_sees(arena: Arena) -> None:
    above = arena.page.get_by_role("img", name=re.compile(r"^The arena from above: \d"))
    expect(above).to_be_visible()
    expect(arena.page.get_by_role("img", name=re.compile("^What the robot sees"))).to_be_visible()
    seconds = re.compile(r"(\d+\.\d) s · 0 delivered")
    first = seconds.search(above.get_attribute("aria-label") or "")
    assert first is not None
    arena.until(lambda: arena.world.simulation.now_s > float(first[1]) + 0.5, "the world moves on")
    expect(above).not_to_have_attribute("aria-label", f"The arena from above: {first[0]}")


def test_a_pushed_robot_is_elsewhere_and_its_wheels_have_not_noticed(arena: Arena) -> None:
    arena.ask_for("Push a robot")
    ahead = arena.page.get_by_label("ahead", exact=True)
    ahead.fill("-0.8")
    before = arena.bench.call(lambda: (arena.body.x, arena.body.y, arena.body.odometry))
    ahead.press("Enter")
    places: list[tuple[float, float]] = []
    arena.page.get_by_role("dialog", name="Push a robot").wait_for(state="hidden")

    def is_pushed() -> bool:
        body = arena.body
        places.append((math.dist((body.x, body.y), before[:2]), math.dist(body.odometry[:2], before[2][:2])))
        return places[-1][0] > places[-1][1] + 0.5

    arena.until(is_pushed, "the robot was pushed further than its wheels have rolled")
    arena.page.get_by_role("tab", name="History").click()
    expect(arena.page.locator("#time .list")).to_contain_text("Push a robot: robot 0, ahead -0.8")
    expect(arena.page.locator("#time .list")).to_contain_text("cannot be undone")


def test_before_a_blocked_station_stands_a_crate_until_one_undoes_it(arena: Arena) -> None:
    arena.ask_for("Block a station")
    arena.page.get_by_role("dialog").get_by_label("blocked").select_option("filling 0")
    arena.do("Block a station")
    arena.until(lambda: arena.world.simulation.crates(), "a crate stands in the arena")

    def is_measured() -> bool:
        """Whether a ray of the laser ends at the crate."""
        ((x, y, radius),) = arena.world.simulation.crates()
        body = arena.body
        scan = arena.world.simulation.scan(0)
        far, angle = math.dist((x, y), (body.x, body.y)), math.atan2(y - body.y, x - body.x) - body.theta
        ray = min(range(len(scan.angles)), key=lambda one: abs(math.remainder(scan.angles[one] - angle, math.tau)))
        return bool(abs(float(scan.ranges[ray]) - (far - radius)) < 0.15)

    arena.until(is_measured, "the laser of the robot sees the crate")
    arena.page.locator("#canvas").click(position={"x": 20, "y": 20})
    arena.story.press("Control+z")
    arena.until(lambda: not arena.world.simulation.crates(), "the crate is gone")


def test_in_the_dark_the_robot_finds_no_signs_and_with_light_it_does(arena: Arena) -> None:
    found: Tap = arena.bench.call(lambda: arena.bench.studio.steering.run.tap("robot_0/perception/targets.out", size=1))  # type: ignore[union-attr]

    def newest() -> Any:
        return None if found.latest is None else found.latest.value

    arena.until(newest, "it sees a bull's-eye")
    arena.ask_for("Dim the light")
    arena.do("Dim the light")
    undo = arena.page.locator(".toast").get_by_role("button", name="Undo")
    undo.hover()  # as long as the mouse is on it, it stays
    arena.until(lambda: newest() == [], "it sees none any more")
    assert arena.bench.call(lambda: arena.world.light) == 0.05
    undo.click()
    arena.until(lambda: arena.world.simulation.light == 1.0, "the light is on again")
    arena.bench.call(found.close)


def test_the_world_stands_still_while_the_run_is_paused_and_steps_wave_by_wave(arena: Arena) -> None:
    arena.story.press("Space")
    arena.bench.state("paused")
    held = arena.bench.call(lambda: arena.world.simulation.now_s)
    expect(arena.page.locator(".clock")).to_contain_text("paused")
    assert arena.bench.call(lambda: arena.world.simulation.now_s) == held
    for _ in range(40):  # other nodes may have waves of their own first
        arena.story.press(".")
        arena.story.settle()
        if arena.bench.call(lambda: arena.world.simulation.now_s) > held:
            break
    assert held < arena.bench.call(lambda: arena.world.simulation.now_s) <= held + 0.21
    arena.story.press("Space")
    arena.until(lambda: arena.world.simulation.now_s > held + 0.5, "the world moves on")


def test_a_robot_whose_motors_are_limited_drives_no_faster(arena: Arena) -> None:
    arena.story.select("world")
    speed = arena.page.locator("#side").get_by_label("speed")
    speed.fill("0.1")
    speed.press("Enter")
    arena.until(lambda: arena.body.limits.speed == 0.1, "the motors are limited")
    arena.until(lambda: 0.05 < arena.body.speed <= 0.1 + 1e-6, "it drives, but slowly")


def test_without_activity_the_robot_stands_still_until_one_resets_it(arena: Arena) -> None:
    arena.until(lambda: arena.body.speed > 0.2, "it drives")
    arena.story.node("robot_0").locator(".t b").click(button="right")
    arena.page.get_by_role("menuitem", name="Take the activity away").click()
    run = arena.bench.studio.steering.run
    assert run is not None
    arena.until(lambda: not list(run.active()), "nothing is active")
    expect(arena.page.locator("#stage")).to_contain_text("nothing is active")
    arena.until(lambda: arena.body.speed == 0.0, "it stands still")
    arena.page.get_by_role("button", name="Reset the activity").click()
    arena.until(lambda: arena.body.speed > 0.1, "it drives again")
