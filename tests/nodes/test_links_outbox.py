"""Publishers that keep what is not done in a file, and die: what follows, in virtual time over a network in memory."""

from __future__ import annotations

import asyncio
import random
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

import hfg
from hfg.errors import NodeError, RunError
from hfg.links.pubsub.outbox import KeptValue, OutboxFile
from hfg_transports.memory import Faults
from tests.nodes.test_links import World, camera, numbers, play, running, viewer, world

__all__ = ["world"]


@pytest.fixture
def file(tmp_path: Path) -> str:
    return str(tmp_path / "front.outbox")


def rows(file: str) -> list[int]:
    with closing(sqlite3.connect(file)) as opened:
        return [number for (number,) in opened.execute("SELECT number FROM hfg_outbox_value ORDER BY number")]


@pytest.mark.rule("L2", "L3")
def test_a_publisher_that_died_goes_on_with_what_was_not_done_and_nobody_gets_it_twice(world: World, file: str) -> None:
    async def scene() -> None:
        one, other = camera(world, rate=None, to=12, outbox=file), camera(world, begin=12, to=15, outbox=file)
        view = viewer(world, pause_s=1.0)
        async with running(one, other, view):
            view.start()
            one.start()
            await asyncio.sleep(2.5)
            world.network.sessions[1].die()
            await one.stop()
            published = rows(file)[-1]
            assert view.seen == [0, 1, 2]
            await asyncio.sleep(20)
            other.start()
            await view.report()
            await other.report()
            assert view.seen == [*range(published), 12, 13, 14]
            assert other.counts["restored"] == len(range(2, published))
            assert other.counts["lost"] == view.counts["lost"] == 0
            assert view.counts["repeated"] > 0
        assert rows(file) == []

    play(scene)


@pytest.mark.rule("L2", "L3")
def test_all_subscribers_that_have_lived_on_get_all_of_it_once_whoever_comes_first(world: World, file: str) -> None:
    async def scene() -> None:
        one, other = camera(world, rate=None, to=100, outbox=file), camera(world, begin=100, to=130, outbox=file)
        quick, slow = viewer(world, capacity=30), viewer(world, pause_s=0.5, capacity=1)
        async with running(one, other, quick, slow):
            quick.start()
            slow.start()
            await asyncio.sleep(0.1)
            one.start()
            await asyncio.sleep(3)
            world.network.sessions[2].die()
            await one.stop()
            published = rows(file)[-1]
            other.start()
            for each in (quick, slow, other):
                await each.report()
            everything = [*range(published), *range(100, 130)]
            assert quick.seen[quick.seen.index(1) :] == slow.seen[slow.seen.index(1) :] == everything[1:]

    play(scene)


@pytest.mark.rule("L2", "L3")
def test_if_both_have_died_the_next_two_go_on_where_the_last_was(world: World, file: str) -> None:
    async def scene() -> None:
        one, other = camera(world, rate=None, to=20, outbox=file), camera(world, begin=20, to=22, outbox=file)
        dies, heir = viewer(world, pause_s=1.0), viewer(world)
        async with running(one, other, dies, heir):
            dies.start()
            one.start()
            await asyncio.sleep(3.5)
            await dies.stop()
            await asyncio.sleep(5)
            await one.stop()
            left = rows(file)
            assert left[0] == 4, "the first three are done, and it was about the fourth when it was stopped"
            other.start()
            heir.start()
            await heir.report()
            await other.report()
            assert dies.seen == [0, 1, 2, 3]
            assert heir.seen == [*range(3, left[-1]), 20, 21]

    play(scene)


@pytest.mark.rule("F13", "L2")
def test_an_end_that_nobody_had_heard_is_not_the_end_of_the_next_life(world: World, file: str) -> None:
    async def scene() -> None:
        one, other = camera(world, rate=None, to=3, outbox=file), camera(world, begin=3, to=5, outbox=file)
        view = viewer(world, pause_s=1.0, capacity=1)
        async with running(one, other, view):
            view.start()
            one.start()
            await asyncio.sleep(1.5)
            world.network.sessions[1].die()
            await one.stop()
            assert rows(file) == [2, 3, 4], "and the fourth is the end"
            await asyncio.sleep(5)
            other.start()
            await view.report()
            assert view.seen == [0, 1, 2, 3, 4]

    play(scene)


