"""The nodes among themselves, over a router of their own: who is there, what is lost, what bad input gets."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

import hfg
from hfg.cli import main
from hfg.errors import HfgError, NodeError
from hfg.nodes.ros import RosAction, RosPublish, RosService, RosServiceClient, RosSubscribe
from hfg.ros import goals
from hfg.ros.connection import Connection
from hfg.ros.messages import action, message, service
from hfg.ros.wire import Entity, Qos
from tests.ros.conftest import Router, until
from tests.ros.ends import Keep, Say
from tests.transports.zenoh.conftest import free_port

pytestmark = [pytest.mark.slow, pytest.mark.asyncio]

STRING = "std_msgs/msg/String"
SET_BOOL = service("std_srvs/srv/SetBool")
FIBONACCI = action("example_interfaces/action/Fibonacci")


class Answer(hfg.Node):
    """Answers a request, unless it asks for nothing."""

    out = hfg.Event(Any)

    @hfg.slot
    def request(self, value: hfg.Token[Any]) -> None:
        if value.value.data:
            self.out.trigger(SET_BOOL.response.record(success=True, message=""), stamp=value.stamp)


def talker(topic: str, kind: str = STRING, **parameters: Any) -> tuple[hfg.Graph, Say, RosPublish]:
    graph = hfg.Graph("talker")
    say, publish = graph.add(Say()), graph.add(RosPublish(topic=topic, type=kind, **parameters))
    graph.connect(say.out, publish.value)
    return graph, say, publish


def listener(topic: str, kind: str = STRING, **parameters: Any) -> tuple[hfg.Graph, RosSubscribe, Keep]:
    graph = hfg.Graph("listener")
    subscribe, keep = graph.add(RosSubscribe(topic=topic, type=kind, **parameters)), graph.add(Keep())
    graph.connect(subscribe.out, keep.value)
    return graph, subscribe, keep


async def test_who_joins_later_gets_what_a_transient_local_publisher_has_kept(
    router: Router, capsys: pytest.CaptureFixture[str]
) -> None:
    at: dict[str, Any] = {"router": router.address, "durability": "transient_local", "depth": 2}
    graph, say, publish = talker("latched", **at)
    async with hfg.running(graph) as run:
        for text in ("a", "b", "c"):
            await run.trigger(say.say, text)
        await until(lambda: publish.statistics()["sent"] == 3)
        late, subscribe, keep = listener("/latched", **at)
        async with hfg.running(late) as other:
            await until(lambda: len(keep.kept) == 2)
            await run.trigger(say.say, "d")
            await until(lambda: len(keep.kept) == 3)
            assert keep.kept == ["b", "c", "d"]
            assert subscribe.statistics()["lost"] == 0
            other.stop()
        echo = ["ros", "echo", "/latched", "-n", "2", "--durability", "transient_local", "--router", router.address]
        assert await asyncio.to_thread(main, echo) == 0
        assert [line.split("s  ")[1] for line in capsys.readouterr().out.splitlines()] == ["'c'", "'d'"]
        run.stop()


async def test_an_end_of_another_type_is_counted_and_reported_once(
    router: Router, caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]
) -> None:
    graph, say, publish = talker("two_types", "std_msgs/msg/Int32", router=router.address)
    other, subscribe, keep = listener("two_types", router=router.address)
    async with hfg.running(graph) as run, hfg.running(other) as second:
        await until(lambda: subscribe.statistics()["unfit"] and publish.statistics()["unfit"])
        await run.trigger(say.say, 3)
        await until(lambda: publish.statistics()["sent"])
        code = await asyncio.to_thread(main, ["ros", "echo", "two_types", "--router", router.address])
        assert (code, await asyncio.to_thread(main, ["ros", "list", "-t", "--router", router.address])) == (2, 0)
        run.stop()
        second.stop()
    told = [one.getMessage() for one in caplog.records if "two_types" in one.getMessage()]
    assert len(told) == 2
    assert all("use one type, or another name" in one for one in told)
    assert keep.kept == []
    said = capsys.readouterr()
    assert "has 2 types, std_msgs/msg/Int32 and std_msgs/msg/String" in said.err
    assert "/two_types [std_msgs/msg/Int32, std_msgs/msg/String]" in said.out


async def test_bytes_that_are_no_message_are_counted_and_the_next_message_passes(
    router: Router, caplog: pytest.LogCaptureFixture
) -> None:
    other, subscribe, keep = listener("broken", router=router.address)
    link = Connection(router.address, 0)
    try:
        async with hfg.running(other) as run:
            await until(lambda: link.connected and subscribe.statistics()["connected"])
            key = Entity(0, "0", 0, 0, "MP", "/", "x", "/broken", STRING, message(STRING).hash).key
            publisher = link.session.publisher(key, waits=False, kept=0)
            text = message(STRING).encode("whole")
            while not keep.kept:
                for payload in (b"", b"\0\1\0\0\xff\xff\xff\x7f", text):
                    await publisher.put(payload, b"no attachment of rmw_zenoh")
                await asyncio.sleep(0.05)
            assert keep.kept[0] == "whole"
            assert subscribe.statistics()["refused"] >= 1
            run.stop()
    finally:
        await link.close()
    assert len([one for one in caplog.records if "a message of" in one.getMessage()]) == 1


async def test_a_service_refuses_what_the_graph_does_not_answer(router: Router) -> None:
    graph = hfg.Graph("asking")
    server = graph.add(RosService(name="~/set", type=SET_BOOL.name, router=router.address, timeout_s=0.2))
    answer, say, keep = graph.add(Answer()), graph.add(Say()), graph.add(Keep())
    client = graph.add(RosServiceClient(name="/asking/set", type=SET_BOOL.name, router=router.address), on_error="skip")
    graph.connect(server.request, answer.request)
    graph.connect(answer.out, server.answer)
    graph.connect(say.out, client.request)
    graph.connect(client.response, keep.value)
    async with hfg.running(graph) as run:
        for wish in (False, True):
            await run.trigger(say.say, SET_BOOL.request.record(data=wish))
        await until(lambda: keep.kept)
        run.stop()
    assert (client.statistics()["asked"], client.statistics()["answered"]) == (2, 1)
    numbers = server.statistics()
    assert (numbers["asked"], numbers["answered"], numbers["refused"]) == (2, 1, 1)


async def test_a_graph_starts_without_a_router_and_works_once_it_is_there(caplog: pytest.LogCaptureFixture) -> None:
    late = Router()
    graph, say, publish = talker("later", router=late.address, durability="transient_local")
    other, subscribe, keep = listener("later", router=late.address, durability="transient_local")
    try:
        async with hfg.running(graph) as run, hfg.running(other) as second:
            await run.trigger(say.say, "kept")
            await run.wait_quiet()
            await asyncio.to_thread(late.start)
            await until(lambda: keep.kept)
            late.kill()
            await until(lambda: not publish.statistics()["connected"])
            await asyncio.to_thread(late.start)
            await until(lambda: publish.statistics()["here"] and subscribe.statistics()["here"])
            await run.trigger(say.say, "again")
            await until(lambda: "again" in keep.kept)
            run.stop()
            second.stop()
    finally:
        late.kill()
    told = [one.getMessage() for one in caplog.records]
    assert any(late.address in one and "trying again until it is there" in one for one in told)
    assert any(late.address in one and "has gone" in one for one in told)
    assert publish.statistics()["reconnected"] == 1


@pytest.mark.soak
async def test_a_router_that_is_killed_20_times_is_found_again(caplog: pytest.LogCaptureFixture) -> None:
    mortal = Router()
    at = {"router": mortal.address}
    graph, say, publish = talker("mortal", **at)
    other, subscribe, keep = listener("mortal", **at)
    server, answer = other.add(RosService(name="/mortal_set", type=SET_BOOL.name, **at)), other.add(Answer())
    other.connect(server.request, answer.request)
    other.connect(answer.out, server.answer)
    wish, answers = graph.add(Say()), graph.add(Keep())
    client = graph.add(RosServiceClient(name="/mortal_set", type=SET_BOOL.name, **at))
    graph.connect(wish.out, client.request)
    graph.connect(client.response, answers.value)
    try:
        async with hfg.running(graph) as run, hfg.running(other) as second:
            for life in range(21):
                await asyncio.to_thread(mortal.start)
                await until(lambda: all(one.statistics()["here"] for one in (publish, subscribe, client, server)))
                await run.trigger(say.say, f"{life}")
                await run.trigger(wish.say, SET_BOOL.request.record(data=True))
                await until(lambda life=life: f"{life}" in keep.kept and len(answers.kept) == life + 1)
                await asyncio.to_thread(mortal.kill)
                await until(lambda: not (publish.statistics()["connected"] or subscribe.statistics()["connected"]))
                await run.trigger(say.say, f"lost {life}")
            await until(lambda: publish.statistics()["lost"] == 21)
            assert len(list(subscribe.link.graph)) == 0
            run.stop()
            second.stop()
    finally:
        mortal.kill()
    assert keep.kept == [f"{life}" for life in range(21)]
    assert publish.statistics()["reconnected"] == subscribe.statistics()["reconnected"] == 20
    assert len([one for one in caplog.records if "has gone" in one.getMessage()]) == 42


async def test_without_a_server_a_client_fails_with_one_sentence(router: Router) -> None:
    graph = hfg.Graph("lonely")
    say = graph.add(Say())
    client = graph.add(RosServiceClient(name="nobody", type=SET_BOOL.name, router=router.address, timeout_s=0.2))
    graph.connect(say.out, client.request)

    async def ask() -> None:
        async with hfg.running(graph) as run:
            await run.trigger(say.say, SET_BOOL.request.record(data=True))
            await run.wait_finished()

    with pytest.raises(NodeError, match=r'"/nobody" \(std_srvs/srv/SetBool\) at "tcp/.*no server is there for 0.2 s'):
        await ask()


async def test_a_settings_file_names_the_router(router: Router, tmp_path: Path) -> None:
    file = tmp_path / "cell.toml"
    file.write_text(f'connect = ["{router.address}"]\ninsecure = true\n')
    graph, say, publish = talker("by_file", router=str(file), reliability="best_effort")
    other, _, keep = listener("by_file", router=router.address, namespace="/", node="ear")
    async with hfg.running(graph) as run, hfg.running(other) as second:
        await until(lambda: publish.statistics()["here"])
        while not keep.kept:  # with best effort, what is sent before the way is known is lost
            await run.trigger(say.say, "heard")
            await asyncio.sleep(0.05)
        assert set(keep.kept) == {"heard"}
        run.stop()
        second.stop()


@pytest.mark.parametrize(
    ("parameters", "sentence"),
    [
        ({"topic": "a", "type": STRING}, "no router is named"),
        ({"topic": "a", "type": STRING, "router": "tcp/10.0.0.1:7447"}, "insecure = true"),
        ({"topic": "a b", "type": STRING, "router": "tcp/127.0.0.1:1"}, "not a name in ROS 2"),
        ({"topic": "a", "type": "no_msgs/msg/Thing", "router": "tcp/127.0.0.1:1"}, "no_msgs"),
    ],
)
async def test_wrong_parameters_are_refused_before_the_run(
    parameters: dict[str, Any], sentence: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("HFG_ROS_ROUTER", raising=False)
    graph, _, _ = listener(**{"kind": parameters.pop("type"), **parameters})

    async def run() -> None:
        async with hfg.running(graph):
            pass

    with pytest.raises(HfgError, match=sentence):
        await run()


async def test_ros_nodes_refuse_virtual_time() -> None:
    graph, _, _ = listener("a", router=f"tcp/127.0.0.1:{free_port()}")
    with pytest.raises(HfgError, match='run with clock="real"'):
        await asyncio.to_thread(hfg.run, graph, clock="virtual")


# --- actions ---


class Server:
    """Serves Fibonacci as other programs do: with the connection only, without nodes."""

    def __init__(self, link: Connection, name: str) -> None:
        self.link = link
        self.accept = True
        self.cancelled: list[bytes] = []
        self.waiting: list[Any] = []
        session, who = link.session, ("/", "fibonacci")
        self.told = link.entity("MP", who, f"{name}/_action/feedback", FIBONACCI.feedback_message, Qos())
        self.publisher = session.publisher(self.told.key, waits=False, kept=0)
        session.token(self.told.token)
        for what, kind, serve in (
            ("send_goal", FIBONACCI.send_goal, self.goal),
            ("get_result", FIBONACCI.get_result, self.result),
            ("cancel_goal", service(goals.CANCEL), self.cancel),
        ):
            one = link.entity("SS", who, f"{name}/_action/{what}", kind, Qos())
            session.serve(one.key, serve)
            session.token(one.token)

    def goal(self, requests: list[Any]) -> None:
        for one in requests:
            self.goal_id, self.order = one.payload[4:20], one.payload[20]
            one.answer(b"\0\1\0\0" + bytes([self.accept, 0, 0, 0]) + bytes(8), one.attachment)

    def result(self, requests: list[Any]) -> None:
        self.waiting += requests

    def cancel(self, requests: list[Any]) -> None:
        for one in requests:
            self.cancelled.append(one.payload[4:20])
            one.answer(b"\0\1\0\0" + bytes(8), one.attachment)

    async def feed_back(self, number: int) -> None:
        """Tell a sequence of one number."""
        payload = b"\0\1\0\0" + self.goal_id + bytes([1, 0, 0, 0, number, 0, 0, 0])
        await self.publisher.put(payload, b"")

    def end(self, status: int) -> None:
        """Answer who waits for the result: a sequence of one 7."""
        self.waiting.pop().answer(b"\0\1\0\0" + bytes([status, 0, 0, 0, 1, 0, 0, 0, 7, 0, 0, 0]), b"")


def pursuing(name: str, router: str) -> tuple[hfg.Graph, Say, RosAction, dict[str, Keep]]:
    graph = hfg.Graph("pursuing")
    say, pursue, rest = (
        graph.add(Say()),
        graph.add(RosAction(name=name, type=FIBONACCI.name, router=router)),
        graph.add(Say()),
    )
    graph.start.activates(say.activate)
    graph.connect(say.out, pursue.goal, active=True)
    graph.connect(pursue.succeeded, rest.say, active=True)
    graph.connect(pursue.aborted, rest.say, active=True)
    kept = {}
    for port in (pursue.feedback, pursue.succeeded, pursue.aborted, pursue.rejected, pursue.completed):
        kept[port.name] = graph.add(Keep())
        graph.connect(port, kept[port.name].value)
    return graph, say, pursue, kept


async def test_a_goal_lives_as_long_as_the_activity_of_its_node(router: Router) -> None:
    link = Connection(router.address, 0)
    graph, say, pursue, kept = pursuing("/fib", router.address)
    goal = FIBONACCI.goal.record(order=5)
    try:
        await link.tried()
        server = Server(link, "/fib")
        async with hfg.running(graph) as run:
            await run.trigger(say.say, goal)
            await until(lambda: server.waiting)
            assert server.order == 5
            await until(lambda: link.graph.fit(server.told, "MS"))
            await server.feed_back(3)
            await until(lambda: kept["feedback"].kept)
            assert list(kept["feedback"].kept[0].sequence) == [3]
            server.end(goals.Status.SUCCEEDED)
            await until(lambda: kept["succeeded"].kept)
            assert list(kept["succeeded"].kept[0].sequence) == [7]
            await until(lambda: not pursue.active)
            assert kept["completed"].kept == []  # the activity has left with the result

            await run.trigger(pursue.goal, goal, activity=1)
            await until(lambda: server.waiting)
            await run.trigger(pursue.deactivate)
            await until(lambda: server.cancelled == [server.goal_id])

            server.accept = False
            await run.trigger(pursue.goal, goal, activity=1)
            await until(lambda: kept["completed"].kept == ["rejected"])
            run.stop()
    finally:
        await link.close()
    numbers = pursue.statistics()
    assert (numbers["sent"], numbers["accepted"], numbers["cancelled"]) == (3, 2, 1)
