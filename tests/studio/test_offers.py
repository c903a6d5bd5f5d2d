"""What nodes offer to people: views are drawn for those who look, actions change the run as commands and signals do."""

from __future__ import annotations

import asyncio
import base64
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest
from annotated_types import Interval

import hfg
from hfg.panels import Call, Change, Look, Scene, View, actions_of, view, views_of
from hfg.studio.scenes import scene_as_data
from hfg.studio.viewing import Subscription
from tests.studio.page import Page, studio_of


class Knock(NamedTuple):
    """How to knock."""

    times: Annotated[int, Interval(ge=1, le=5), hfg.Parameter(unit="1")] = 2
    loud: bool = False


@dataclass(frozen=True)
class Letter:
    """What is put under the door."""

    text: str


class Room(hfg.Node):
    """A room with a door."""

    light = hfg.Parameter(1.0, Interval(ge=0, le=1))
    door = hfg.Parameter("open", choices=("open", "closed"))
    ticks = hfg.Output(int)

    heard: hfg.State[list[Any]] = hfg.State(factory=list)
    drawn = hfg.State(0)

    evening = Change("Make it evening", {"light": 0.25, "door": "closed"}, "Dim, and nobody comes in.")
    knock_twice = Call("Knock", "knock")
    ring_once = Call("Ring", "ring")
    say_something = Call("Say something", "say")
    push_letter = Call("Push a letter through", "post")
    nowhere = Call("Leads nowhere", "no_such_slot")

    def process(self) -> None:
        """Go on."""
        self.ticks.send(len(self.heard))

    @hfg.slot
    def knock(self, knock: Knock) -> None:
        """Hear it."""
        self.heard.append(knock)

    @hfg.slot
    def ring(self) -> None:
        """Hear it."""
        self.heard.append("ring")

    @hfg.slot
    def say(self, words: str) -> None:
        """Hear it."""
        self.heard.append(words)

    @hfg.slot
    def post(self, letter: Letter) -> None:
        """Get it."""
        self.heard.append(letter)

    @view("The room")
    def seen(self, look: Look) -> Scene | None:
        """The room from the door."""
        self.drawn += 1
        scene = Scene(0, 0, 4, 3, caption=f"{look.path}, ticks {look.latest('ticks')}, active {list(look.active())}")
        scene.disc((2, 1.5), 1, fill="one")
        return scene

    @view("Broken")
    def broken(self, look: Look) -> Scene | None:
        raise ZeroDivisionError("no light")

    @view("Nothing yet")
    def nothing(self, look: Look) -> Scene | None:
        return None


@hfg.node
def count(value: int) -> int:
    """Pass it on."""
    return value


def house(**options: Any) -> hfg.Graph:
    """A room that ticks ten times a second."""
    graph = hfg.Graph("house")
    room = graph.add(Room(), name="room", max_rate_hz=10, **options)
    graph.connect(room.ticks, graph.add(count(), name="count").value)
    return graph


def virtually(main: Callable[[], Coroutine[Any, Any, None]]) -> None:
    """Run a test in virtual time."""
    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())


async def begun(graph: hfg.Graph | None = None) -> Page:
    """A page of a house that is alive."""
    page = Page(studio_of(graph or house())).join()
    assert (await page.ask("start"))["t"] == "ack"
    return page


def scenes(page: Page, sub: int = 1) -> list[Any]:
    return [frame["value"] for frame in page.frames if frame["t"] == "data" and frame["sub"] == sub]


def gone(page: Page) -> list[str]:
    return [frame["message"] for frame in page.frames if frame["t"] == "gone"]


def look_at(page: Page, name: str, path: str = "room") -> None:
    page.say(t="sub", sub=1, topic="view", hz=10, args={"path": path, "name": name})


async def act(page: Page, name: str, **args: Any) -> dict[str, Any]:
    return await page.ask("act", path="room", name=name, args=args)


# --- what is offered ---


def test_a_type_says_what_it_offers_with_the_arguments_that_it_suggests() -> None:
    async def main() -> None:
        page = Page(studio_of(house())).join()
        record = page.tables["types"][page.tables["nodes"]["room"]["type"]]
        assert [one["title"] for one in record["views"]] == ["The room", "Broken", "Nothing yet"]
        assert record["views"][0]["doc"] == "The room from the door."
        actions = {one["label"]: one for one in record["actions"]}
        assert list(actions) == ["Make it evening", "Knock", "Ring", "Say something", "Push a letter through"]
        evening, knock = actions["Make it evening"], actions["Knock"]
        assert evening["undoable"]
        assert not knock["undoable"]
        assert [(one["name"], one["default"]) for one in evening["arguments"]] == [("light", 0.25), ("door", "closed")]
        times = knock["arguments"][0]
        assert (times["kind"], times["low"], times["high"]) == ("int", 1, 5)
        assert actions["Ring"]["arguments"] == []

    virtually(main)


