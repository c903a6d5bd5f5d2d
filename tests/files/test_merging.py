"""Two people change one graph: a diff shows what changed, and git puts both together."""

from __future__ import annotations

import difflib
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

import hfg
from hfg import commands as c
from hfg.files import describe, load, text_of
from tests.files.programs import Ear, double, numbers, shown

TYPES = "tests.files.programs"


def graph() -> hfg.Graph:
    made = hfg.Graph("line")
    made.group("side")
    last = made.add(numbers(), name="camera", max_rate_hz=5)
    for name in ("first", "second", "third", "fourth"):
        node = made.add(double(factor=3), name=name)
        made.connect(last.out, node.value)
        made.edit(c.Note(name, "position", [len(made.nodes), 0]))
        last = node
    look, ear = made.add(shown()), made.add(Ear())
    made.connect(last.out, look.value)
    made.connect(ear.rang, made.stop)
    return made


def edited(*edits: c.Command) -> str:
    made = graph()
    made.edit(*edits)
    return text_of(describe(made))


def merged(base: str, ours: str, theirs: str, folder: Path) -> tuple[str, int]:
    """What git makes of two changes, and how many conflicts there are."""
    for name, text in (("ours", ours), ("base", base), ("theirs", theirs)):
        (folder / name).write_text(text, encoding="utf-8")
    done = subprocess.run(
        ["git", "merge-file", "-p", "ours", "base", "theirs"], cwd=folder, capture_output=True, text=True, check=False
    )
    return done.stdout, done.returncode


def changed(before: str, after: str) -> list[str]:
    lines = difflib.unified_diff(before.splitlines(), after.splitlines(), n=0, lineterm="")
    return [line for line in lines if line[:3] not in ("---", "+++") and line[:2] != "@@"]


def test_a_diff_shows_what_changed_and_nothing_else() -> None:
    base = text_of(describe(graph()))
    assert changed(base, edited(c.SetParameter("second.factor", 7))) == ["-      factor: 3", "+      factor: 7"]
    assert changed(base, edited(c.Move("third", "side"))) == ["+    group: side"]
    assert changed(base, edited(c.Disconnect("camera.out", "first.value"))) == ["-  - camera.out -> first.value"]
    assert changed(base, edited(c.MakeActive("ear.rang", "stop"))) == [
        "-  - ear.rang -> stop",
        "+  - ear.rang -> stop:",
        "+      active: true",
    ]
    assert changed(base, edited(c.Note("first", "position", [3, 4]))) == [
        "-    position: [2, 0]",
        "+    position: [3, 4]",
    ]
    assert changed(base, edited(c.Add(f"{TYPES}:Ear", "other"))) == ["+  other:", "+    type: tests.files.programs:Ear"]


EDITS: list[Callable[[], tuple[c.Command, ...]]] = [
    lambda: (c.SetParameter("camera.count", 9),),
    lambda: (c.SetParameter("second.factor", 7), c.Note("second", "position", [9, 9])),
    lambda: (c.Move("third", "side"),),
    lambda: (c.Disable("fourth"),),
    lambda: (c.Disconnect("third.out", "fourth.value"), c.Remove("fourth")),
    lambda: (c.Connect("camera.out", "ear.hear"), c.Add(f"{TYPES}:Ear", "other")),
    lambda: (c.Gate("first", "ear"),),
    lambda: (c.Note("", "title", "ours"),),
]


@pytest.mark.parametrize("mine", range(len(EDITS)))
@pytest.mark.parametrize("others", range(len(EDITS)))
def test_git_merges_changes_in_different_places(mine: int, others: int, tmp_path: Path) -> None:
    if mine == others or {mine, others} == {3, 4}:  # the same place
        return
    ours, theirs = EDITS[mine](), EDITS[others]()
    text, conflicts = merged(text_of(describe(graph())), edited(*ours), edited(*theirs), tmp_path)
    assert not conflicts, text
    file = tmp_path / "merged.hfg.yaml"
    file.write_text(text)
    both = load(file)
    wanted = graph()
    wanted.edit(*ours, *theirs)
    assert both.as_commands() == wanted.as_commands()


def test_what_two_people_add_at_the_end_is_a_conflict_of_whole_entries(tmp_path: Path) -> None:
    ours = edited(c.Add(f"{TYPES}:Ear", "mine", options={"priority": 1}))
    theirs = edited(c.Add(f"{TYPES}:Ear", "others", options={"priority": 2}))
    text, conflicts = merged(text_of(describe(graph())), ours, theirs, tmp_path)
    assert conflicts == 1
    between = text.partition("<<<<<<< ours\n")[2].partition(">>>>>>> theirs")[0]
    assert [line.strip() for line in between.splitlines() if line.startswith("  ")]
    file = tmp_path / "both.hfg.yaml"
    file.write_text(text)
    with pytest.raises(hfg.errors.FileError, match="this is no YAML"):
        load(file)
