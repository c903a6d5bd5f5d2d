"""A recording in the studio: everything is as it was at the time of the cursor, and nothing can be changed."""

from __future__ import annotations

import asyncio
import struct
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import pytest

import hfg
from hfg.errors import UsageError
from hfg.graph.editing.commands import decode
from hfg.recording import File, writing
from hfg.recording.chunks import HEAD
from hfg.recording.seeking import MOST_MARKS, Seeking
from hfg.studio.project import RecordedProject
from hfg.studio.recorded import Recorded
from hfg.studio.replaying import Replay
from hfg.studio.studio import Studio
from tests.studio.page import Page, live, studio_of
from tests.studio.recordings import patrol, recording_of

Story = Callable[[Page], Coroutine[Any, Any, None]]


def watched(file: Path, story: Story, graph: hfg.Graph | None = None) -> None:
    """Open a recording in virtual time, and let a page look at it."""

    async def main() -> None:
        recorded = Recorded(file, graph)
        studio = Studio(RecordedProject(recorded.graph_after(0), file), recorded=recorded)
        page = Page(studio).join()
        await replay(page).read()
        await story(page)
        await studio.close()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())


def replay(page: Page) -> Replay:
    assert isinstance(page.studio.steering, Replay)
    return page.studio.steering


def seen(page: Page, sub: int) -> Any:
    """The value in the last frame of a subscription."""
    return [frame["value"] for frame in page.frames if frame["t"] == "data" and frame["sub"] == sub][-1]


@pytest.fixture(scope="module")
def run_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recording_of(tmp_path_factory.mktemp("recordings") / "run.mcap", edits=True)


