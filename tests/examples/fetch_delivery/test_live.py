"""The robot live: its views, and what its mission does when a visitor lets things go wrong. In virtual time."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

import hfg
from examples.fetch_delivery.mission import build
from hfg.engine.observing.taps import Tap
from tests.studio.page import Page, studio_of

pytestmark = pytest.mark.slow


def virtually(main: Callable[[], Coroutine[Any, Any, None]]) -> None:
    """Run a test in virtual time."""
    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())


async def arena(robots: int = 1) -> tuple[Page, Any]:
    """A page, and the node of the world behind it."""
    page = Page(studio_of(build(robots=robots))).join()
    assert (await page.ask("start"))["t"] == "ack"
    return page, page.studio.graph["world"]


async def act(page: Page, name: str, **args: Any) -> None:
    assert (await page.ask("act", path="world", name=name, args=args))["t"] == "ack"


@contextmanager
def tap(page: Page, path: str) -> Iterator[Tap]:
    """What passes a port."""
    run = page.studio.steering.run
    assert run is not None
    with run.tap(path, size=1) as found:
        yield found


def scene(page: Page, sub: int) -> dict[str, Any]:
    """The newest scene of a view."""
    found: dict[str, Any] = [one for one in page.frames if one["t"] == "data" and one["sub"] == sub][-1]["value"]
    return found


def kinds(scene: dict[str, Any]) -> dict[str, int]:
    named = [shape[0] for shape in scene["shapes"]]
    return {kind: named.count(kind) for kind in named}


def test_the_views_show_the_arena_with_rays_robots_and_crates_and_what_the_cameras_saw() -> None:
    async def main() -> None:
        page, world = await arena(robots=2)
        for sub, path, name in ((1, "world", "seen_from_above"), (2, "robot_1", "seen")):
            page.say(t="sub", sub=sub, topic="view", hz=10, args={"path": path, "name": name})
        body, places = world.simulation.robots[0], []
        for _ in range(100):
            await asyncio.sleep(0.05)
            places.append((body.x, body.y))
        above = scene(page, 1)
        assert kinds(above)["rays"] == 2
        assert above["caption"].endswith("0 delivered")
        begin, ends = above["shapes"][1][1:3]
        assert min(math.dist(begin, place) for place in places) < 0.05  # where it was; it drives on while they travel
        assert all(math.hypot(*end) < 6.3 for end in ends)
        assert kinds(scene(page, 2))["image"] >= 1
        assert scene(page, 2)["caption"] == "advance"
        areas = kinds(above)["area"]
        await act(page, "block_station")
        await asyncio.sleep(1)
        assert kinds(scene(page, 1))["area"] == areas + 1
        await page.studio.close()

    virtually(main)


def test_a_robot_that_is_pushed_finds_out_where_it_is() -> None:
    async def main() -> None:
        page, world = await arena()
        with tap(page, "robot_0/perception/localise.localised") as localised:
            await asyncio.sleep(7)
            body = world.simulation.robots[0]
            before, rolled = math.hypot(body.x, body.y), body.odometry
            await act(page, "push_robot", ahead=-0.5, left=0.0, turn=0.0)
            await asyncio.sleep(0.15)
            assert math.dist(body.odometry[:2], rolled[:2]) < 0.2  # its wheels have not noticed
            await asyncio.sleep(8)
            assert localised.latest is not None
            believed = localised.latest.value
            assert believed.fits
            assert math.hypot(*believed.pose[:2]) == pytest.approx(math.hypot(body.x, body.y), abs=0.2)
            assert before > 0
        await page.studio.close()

    virtually(main)


def test_in_the_dark_the_robot_finds_no_signs_until_the_light_is_on_again() -> None:
    async def main() -> None:
        page, _ = await arena()
        with tap(page, "robot_0/perception/targets.out") as targets:

            async def newest() -> Any:
                await asyncio.sleep(1)
                assert targets.latest is not None
                return targets.latest.value

            await asyncio.sleep(3)
            assert await newest() != []
            await act(page, "dim_light")
            assert await newest() == []
            await page.ask("undo")
            assert await newest() != []
        await page.studio.close()

    virtually(main)


def test_a_robot_does_not_wait_for_a_cube_at_a_blocked_station() -> None:
    async def main() -> None:
        page, world = await arena()
        while (station := next(iter(world.simulation.handing_over()), None)) is None:  # where it would fetch
            await asyncio.sleep(0.5)
        here = station[1]
        await page.studio.close()
        page, world = await arena()  # the same world again
        await act(page, "block_station", blocked=f"{here.kind} {here.number}")
        while (station := next(iter(world.simulation.handing_over()), None)) is None:
            await asyncio.sleep(0.5)
        assert station[1] != here
        await page.studio.close()

    virtually(main)


def test_motors_obey_their_limit_at_once() -> None:
    async def main() -> None:
        page, world = await arena()
        await asyncio.sleep(5)
        await page.edit({"do": "SetParameter", "path": "world.speed", "value": 0.1})
        await asyncio.sleep(2)
        assert 0 < world.simulation.robots[0].speed <= 0.1 + 1e-6
        await page.studio.close()

    virtually(main)


def test_without_activity_the_robot_stands_still_and_a_reset_starts_the_mission_over() -> None:
    async def main() -> None:
        page, world = await arena()
        run = page.studio.steering.run
        assert run is not None
        await asyncio.sleep(5)
        body = world.simulation.robots[0]
        assert body.speed > 0
        await page.ask("trigger", path="robot_0.deactivate", value=True)
        await asyncio.sleep(2)
        assert list(run.active()) == []
        assert body.speed == 0
        await page.ask("reset")
        await asyncio.sleep(3)
        assert "robot_0/advance" in run.active()
        assert body.speed > 0
        await page.studio.close()

    virtually(main)


def test_a_push_of_a_robot_that_is_not_there_does_no_harm() -> None:
    async def main() -> None:
        page, world = await arena()
        await act(page, "push_robot", robot=3)
        await asyncio.sleep(1)
        assert page.run["state"] == "running"
        assert world.simulation.now_s > 0.5
        await page.studio.close()

    virtually(main)
