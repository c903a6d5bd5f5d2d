"""One browser for all stories; each has a studio and a page of its own."""

from __future__ import annotations

import asyncio
import os
import shutil
from asyncio import _set_running_loop
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

import hfg
from hfg.studio.palette import search_types
from tests.limits import patience
from tests.studio.stories.bench import Bench, Story
from tests.studio.stories.graphs import mission

if TYPE_CHECKING:
    from playwright.sync_api import Browser

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--disable-background-networking", "--disable-sync"]


def need(what: str) -> None:
    """Skip where there is no browser, but not where one must be."""
    if os.environ.get("HFG_BROWSER") == "required":
        pytest.fail(f"the stories of the studio need {what}")
    pytest.skip(f"no {what} here")


@pytest.fixture(scope="session")
def chromium() -> Iterator[tuple[Browser, asyncio.AbstractEventLoop]]:
    """Start the browser once, with the loop on which Playwright talks to it."""
    if os.environ.get("HFG_BROWSER") == "no":
        pytest.skip("HFG_BROWSER=no")
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if found is None:
        need("Chromium")
    try:
        from playwright.sync_api import expect, sync_playwright
    except ModuleNotFoundError:
        need("package playwright")
    expect.set_options(timeout=1000 * patience(5))
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found, args=FLAGS)
        loop = asyncio.get_running_loop()
        _set_running_loop(None)
        yield browser, loop
        _set_running_loop(loop)
        browser.close()


@pytest.fixture
def browser(chromium: tuple[Browser, asyncio.AbstractEventLoop]) -> Iterator[Browser]:
    """Let Playwright's loop be the running one during a story only: other tests have loops of their own."""
    browser, loop = chromium
    _set_running_loop(loop)
    yield browser
    _set_running_loop(None)


@pytest.fixture(scope="session")
def catalogue() -> None:
    """Read the node types once: the first search of a process waits for that."""
    with ThreadPoolExecutor(1) as thread:  # the browser has a loop in this one
        thread.submit(lambda: asyncio.run(search_types(hfg.Graph("empty"), "threshold", "", "", 1))).result()


Open = Callable[..., Story]


@pytest.fixture
def open_studio(browser: Browser, catalogue: None, tmp_path: Path) -> Iterator[Open]:
    """Open a studio of a graph in the browser."""
    benches: list[Bench] = []
    stories: list[Story] = []
    context = browser.new_context(viewport={"width": 1440, "height": 900}, reduced_motion="reduce")
    context.set_default_timeout(1000 * patience(5))
    context.grant_permissions(["clipboard-read", "clipboard-write"])

    def opened(graph: hfg.Graph | None = None, **options: Any) -> Story:
        bench = Bench(graph or mission(), tmp_path, **options)
        benches.append(bench)
        story = Story(bench, context.new_page())
        stories.append(story)
        return story

    yield opened
    context.close()
    for bench in benches:
        bench.close()
    assert [error for story in stories for error in story.errors] == []


@pytest.fixture
def story(open_studio: Open) -> Story:
    return open_studio()
