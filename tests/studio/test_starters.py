"""The graphs that a page offers to a user who has none: each runs, has no mistakes, and can be saved."""

from __future__ import annotations

from pathlib import Path

import pytest

import hfg
from hfg.studio.starters import STARTERS, starter_graph
from hfg.trace import ActivityChanged, TraceEvent
from tests.studio.page import Page, live, studio_of


@pytest.mark.parametrize("name", STARTERS)
def test_a_starter_has_no_mistakes_and_is_the_same_from_its_file(name: str, tmp_path: Path) -> None:
    graph = starter_graph(name)
    assert [str(one) for one in graph.check()] == []
    hfg.save(graph, tmp_path / "saved.hfg.yaml")
    again = hfg.load(tmp_path / "saved.hfg.yaml")
    assert again.as_commands() == graph.as_commands()


def test_the_first_one_searches_follows_and_rests() -> None:
    seen: list[TraceEvent] = []
    hfg.run(starter_graph("ball"), clock="virtual", until_s=30, trace=seen)
    states = {one.node for one in seen if isinstance(one, ActivityChanged)}
    assert states == {"search", "follow/aim", "follow/keep", "rest"}


def test_without_the_curtain_the_ball_is_never_lost() -> None:
    graph = starter_graph("ball")
    graph["camera"].curtain = False
    seen: list[TraceEvent] = []
    hfg.run(graph, clock="virtual", until_s=30, trace=seen)
    order = [one.node for one in seen if isinstance(one, ActivityChanged) and one.active]
    assert order[:5] == ["search", "follow/aim", "follow/keep", "rest", "search"]


def test_a_page_opens_a_starter_and_another_file_can_follow(tmp_path: Path) -> None:
    async def main() -> None:
        page = Page(studio_of(hfg.Graph("graph"), tmp_path)).join()
        offered = (await page.value("start"))["starters"]
        assert [one["name"] for one in offered] == list(STARTERS)
        assert offered[0]["nodes"] == 7
        assert (await page.ask("open", starter="ball"))["t"] == "ack"
        assert page.tables["studio"]["file"]["graph"] == "ball"
        assert page.tables["nodes"]["follow/keep"]["level"] == "follow"
        answer = await page.ask("open", starter="moon")
        assert answer["message"] == 'there is no starting graph "moon"; there are ball, two_nodes, start_signal'
        await page.studio.close()

    live(main)
