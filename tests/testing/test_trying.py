"""A type that keeps its word is usable, each way to break it is told, and who crashes or hangs is named."""

from __future__ import annotations

import asyncio
import ctypes
import doctest
import os
import platform
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, cast

import numpy as np
import pytest
from annotated_types import Ge

import hfg
import hfg.testing.trying
from hfg.images import Gray
from hfg.testing import NotUsable, Trial, try_type, usable
from hfg.testing.usable import main, try_all


@hfg.node
def half(number: int) -> float:
    """Halve a number."""
    return number / 2


@hfg.node
def wrong_result(number: int) -> str:
    return cast(str, number)


@hfg.node
def divides(number: int) -> float:
    """Divide by a number.

    Raises:
      ArithmeticError: the number is zero.
    """
    return 1 / number


@hfg.node
def divides_unsaid(number: int) -> float:
    """Divide by a number.

    Raises:
      ValueError: never.
      Exception: which says nothing.
    """
    return 1 / number


@hfg.node
def divides_by_more(number: Annotated[int, Ge(1)]) -> float:
    return 1 / number


@hfg.node
def refuses_all(number: int) -> float:
    """Refuse.

    Raises:
      ValueError: always.
    """
    raise ValueError(f"not {number}")


@hfg.node
def needs_more(*, count: Annotated[int, Ge(0)] = 0) -> Iterator[float]:
    yield 1 / count


@hfg.node
def counting(*, count: int = 2) -> Iterator[int]:
    yield from range(count)


@hfg.node
async def sleeping(value: object) -> object:
    await asyncio.sleep(1000)
    return value


@hfg.node
def brightest(image: Gray) -> int:
    """Give the brightest pixel.

    Raises:
      ValueError: the image is empty.
    """
    assert isinstance(image, np.ndarray)
    return int(image.max())


class Relay(hfg.Node):
    said = hfg.Event(int)

    @hfg.slot
    def say(self, value: int) -> None:
        self.said.trigger(value)


class WrongEvent(hfg.Node):
    said = hfg.Event(int)

    @hfg.slot
    def say(self) -> None:
        self.said.trigger(cast(int, "three"))


class WrongEnd(hfg.Node):
    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> None: ...

    def end(self) -> None:
        self.out.send(cast(int, "three"))


class Held(hfg.Node):
    """Fires only when it has something; that is what `ready` says."""

    value = hfg.Output(int)
    kept = hfg.State[int | None](None)

    def ready(self) -> bool:
        return self.kept is not None

    def process(self) -> int:
        return cast(int, self.kept) + 1

    @hfg.slot
    def keep(self, value: int) -> None:
        self.kept = value


class AnyOf(hfg.Node):
    values = hfg.Inputs(int, 2, optional=True)
    out = hfg.Output(int)

    def process(self, values: list[int]) -> int:
        return max(value or 0 for value in values)


class Both(hfg.Subgraph):
    number = hfg.Input(int)
    halves = hfg.Output(float)

    def build(self, graph: hfg.Graph) -> None:
        inner = graph.add(half())
        graph.connect(self.number.inner, inner.ports.inputs["number"])
        graph.connect(inner.out, self.halves.inner)


class EachOfBoth(Both):
    iterate_over = ("number",)


class WrongInside(hfg.Subgraph):
    number = hfg.Input(int)
    halves = hfg.Output(float)

    def build(self, graph: hfg.Graph) -> None:
        inner = graph.add(divides_unsaid())
        graph.connect(self.number.inner, inner.ports.inputs["number"])
        graph.connect(inner.out, self.halves.inner)


class ManyParameters(hfg.Node):
    value = hfg.Input(float)
    out = hfg.Output(float)
    low = hfg.Parameter(0.0)
    high = hfg.Parameter(1.0)
    done = hfg.Parameter(0.0, read_only=True)
    poke = hfg.Parameter(trigger=True)

    def process(self, value: float) -> float:
        """Scale.

        Raises:
          ValueError: of the process function, where nobody looks.
        """
        if self.low > self.high:
            raise ValueError("low is above high")
        return value


@hfg.node
def crashes(value: int) -> int:
    os.kill(os.getpid(), signal.SIGSEGV)
    return value


@hfg.node
def leaves(value: int) -> int:
    os._exit(3)


@hfg.node
def asks_to_leave(value: int) -> int:
    raise SystemExit(2)


@hfg.node
def hangs(value: int) -> int:
    print("noise on standard output")
    time.sleep(600)
    return value


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind",
    [half, divides, divides_by_more, counting, sleeping, brightest, Relay, Held, AnyOf, Both, EachOfBoth],
    ids=lambda kind: str(kind._type.name),
)
def test_what_keeps_its_word_is_usable(kind: Any) -> None:
    for seed in range(3):
        trial = try_type(kind, seed=seed)
        assert trial.usable
        assert trial.fired >= 3
        assert trial.reference.startswith(f"{__name__}:")


