"""One browser, one page and one server for all stories of a process; each story has a studio of its own."""

from __future__ import annotations

import asyncio
import os
from asyncio import _set_running_loop
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

import hfg
from hfg.studio.palette import search_types
from tests.limits import patience
from tests.studio.stories.bench import IN_THE_PAGE, Bench, Story
from tests.studio.stories.graphs import mission
from tools.browser import CHROMIUM, LISTENING, WINDOW, browsers

if TYPE_CHECKING:
    from playwright.sync_api import BrowserContext, Page


def need(what: str) -> None:
    """Skip where there is no browser, but not where one must be."""
    if os.environ.get("HFG_BROWSER") == "required":
        pytest.fail(f"the stories of the studio need {what}")
    pytest.skip(f"no {what} here")


@pytest.fixture(scope="session")
def chromium() -> Iterator[tuple[BrowserContext, asyncio.AbstractEventLoop]]:
    """Start the browser once, with the loop on which Playwright talks to it."""
    if os.environ.get("HFG_BROWSER") == "no":
        pytest.skip("HFG_BROWSER=no")
    if not CHROMIUM:
        need("Chromium")
    try:
        from playwright.sync_api import expect
    except ModuleNotFoundError:
        need("package playwright")
    expect.set_options(timeout=1000 * patience(5))
    with browsers() as browser:
        context = browser.new_context(viewport=WINDOW, reduced_motion="reduce")
        context.set_default_timeout(1000 * patience(5))
        context.grant_permissions(["clipboard-read", "clipboard-write"])
        context.add_init_script(LISTENING + IN_THE_PAGE)
        loop = asyncio.get_running_loop()
        _set_running_loop(None)
        yield context, loop
        _set_running_loop(loop)


@pytest.fixture
def page(chromium: tuple[BrowserContext, asyncio.AbstractEventLoop]) -> Iterator[Page]:
    """Let Playwright's loop be the running one during a story only: other tests have loops of their own."""
    context, loop = chromium
    _set_running_loop(loop)
    yield context.pages[0] if context.pages else context.new_page()
    for other in context.pages[1:]:
        other.close()
    _set_running_loop(None)


@pytest.fixture(scope="session")
def catalogue() -> None:
    """Read the node types once: the first search of a process waits for that."""
    with ThreadPoolExecutor(1) as thread:  # the browser has a loop in this one
        thread.submit(lambda: asyncio.run(search_types(hfg.Graph("empty"), "threshold", "", "", 1))).result()


@pytest.fixture(scope="session")
def bench() -> Iterator[Bench]:
    bench = Bench()
    yield bench
    bench.close()


Open = Callable[..., Story]


@pytest.fixture
def open_studio(page: Page, bench: Bench, catalogue: None, tmp_path: Path) -> Iterator[Open]:
    """Open a studio of a graph in the browser."""
    stories: list[Story] = []

    def opened(graph: hfg.Graph | None = None, **options: Any) -> Story:
        bench.open(graph or mission(), tmp_path, **options)
        stories.append(Story(bench, page))
        return stories[-1]

    yield opened
    for story in stories:
        story.close()
    bench.shut()
    assert [error for story in stories for error in story.errors] == []


@pytest.fixture
def story(open_studio: Open) -> Story:
    return open_studio()