def test_a_subclass_offers_what_its_base_offers_and_can_take_it_back() -> None:
    class Cellar(Room):
        evening = None  # type: ignore[assignment]
        flood = Change("Flood it", {"light": 0.0})

    assert list(actions_of(Cellar))[-1] == "flood"
    assert "evening" not in actions_of(Cellar)
    assert list(views_of(Cellar)) == ["seen", "broken", "nothing"]
    assert isinstance(Room.seen, View)


# --- actions ---


def test_an_action_that_sets_parameters_is_one_step_that_can_be_undone() -> None:
    async def main() -> None:
        page = await begun()
        room = page.studio.graph["room"]
        assert (await act(page, "evening"))["t"] == "ack"
        assert (room.light, room.door) == (0.25, "closed")
        assert [step["by"] for step in page.tables["studio"]["history"]["done"]] == [page.viewer.number]
        await page.ask("undo")
        assert (room.light, room.door) == (1.0, "open")
        assert page.agrees()
        await page.studio.close()

    virtually(main)


def test_a_person_may_give_other_values_than_those_suggested_also_at_rest() -> None:
    async def main() -> None:
        page = Page(studio_of(house())).join()
        assert (await act(page, "evening", light=0.5))["t"] == "ack"
        room = page.studio.graph["room"]
        assert (room.light, room.door) == (0.5, "closed")

    virtually(main)


def test_an_action_that_calls_a_slot_reaches_the_node_and_is_in_the_history_of_all_pages() -> None:
    async def main() -> None:
        page = await begun()
        other = Page(page.studio).join()
        for name, args in (
            ("knock_twice", {"loud": True}),
            ("ring_once", {}),
            ("say_something", {"value": "hello"}),
            ("push_letter", {"text": "hi"}),
        ):
            assert (await act(page, name, **args))["t"] == "ack", name
        await asyncio.sleep(1)
        assert page.studio.graph["room"].heard == [Knock(2, True), "ring", "hello", Letter("hi")]
        history = other.tables["studio"]["history"]
        assert history["done"] == []  # Undo has nothing to do
        assert [step["text"] for step in history["calls"]][:2] == ["Knock: times 2, loud True", "Ring"]
        await page.studio.close()

    virtually(main)


@pytest.mark.parametrize(
    ("name", "args", "says"),
    [
        ("no_such", {}, "offers the actions"),
        ("nowhere", {}, "offers the actions"),
        ("evening", {"size": 1}, "takes light, door"),
        ("evening", {"light": 3}, "must be <= 1"),
        ("knock_twice", {"times": 9}, "must be <= 5"),
        ("knock_twice", {"times": "often"}, "times"),
        ("say_something", {}, "needs a value"),
        ("push_letter", {"text": "a", "to": "b"}, 'got "to"'),
    ],
)
def test_what_is_wrong_with_an_action_is_said_and_nothing_happens(name: str, args: dict[str, Any], says: str) -> None:
    async def main() -> None:
        page = await begun()
        answer = await act(page, name, **args)
        assert answer["t"] == "reject"
        assert says in answer["message"]
        await asyncio.sleep(1)
        room = page.studio.graph["room"]
        assert (room.light, room.door, room.heard) == (1.0, "open", [])
        assert page.tables["studio"]["history"]["calls"] == []
        await page.studio.close()

    virtually(main)


def test_a_slot_is_called_only_while_the_graph_runs_and_by_none_who_may_only_look() -> None:
    async def main() -> None:
        page = Page(studio_of(house())).join()
        assert "start it first" in (await act(page, "ring_once"))["message"]
        looking = Page(studio_of(house(), read_only="You may look.")).join()
        assert (await act(looking, "evening"))["message"] == "You may look."
        assert looking.studio.graph["room"].light == 1.0

    virtually(main)


# --- views ---


def test_a_view_shows_what_has_passed_since_the_page_began_to_look() -> None:
    async def main() -> None:
        page = await begun()
        look_at(page, "seen")
        await asyncio.sleep(1)
        first, last = scenes(page)[0], scenes(page)[-1]
        assert first["caption"] == "room, ticks None, active []"
        assert last["caption"] == "room, ticks 0, active []"
        assert last["bounds"] == [0, 0, 4, 3]
        assert last["shapes"] == [["disc", [2, 1.5], 1, "one", "", 1]]
        await page.studio.close()

    virtually(main)


