"""A file is written where its user said, and not where somebody else leads to."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from hfg.base.whole import GrowingFile, write_whole

STRANGER = 65534


def grow(path: Path) -> None:
    file = GrowingFile(path, append=False, at_once=True)
    file.write(b"new")


def append(path: Path) -> None:
    file = GrowingFile(path, append=True, at_once=True)
    file.write(b"new")


def replace(path: Path) -> None:
    write_whole(path, lambda file: file.write(b"new"))


@pytest.mark.rule("L5")
@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a link to another user")
@pytest.mark.parametrize("write", [grow, append, replace])
def test_nothing_is_written_through_a_link_of_another_user(tmp_path: Path, write: Callable[[Path], None]) -> None:
    mine, planted = tmp_path / "mine", tmp_path / "run.jsonl"
    mine.write_bytes(b"old")
    planted.symlink_to(mine)
    os.lchown(planted, STRANGER, STRANGER)
    with pytest.raises(PermissionError, match="a symbolic link of another user is in its place; remove it"):
        write(planted)
    assert mine.read_bytes() == b"old"
    assert not mine.with_name("mine.part").exists()


def test_a_link_of_ones_own_leads_to_the_file_that_is_written(tmp_path: Path) -> None:
    mine, link = tmp_path / "mine", tmp_path / "link"
    mine.write_bytes(b"old")
    link.symlink_to(mine)
    replace(link)
    assert link.is_symlink()
    assert mine.read_bytes() == b"new"
