"""Two hundred requests: in order and complete, from a real server or a simulated one, and not longer than by hand."""

from __future__ import annotations

import asyncio

import pytest

import hfg
from examples import many_requests
from tests.examples import plain_requests
from tests.examples.lengths import lines_of_code

SQUARES = [number * number for number in range(200)]


@pytest.fixture(autouse=True)
def fresh(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(many_requests, "SIMULATED", many_requests.Service())


@pytest.mark.rule("F14", "X1", "X2")
def test_all_answers_come_in_order_and_eight_are_asked_for_at_once() -> None:
    graph = many_requests.build()
    report = hfg.run(graph, clock="virtual")
    assert graph["collect"].answers == SQUARES
    assert report.nodes["ask"].retries == 20
    assert report.nodes["ask"].most_under_way == many_requests.AT_ONCE


def test_by_hand_it_is_the_same_in_about_the_same_time() -> None:
    async def main() -> float:
        asking = plain_requests.Requests()
        await asking.run(iter(range(200)))
        assert asking.answers == SQUARES
        assert asking.retries == 20
        return asyncio.get_running_loop().time()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        by_hand = runner.run(main())
    many_requests.SIMULATED.asked.clear()
    assert hfg.run(many_requests.build(), clock="virtual").duration_s <= 1.1 * by_hand


def test_a_real_server_gives_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(many_requests, "TAKES_S", 0.001)

    async def main() -> list[int]:
        async with await asyncio.start_server(many_requests.Service().serve, "127.0.0.1", 0) as server:
            graph = many_requests.build(count=60, port=server.sockets[0].getsockname()[1])
            await hfg.run_async(graph)
            found: list[int] = graph["collect"].answers
            return found

    assert asyncio.run(main()) == SQUARES[:60]


def test_it_is_no_longer_than_by_hand() -> None:
    ours = lines_of_code(many_requests, "numbers", "ask", "Collect", "build")
    assert ours <= lines_of_code(plain_requests, "Requests")
