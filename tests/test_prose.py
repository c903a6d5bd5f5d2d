"""The check of our English finds habits in all that people read, and lets a folder only become better."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from tools import prose

PAGE = """# A page

Plain text. `nobody` is code, and so is

```python
nobody = "behind"
```

Who reads this goes on.
"""
MODULE = '''"""Give a number."""

import math

# Nobody asks.
def sign(value: float) -> float:
    """Return the sign.

    The value lies behind the point.
    """
    if not value:
        raise ValueError(f"{value} is no number")
    return math.copysign(1, value)
'''


def found_in(folder: Path) -> list[tuple[str, str, str]]:
    lines = prose.check_files((), folder, prose.read_rules()).lines
    return sorted({(parts[0], parts[1].strip(), parts[2].strip()) for parts in (line.split(": ", 3) for line in lines)})


@pytest.fixture
def project(tmp_path: Path) -> Path:
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "page.md").write_text(PAGE)
    (tmp_path / "hfg" / "sums").mkdir(parents=True)
    (tmp_path / "hfg" / "sums" / "signs.py").write_text(MODULE)
    return tmp_path


def test_habits_are_found_in_pages_docstrings_messages_and_comments_but_not_in_code(project: Path) -> None:
    assert found_in(project) == [
        ("docs/page.md:9", "docs", "go-on-anew"),
        ("docs/page.md:9", "docs", "who-clause"),
        ("hfg/sums/signs.py:1", "docstring", "give"),
        ("hfg/sums/signs.py:12", "error", "is-no"),
        ("hfg/sums/signs.py:5", "comment", "somebody"),
        ("hfg/sums/signs.py:9", "docstring", "behind-amid-beside"),
    ]


def test_a_folder_may_not_become_worse(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    baseline = project / "baseline.txt"
    options = ["--root", str(project), "--baseline", str(baseline)]
    assert prose.main([*options, "--write-baseline"]) == 0
    assert prose.main([*options, "--ratchet"]) == 0
    with (project / "docs" / "page.md").open("a") as page:
        page.write("\nNobody knows.\n")
    assert prose.main([*options, "--ratchet"]) == 1
    assert capsys.readouterr().out == "docs: 3 findings of tools/prose.py, at most 2 allowed\n"


def test_the_smaller_number_counts_where_a_merge_left_two_lines(tmp_path: Path) -> None:
    baseline = tmp_path / "baseline.txt"
    baseline.write_text("# a comment\ndocs 7\nhfg/ports 3\ndocs 5\n")
    assert prose.read_baseline(baseline) == {"docs": 5, "hfg/ports": 3}


@pytest.mark.parametrize(
    ("subject", "problem"),
    [
        ("Drop signals after END and return their activity to the sender (F13, F4)", None),
        ("Merge branch 'nobody'", None),
        ("Who leaves at once leaves no folder", "who-clause"),
        ("Explain in one subject, at length and without need, everything that the body could say", "86 characters"),
    ],
)
def test_subjects_of_commits_are_short_and_plain(subject: str, problem: str | None, tmp_path: Path) -> None:
    problems = prose.check_subject(subject, prose.read_rules())
    assert (not problems) if problem is None else any(problem in line for line in problems)
    message = tmp_path / "COMMIT_EDITMSG"
    message.write_text(f"{subject}\n\nNobody checks the body.\n")
    assert prose.main(["--commit", str(message)]) == bool(problem)


def test_each_replacement_of_the_word_list_is_advised() -> None:
    rules = prose.read_rules()
    terms = next(rule for rule in tomllib.loads((prose.HERE / "prose.toml").read_text())["rule"] if "words_to" in rule)
    for advice in terms["words_to"].values():
        assert advice.strip()
    assert [found.advice for found in prose.check("docs", "It gives back a value.", rules)] == ["returns"]