@pytest.mark.slow
@pytest.mark.rule("L1", "L2", "L3")
@pytest.mark.parametrize("seed", range(12))
def test_whatever_dies_when_on_a_bad_network_who_lives_on_gets_each_value_once_and_in_order(
    world: World, file: str, seed: int
) -> None:
    async def scene() -> None:
        draw = random.Random(seed)
        world.network.faults = Faults(loss=draw.choice([0.0, 0.2]))
        views = [
            viewer(world, pause_s=draw.choice([0.02, 0.1, 0.3]), capacity=draw.randint(1, 9), at_end="wait")
            for _ in range(draw.randint(1, 3))
        ]
        lives = draw.randint(2, 5)
        async with running(*views):
            for view in views:
                view.start()
            await asyncio.sleep(0.1)
            for life in range(lives):
                is_last = life == lives - 1
                to = 1000 * life + (10 if is_last else 150)
                one = camera(world, rate=None, begin=1000 * life, to=to, outbox=file, window=draw.randint(1, 8))
                async with running(one):
                    sessions = len(world.network.sessions)
                    one.start()
                    if is_last:
                        await one.report()
                        break
                    await asyncio.sleep(draw.uniform(0.0, 2.0))
                    if draw.random() < 0.7 and len(world.network.sessions) > sessions:
                        world.network.sessions[-1].die()
                await asyncio.sleep(draw.choice([0.0, 0.5, 4.0]))
            await asyncio.sleep(1)
            for view in views:
                first = min(view.seen)  # those who come later begin with what is sent from then on
                for life in range(first // 1000, lives):
                    seen = [value for value in view.seen if value // 1000 == life]
                    begin = first if life == first // 1000 else 1000 * life
                    assert seen == list(range(begin, begin + len(seen)))
                assert view.seen == sorted(view.seen)
                assert view.seen == [value for value in views[0].seen if value >= first]
                assert view.seen[-1] == 1000 * (lives - 1) + 9

    play(scene)


@pytest.mark.rule("L3")
def test_after_a_good_end_the_next_publisher_begins_anew(world: World, file: str) -> None:
    async def scene() -> None:
        for begin in (0, 3):
            one, view = camera(world, begin=begin, to=begin + 3, outbox=file), viewer(world)
            async with running(one, view):
                view.start()
                one.start()
                await view.report()
                await one.report()
                assert view.seen == list(range(begin, begin + 3))
                assert one.counts["restored"] == view.counts["repeated"] == 0

    play(scene)


@pytest.mark.rule("L2")
def test_an_outbox_of_another_name_or_type_that_keeps_something_is_refused(file: str) -> None:
    first = OutboxFile(file, "camera/front", "int")
    with pytest.raises(RunError, match=r'outbox ".*" of "camera/front" cannot be used: database is locked'):
        OutboxFile(file, "camera/front", "int")
    first.keep(KeptValue(1, b"", b"1"), 0, {"a"})
    first.close()
    with pytest.raises(RunError, match=r'has 1 values of "camera/front", so "camera/back" cannot be published'):
        OutboxFile(file, "camera/back", "int")
    with pytest.raises(RunError, match=r"has 1 values of another type"):
        OutboxFile(file, "camera/front", "str")
    again = OutboxFile(file, "camera/front", "int")
    assert (again.stream, again.last, again.kept) == (first.stream, 1, [KeptValue(1, b"", b"1")])
    assert again.members == {"a"}
    again.forget(1)
    again.close()
    back = OutboxFile(file, "camera/back", "int")
    assert (back.last, back.kept) == (0, [])
    assert back.stream != first.stream
    back.close()


@pytest.mark.rule("L2")
def test_a_value_is_in_the_file_or_the_whole_change_is_not(file: str) -> None:
    outbox = OutboxFile(file, "camera/front", "int")
    outbox.keep(KeptValue(1, b"", b"1"), 0, {"a"})
    not_for_sqlite: Any = object()
    with pytest.raises(RunError, match="cannot be used"):
        outbox.keep(KeptValue(2, b"", not_for_sqlite), 1, set())
    outbox.keep(KeptValue(2, b"", b"2"), 0, set())
    outbox.close()
    assert rows(file) == [1, 2]


@pytest.mark.parametrize(
    ("how", "sentence"),
    [
        (
            {"lossless": False},
            "which does not wait for subscribers, and with an outbox, from which nothing must get lost",
        ),
        ({"outbox": "/no/such/folder/box"}, "cannot be used: No such file or directory; use a writable path"),
    ],
)
def test_an_outbox_that_cannot_be_is_one_sentence(
    world: World, file: str, how: dict[str, object], sentence: str
) -> None:
    graph = hfg.Graph("camera")
    source = graph.add(numbers())
    hfg.publish("camera/front", source.out, settings=world.settings, **({"outbox": file} | how))
    with pytest.raises(NodeError, match=sentence):
        hfg.run(graph, clock="virtual")


def test_what_is_no_outbox_is_left_alone(world: World, file: str) -> None:
    Path(file).write_bytes(b"somebody's notes, longer than the head of a database would be" * 20)
    graph = hfg.Graph("camera")
    hfg.publish("camera/front", graph.add(numbers()).out, settings=world.settings, outbox=file)
    with pytest.raises(NodeError, match="cannot be used: file is not a database"):
        hfg.run(graph, clock="virtual")
    assert Path(file).read_bytes().startswith(b"somebody's notes")
