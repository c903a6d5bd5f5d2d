"""Whatever pages do, cut and reconnected: their replicas are the graph, and the graph is what its edits make it."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import msgspec
import pytest

from hfg.errors import HfgError
from hfg.graph import Graph
from hfg.graph import commands as c
from hfg.studio.studio import Studio
from tests.studio.page import Page, live, studio_of
from tests.support.edits import drawn, random_edit
from tests.support.making import Allowed, SeededChooser, random_plan

__all__ = ["walk", "walk_running"]


@pytest.mark.slow
@pytest.mark.rule("R4")
@pytest.mark.parametrize("block", range(10))
def test_replicas_of_two_pages_are_the_graph_after_any_edits_cuts_and_restarts(block: int) -> None:
    for seed in range(block * 20, block * 20 + 20):
        live(lambda seed=seed: walk(seed, steps=12))  # type: ignore[misc]


@pytest.mark.slow
@pytest.mark.rule("R4")
@pytest.mark.parametrize("block", range(4))
def test_replicas_follow_a_graph_that_is_started_and_stopped_in_between(block: int) -> None:
    for seed in range(block * 5, block * 5 + 5):
        live(lambda seed=seed: walk_running(seed, steps=12))  # type: ignore[misc]


async def walk_running(seed: int, *, steps: int) -> None:
    """What a run refuses is not done to the plain graph either; what it acknowledges is."""
    plan, choose = random_plan(seed, Allowed()), SeededChooser(seed)
    graph, oracle = plan.build(), plan.build()
    studio = studio_of(graph)
    pages = [Page(studio).join(), Page(studio).join()]
    for number in range(steps):
        page = pages[choose.number(0, 1)]
        if choose.chance(20):
            answer = await page.ask("start", stay=True) if studio.steering.run is None else await page.ask("stop")
            if answer["t"] == "ack" and page.run["state"] == "stopping":
                await page.state("ended")
            continue
        verb = choose.one_of(("edit", "edit", "undo", "redo"))
        commands = random_edit(graph, choose, number) if verb == "edit" else []
        plain = msgspec.json.decode(c.encode(commands))
        answer = await (page.edit(*plain) if verb == "edit" else page.ask(verb))
        if answer["t"] == "ack":
            oracle.edit(*commands) if verb == "edit" else getattr(oracle, verb)()
    await studio.steering.close()
    pages[0].studio.refresh_all()
    assert pages[0].agrees()
    assert pages[0].tables == pages[1].tables
    assert _without_values(drawn(graph, identity=False)) == _without_values(drawn(oracle, identity=False))
    await studio.close()


def _without_values(state: Any) -> Any:
    """Tokens of the run have set parameters, too."""
    if isinstance(state, dict):
        return {name: _without_values(one) for name, one in state.items() if name != "parameters"}
    return state


async def walk(seed: int, *, steps: int) -> None:
    """Two pages do anything; a plain graph does the same."""
    plan, choose = random_plan(seed, Allowed()), SeededChooser(seed)
    graph, oracle = plan.build(), plan.build()
    studio = studio_of(graph)
    pages = [Page(studio).join(), Page(studio).join()]
    away: set[int] = set()
    for number in range(steps):
        who = choose.number(0, 1)
        if choose.chance(15):
            if who in away:
                pages[who].come_back(studio)
                away.discard(who)
            else:
                pages[who].cut()
                away.add(who)
        elif choose.chance(6):
            studio = _restart(studio, pages, away)
        elif who not in away:
            await _act(pages[who], oracle, choose, number)
            assert not choose.chance(30) or pages[who].agrees()
    for who in away:
        pages[who].come_back(studio)
    assert pages[0].agrees()
    assert pages[0].tables == pages[1].tables
    assert drawn(graph, identity=False) == drawn(oracle, identity=False)
    await studio.close()


def _restart(studio: Studio, pages: list[Page], away: set[int]) -> Studio:
    """The server is killed and started again; the graph is as it was."""
    again = studio_of(studio.graph)
    for who, page in enumerate(pages):
        page.cut()
        if who not in away:
            page.come_back(again)
    return again


async def _act(page: Page, oracle: Graph, choose: SeededChooser, number: int) -> None:
    verb = "undo" if choose.chance(25) else "redo" if choose.chance(25) else "edit"
    if verb == "edit":
        commands = random_edit(page.studio.graph, choose, number)
        plain = msgspec.json.decode(c.encode(commands))
        answer = await page.edit(*plain)
        done = False
        with suppress(HfgError):
            oracle.edit(*commands)
            done = True
    else:
        answer = await page.ask(verb)
        done = False
        with suppress(HfgError):
            getattr(oracle, verb)()
            done = True
    assert (answer["t"] == "ack") == done, answer
