"""What viewers see of a run, and what it costs: in virtual time, without a network."""

from __future__ import annotations

import asyncio
import json
import random
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

import hfg
from hfg import commands
from hfg.engine import Run
from hfg.engine.runtime import settings
from hfg.errors import UsageError
from hfg.recording import record
from hfg.viewers.channels import ACTIVITY, LOG, Channel, Channels
from hfg.viewers.looking import MOST_VIEWERS, Looking, Viewer
from tests.viewers.robots import robot

CIRCUMSTANCES = ("time", "began", "waited", "call", "beside", "last", "silent", "firing")


class Desk:
    """The server's part, on the loop of the run: what is told is encoded at once, or on `deliver`."""

    def __init__(self, run: Run, *, at_once: bool = True) -> None:
        self.told: list[Channel] = []
        self.wishes: list[tuple[str, bool]] = []
        self.channels = Channels(run, self._tell)
        self.looking = Looking(self.channels.of.values(), self._wish, virtual=True, name="robot", session="1")
        self.channels.when_changed = self.looking.change
        self._at_once = at_once

    def _tell(self, channel: Channel) -> None:
        if self._at_once:
            self.looking.deliver(channel)
        else:
            self.told.append(channel)

    def _wish(self, number: int, wanted: bool) -> None:
        if number in self.channels.of:
            self.wishes.append((self.channels.of[number].topic, wanted))
        self.channels.wish(number, wanted=wanted)

    def number(self, topic: str) -> int:
        return next(number for number, one in self.channels.of.items() if one.topic == topic)

    def enter(self, *topics: str) -> Viewer:
        viewer = self.looking.enter(lambda: None)
        subscriptions = [{"id": 1000 + self.number(one), "channelId": self.number(one)} for one in topics]
        viewer.say(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))
        return viewer

    def taken(self, viewer: Viewer) -> list[tuple[str, dict[str, Any]]]:
        """Everything that is on its way to a viewer: topic and message."""
        found = []
        while (message := viewer.take()) is not None:
            if not isinstance(message, str) and message[0] == 1:
                _, number, _ = struct.unpack_from("<BIQ", message)
                found.append((self.channels.of[number - 1000].topic, json.loads(message[13:])))
        return found


def run(graph: hfg.Graph, begin: Callable[[Run], Any], until_s: float = 0.5) -> hfg.Report:
    return hfg.run(graph, clock="virtual", until_s=until_s, begin=lambda run: begin(run) and None)


@pytest.mark.rule("R7")
def test_a_viewer_sees_what_a_recording_writes(tmp_path: Path) -> None:
    seen: list[tuple[str, dict[str, Any]]] = []
    ports = ["camera.out", "laser.out", "lidar.out", "tree.out", "number.out", "half.out"]

    def begin(run: Run) -> None:
        record(run, tmp_path / "run.mcap")
        desk = Desk(run)
        viewer = desk.enter(*ports)
        run._engine.callbacks.pumped.append(lambda: seen.extend(desk.taken(viewer)))

    run(robot(), begin)
    with (tmp_path / "run.mcap").open("rb") as stream:
        written = [(channel.topic, json.loads(one.data)) for _, channel, one in make_reader(stream).iter_messages()]

    def of(port: str, found: list[tuple[str, dict[str, Any]]]) -> list[dict[str, Any]]:
        return [{k: v for k, v in data.items() if k not in CIRCUMSTANCES} for topic, data in found if topic == port]

    for port in ports:
        assert len(of(port, seen)) >= 5
        assert of(port, seen) == of(port, written), port


@pytest.mark.rule("R7", "A5")
def test_the_state_the_events_and_the_log_are_channels() -> None:
    desks: list[tuple[Desk, Viewer]] = []

    def begin(run: Run) -> None:
        desk = Desk(run)
        desks.append((desk, desk.enter("hfg/events", ACTIVITY, LOG)))

    run(robot(), begin)
    found = desks[0][0].taken(desks[0][1])
    states = [data["state"] for topic, data in found if topic == ACTIVITY]
    assert states[0] == ""
    assert "drive" in states
    assert any(data["type"] == "ActivityChanged" for topic, data in found if topic == "hfg/events")
    [line] = [data for topic, data in found if topic == LOG and data["name"] == "drive"]
    assert (line["message"], line["level"]) == ("off we go", 3)


@pytest.mark.rule("R7")
def test_nothing_is_kept_or_encoded_of_what_nobody_looks_at(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings, "FUSE_AFTER", 0)
    desks: list[tuple[Desk, Viewer]] = []
    fused: list[Any] = []

    def begin(run: Run) -> None:
        desk = Desk(run)
        desks.append((desk, desk.enter("half.out")))
        run._engine.callbacks.finished.append(lambda: fused.append(run.explain()))

    run(robot(), begin)
    alone: list[Any] = []
    run(robot(), lambda run: run._engine.callbacks.finished.append(lambda: alone.append(run.explain())))
    channels = {one.topic: one for one in desks[0][0].channels.of.values()}
    assert channels["half.out"].made >= 5
    assert {topic for topic, one in channels.items() if one.passed or one.made} == {"half.out"}
    assert str(fused) == str(alone)  # and the watched one too, because a tap takes waves


@pytest.mark.rule("R7")
def test_after_the_last_viewer_has_gone_nothing_is_observed() -> None:
    desks: list[Desk] = []

    def begin(run: Run) -> None:
        desk = Desk(run)
        desks.append(desk)
        one, other = desk.enter("number.out", LOG), desk.enter("number.out")
        one.leave()
        assert desk.wishes == [("number.out", True), (LOG, True), (LOG, False)]
        other.say(json.dumps({"op": "unsubscribe", "subscriptionIds": [1000 + desk.number("number.out"), 77]}))
        other.leave()

    run(robot(), begin)
    assert desks[0].wishes[-1] == ("number.out", False)
    assert all(one.passed == 0 for one in desks[0].channels.of.values())
    assert not desks[0].looking.viewers


