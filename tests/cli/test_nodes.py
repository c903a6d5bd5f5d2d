"""`hfg nodes`: the catalogue on a terminal."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from hfg import catalogue
from tests.cli.conftest import Command, Shown

LAMPS = '''
import hfg


@hfg.node
def dim(light: float, *, share: float = 0.5) -> float:
    """Take away a share of the light.

    It never gives more than it takes:

      - not even by a negative share,
      - or by a share above one.

    Args:
      light: in lumen.
      share: what is taken away.
      out: what is left, in lumen.

    Raises:
      ValueError: the light is negative.

    CS::APEX: lamps::Dim.
    """
    return light * (1 - share)


class Switch(hfg.Node):
    """Turn light on and off, which is so wonderful a thing that it needs a sentence longer than a line has room.

    Attributes:
      light: an optional input.
      out: what is let through.
      turned: each time.
    """

    light = hfg.Input(float, optional=True, default=1.0)
    out = hfg.Output(float)
    turned = hfg.Event()

    def process(self, light: float) -> None: ...

    @hfg.slot
    def turn(self) -> None:
        """Turn it."""
'''


@pytest.fixture
def lamps(command: Command) -> Command:
    Path("lamps.py").write_text(LAMPS, encoding="utf-8")
    return command


def test_the_types_of_a_file_are_a_line_each_below_their_category(lamps: Command) -> None:
    shown = lamps("nodes", "lamps.py")
    assert (shown.code, shown.err) == (0, "")
    title, dim, switch = shown.out.splitlines()
    assert title == "lamps (2)"
    assert dim == "  lamps:dim     Take away a share of the light."
    assert switch.startswith("  lamps:Switch  Turn light on and off, which")
    assert switch.endswith("...")
    assert len(switch) == 120


def test_a_type_has_a_page(lamps: Command) -> None:
    shown = lamps("nodes", "lamps.py:dim")
    assert (shown.code, shown.err) == (0, "")
    assert (
        shown.out
        == """\
lamps:dim  (node, lamps)
Take away a share of the light.

It never gives more than it takes:

  - not even by a negative share,
  - or by a share above one.

inputs
  light: float
      in lumen.

outputs
  out: float
      what is left, in lumen.

parameters
  share: float = 0.5
      what is taken away.

errors
  ValueError
      the light is negative.

CS::APEX: lamps::Dim
"""
    )
    assert "  light: float = 1.0\n      an optional input." in lamps("nodes", "lamps:switch").out


def test_the_json_has_all_that_is_known(lamps: Command) -> None:
    dim, switch = json.loads(lamps("nodes", "lamps.py", "--json").out)
    assert (dim["reference"], dim["category"], dim["apex"]) == ("lamps:dim", "lamps", ["lamps::Dim"])
    assert dim["parameters"][0]["default"] == 0.5
    assert dim["errors"] == [{"name": "ValueError", "when": "the light is negative."}]
    assert switch["slots"][0]["doc"] == "Turn it."
    assert [one["name"] for one in json.loads(lamps("nodes", "lamps:dim", "--json").out)] == ["dim"]


@pytest.mark.slow
def test_words_and_categories_choose(lamps: Command) -> None:
    assert lamps("nodes", "lamps.py", "--search", "share lumen").out.split() == [
        "lamps:dim",
        "Take",
        "away",
        "a",
        "share",
        "of",
        "the",
        "light.",
    ]
    assert lamps("nodes", "lamps.py", "-s", "lght").out == 'no node type matches "lght"; search for light?\n'
    assert lamps("nodes", "lamps.py", "-s", "xyzzy").out == 'no node type matches "xyzzy"; hfg nodes lists all\n'
    assert lamps("nodes", "lamps.py", "--category", "LAMPS").out == lamps("nodes", "lamps.py").out
    assert json.loads(lamps("nodes", "lamps.py", "--json", "-s", "zebra").out) == []


@pytest.mark.slow
def test_a_search_of_all_that_is_installed_lists_the_best_first(command: Command) -> None:
    shown = command("nodes", "--search", "webcam")
    assert (shown.code, shown.err) == (0, "")
    assert shown.out.startswith("hfg.nodes.video:Camera ")
    assert command("nodes", "--search", "webcam", "-c", "VIDEO").out.startswith("hfg.nodes.video:Camera ")
    assert command("nodes", "--search", "webcam", "-c", "logic").out == (
        'no node type of the category "logic" matches "webcam"\n'
    )
    assert command("nodes", "--search", "xylofone").out.startswith('no node type matches "xylofone"')
    assert command("nodes", "--search", "webcam", "-c", "zebra").code == 2


@pytest.mark.slow
def test_a_family_and_a_type_of_the_library_have_short_names(command: Command) -> None:
    family = command("nodes", "logic").out
    assert family.startswith("logic (")
    assert "\n  FlipFlop " in family
    pages = {
        command("nodes", name).out for name in ("FlipFlop", "flip_flop", "logic:FlipFlop", "hfg.nodes.logic:FlipFlop")
    }
    assert len(pages) == 1
    assert pages.pop().startswith("hfg.nodes.logic:FlipFlop  (node, logic)\n")


def test_without_a_module_all_that_is_installed_is_listed_and_what_is_broken_told(
    command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("here.py").write_text(LAMPS, encoding="utf-8")
    monkeypatch.syspath_prepend(Path.cwd())
    offered: list[catalogue.Offer] = []
    for module in ("finding", "keeping"):
        monkeypatch.setattr(f"hfg.catalogue.{module}.offers", lambda: tuple(offered))
    assert command("nodes") == Shown(
        0, "no node types are installed; name a module or a file: hfg nodes robot.py\n", ""
    )
    offered += [catalogue.Offer("nowhere", "", "somebody"), catalogue.Offer("here")]
    shown = command("nodes")
    assert shown.code == 0
    assert "here:dim" in shown.out
    assert shown.err == (
        'hfg: there is no module "nowhere", which somebody names: is it installed, and spelled like that?\n'
    )
    assert command("nodes", "dim").out.startswith("here:dim")


@pytest.mark.slow
def test_a_module_without_any_says_so(command: Command) -> None:
    Path("empty.py").write_text("", encoding="utf-8")
    assert command("nodes", "empty.py") == Shown(0, "no node types in empty.py\n", "")
    assert command("nodes", "select") == Shown(0, "no node types in select\n", "")  # a module of Python's own


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("hysterisis",), 'there is no module, family or node type "hysterisis" here or installed; is '),
        (("lamps:dimm",), '"lamps:dimm" here or installed; is dim meant?'),
        (("lamps:zebra",), "; hfg nodes lists what there is"),
        (("nowhere.py",), "nowhere.py: does not exist"),
        (("nowhere:zebra",), 'there is no module "nowhere" here or installed'),
        (("lamps.py", "-c", "zebra"), 'there is no category "zebra"; there are lamps'),
        (("no such thing",), 'no module, family or node type "no such thing"'),
        (("",), 'no module, family or node type ""'),
        (("..",), 'no module, family or node type ".."'),
    ],
)
def test_what_is_not_there_is_told_in_a_sentence(lamps: Command, arguments: tuple[str, ...], sentence: str) -> None:
    shown = lamps("nodes", *arguments)
    assert (shown.code, shown.out) == (2, "")
    assert sentence in shown.err
    assert shown.err.count("\n") == 1
