"""How long the pump keeps the event loop to itself (R1)."""

from __future__ import annotations

import asyncio

import pytest

import hfg
from hfg.engine.runtime import engine


class Counting(hfg.Node):
    """A source that asks, when it begins to fire, to be told when the event loop has its turn."""

    count = hfg.Parameter(4000)
    out = hfg.Output(int)
    fired = hfg.State(0)
    had_by_then = hfg.State(0)

    def process(self) -> int:
        if self.fired == self.count:
            raise hfg.EndOfStream
        if not self.fired:
            asyncio.get_running_loop().call_soon(self.look)
        self.fired += 1
        return self.fired

    def look(self) -> None:
        self.had_by_then = self.fired


@pytest.mark.rule("R1")
@pytest.mark.parametrize("group", [None, "side"])
def test_the_event_loop_has_its_turn_behind_so_many_firings_whatever_group_they_are_of(
    monkeypatch: pytest.MonkeyPatch, group: str | None
) -> None:
    monkeypatch.setattr(engine, "_SLICE_S", 0.0)
    graph, source = hfg.Graph(), Counting()
    graph.add(source, group=group)
    if group is not None:
        graph.group(group, threads=0)
    hfg.run(graph, fast=False)
    assert source.fired == 4000
    assert 0 < source.had_by_then <= 2 * engine._SLICE_STEPS
