"""Files: open and save inside the folder, what another program has changed, edits that survive a sudden end."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import hfg
from hfg.cli.studio import read_target
from hfg.studio.project import Project
from hfg.studio.studio import Studio
from tests.studio.page import Page, live
from tests.studio.test_studio import HERE, add, doubling

SET = {"do": "SetParameter", "path": "scaled.factor", "value": 9}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    found = tmp_path / "doubling.hfg.yaml"
    hfg.save(doubling(), found)
    return found


def opened(file: Path) -> Studio:
    return Studio(Project(hfg.load(file, allow=[HERE.partition(".")[0]]), file.parent, file, allow=["tests"]))


def of_file(page: Page) -> Any:
    return page.tables["studio"]["file"]


def test_what_is_saved_is_what_was_edited(file: Path) -> None:
    async def main() -> None:
        page = Page(opened(file)).join()
        assert (of_file(page)["changes"], of_file(page)["kind"]) == (0, "yaml")
        await page.edit(SET)
        assert of_file(page)["changes"] == 1
        assert (await page.ask("save"))["t"] == "ack"
        assert of_file(page)["changes"] == 0
        assert hfg.load(file, allow=["tests"])["scaled"].factor == 9
        await page.ask("undo")
        assert of_file(page)["changes"] == 1
        await page.ask("redo")
        assert of_file(page)["changes"] == 0

    live(main)


def test_a_graph_of_code_is_saved_under_the_name_of_a_graph_file(tmp_path: Path) -> None:
    async def main() -> None:
        page = Page(Studio(Project(doubling(), tmp_path))).join()
        assert of_file(page)["kind"] == "none"
        assert (await page.ask("save"))["code"] == "file"
        assert (await page.ask("save", path="mine.py"))["code"] == "file"
        assert (await page.ask("save", path="mine.hfg.yaml"))["t"] == "ack"
        assert of_file(page)["path"] == "mine.hfg.yaml"

    live(main)


TWO = """
import hfg

def one() -> hfg.Graph:
    return hfg.Graph("one")

def other() -> hfg.Graph:
    return hfg.Graph("other")