@pytest.fixture
def chunked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A recording of many small chunks."""
    monkeypatch.setattr(writing, "_CHUNK_BYTES", 20_000)
    monkeypatch.setattr(writing, "_BATCH", 16)
    return recording_of(tmp_path / "run.mcap")


def test_values_are_those_that_were_sent_last_before_the_cursor(run_file: Path) -> None:
    async def story(page: Page) -> None:
        page.say(t="sub", sub=1, topic="value", args={"path": "scale.out -> check.value"})
        for at, value, rate in ((2.05, 40, 10.0), (9.95, 495, 10.0), (0.0, 0, 1.0), (3.05, 150, 10.0)):
            await page.ask("seek", at=at)
            assert (seen(page, 1)["data"], seen(page, 1)["rate_hz"]) == (value, rate)

    watched(run_file, story)


def test_before_the_first_value_there_is_none(run_file: Path) -> None:
    async def story(page: Page) -> None:
        page.say(t="sub", sub=1, topic="value", args={"path": "rest.done"})
        await page.ask("seek", at=7.0)
        assert seen(page, 1)["kind"] == "none"  # it never had a value
        await page.ask("seek", at=5.0)
        assert seen(page, 1) is None

    watched(run_file, story)


@pytest.mark.rule("A5")
def test_activity_is_as_it_was_and_says_by_which_edge_it_came(run_file: Path) -> None:
    async def story(page: Page) -> None:
        page.say(t="sub", sub=1, topic="activity")
        for at, active in ((1.0, "round/there"), (5.0, "rest"), (2.5, "round/back")):
            await page.ask("seek", at=at)
            assert list(seen(page, 1)["active"]) == [active]
            assert seen(page, 1)["still"]
        assert seen(page, 1)["moves"][-1][4] == ["round/there.done -> round/back.begin"]

    watched(run_file, story)


def test_the_graph_and_its_parameters_are_as_they_were(run_file: Path) -> None:
    async def story(page: Page) -> None:
        for at, factor, has_spare in (
            (2.9, 2, False),
            (3.0, 5, False),
            (6.0, 5, True),
            (1.0, 2, False),
            (9.0, 5, True),
        ):
            await page.ask("seek", at=at)
            assert page.tables["nodes"]["scale"]["parameters"] == {"factor": factor}
            assert ("spare" in page.tables["nodes"]) == has_spare

    watched(run_file, story)


def test_the_timeline_has_the_activity_of_the_whole_run_and_the_firings_of_the_window(run_file: Path) -> None:
    async def story(page: Page) -> None:
        page.say(t="sub", sub=1, topic="timeline", args={"begin": 3.95, "end": 4.15})
        await page.ask("seek", at=4.05)
        frames = [frame["value"] for frame in page.frames]
        assert [one["activity"] for one in frames if "activity" in one] == [
            [["round/there", 0.0, 2.0], ["round/back", 2.0, 4.0], ["rest", 4.0, 10.0]]
        ]
        (boxes,) = [one["boxes"] for one in frames if one.get("fresh")]
        at_4 = {"numbers", "scale", "draw", "round/back"}
        assert {box[0] for box in boxes if box[2] == 4.0} == at_4
        assert sorted({round(box[2], 6) for box in boxes}) == [4.0, 4.1]
        assert (frames[-1]["now"], frames[-1]["length"]) == (4.05, 10.0)

    watched(run_file, story)


def test_steps_go_from_firing_to_firing_of_a_node_or_of_any(run_file: Path) -> None:
    async def story(page: Page) -> None:
        async def step(path: str, *, back: bool = False) -> float:
            assert (await page.ask("step", path=path, back=back))["t"] == "answer"
            return float(page.run["elapsed_s"])

        assert await step("round") == 2.0
        assert await step("round") == 4.0
        assert await step("scale") == pytest.approx(4.1)
        assert await step("scale", back=True) == 4.0
        assert await step("", back=True) == pytest.approx(3.9)
        answer = await page.ask("step", path="round", back=True)
        assert answer["value"]["moved"]
        answer = await page.ask("step", path="round", back=True)
        assert answer["value"]["why_not"] == 'no firing of "round" was recorded before 2.00 s'

    watched(run_file, story)


def test_it_is_played_at_the_speed_of_the_run_until_its_end(run_file: Path) -> None:
    async def story(page: Page) -> None:
        page.say(t="sub", sub=1, topic="activity")
        await page.ask("seek", at=1.5)
        await page.ask("proceed")
        assert page.run["state"] == "running"
        await asyncio.sleep(1.0)
        assert replay(page).elapsed() == pytest.approx(2.5)
        moves = [
            move[1:3] for frame in page.frames[-40:] for move in frame["value"]["moves"] if not frame["value"]["still"]
        ]
        assert moves == [["round/there", False], ["round/back", True]]
        await page.ask("pause")
        await asyncio.sleep(1.0)
        assert page.run["elapsed_s"] == pytest.approx(2.5)
        await page.ask("proceed")
        await page.state("paused")
        assert page.run["elapsed_s"] == page.run["length_s"]

    watched(run_file, story)


def test_what_would_change_a_recording_is_refused_in_one_sentence(run_file: Path) -> None:
    async def story(page: Page) -> None:
        before = page.tables["nodes"]
        for message in (
            {"t": "edit", "commands": [{"do": "Remove", "path": "scale"}]},
            {"t": "undo"},
            {"t": "trigger", "path": "rest.begin"},
            {"t": "break", "path": "scale"},
            {"t": "stop"},
        ):
            answer = await page.ask(**message)
            assert answer["message"].startswith("this is a recording; it can be looked at, not changed")
        assert page.tables["nodes"] == before
        assert page.hello["read_only"].startswith("this is a recording")

    watched(run_file, story)


def test_a_recording_takes_the_place_of_a_graph_and_the_other_way_round(run_file: Path) -> None:
    hfg.save(hfg.Graph("drawn"), run_file.with_name("drawn.hfg.yaml"))

    async def main() -> None:
        studio = studio_of(hfg.Graph("empty"), run_file.parent)
        page = Page(studio).join()
        listed = (await page.value("folder", path=""))["files"]
        assert ("run.mcap", "recording") in [(one["name"], one["kind"]) for one in listed]
        assert (await page.ask("open", path="run.mcap"))["t"] == "ack"
        await page.until(lambda: page.closed is not None)
        assert page.closed == (4012, "another file was opened")
        again = Page(studio).join()
        assert again.boot != page.boot
        assert again.tables["studio"]["file"]["kind"] == "recording"
        assert "scale" in again.tables["nodes"]
        assert (await again.ask("edit", commands=[{"do": "Remove", "path": "scale"}]))["code"] == "read_only"
        assert (await again.ask("open", path="drawn.hfg.yaml"))["t"] == "ack"
        await again.until(lambda: again.closed is not None)
        third = Page(studio).join()
        assert (third.tables["studio"]["file"]["graph"], third.hello["read_only"]) == ("drawn", "")
        await studio.close()

    live(main)


def test_who_may_only_look_at_a_recording_opens_nothing_else(run_file: Path) -> None:
    async def main() -> None:
        recorded = Recorded(run_file)
        project = RecordedProject(recorded.graph_after(0), run_file)
        page = Page(Studio(project, recorded=recorded, read_only="only look")).join()
        assert (await page.ask("open", path="run.mcap"))["message"] == "only look"
        await page.studio.close()

    live(main)


def test_failures_of_the_run_are_in_the_list_of_problems_at_their_times(run_file: Path) -> None:
    async def story(page: Page) -> None:
        (problem,) = page.tables["problems"].values()
        assert (problem["path"], problem["at_s"]) == ("check", pytest.approx(3.2))
        assert "160 is too large" in problem["why"]

    watched(run_file, story)


def test_pictures_and_plots_end_at_the_cursor(run_file: Path) -> None:
    async def story(page: Page) -> None:
        page.say(t="sub", sub=1, topic="image", args={"path": "draw.out"})
        page.say(t="sub", sub=2, topic="history", args={"path": "numbers.out"})
        await page.ask("seek", at=5.0)
        assert struct.unpack_from("<HH", page.binary[-1][2]) == (64, 48)
        await page.until(lambda: len(seen(page, 2)["values"]) == 51)
        assert seen(page, 2)["values"][-1] == 50

    watched(run_file, story)


# --- damage, and what is missing ---


def spoil(file: Path, number: int) -> None:
    """Change a byte in the middle of a chunk."""
    with File(file) as found:
        piece = found.layout.pieces[number]
    data = bytearray(file.read_bytes())
    data[piece.begin + piece.length // 2] ^= 0xFF
    file.write_bytes(data)


@pytest.mark.rule("L4")
def test_a_damaged_chunk_is_a_problem_in_the_page_and_the_rest_is_there(chunked: Path) -> None:
    with File(chunked) as found:
        count = len(found.layout.pieces)
    assert count > 5
    spoil(chunked, 2)

    async def story(page: Page) -> None:
        (damage,) = [one for one in page.tables["problems"].values() if one["source"] == "recording"]
        assert f"chunk 3 of {count} cannot be read" in damage["what"]
        page.say(t="sub", sub=1, topic="value", args={"path": "numbers.out"})
        await page.ask("seek", at=9.0)
        assert seen(page, 1)["data"] == 90
        await page.ask("seek", at=damage["at_s"] + 0.15)
        assert "cannot be read" in seen(page, 1)["message"]

    watched(chunked, story)


@pytest.mark.rule("L4")
def test_a_list_of_messages_that_lies_costs_its_chunk_only(chunked: Path) -> None:
    with File(chunked) as found:
        piece = found.layout.pieces[1]
        ((channel, (at, length)), *_) = [
            one for one in found.layout.indexes_of(piece).items() if found.channels[one[0]].topic == "numbers.out"
        ]
    data = bytearray(chunked.read_bytes())
    for place in range(at + 6 + 8, at + length, 16):
        data[place : place + 8] = struct.pack("<q", 2**62)
    chunked.write_bytes(data)

    async def story(page: Page) -> None:
        page.say(t="sub", sub=1, topic="value", args={"path": "numbers.out"})
        seeking = replay(page).recorded.seeking
        when = int(seeking._lists_of(1)[channel]["time"][0]) / 1e9
        await page.ask("seek", at=when)
        assert "the list of its messages is wrong" in seen(page, 1)["message"]
        await page.ask("seek", at=9.0)
        assert seen(page, 1)["data"] == 90

    watched(chunked, story)


@pytest.mark.rule("L4")
def test_a_recording_that_was_cut_off_is_shown_up_to_there(chunked: Path) -> None:
    with File(chunked) as found:
        piece = found.layout.pieces[4]
    chunked.write_bytes(chunked.read_bytes()[: piece.begin - HEAD.size + 40])

    async def story(page: Page) -> None:
        assert any("it was cut off here" in one["what"] for one in page.tables["problems"].values())
        page.say(t="sub", sub=1, topic="value", args={"path": "numbers.out"})
        await page.ask("seek", at=1e9)
        assert seen(page, 1)["data"] == int(page.run["elapsed_s"] * 10 + 0.5)
        assert 0 < page.run["length_s"] < 9

    watched(chunked, story)


def test_a_node_whose_type_is_not_there_keeps_its_place_and_its_values(
    run_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def without_picture(data: str, *, allow: Any) -> Any:
        if ":picture" in data:
            raise hfg.errors.GraphError('"elsewhere:picture" is not installed')
        return decode(data, allow=allow)

    monkeypatch.setattr("hfg.studio.recorded.decode", without_picture)

    async def story(page: Page) -> None:
        assert page.tables["nodes"]["draw"]["missing"]
        assert "numbers.out -> draw.value" in page.tables["edges"]
        assert any("not installed" in one["what"] for one in page.tables["problems"].values())
        page.say(t="sub", sub=1, topic="image", args={"path": "draw.out"})
        await page.ask("seek", at=5.0)
        assert struct.unpack_from("<HH", page.binary[-1][2]) == (64, 48)

    watched(run_file, story)


def test_the_graph_may_be_given_beside_the_recording(run_file: Path) -> None:
    async def story(page: Page) -> None:
        assert "scale" in page.tables["nodes"]
        await page.ask("seek", at=7.0)
        assert "spare" in page.tables["nodes"]

    watched(run_file, story, patrol())


def test_a_file_of_another_program_is_refused_in_one_sentence(tmp_path: Path) -> None:
    from hfg.recording.mcap import Writer

    with (tmp_path / "other.mcap").open("wb") as stream:
        Writer(stream, library="other").finish()
    with pytest.raises(UsageError, match="holds no graph, because hfg did not write it"):
        Recorded(tmp_path / "other.mcap")


# --- by time, chunk by chunk ---


def test_finding_by_time_agrees_with_reading_the_whole_file(chunked: Path) -> None:
    with File(chunked) as file:
        seeking = Seeking(file)
        for number in file.channels:
            times = [when for channel, when, _ in file.messages() if channel == number]
            bodies = [data for channel, _, data in file.messages() if channel == number]
            for at in range(-1, seeking.last + 2, seeking.last // 37):
                before = [when for when in times if when <= at]
                found = seeking.latest(number, at)
                assert (found is None) == (not before)
                if found is not None:
                    assert found.time == before[-1]
                    assert seeking.read(found) == bodies[len(before) - 1]
                assert seeking.after([number], at) == min((when for when in times if when > at), default=None)
                assert seeking.before([number], at) == max((when for when in times if when < at), default=None)
                assert seeking.count([number], at, at + 10**9) == sum(at < when <= at + 10**9 for when in times)


def test_of_very_many_messages_some_are_marked_and_the_rest_is_counted(tmp_path: Path) -> None:
    file = recording_of(tmp_path / "run.mcap", patrol(upto=5000, rate=1000.0))
    with File(file) as found:
        seeking = Seeking(found)
        marks, total = seeking.marks(found.channels, seeking.first, seeking.last)
        assert total > 15_000
        assert 1000 < sum(map(len, marks.values())) <= MOST_MARKS
        marks, total = seeking.marks(found.channels, 10**9, 10**9 + 10**7)
        assert total == sum(map(len, marks.values())) == 33
