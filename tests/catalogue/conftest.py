"""Distributions that are as good as installed: a folder on the path, with the metadata that pip would write."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from textwrap import dedent

import pytest

Install = Callable[..., None]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Give what installs a distribution: its name, its entry points and its files."""
    monkeypatch.syspath_prepend(tmp_path)
    loaded = set(sys.modules)

    def installed(distribution: str, entry_points: dict[str, str], **files: str) -> None:
        info = tmp_path / f"{distribution}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {distribution}\nVersion: 1.0\n")
        lines = [f"{name} = {value}" for name, value in entry_points.items()]
        (info / "entry_points.txt").write_text("\n".join(["[hfg.nodes]", *lines, ""]))
        for place, code in files.items():
            file = tmp_path.joinpath(*place.split("__in__")).with_suffix(".py")
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(dedent(code))
        importlib.invalidate_caches()

    yield installed
    for name in set(sys.modules) - loaded:
        if str(tmp_path) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]
