"""The delivery robots from the command line: what they say in the end, however that comes, and what they refuse."""

from __future__ import annotations

import asyncio
import re
import signal

import pytest
from typer.testing import CliRunner, Result

import hfg
from examples.fetch_delivery.__main__ import app
from examples.fetch_delivery.mission import build
from examples.fetch_delivery.running import carry_out
from examples.fetch_delivery.world import Simulation


def command(*arguments: str) -> Result:
    return CliRunner().invoke(app, arguments)


def said(result: Result) -> str:
    """Give the text without the frame around it."""
    return re.sub(r"[\s│]+", " ", result.output)


@pytest.mark.slow
def test_the_score_of_each_robot_is_told() -> None:
    result = command("--minutes", "0.02", "--robots", "2")
    assert result.exit_code == 0
    assert [line.partition(",")[0] for line in result.output.splitlines()[:2]] == [
        "robot 0: 0 delivered",
        "robot 1: 0 delivered",
    ]
    assert "0.02 minutes in" in result.output


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--seed", "-1"), "'--seed': Input should be greater than or equal to 0"),
        (("--robots", "5"), "'--robots': Input should be less than or equal to 4"),
        (("--robots", "0"), "'--robots': Input should be greater than or equal to 1"),
        (("--minutes", "nan"), "'--minutes'"),
        (("--param", "size=7"), "an arena has no 'size'; it has radius, octagon, drift, noise"),
        (("--param", "radius=large"), "write a number behind radius, such as radius=6, not 'radius=large'"),
        (("--param", "radius=9"), "radius of an arena is 5 to 6.35, not 9"),
        (("--param", "light=nan"), "light of an arena is 0 to 2, not nan"),
        (("--fault", "bad luck"), "there is no fault 'bad luck'; there are blocked station, absent operator"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_what_is_out_of_range_is_refused_in_a_sentence(arguments: tuple[str, ...], sentence: str) -> None:
    result = command(*arguments)
    assert result.exit_code == 2
    assert sentence in said(result)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda number: number.name)
def test_ctrl_c_ends_a_mission_with_what_it_has_reached_and_so_does_a_request_to_end(number: signal.Signals) -> None:
    def press(_run: hfg.Run) -> None:
        asyncio.get_running_loop().call_later(0.75, signal.raise_signal, number)

    result = carry_out(build(), 60, begin=press)
    assert result.outcome == "interrupted"
    assert 0.7 <= result.simulated_s < 2
    assert len(result.scores) == 1
    assert str(result).endswith("interrupted")


def test_a_mission_that_takes_too_long_ends_earlier() -> None:
    result = carry_out(build(), 60, within_s=0)
    assert result.outcome == "late"
    assert result.simulated_s < 2
    assert str(result).endswith("stopped because it got late")


def test_a_mission_that_fails_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    def break_down(_simulation: Simulation, _dt: float) -> None:
        raise OSError("the motors have no power")

    monkeypatch.setattr(Simulation, "step", break_down)
    result = command("--minutes", "0.1")
    assert result.exit_code == 1
    assert "robot 0: 0 delivered" in result.output
    assert "then it failed" in result.output
    assert 'node "world" failed in firing 1: OSError: the motors have no power' in result.stderr
