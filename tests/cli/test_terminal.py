"""Lines at the foot of a terminal, while others print."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path

import pytest

from hfg.cli.terminal import Foot, is_terminal
from tests.cli.screen import Screen
from tests.limits import patience


@pytest.fixture
def screen() -> Screen:
    return Screen()


@contextmanager
def table_on(screen: Screen) -> Iterator[Foot]:
    """Let both streams go to the screen, with a line at its foot."""
    with redirect_stdout(screen), redirect_stderr(screen):
        foot = Foot(screen)
        with foot.beneath():
            foot.draw(["table"])
            yield foot


def test_lines_change_in_place(screen: Screen) -> None:
    foot = Foot(screen)
    foot.draw(["one", "two and more", "three"])
    foot.draw(["ONE", "2"])
    assert screen.shown == ["ONE", "2"]
    foot.draw(["1", "2", "3", "4"])
    assert screen.shown == ["1", "2", "3", "4"]
    foot.clear()
    assert screen.shown == [""]


def test_what_is_printed_stays_above(screen: Screen) -> None:
    with table_on(screen):
        print("first")
        print("second", file=sys.stderr)
        assert screen.shown == ["first", "second", "table"]
        sys.stdout.writelines(["a", "b\n", "c\n"])
        assert screen.shown == ["first", "second", "ab", "c", "table"]
    assert screen.shown == ["first", "second", "ab", "c"]


def test_a_line_waits_for_its_end(screen: Screen) -> None:
    with table_on(screen):
        print("half", end="")
        assert screen.shown == ["table"]
        print(" and half")
        assert screen.shown == ["half and half", "table"]
        print("rest", end="")
    assert screen.shown == ["half and half", "rest"]


def test_a_prompt_is_shown_and_the_table_waits_for_its_end(screen: Screen) -> None:
    with table_on(screen) as foot:
        print("name? ", end="", flush=True)
        foot.draw(["table"])
        assert screen.shown == ["name? "]
        assert not foot.is_ready()
        print("thanks")
        foot.draw(["table"])
        assert screen.shown == ["name? thanks", "table"]


def test_dots_of_progress_stand_above_the_table(screen: Screen) -> None:
    with table_on(screen) as foot:
        for dots in (".", "..", "..."):
            print(".", end="", flush=True)
            foot.draw(["table", "again"])
            assert screen.shown == ([dots] if dots == "." else [dots, "table", "again"])
        print(" done")
        foot.draw(["table"])
        assert screen.shown == ["... done", "table"]
        print("behind")
    assert screen.shown == ["... done", "behind"]


def test_a_line_that_is_written_over_again_and_again_stands_above_the_table(screen: Screen) -> None:
    with table_on(screen) as foot:
        for percent in (10, 20, 30):
            print(f"\r{percent} %", end="", flush=True)
            foot.draw(["table"])
        assert screen.shown == ["30 %", "table"]
    assert screen.shown == ["30 %"]


def test_a_terminal_made_narrower_has_no_remains(screen: Screen, monkeypatch: pytest.MonkeyPatch) -> None:
    foot = Foot(screen)
    foot.draw(["x" * 30, "short"])
    screen.rows, screen.row, screen.columns = (
        ["x" * 20, "x" * 10, "short", ""],
        3,
        20,
    )  # as terminals wrap what was there
    monkeypatch.setattr(foot, "size", lambda: (20, 24))
    foot.draw(["y" * 19])
    assert screen.shown == ["y" * 19]


def test_a_terminal_that_goes_away_is_left_alone(screen: Screen) -> None:
    foot = Foot(screen)
    foot.draw(["table"])
    screen.is_gone = True
    foot.draw(["table"])
    foot.clear()
    screen.is_gone = False
    foot.draw(["again"])
    assert screen.shown == ["table"]
    assert not foot.is_ready()


def test_everything_else_of_a_stream_is_as_before(screen: Screen) -> None:
    before = sys.stdout
    with table_on(screen):
        assert sys.stdout is not screen
        assert sys.stdout.isatty()
        assert sys.stdout.encoding == screen.encoding
    assert sys.stdout is before


@pytest.mark.parametrize("term", ["dumb", "unknown", None])
def test_a_dumb_terminal_is_none(screen: Screen, monkeypatch: pytest.MonkeyPatch, term: str | None) -> None:
    monkeypatch.setenv("TERM", "xterm")
    assert is_terminal(screen, screen)
    if term is None:
        monkeypatch.delenv("TERM")
    else:
        monkeypatch.setenv("TERM", term)
    assert not is_terminal(screen)


def test_a_file_or_a_closed_stream_is_no_terminal(
    screen: Screen, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TERM", "xterm")
    with (tmp_path / "file").open("w") as file:
        assert not is_terminal(screen, file)
    assert not is_terminal(file)
    assert not is_terminal(None)  # type: ignore[arg-type]


def test_no_color_is_heeded(screen: Screen, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    assert not Foot(screen).coloured
    monkeypatch.setenv("NO_COLOR", "")
    assert Foot(screen).coloured


def test_whoever_leaves_at_once_leaves_no_lines_and_waits_for_nobody(screen: Screen) -> None:
    with table_on(screen) as foot:
        drawing, done = threading.Event(), threading.Event()

        def draw() -> None:
            with foot._lock:
                drawing.set()
                done.wait(patience(10))

        thread = threading.Thread(target=draw)
        thread.start()
        drawing.wait(patience(10))
        foot.leave()  # somebody draws at the moment, and the terminal does not take it
        done.set()
        thread.join()
        foot.draw(["again"])
        assert screen.shown == ["table"]
    other = Screen()
    foot = Foot(other)
    foot.draw(["table"])
    foot.leave()
    foot.draw(["again"])
    assert other.shown == [""]
