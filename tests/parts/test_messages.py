"""What parts tell each other is data: it comes back as it was, and whatever else arrives changes nothing (rule L4)."""

from __future__ import annotations

import asyncio
import typing
from typing import Any

import msgspec
import pytest

import hfg
from hfg.base.token import Token
from hfg.engine.face.composition import Composition
from hfg.engine.runtime.settings import Settings
from hfg.graph.flat import MAIN, cut, flatten
from hfg.links.frames import Tokens, write
from hfg.links.running import LinkSender
from hfg.parts.model.agreement import Answer, Question, Rest
from hfg.parts.model.messages import (
    Ask,
    Begin,
    Call,
    GoesOn,
    Hears,
    Joins,
    Message,
    OfAnEdge,
    Parcel,
    Passed,
    PlainEvent,
    Rests,
    Result,
    Seen,
    Sees,
    Shares,
    Speaks,
    Told,
    Untrue,
    pack,
    unpack,
)
from hfg.parts.model.trace_filter import trace_filter
from hfg.parts.running.channels import Channel, name_of
from hfg.parts.running.part import Part
from hfg.parts.running.part_links import PartLinks
from hfg.trace import NodeEnded, TokenProcessed, TokenSent, TokenTaken, TraceEvent
from hfg.transport import Traffic
from hfg_transports.memory import Network
from tests.parts.test_deaths import Counts, chain, latest

RUN = "hfg/test"
TO_RELAY, FROM_RELAY = "numbers.out -> relay0.value", "relay0.out -> out"


@pytest.mark.rule("L4")
@pytest.mark.parametrize(
    "message",
    [
        Begin(),
        Ask(Question("grow", 3, "a.out -> b.in")),
        Told(Answer("far", "rests", 3, moved=True)),
        Rests(Rest("far", 1, {"a -> b": (1, 1, "open", True)}, {})),
        Call(7, "set", {"path": "scaler.factor", "parcel": [b"", b"\x01"]}),
        Result(7, value={"nodes": [1, 2.5, None, "x", b"y"]}),
        Seen(2, tokens=[Parcel(b"", b"\x01")], events=[Passed(0.5, "set", "a", Parcel(b"", b""), "b")], count=9),
        Joins("a -> b", 3, 1, 2, "deaf"),
        GoesOn("a -> b", 1, 2),
        Sees("a -> b", "segment", 1, "it is on another host"),
    ],
    ids=lambda message: type(message).__name__,
)
def test_a_message_comes_back_as_it_was(message: Message) -> None:
    assert unpack(pack(message)) == message


HOSTILE = {
    "nothing": b"",
    "text": b"\xa5hello",
    "half of one": pack(Begin())[:-1],
    "two in one": pack(Begin()) * 2,
    "none of ours": msgspec.msgpack.encode({"type": "Format", "disk": "/"}),
    "without a field": msgspec.msgpack.encode({"type": "Speaks", "label": "a -> b"}),
    "of another type": msgspec.msgpack.encode({"type": "Speaks", "label": 7, "speaking": True, "total": 1}),
    "no text where text is": pack(Speaks("ab", True, 1)).replace(b"\xa2ab", b"\xa2\xff\xfe"),
    "endlessly deep": pack(Call(1, "set", {"x": 1})).replace(b"\xa1x\x01", b"\xa1x" + b"\x91" * 5000 + b"\x01"),
}


@pytest.mark.rule("L4")
@pytest.mark.parametrize("data", HOSTILE.values(), ids=HOSTILE)
def test_what_is_no_message_is_none(data: bytes) -> None:
    assert unpack(data) is None


@pytest.mark.rule("L4", "L2")
def test_a_channel_counts_what_is_no_message_and_hears_what_comes_behind() -> None:
    async def main() -> None:
        network = Network()
        here, there = await network.open(), await network.open()
        heard: list[Message] = []
        channel = Channel(here, RUN, "far", MAIN, (1, 1), heard.append)
        sender = LinkSender(there, f"{RUN}/{name_of(MAIN)}/{name_of('far')}/1.1", epoch=1)
        sender.admit(name_of("far"), 1)
        for data in (*HOSTILE.values(), pack(Begin())):
            await sender.send((b"", data))
        await sender.wait_finished()
        assert heard == [Begin()]
        assert channel.refused == len(HOSTILE)
        await channel.close()
        await sender.close()
        await here.close()
        await there.close()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())


