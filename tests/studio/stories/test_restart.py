"""The studio is killed and started again: the page goes on by itself, and edits that were not saved are offered."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from playwright.sync_api import expect

import hfg
from tests.limits import patience
from tests.studio.stories.graphs import mission

if TYPE_CHECKING:
    from playwright.sync_api import Browser

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[3]


@contextmanager
def studio(file: Path, *options: str) -> Iterator[str]:
    """Start `hfg studio`, give its address, and kill it."""
    command = [sys.executable, "-m", "hfg", "studio", str(file), "--no-browser", "--allow", "tests.studio.stories"]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join((str(ROOT), str(ROOT / "transports")))}
    with subprocess.Popen([*command, *options], stdout=subprocess.PIPE, text=True, env=environment) as process:
        try:
            assert process.stdout is not None
            yield next(found[0] for line in process.stdout if (found := re.search(r"http://\S+", line)))
        finally:
            process.send_signal(signal.SIGKILL)


def test_after_a_kill_and_a_restart_the_page_is_live_without_a_reload_and_offers_what_was_not_saved(
    browser: Browser, tmp_path: Path
) -> None:
    file = tmp_path / "mission.hfg.yaml"
    hfg.save(mission(), file)
    page = browser.new_page(viewport={"width": 1440, "height": 900})
    page.set_default_timeout(1000 * patience(10))
    with studio(file) as address:
        page.goto(address)
        page.locator('[data-node="spare"]').wait_for()
        page.evaluate("window.sameDocument = true")
        page.locator('[data-node="spare"] .t b').click()
        page.keyboard.press("Delete")
        expect(page.locator(".filename")).to_contain_text("1 change")
    expect(page.locator(".live")).to_contain_text("away")
    assert "spare" in file.read_text()
    port = address.split(":")[2].partition("/")[0]
    with studio(file, "--port", port):
        expect(page.locator(".live")).to_have_text("ready")
        bar = page.locator(".bar-above")
        expect(bar).to_contain_text("1 change that was not saved")
        expect(page.locator('[data-node="spare"]')).to_be_visible()
        bar.get_by_role("button", name="Take them up").click()
        expect(page.locator('[data-node="spare"]')).to_have_count(0)
        assert page.evaluate("window.sameDocument") is True
        page.locator('[data-node="stamp"] .t b').click()
        page.keyboard.press("Delete")
        expect(page.locator(".filename")).to_contain_text("2 changes")
    page.close()