"""


def test_a_graph_of_code_with_several_is_opened_by_its_name_and_read_again(tmp_path: Path) -> None:
    async def main() -> None:
        (tmp_path / "two_graphs.py").write_text(TWO)
        project = Project(doubling(), tmp_path, read=read_target)
        page = Page(Studio(project)).join()
        refusal = await page.ask("open", path="two_graphs.py")
        assert refusal["choices"] == ["one", "other"]
        assert "name one of" in refusal["message"]
        assert (await page.ask("open", path="two_graphs.py:other"))["t"] == "ack"
        assert (of_file(page)["graph"], of_file(page)["path"]) == ("other", "two_graphs.py")
        assert (await page.ask("reread"))["t"] == "ack"
        assert of_file(page)["graph"] == "other"
        assert 'has no "third"; it has one, other' in (await page.ask("open", path="two_graphs.py:third"))["message"]
        assert (await page.ask("open", path="../two_graphs.py:one"))["code"] == "file"

    live(main)


@pytest.mark.rule("L5")
@pytest.mark.parametrize(
    "path", ["../x.hfg.yaml", "/etc/x.hfg.yaml", "a/../../x.hfg.yaml", "link/x.hfg.yaml", "\0", ""]
)
def test_nothing_outside_of_the_folder_is_opened_or_written(file: Path, tmp_path: Path, path: str) -> None:
    async def main() -> None:
        (tmp_path / "inner").mkdir()
        (tmp_path / "inner" / "link").symlink_to(tmp_path)
        page = Page(Studio(Project(doubling(), tmp_path / "inner"))).join()
        assert (await page.ask("save", path=path, force=True))["code"] == "file"
        if path:
            assert (await page.ask("open", path=path, discard=True))["code"] == "file"
            assert (await page.ask("ask", what="folder", args={"path": path}))["code"] == "file"
        assert sorted(one.name for one in tmp_path.rglob("*.yaml")) == [file.name]

    live(main)


def test_a_file_that_was_changed_elsewhere_is_not_overwritten(file: Path) -> None:
    async def main() -> None:
        page = Page(opened(file)).join()
        await page.edit(SET)
        text = file.read_text()
        file.write_text(text.replace("doubling", "theirs"))
        answer = await page.ask("save")
        assert answer["code"] == "changed"
        assert answer["message"] == "doubling.hfg.yaml was changed on disk by another program. Yours has 1 change."
        assert "theirs" in file.read_text()
        lines = await page.value("difference")
        assert any(line.startswith("-") and "theirs" in line for line in lines)
        assert (await page.ask("save", force=True))["t"] == "ack"
        assert "theirs" not in file.read_text()

    live(main)


def test_pages_are_told_that_the_file_was_changed_elsewhere(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hfg.studio.studio._LOOK_S", 0.0)

    async def main() -> None:
        page = Page(opened(file)).join()
        text = file.read_text()
        file.write_text(text.replace("doubling", "theirs"))
        await page.until(lambda: bool(of_file(page)["elsewhere"]))
        file.write_text(text)  # as it was
        await page.until(lambda: not of_file(page)["elsewhere"])
        file.unlink()
        await page.until(lambda: "was removed" in of_file(page)["elsewhere"])
        await page.studio.close()

    live(main)


def test_taking_theirs_reads_the_file_again(file: Path) -> None:
    async def main() -> None:
        page = Page(opened(file)).join()
        await page.edit(add("more"))
        file.write_text(file.read_text().replace("doubling", "theirs"))
        assert (await page.ask("reread"))["t"] == "ack"
        assert page.studio.graph.name == "theirs"
        assert "more" not in page.tables["nodes"]
        assert page.agrees()
        assert of_file(page)["changes"] == 0

    live(main)


def test_another_file_takes_the_place_of_the_graph_for_all_pages(file: Path) -> None:
    async def main() -> None:
        other = hfg.Graph("other")
        hfg.save(other, file.with_name("other.hfg.yaml"))
        studio = opened(file)
        one, two = Page(studio).join(), Page(studio).join()
        listed = await one.value("folder", path="")
        assert [one["name"] for one in listed["files"]] == ["doubling.hfg.yaml", "other.hfg.yaml"]
        await one.edit(SET)
        assert (await one.ask("open", path="other.hfg.yaml"))["code"] == "changed"
        assert (await one.ask("open", path="other.hfg.yaml", discard=True))["t"] == "ack"
        assert two.tables["nodes"] == {}
        assert two.agrees()
        assert (await one.ask("open", path="", discard=True))["t"] == "ack"
        assert of_file(two)["kind"] == "none"

    live(main)


def test_a_file_that_is_broken_is_told_with_its_line_and_nothing_is_lost(file: Path) -> None:
    async def main() -> None:
        (file.parent / "broken.hfg.yaml").write_text("hfg: 1\nnodes: [\n")
        page = Page(opened(file)).join()
        answer = await page.ask("open", path="broken.hfg.yaml")
        assert answer["code"] == "file"
        assert page.agrees()
        assert page.studio.graph.name == "doubling"

    live(main)


def test_edits_survive_the_sudden_end_of_the_studio(file: Path) -> None:
    async def main() -> None:
        page = Page(opened(file)).join()
        await page.edit(SET)
        await page.edit(add("more"))
        for value in (3, 4):
            await page.edit({**SET, "value": value}, gesture="drag")
        await page.ask("undo")
        await page.ask("redo")
        wanted = page.tables["nodes"]

        again = Page(opened(file)).join()
        assert of_file(again)["journal"]["changes"] == 5
        assert (await again.ask("journal", take=True))["t"] == "ack"
        assert again.tables["nodes"] == wanted
        assert of_file(again)["journal"] is None
        await again.ask("undo")
        assert again.tables["nodes"]["scaled"]["parameters"]["factor"] == 9

    live(main)


def test_edits_that_were_offered_stay_if_one_goes_on_without_them(file: Path) -> None:
    async def main() -> None:
        await Page(opened(file)).join().edit(SET)
        journal = file.parent / f".{file.name}.hfg-journal"
        before = journal.read_bytes()
        await Page(opened(file)).join().edit(add("more"))
        assert journal.with_name(f"{journal.name}-before").read_bytes() == before

    live(main)


def test_edits_that_are_dropped_are_not_offered_again(file: Path) -> None:
    async def main() -> None:
        await Page(opened(file)).join().edit(SET)
        page = Page(opened(file)).join()
        assert (await page.ask("journal", take=False))["t"] == "ack"
        assert of_file(Page(opened(file)).join())["journal"] is None

    live(main)


def test_a_saved_file_leaves_no_journal(file: Path) -> None:
    async def main() -> None:
        page = Page(opened(file)).join()
        await page.edit(SET)
        await page.ask("save")
        await page.studio.close()
        assert [one.name for one in file.parent.iterdir()] == [file.name]

    live(main)


def test_edits_of_another_version_of_the_file_are_refused(file: Path) -> None:
    async def main() -> None:
        await Page(opened(file)).join().edit(SET)
        file.write_text(file.read_text().replace("doubling", "theirs"))
        page = Page(opened(file)).join()
        answer = await page.ask("journal", take=True)
        assert answer["code"] == "changed"
        assert page.agrees()

    live(main)


@pytest.mark.rule("L5")
def test_a_journal_through_a_link_is_not_read(file: Path, tmp_path: Path) -> None:
    async def main() -> None:
        elsewhere = tmp_path / "elsewhere"
        elsewhere.write_text('{"base":""}\n{"did":"undo"}\n')
        (file.parent / f".{file.name}.hfg-journal").symlink_to(elsewhere)
        assert of_file(Page(opened(file)).join())["journal"] is None

    live(main)


def test_half_a_line_at_the_end_of_a_journal_is_left_out(file: Path) -> None:
    async def main() -> None:
        await Page(opened(file)).join().edit(SET)
        journal = file.parent / f".{file.name}.hfg-journal"
        journal.write_bytes(journal.read_bytes() + b'{"commands":"[{')
        page = Page(opened(file)).join()
        assert of_file(page)["journal"]["changes"] == 1
        assert (await page.ask("journal", take=True))["t"] == "ack"
        assert page.tables["nodes"]["scaled"]["parameters"]["factor"] == 9

    live(main)


def test_a_first_start_finds_examples_and_an_empty_graph(tmp_path: Path) -> None:
    async def main() -> None:
        page = Page(Studio(Project(hfg.Graph(), tmp_path))).join()
        found = await page.value("start")
        assert found["folder"] == tmp_path.name
        assert found["files"] == []

    live(main)