@pytest.mark.slow
def test_declared_errors_are_counted() -> None:
    trial = try_type(divides)
    assert (trial.refused > 0, trial.errors) == (True, ("ZeroDivisionError",))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "sentence"),
    [
        (wrong_result, 'fire(wrong_result(), number=0) gave output "out" int: 0, which is declared str'),
        (divides_unsaid, "fire(divides_unsaid(), number=0) raised ZeroDivisionError"),
        (refuses_all, "firings ended by errors that it declares, as ValueError: not "),
        (needs_more, "fire(needs_more()) raised ZeroDivisionError"),
        (WrongEvent, "fire(WrongEvent(), slot='say') gave event \"said\" str: 'three', which is declared int"),
        (WrongEnd, "hook='end') gave output \"out\" str: 'three', which is declared int"),
        (WrongInside, "raised ZeroDivisionError"),
        (ManyParameters, "its Raises: declares nothing: add it, or say by types and limits"),
    ],
    ids=lambda one: one if isinstance(one, str) else str(one._type.name),
)
def test_what_breaks_its_word_is_told_by_the_smallest_call(kind: Any, sentence: str) -> None:
    with pytest.raises(NotUsable) as error:
        try_type(kind, firings=5)
    assert sentence in str(error.value)
    assert str(error.value).startswith(f"{__name__}:{kind._type.qualname}: ")


def test_the_same_seed_fires_the_same() -> None:
    first, again = try_type(divides, seed=5), try_type(divides, seed=5)
    assert first == again


def test_a_hook_that_nobody_defines_and_a_slot_without_handler_are_left_alone() -> None:
    class Nothing(hfg.Node):
        begin = hfg.Parameter(trigger=True)

    assert try_type(Nothing).fired > 0


def named(*kinds: Any) -> list[str]:
    return [f"tests.testing.test_trying:{kind._type.qualname}" for kind in kinds]


@hfg.node
def counts_without_end(value: int) -> int:
    while True:
        value += 1


@hfg.node
def writes_beyond(value: int) -> int:
    """Write behind what belongs to it, as a library in C may do."""
    text = ctypes.create_string_buffer(4096)
    ctypes.memset(text, 0x78, 4096 + 4)
    return value


@pytest.mark.slow
@pytest.mark.timeout(240)
def test_a_type_that_ends_its_process_or_does_not_come_back_is_named_and_the_others_go_on() -> None:
    kinds = (half, crashes, leaves, asks_to_leave, hangs, counts_without_end, divides)
    trials = try_all(named(*kinds), confirm=False, limit_s=2)
    assert [trial.reference for trial in trials] == named(*kinds)
    assert [trial.usable for trial in trials] == [True, False, False, False, False, False, True]
    faults = [trial.fault.removeprefix(f"{trial.reference}: ") for trial in trials if trial.fault]
    assert faults[0].startswith("ended its process by SIGSEGV")
    assert faults[1].startswith("ended its process with exit code 3")
    assert faults[2].startswith("SystemExit: 2")
    assert faults[3] == "did not return within 8 s"
    assert faults[4] in ("did not return within 2 s of CPU time", "did not return within 8 s")  # if others are busy


@pytest.mark.slow
@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc can look after its heap")
def test_a_type_that_writes_beyond_its_memory_is_named_although_nothing_else_shows_it() -> None:
    first, second = try_all(named(writes_beyond, half))
    assert first.fault.startswith(f"{first.reference}: ended its process by SIGABRT")
    assert second.usable


@pytest.mark.slow
def test_types_are_shared_by_processes_and_told_in_their_order() -> None:
    kinds = (half, divides, leaves, brightest, counting)
    one, two = (try_all(named(*kinds), processes=processes, confirm=False) for processes in (1, 2))
    assert [trial.reference for trial in two] == named(*kinds)
    assert two == one


@pytest.mark.parametrize(
    ("deaths", "fault"),
    [
        (["did not return within 3 s", ""], ""),
        (["did not return within 3 s", "did not return within 3 s"], "x: did not return within 3 s"),
        (["ended its process by SIGXCPU", "ended its process by SIGXCPU"], "x: did not return within 3 s of CPU time"),
        (["ended its process by SIGSEGV"], "x: ended its process by SIGSEGV"),
    ],
    ids=["slow only once", "slow twice", "busy twice", "crashed"],
)
def test_a_type_that_was_stopped_is_tried_once_more(
    deaths: list[str], fault: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The load of the machine may have been the reason; a crash has no such excuse."""

    def forked(run: Any, *limits: Any, **more: Any) -> str:
        run.__defaults__[0].write(b'{"reference": "x"}')
        return deaths.pop(0)

    monkeypatch.setattr(usable, "forked", forked)
    assert usable._tried("x", usable._How(3, 0, 3.0, confirm=True)).fault == fault
    assert not deaths


@pytest.mark.slow
def test_the_command_tells_what_is_not_usable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "lamps_to_try.py").write_text(
        "import hfg\n\n@hfg.node\ndef dim(light: int) -> int:\n    return 1 // light\n\n"
        "@hfg.node\ndef off(light: int) -> int:\n    return 0\n"
    )
    assert main(["lamps_to_try", "lamps_to_try:off"]) == 1
    fault, count = capsys.readouterr().out.splitlines()
    assert fault.startswith("lamps_to_try:dim: fire(dim(), light=0) raised ZeroDivisionError")
    assert count == "1 of 2 node types are usable"
    monkeypatch.setattr(usable, "try_all", lambda references, **settings: [Trial(one, 1) for one in references])
    assert main(["lamps_to_try:off", "--json"]) == 0
    assert '"reference": "lamps_to_try:off"' in capsys.readouterr().out
    assert main(["no_such_module"]) == 1
    assert 'there is no module "no_such_module"' in capsys.readouterr().out


def test_examples_in_docstrings_run() -> None:
    assert doctest.testmod(hfg.testing.trying).failed == 0