def test_a_view_says_which_nodes_in_its_subgraph_are_active() -> None:
    class Errand(hfg.Node):
        @hfg.slot
        def begin(self) -> None:
            """Begin."""

    class Robot(hfg.Subgraph):
        begin = hfg.slot(type=object)

        def build(self, graph: hfg.Graph) -> None:
            self.begin.inner.activates(graph.add(Errand(), name="errand").begin)

        @view("Doing")
        def doing(self, look: Look) -> Scene:
            return Scene(0, 0, 1, 1, caption=", ".join(look.active()))

    async def main() -> None:
        graph = house()
        graph.start.activates(graph.add(Robot(), name="robot").begin)
        page = await begun(graph)
        look_at(page, "doing", "robot")
        await asyncio.sleep(1)
        assert scenes(page)[-1]["caption"] == "errand"
        assert (await page.ask("trigger", path="robot.deactivate", value=True))["t"] == "ack"
        await asyncio.sleep(1)
        assert scenes(page)[-1]["caption"] == ""
        await page.studio.close()

    virtually(main)


def test_a_view_is_drawn_for_no_page_that_cannot_take_it() -> None:
    async def main() -> None:
        page = await begun()
        room = page.studio.graph["room"]
        await asyncio.sleep(1)
        assert room.drawn == 0
        look_at(page, "seen")
        stream: Subscription = page.viewer.subscriptions[1]
        stream.painted = lambda seq: None  # type: ignore[method-assign]  # a page that paints nothing
        await asyncio.sleep(5)
        assert room.drawn == 2  # the first was painted at once, the second never is
        await page.studio.close()

    virtually(main)


def test_a_view_that_fails_ends_with_a_sentence_and_the_run_goes_on() -> None:
    async def main() -> None:
        page = await begun()
        look_at(page, "broken")
        await asyncio.sleep(1)
        (said,) = gone(page)
        assert 'view "broken" of "room" failed' in said
        assert "no light" in said
        assert page.run["state"] == "running"
        look_at(page, "nothing")
        await asyncio.sleep(1)
        assert scenes(page) == []
        await page.studio.close()

    virtually(main)


def test_a_view_that_is_not_there_or_not_on_the_loop_is_refused() -> None:
    async def main() -> None:
        graph = house(group="work")
        graph.group("work", threads=1)
        page = await begun(graph)
        look_at(page, "no_such")
        look_at(page, "seen")
        await asyncio.sleep(0.1)
        missing, elsewhere = gone(page)
        assert "offers the views seen, broken, nothing" in missing
        assert 'runs in group "work"' in elsewhere
        await page.studio.close()

    asyncio.run(main())


def test_a_view_goes_on_with_the_next_run() -> None:
    async def main() -> None:
        page = await begun()
        look_at(page, "seen")
        await asyncio.sleep(1)
        await page.ask("stop")
        await page.state("ended")
        frames = len(scenes(page))
        await asyncio.sleep(1)
        assert len(scenes(page)) == frames  # nothing is drawn at rest
        await page.ask("start")
        await asyncio.sleep(1)
        assert scenes(page)[frames]["caption"] == "room, ticks None, active []"
        await page.studio.close()

    virtually(main)


# --- scenes ---


def test_a_scene_becomes_numbers_and_pictures_that_a_page_can_draw() -> None:
    scene = Scene(-1, -1, 1, 1, caption="all")
    scene.line(np.array([[0.12345, 0], [1, 1]]), "soft", width=2)
    scene.area([(0, 0), (1, 0), (1, 1)], fill="ground")
    scene.rays((0, 0), [(1, 0), (0, 1)], "two")
    scene.text("wall", (0, 0.5), 0.2)
    scene.image(np.full((20, 30), 128, np.uint8), -1, -1, 1, 1)
    shapes = scene_as_data(scene)["shapes"]
    assert shapes[0] == ["line", [[0.123, 0.0], [1.0, 1.0]], "", "soft", 2.0]
    assert shapes[1][2:] == ["ground", "", 1.0]
    assert shapes[2] == ["rays", [0.0, 0.0], [[1.0, 0.0], [0.0, 1.0]], "two"]
    assert shapes[3] == ["text", "wall", [0.0, 0.5], 0.2, "ink", "middle"]
    assert base64.b64decode(shapes[4][1])[:2] in (b"\xff\xd8", b"\x89P")


def test_what_cannot_be_drawn_is_left_out() -> None:
    scene = Scene(-1, -1, 1, 1)
    scene.disc((float("nan"), 0), 1, fill="one")
    scene.line([(0, 0), (1,)])  # not a point
    scene.disc((0, 0), 1, line="one")
    assert [shape[0] for shape in scene_as_data(scene)["shapes"]] == ["disc"]
