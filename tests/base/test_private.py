"""Folders that only their user can enter: owner, mode, and every folder and link on the way (rule L5)."""

from __future__ import annotations

import grp
import os
import pwd
from collections.abc import Iterator
from pathlib import Path

import pytest

from hfg.base.private import check_parents, exposure_of_key, open_private, state_folder
from hfg.catalogue.keeping import installed_index
from hfg.errors import TransportError

pytestmark = pytest.mark.rule("L5")
as_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root can make files of another user")
NOBODY = 65534


@pytest.fixture
def without_umask() -> Iterator[None]:
    before = os.umask(0)
    yield
    os.umask(before)


def test_missing_folders_on_the_way_are_for_their_user_only(tmp_path: Path, without_umask: None) -> None:
    os.close(open_private(tmp_path / "state" / "hfg" / "logs"))
    made = [tmp_path / "state", tmp_path / "state" / "hfg", tmp_path / "state" / "hfg" / "logs"]
    assert [folder.stat().st_mode & 0o777 for folder in made] == [0o700] * 3


def test_a_folder_on_the_way_that_others_may_write_to_is_refused(tmp_path: Path) -> None:
    (tmp_path / "hfg").mkdir()
    (tmp_path / "hfg").chmod(0o777)
    with pytest.raises(TransportError, match=f"replace folders in {tmp_path}/hfg; write chmod go-w {tmp_path}/hfg"):
        open_private(tmp_path / "hfg" / "logs")


@pytest.mark.parametrize("mode", [0o1777, 0o1733])
def test_a_sticky_folder_on_the_way_is_safe(tmp_path: Path, mode: int) -> None:
    (tmp_path / "tmp").mkdir()
    (tmp_path / "tmp").chmod(mode)
    os.close(open_private(tmp_path / "tmp" / "hfg"))


def chain(folder: Path) -> Path:
    """Return a way over two links, the first of which leads to "via/link", and that to "safe"."""
    for name in ("safe", "via"):
        (folder / name).mkdir()
    (folder / "via" / "link").symlink_to("../safe")
    (folder / "mine").symlink_to(folder / "via" / "link")
    return folder / "mine" / "hfg"


def test_a_chain_of_links_is_followed_to_its_end(tmp_path: Path) -> None:
    os.close(open_private(chain(tmp_path)))
    assert (tmp_path / "safe" / "hfg").is_dir()


def test_a_folder_with_a_middle_link_that_others_may_write_to_is_refused(tmp_path: Path) -> None:
    way = chain(tmp_path)
    (tmp_path / "via").chmod(0o777)
    with pytest.raises(TransportError, match=f"replace folders in {tmp_path}/via;"):
        open_private(way)


@as_root
@pytest.mark.parametrize("whose", ["via", "via/link", "mine"])
def test_a_link_on_the_way_that_belongs_to_another_user_is_refused(tmp_path: Path, whose: str) -> None:
    way = chain(tmp_path)
    os.lchown(tmp_path / whose, NOBODY, NOBODY)
    with pytest.raises(TransportError, match=f"replace folders in {tmp_path}/{whose};"):
        open_private(way)


def test_links_in_a_circle_are_refused(tmp_path: Path) -> None:
    (tmp_path / "one").symlink_to("other")
    (tmp_path / "other").symlink_to("one")
    with pytest.raises(TransportError, match="cannot be used"):
        open_private(tmp_path / "one" / "hfg")


@as_root
@pytest.mark.parametrize(("members", "is_safe"), [([], True), (["somebody"], False)])
def test_only_a_group_of_the_user_alone_may_write_to_a_folder_on_the_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, members: list[str], is_safe: bool
) -> None:
    """Systems that give each user a group of the same name often have a umask of 002."""
    os.chown(tmp_path, 0, 4711)
    tmp_path.chmod(0o770)
    user = pwd.struct_passwd(("root", "x", 0, 4711, "", "/root", "/bin/sh"))
    monkeypatch.setattr(pwd, "getpwuid", lambda _: user)
    monkeypatch.setattr(grp, "getgrgid", lambda _: grp.struct_group(("root", "x", 4711, members)))
    if is_safe:
        check_parents(tmp_path / "hfg")
    else:
        with pytest.raises(TransportError, match="other users can replace folders in"):
            check_parents(tmp_path / "hfg")


@as_root
def test_a_group_without_a_name_is_not_the_user_s_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def unknown(_: int) -> None:
        raise KeyError

    os.chown(tmp_path, 0, 4711)
    tmp_path.chmod(0o770)
    monkeypatch.setattr(pwd, "getpwuid", unknown)
    with pytest.raises(TransportError, match="other users can replace"):
        check_parents(tmp_path / "hfg")


def test_a_user_without_a_home_directory_is_told_what_to_set(monkeypatch: pytest.MonkeyPatch) -> None:
    def unknown() -> Path:
        raise RuntimeError

    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.setattr(Path, "home", unknown)
    with pytest.raises(TransportError, match="has no home directory: set HOME, or set XDG_STATE_HOME"):
        state_folder()


def stat_of(mode: int, user: int) -> os.stat_result:
    return os.stat_result((mode, 0, 0, 1, user, 0, 0, 0, 0, 0))


OPEN = ("other users can read or change cell.key", "write chmod 600 cell.key")
THEIRS = (
    "cell.key belongs to user 1001, who knows it, and this is user 1000",
    "take a key that this user has made",
)


@pytest.mark.parametrize(
    ("mode", "user", "exposure"),
    [
        (0o100600, 1000, None),
        (0o100400, 1000, None),
        (0o100640, 1000, OPEN),
        (0o100604, 1000, OPEN),
        (0o100620, 1000, OPEN),
        (0o100600, 1001, THEIRS),
        (0o100640, 0, None),  # as systems keep the keys of services
        (0o100660, 0, OPEN),
        (0o100644, 0, OPEN),
    ],
)
def test_a_key_is_its_user_s_only(
    monkeypatch: pytest.MonkeyPatch, mode: int, user: int, exposure: tuple[str, str] | None
) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    assert exposure_of_key("cell.key", stat_of(mode, user)) == exposure


def test_folders_on_the_way_to_a_cache_are_for_this_user_only_whatever_the_umask_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "one" / "two"))
    before = os.umask(0)
    try:
        installed_index()
    finally:
        os.umask(before)
    found = [tmp_path / "one", *(tmp_path / "one").rglob("*")]
    assert len(found) == 4
    assert not [one for one in found if one.stat().st_mode & 0o077]
