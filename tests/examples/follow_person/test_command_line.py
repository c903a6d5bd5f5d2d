"""The robot that follows a person, from the command line: its report, and what is refused."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from examples.follow_person.__main__ import app


def command(*arguments: str) -> Result:
    return CliRunner().invoke(app, arguments)


@pytest.mark.slow
def test_a_report_has_the_map_the_curves_and_the_figures(tmp_path: Path) -> None:
    result = command("--metres", "4", "--seed", "2", "--report", str(tmp_path))
    assert result.exit_code == 0, result.output
    assert "0 contacts" in result.output
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    for section in ("How it went", "The way (figure 25)", "Distance and speed", "The mission (figure 24)"):
        assert section in page
    assert "<polyline" in (tmp_path / "map.svg").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--seed", "-1"), "'--seed': Input should be greater than or equal to 0"),
        (("--course", "swamp"), "'swamp' is not one of 'open', 'dense'"),
        (("--pace", "9"), "'--pace': Input should be less than or equal to 1.95"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_what_is_out_of_range_is_refused_in_a_sentence(arguments: tuple[str, ...], sentence: str) -> None:
    result = command(*arguments)
    assert result.exit_code == 2
    assert sentence in re.sub(r"[\s│]+", " ", result.output)


def test_a_folder_that_cannot_be_written_to_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    result = command("--metres", "4", "--report", str(tmp_path / "file"))
    assert result.exit_code == 2
    assert "name a folder that you can write to" in re.sub(r"[\s│]+", " ", result.output)
