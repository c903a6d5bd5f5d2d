"""How `hfg studio` opens the page."""

from __future__ import annotations

import stat
import webbrowser
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from hfg.cli.studio import _shown

ADDRESS = "http://127.0.0.1:8800/?token=secret"


@pytest.mark.rule("L5")
def test_the_browser_is_opened_without_the_token_on_its_command_line(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    with _shown(ADDRESS, browser=True):
        (uri,) = opened
        page = Path(urlsplit(uri).path)
        assert "secret" not in uri
        assert f"url={ADDRESS}" in page.read_text()
        assert stat.S_IMODE(page.parent.stat().st_mode) == stat.S_IRWXU
    assert not page.parent.exists()


def test_without_a_browser_only_the_address_is_written(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(webbrowser, "open", lambda _: pytest.fail("a browser was opened"))
    with _shown(ADDRESS, browser=False):
        assert capsys.readouterr().out == f"{ADDRESS}\n"
