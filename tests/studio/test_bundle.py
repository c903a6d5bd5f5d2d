"""The committed page of the studio is the one that its sources give, checked without Node."""

import hashlib
import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
WEB = ROOT / "web"
STATIC = ROOT / "hfg/studio/static"
STAMPED = ("index.html", "package.json", "package-lock.json", "public", "src", "tsconfig.json", "vite.config.ts")


def hash_of_sources() -> str:
    """Compute what `stamp` in web/vite.config.ts computes."""
    tops = [WEB / name for name in STAMPED]
    files = [file for top in tops for file in ([top] if top.is_file() else top.rglob("*")) if file.is_file()]
    names = sorted(file.relative_to(WEB).as_posix() for file in files)
    sources = hashlib.sha256()
    for name in names:
        sources.update(name.encode() + b"\0" + (WEB / name).read_bytes() + b"\0")
    return sources.hexdigest()


def test_the_bundle_was_built_from_the_sources_beside_it() -> None:
    built = json.loads((STATIC / "BUILD.json").read_text())
    assert built["sources_sha256"] == hash_of_sources(), "web/ has changed since the page was built; run `make web`"


def test_a_change_of_a_source_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = hash_of_sources()
    copied = tmp_path / "web"
    for name in STAMPED:
        for file in [WEB / name] if (WEB / name).is_file() else (WEB / name).rglob("*"):
            if file.is_file():
                (copied / file.relative_to(WEB)).parent.mkdir(parents=True, exist_ok=True)
                (copied / file.relative_to(WEB)).write_bytes(file.read_bytes())
    monkeypatch.setattr(f"{__name__}.WEB", copied)
    assert hash_of_sources() == before
    (copied / "src/main.tsx").write_bytes(b"// changed\n" + (copied / "src/main.tsx").read_bytes())
    assert hash_of_sources() != before


def test_the_page_loads_nothing_from_elsewhere() -> None:
    page = (STATIC / "index.html").read_text()
    used = re.findall(r'(?:src|href)="([^"]+)"', page)
    assert used
    assert all(address.startswith("./") and (STATIC / address).is_file() for address in used)
    assert "<script>" not in page
    styles = "".join(file.read_text() for file in (STATIC / "assets").glob("*.css"))
    assert set(re.findall(r"url\((?!data:)[\"']?([^)\"']+)", styles)) == {"./inter-latin-wght-normal.woff2"}


def test_the_lock_file_names_no_registry() -> None:
    assert '"resolved"' not in (WEB / "package-lock.json").read_text()


def test_licences_of_what_is_bundled_are_beside_it() -> None:
    licences = (STATIC / "licenses.txt").read_text()
    for package in ("@xyflow/react", "react-dom", "zustand"):
        assert package in licences
