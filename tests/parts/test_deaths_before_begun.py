"""Parts that die before the run has begun are begun again as later ones are (rules A10, L2, L3)."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from typing import Any

import pytest

import hfg
from hfg.parts.processes import launching
from hfg_transports.memory import Faults, Network
from tests.parts.test_deaths import numbers

LONG_S = 60.0
SETS_UP_S = 0.05


class Slow(hfg.Node):
    """Takes a while to set up."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    async def setup(self) -> None:
        await asyncio.sleep(SETS_UP_S)

    def process(self, value: int) -> int:
        return value + 1000


class Mortal(launching.LoopLauncher):
    """Begins parts on the loop; each life of one dies so long after its launch, as long as moments are left."""

    def __init__(self, moments: dict[str, list[float]]) -> None:
        super().__init__(network=Network(Faults(delay_s=(0.0, 0.003)), seed=1))
        self._moments = {part: list(moments[part]) for part in moments}
        self.lives: dict[str, int] = {}

    async def launch(self, run: str, part: str, host: str, incarnations: tuple[int, int]) -> Any:
        launched = await super().launch(run, part, host, incarnations)
        self.lives[part] = self.lives.get(part, 0) + 1
        if self._moments.get(part):
            asyncio.get_running_loop().call_later(self._moments[part].pop(0), launched.kill)
        return launched


@pytest.fixture
def mortal(monkeypatch: pytest.MonkeyPatch) -> Callable[[dict[str, list[float]]], list[Mortal]]:
    """Have parts of the next run die so long after they were launched."""

    def use(moments: dict[str, list[float]]) -> list[Mortal]:
        made: list[Mortal] = []

        def make() -> Mortal:
            made.append(Mortal(moments))
            return made[-1]

        monkeypatch.setattr(launching, "LoopLauncher", make)
        return made

    return use


def two(count: int = 12) -> hfg.Graph:
    graph = hfg.Graph("two")
    last = graph.add(numbers(count=count)).out
    for name in ("a", "b"):
        graph.group(name, process=True)
        one = graph.add(Slow(), name=name, group=name)
        graph.connect(last, one.value)
        last = one.out
    graph.connect(last, graph.output("out", int))
    return graph


@pytest.mark.rule("L2", "L3", "A10")
@pytest.mark.parametrize(
    "moments",
    [
        {"a": [0.0]},
        {"a": [0.001]},
        {"a": [0.02]},
        {"a": [0.052]},
        {"b": [0.0]},
        {"b": [0.03]},
        {"a": [0.02], "b": [0.02]},
        {"a": [0.02, 0.02], "b": [0.04]},
        {"a": [0.053], "b": [0.03, 0.04]},
        {"a": [0.056, 0.056, 0.056], "b": [0.02, 0.02]},
    ],
    ids=str,
)
def test_a_part_that_dies_before_the_run_has_begun_is_begun_again(mortal: Any, moments: dict[str, list[float]]) -> None:
    made = mortal(moments)
    report = hfg.run(two(), clock="virtual", until_s=LONG_S)
    assert made[0].lives == {name: 1 + len(moments.get(name, ())) for name in ("a", "b")}
    assert (report.outcome, report.outputs) == ("done", {"out": [2000 + number for number in range(12)]})


@pytest.mark.rule("L2", "X1")
def test_a_part_that_never_comes_to_its_beginning_ends_the_run_with_one_sentence(mortal: Any) -> None:
    made = mortal({"b": [0.02] * 10})
    with pytest.raises(hfg.errors.RunError, match=r'group "b" is gone: .*it died 6 times within 60 s'):
        hfg.run(two(), clock="virtual", until_s=LONG_S)
    assert made[0].lives == {"a": 1, "b": 6}


@pytest.mark.rule("X1", "L2")
def test_a_setup_that_fails_in_a_later_life_ends_the_run_with_its_error(
    mortal: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    setups: list[Any] = []
    setup = Slow.setup

    async def fail_at_last(self: Slow) -> None:
        setups.append(self)
        if len(setups) > 2:
            raise ValueError("no camera")
        await setup(self)

    monkeypatch.setattr(Slow, "setup", fail_at_last)
    mortal({"a": [0.02]})
    with pytest.raises(hfg.errors.NodeError, match="no camera"):
        hfg.run(two(), clock="virtual", until_s=LONG_S)


@pytest.mark.rule("L3")
def test_links_say_at_level_info_that_the_other_side_is_there_again(
    mortal: Any, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "hfg")
    mortal({"a": [0.02]})
    hfg.run(two(), clock="virtual", until_s=LONG_S)
    assert any('group "a" is back as incarnation 2' in record.getMessage() for record in caplog.records)
