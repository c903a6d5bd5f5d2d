"""The studio is killed and started again: the page goes on by itself, and edits that were not saved are offered."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

import hfg
from tests.studio.stories.graphs import mission
from tools.browser import Person, StudioProcess

pytestmark = pytest.mark.slow


def test_after_a_kill_and_a_restart_the_page_is_live_without_a_reload_and_offers_what_was_not_saved(
    page: Page, tmp_path: Path
) -> None:
    file = tmp_path / "mission.hfg.yaml"
    hfg.save(mission(), file)
    with StudioProcess(str(file), "--allow", "tests.studio.stories", folder=tmp_path) as studio:
        person = Person(page, studio.address)
        page.evaluate("window.sameDocument = true")
        person.select("spare")
        person.press("Delete")
        expect(page.locator(".filename")).to_contain_text("1 change")
        studio.kill()
        expect(page.locator(".live")).to_contain_text("away")
        assert "spare" in file.read_text()
        studio.start()
        expect(page.locator(".live")).to_have_text("ready")
        bar = page.locator(".bar-above")
        expect(bar).to_contain_text("1 change that was not saved")
        expect(person.node("spare")).to_be_visible()
        bar.get_by_role("button", name="Take them up").click()
        expect(person.node("spare")).to_have_count(0)
        assert page.evaluate("window.sameDocument") is True
        person.select("stamp")
        person.press("Delete")
        expect(page.locator(".filename")).to_contain_text("2 changes")