@pytest.mark.rule("R7")
def test_a_viewer_that_takes_nothing_costs_one_image_and_the_newest_wins() -> None:
    desks: list[tuple[Desk, Viewer]] = []

    def begin(run: Run) -> None:
        desk = Desk(run)
        desks.append((desk, desk.enter("camera.out", "number.out")))

    report = run(robot(rate_hz=1000.0), begin, until_s=2.0)
    desk, viewer = desks[0]
    camera, number = (desk.channels.of[desk.number(one)] for one in ("camera.out", "number.out"))
    assert report.outcome == "until"
    assert camera.passed >= 1999
    assert camera.made == 1
    assert number.made == 256
    taken = desk.taken(viewer)
    assert len([1 for topic, _ in taken if topic == "camera.out"]) == 2  # the first, and the newest that waited
    assert [data["value"] for topic, data in taken if topic == "number.out"][-1] == number.passed


def test_a_slow_viewer_misses_what_a_fast_one_sees() -> None:
    desks: list[tuple[Desk, Viewer, Viewer]] = []
    fast: list[Any] = []

    def begin(run: Run) -> None:
        desk = Desk(run)
        one = (desk, desk.enter("camera.out"), desk.enter("camera.out"))
        desks.append(one)
        run._engine.callbacks.pumped.append(lambda: fast.extend(desk.taken(one[1])))

    run(robot(), begin)
    desk, quick, slow = desks[0]
    assert len(fast) >= 10
    assert quick.skipped == 0
    assert slow.skipped == len(fast) - 1
    assert [data["sequence"] for _, data in desk.taken(slow)] == [len(fast)]


def test_ports_that_come_and_go_are_advertised() -> None:
    said: list[str] = []
    editing: list[asyncio.Future[None]] = []

    def begin(run: Run) -> None:
        desk = Desk(run)
        viewer = desk.enter("half.out")

        async def edit() -> None:
            await asyncio.sleep(0.1)
            await run.edit(commands.Remove("half"))

        editing.append(asyncio.ensure_future(edit()))

        def take() -> None:
            said.extend(one for one in iter(viewer.take, None) if isinstance(one, str))

        run._engine.callbacks.pumped.append(take)

    run(robot(), begin)
    gone = [json.loads(one) for one in said if '"unadvertise"' in one]
    assert len(gone) == 1
    assert len(gone[0]["channelIds"]) == 2  # that of the node, and that of the source, which has no edge any more


def test_what_is_not_allowed_is_refused_in_words() -> None:
    desks: list[tuple[Desk, Viewer]] = []
    run(robot(), lambda run: desks.append(((desk := Desk(run)), desk.enter("half.out"))), until_s=0.0)
    desk, viewer = desks[0]
    desk.taken(viewer)

    def answer(message: dict[str, Any]) -> str:
        viewer.say(json.dumps(message))
        said = viewer.take()
        assert isinstance(said, str)
        status = json.loads(said)
        assert status["op"] == "status"
        assert status["level"] == 2
        return str(status["message"])

    half = desk.number("half.out")
    assert "takes nothing" in answer({"op": "setParameters", "parameters": [{"name": "half.x", "value": 1}]})
    assert "takes nothing" in answer({"op": "advertise", "channels": []})
    assert answer({"op": "subscribe", "subscriptions": [{"id": 9, "channelId": 999}]}) == "there is no channel 999"
    assert "subscribed already" in answer({"op": "subscribe", "subscriptions": [{"id": 9, "channelId": half}]})
    for wrong in ("", "[]", "{}", '{"op": 3}', '{"op": "subscribe"}', '{"op":"subscribe","subscriptions":[{"id":-1}]}'):
        with pytest.raises(UsageError, match="not a message of Foxglove"):
            viewer.say(wrong)
    with pytest.raises(UsageError, match="a number from 0"):
        viewer.say('{"op": "subscribe", "subscriptions": [{"id": 5000000000, "channelId": 1}]}')
    for _ in range(1000):  # one that asks much and reads nothing
        viewer.say('{"op": "getParameters"}')
    assert len(list(iter(viewer.take, None))) <= 16
    for _ in range(MOST_VIEWERS - 1):
        desk.enter()
    with pytest.raises(UsageError, match="close one of them"):
        desk.enter()


def test_two_thousand_fuzzed_messages_are_refused_in_words_and_nothing_else() -> None:
    chance = random.Random(31)
    desks: list[tuple[Desk, Viewer]] = []
    refused: list[str] = []

    def begin(run: Run) -> None:
        desk = Desk(run)
        viewer = desk.enter()
        desks.append((desk, viewer))
        for _ in range(2000):
            good = json.dumps(
                {
                    "op": chance.choice(["subscribe", "unsubscribe", "advertise", "x" * chance.randrange(60)]),
                    "subscriptions": [{"id": chance.randrange(9), "channelId": chance.randrange(12)}],
                    "subscriptionIds": [chance.randrange(9)],
                }
            )
            text = list(good)
            for _ in range(chance.choice([0, 1, 1, 2, 5])):
                text[chance.randrange(len(text))] = chance.choice('{}[]",:\\0e-\ud83d\u00e9 \x00')
            try:
                viewer.say("".join(text))
            except UsageError as error:
                refused.append(str(error))

    assert run(robot(), begin).outcome == "until"
    assert 200 < len(refused) < 2000
    desk, viewer = desks[0]
    viewer.leave()
    assert not desk.looking.viewers
