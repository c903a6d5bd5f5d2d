"""The documentation as a site: every page and every public name is in it, and it loads nothing from another host.

The tests that build the site and look at it in a browser are skipped where Zensical, Playwright or Chromium is missing:
`pip install -e '.[docs]'`.
"""

from __future__ import annotations

import functools
import hashlib
import http.server
import importlib.util
import pkgutil
import re
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

import hfg
from tests.limits import patience
from tools import build_docs
from tools.browser import CHROMIUM, browsers

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
MODULES = ["activity", "comparing", "errors", "geometry", "images", "monitors", "panels", "recording", "registry"]
MODULES += ["testing", "timeline", "trace", "transport", "tuning", "types"]


# --- the settings, without a build ------------------------------------------------------------------------------------


def pages_in(entry: Any) -> Iterator[str]:
    """Yield the pages of a part of the navigation, in order."""
    if isinstance(entry, str):
        yield entry
    else:
        for inner in entry.values() if isinstance(entry, dict) else entry:
            yield from pages_in(inner)


def test_the_navigation_has_every_page_once() -> None:
    navigation = list(pages_in(yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))["nav"]))
    assert sorted(navigation) == sorted(page.relative_to(DOCS).as_posix() for page in DOCS.rglob("*.md"))


def test_the_reference_has_every_public_name_once() -> None:
    text = "\n".join(page.read_text(encoding="utf-8") for page in (DOCS / "api").glob("*.md"))
    entries = re.findall(r"^::: ([\w.*]+)$", text, re.M)
    expected = [f"hfg.{name}" for name in hfg.__all__ if name != "commands"]
    assert sorted(entries) == sorted([*expected, "hfg.commands.*", *(f"hfg.{module}.*" for module in MODULES)])


def test_a_page_that_loads_from_another_host_is_found(tmp_path: Path) -> None:
    (tmp_path / "assets").mkdir()
    (tmp_path / "page.html").write_text(
        '<link rel="canonical" href="https://example.org/page"><a href="https://example.org">to click on</a>'
        '<script src="https://example.org/a.js"></script><img alt="" src=//example.org/a.png>'
    )
    (tmp_path / "assets" / "a.css").write_text("@import 'https://example.org/b.css'; a { background: url(c.png) }")
    (tmp_path / "assets" / "a.js").write_text('load("https://example.org/d.js"); name = "http://www.w3.org/2000/svg"')
    assert build_docs.loaded_from_outside(tmp_path) == [
        "assets/a.css: https://example.org/b.css",
        "assets/a.js: https://example.org/d.js",
        "page.html: https://example.org/a.js",
        "page.html: //example.org/a.png",
    ]


def test_a_link_that_leads_nowhere_is_found(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text('<h2 id="here"></h2><a href="#here"></a><a href="b.html#there"></a>')
    (tmp_path / "b.html").write_text('<a href="a.html#here"></a><img src="none.svg"><a href="#gone"></a>')
    assert build_docs.dead_links(tmp_path) == ["a.html: b.html#there", "b.html: none.svg", "b.html: #gone"]


def test_rules_and_pages_that_a_text_names_become_links() -> None:
    page = '<nav>F5</nav><article><h2>F5</h2>F5, H264, docs/limits.md <code>F5</code> <a href="#x">F5</a></article>F5'
    linked = build_docs.link_references(page, "../", {"F5": "f5-processed"})
    assert re.findall(r"<a[^>]*>[^<]*</a>", linked) == [
        '<a href="../semantics.html#f5-processed">F5</a>',
        '<a href="../limits.html">docs/limits.md</a>',
        '<a href="#x">F5</a>',
    ]
    assert re.sub(r"</?a[^>]*>", "", linked) == re.sub(r"</?a[^>]*>", "", page)


# --- the site ---------------------------------------------------------------------------------------------------------


def build() -> Path:
    if importlib.util.find_spec("zensical") is None:
        pytest.skip("Zensical is not installed")
    made = subprocess.run(
        [sys.executable, "tools/build_docs.py"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=patience(400),
        check=False,
    )
    assert made.returncode == 0, made.stdout + made.stderr
    return build_docs.SITE


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return shutil.copytree(build(), tmp_path_factory.mktemp("site") / "site")


def digest(folder: Path) -> dict[str, str]:
    return {
        file.relative_to(folder).as_posix(): hashlib.sha256(file.read_bytes()).hexdigest()
        for file in folder.rglob("*")
        if file.is_file()
    }


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_every_page_and_every_public_name_is_in_the_site(site: Path) -> None:
    assert build_docs.problems(site) == []
    missing = [page for page in DOCS.rglob("*.md") if not (site / page.relative_to(DOCS).with_suffix(".html")).exists()]
    assert not missing
    text = "\n".join(page.read_text(encoding="utf-8") for page in (site / "api").glob("*.html"))
    anchors = set(re.findall(r'id="(hfg[\w.]*)"', text))
    names = {f"hfg.{name}" for name in hfg.__all__ if name not in ("commands", "errors")}
    for module in (*MODULES, "commands"):
        names |= {f"hfg.{module}.{name}" for name in pkgutil.resolve_name(f"hfg.{module}").__all__}
    assert names <= anchors


@pytest.mark.soak
@pytest.mark.timeout(900)
def test_a_second_build_gives_the_same_site(site: Path) -> None:
    assert digest(build()) == digest(site)


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_request(self, code: int | str = "-", size: int | str = "-") -> None:
        """Write nothing."""


@pytest.fixture(scope="module")
def address(site: Path) -> Iterator[str]:
    """Serve the site on this computer; return its address."""
    handler = functools.partial(Quiet, directory=site)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
    if not CHROMIUM:
        pytest.skip("Chromium is not installed")
    with browsers() as launched:
        yield launched


@pytest.mark.soak
@pytest.mark.timeout(900)
@pytest.mark.parametrize(
    ("start", "width", "scheme"), [("disk", 390, "light"), ("server", 1280, "dark")], ids=["disk", "server"]
)
def test_every_page_opens_without_an_error_and_the_search_finds(
    start: str, width: int, scheme: str, site: Path, browser: Any, request: pytest.FixtureRequest
) -> None:
    base = site.as_uri() if start == "disk" else request.getfixturevalue("address")
    wrong: list[str] = []
    page = browser.new_page(viewport={"width": width, "height": 844}, color_scheme=scheme)
    page.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("response", lambda answer: None if answer.ok or answer.status == 304 else wrong.append(answer.url))
    page.on("request", lambda sent: None if sent.url.startswith((base, "data:", "blob:")) else wrong.append(sent.url))
    for file in sorted(site.rglob("*.html")):
        name = file.relative_to(site).as_posix()
        if name != "404.html":  # its links are those of a site at the root of a server
            page.goto(f"{base}/{name}")
            if page.evaluate("document.documentElement.scrollWidth") > width:
                wrong.append(f"{name} is wider than {width} pixels")
    page.goto(f"{base}/index.html")
    page.wait_for_load_state("networkidle")
    page.keyboard.press("Control+k")
    page.keyboard.type("activity")
    page.locator("ol a[href*='glossary.html?h=activity']").first.wait_for()
    page.close()
    assert not wrong