@pytest.mark.rule("L4")
@pytest.mark.parametrize(
    "message",
    [
        Speaks("no -> where", False, 1),
        Hears("no -> where", "over", 1),
        Joins("no -> where", 1, 1, 1),
        Shares("no -> where", "segment", 1),
        Sees("no -> where", "segment", 1),
        Speaks(TO_RELAY, False, 1),  # which leaves, so its producer is here
        Hears(FROM_RELAY, "over", 1),  # which comes in, so its consumer is
        GoesOn(TO_RELAY, 1, 1),
        Shares(TO_RELAY, "segment", 1),
        Sees(FROM_RELAY, "segment", 1),
    ],
    ids=lambda message: f"{type(message).__name__} {message.label}",
)
def test_what_is_said_of_an_edge_that_is_not_there_is_refused_and_changes_nothing(message: OfAnEdge) -> None:
    async def main() -> None:
        cutting = cut(flatten(chain()))
        edges = list(cutting.edges_of(MAIN))
        said: list[Any] = []
        part = Part(MAIN, Composition(cutting.parts[MAIN], Settings()), edges, rests=said.append)
        session = await Network().open()
        carrier = PartLinks(
            part, session, session, RUN, dict.fromkeys(cutting.parts, 1), edges, lambda *told: said.append(told)
        )
        for other in cutting.parts:
            with pytest.raises(Untrue, match="an edge"):
                carrier.hear(other, message)
        outlet, inlet = part.outlets[TO_RELAY], part.inlets[FROM_RELAY]
        assert (outlet.hearing, outlet.sent, inlet.speaking, inlet.received, said) == ("open", 0, True, 0, [])
        await carrier.close()
        await session.close()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())


@pytest.mark.rule("L4", "P5")
def test_a_gap_in_the_numbers_of_an_edge_that_may_lose_is_counted_however_large_it_is() -> None:
    async def main() -> None:
        graph = hfg.Graph()
        graph.group("far", process=True)
        speaker = graph.add(Counts(), name="speaker", group="far")
        graph.connect(speaker.said, graph.add(latest(), name="latest").value, overflow="drop_oldest")
        cutting = cut(flatten(graph))
        edges = list(cutting.edges_of(MAIN))
        part = Part(MAIN, Composition(cutting.parts[MAIN], Settings()), edges, rests=lambda _: None)
        here, there = await (network := Network()).open(), await network.open()
        carrier = PartLinks(part, here, here, RUN, dict.fromkeys(cutting.parts, 1), edges, lambda *_: None)
        publisher = there.publisher(f"{RUN}/edge/{edges[0].number}/tokens", Traffic.BULK)
        publisher.put(write(Tokens(1, 1, 2**61, 1, [b""])), b"")
        await asyncio.sleep(0.01)
        assert part.inlets["speaker.said -> latest.value"].received >= 2**61 - 1
        await carrier.close()
        for session in (here, there):
            await session.close()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())


@pytest.mark.rule("R7", "L1")
@pytest.mark.parametrize("label", [TO_RELAY, FROM_RELAY])
def test_each_event_of_an_edge_between_parts_is_told_by_one_of_them(label: str) -> None:
    cutting = cut(flatten(chain()))
    (edge,) = [edge for edge in cutting.edges if edge.label == label]
    is_told = {part: trace_filter(part, cutting.edges_of(part)) for part in cutting.parts}

    def who_tells(event: TraceEvent) -> list[str]:
        return [part for part in cutting.parts if is_told[part](event)]

    assert who_tells(TokenSent(0.0, label, Token(1))) == [edge.source]
    assert who_tells(TokenProcessed(0.0, label)) == [edge.source]
    assert who_tells(TokenTaken(0.0, label, Token(1))) == [edge.target]
    assert who_tells(NodeEnded(0.0, "relay0")) == list(cutting.parts), "each has such events of its own nodes only"


@pytest.mark.rule("R7", "L1")
def test_each_kind_of_event_of_a_trace_can_be_told_to_another_process() -> None:
    """A part that tells of one that the others do not know is not believed any more."""
    by_passed = {"TokenSent", "TokenTaken", "TokenDropped", "TokenDrained", "EventTriggered", "ParameterSet"}
    told = {kind.__name__ for kind in typing.get_args(PlainEvent)} | by_passed
    kinds = {kind.__name__ for kind in TraceEvent.__subclasses__() if kind.__module__ == "hfg.trace"}
    assert kinds == told
