"""What a newcomer gets wrong: each is one sentence that says what to write, and nothing hangs."""

from __future__ import annotations

import asyncio
import types
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from reactivex import operators as ops

import hfg


@hfg.node
def numbers(*, count: int = 3) -> Iterator[int]:
    yield from range(count)


class Ring(hfg.Node):
    value = hfg.Input(int)
    rung = hfg.Event(int)
    loud = hfg.Parameter(1.0)

    def process(self, value: int) -> None:
        self.rung.trigger("loud" if self.loud > 1 else value)  # type: ignore[arg-type]

    @hfg.slot
    def hear(self, value: int) -> None: ...


def ringing(**parameters: Any) -> hfg.Graph:
    graph = hfg.Graph("ringing")
    ring = graph.add(Ring(**parameters))
    graph.connect(graph.add(numbers()).out, ring.value)
    return graph


def drive(main: Callable[[], Any]) -> Any:
    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        return runner.run(main())


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"clock": "virtul"}, 'clock must be "real" or "virtual", got \'virtul\''),
        ({"until_s": -1}, "until_s must be seconds"),
        ({"until_s": "3"}, "until_s must be seconds"),
        ({"trace": 3}, "trace must be a function"),
        ({"seed": "x"}, "seed must be a whole number"),
        ({"block_warning_s": None}, "block_warning_s must be seconds"),
        ({"policy": "x"}, 'unknown policy "x"'),
    ],
)
def test_wrong_option_of_a_run_is_refused_before_anything_starts(options: dict[str, Any], sentence: str) -> None:
    graph = ringing()
    with pytest.raises(hfg.errors.UsageError) as error:
        hfg.run(graph, **{"clock": "virtual", **options})
    assert str(error.value).startswith(sentence)
    assert hfg.run(graph, clock="virtual").outcome == "done"


def test_an_option_that_no_run_has_is_refused_like_any_other_argument() -> None:
    with pytest.raises(TypeError, match=r'a run has no option "debgu"; did you mean "debug"\?'):
        hfg.run(ringing(), debgu=True)  # type: ignore[call-arg]


@pytest.mark.parametrize("option", [{"through": ops.debounce(1)}, {"initial": 3}])
def test_one_alone_where_a_list_is_needed_is_refused(option: dict[str, Any]) -> None:
    graph = ringing()
    with pytest.raises(hfg.errors.ConnectionError, match=rf"{next(iter(option))} takes a list, as in"):
        graph.connect(graph["ring.rung"], graph["ring.hear"], **option)


def test_debug_refuses_a_signal_that_is_not_of_its_events_type() -> None:
    assert hfg.run(ringing(loud=2.0), clock="virtual").outcome == "done"
    with pytest.raises(hfg.errors.NodeError, match=r'event "ring\.rung" is declared int, got str'):
        hfg.run(ringing(loud=2.0), clock="virtual", debug=True)
    assert hfg.run(ringing(), clock="virtual", debug=True).outcome == "done"


def test_what_is_brought_in_from_outside_is_checked() -> None:
    graph = ringing()
    ring, stranger = graph["ring"], Ring()

    async def main() -> None:
        async with hfg.running(graph) as run:
            for call, error, sentence in (
                (lambda: run.trigger(ring.hear, "x"), TypeError, r'slot "ring\.hear" expects int, got \'x\''),
                (lambda: run.trigger(ring.hear), TypeError, r'slot "ring\.hear" expects int, got None'),
                (lambda: run.trigger(ring.rung, "x"), TypeError, r'event "ring\.rung" expects int'),
                (lambda: run.trigger(ring.hear, 1, activity=2), hfg.errors.UsageError, "activity must be -1, 0"),
                (lambda: run.trigger(ring.value, 1), hfg.errors.UsageError, "run.trigger is for slots and events"),
                (lambda: run.trigger(stranger.hear, 1), hfg.errors.UsageError, "is no node of this run"),
                (lambda: run.wait_for(ring.value), hfg.errors.UsageError, "run.wait_for waits for an event"),
            ):
                with pytest.raises(error, match=sentence):
                    await call()
            with pytest.raises(hfg.errors.UsageError, match=r'node\.ports\.parameters\["name"\], got 1\.0'):
                run.set(ring.loud, 2.0)

    drive(main)


def test_start_and_stop_of_the_graph_may_be_triggered() -> None:
    graph = ringing()

    async def main() -> hfg.Report:
        async with hfg.running(graph) as run:
            await run.trigger(graph.start)
            await run.trigger(graph.stop)
            return await run.wait_finished()

    assert drive(main).outcome == "stopped"


@pytest.mark.parametrize("is_async", [False, True])
@pytest.mark.parametrize("on_error", ["skip", "disable", "restart"])
def test_ready_that_raises_is_not_asked_without_end(on_error: Any, is_async: bool) -> None:
    asked: list[int] = []

    class Unsure(hfg.Node):
        def process(self, value: int) -> None: ...

    def ready(self: Any) -> bool:
        asked.append(1)
        raise ValueError("unsure")

    async def ready_later(self: Any) -> bool:
        return ready(self)

    unsure = types.new_class(
        "Unsure", (Unsure,), exec_body=lambda body: body.update(ready=ready_later if is_async else ready)
    )
    graph = hfg.Graph()
    node = graph.add(unsure(), on_error=on_error, restart_limit=2)
    graph.connect(graph.add(numbers()).out, node.value)
    if on_error == "disable":
        assert hfg.run(graph, clock="virtual").outcome == "done"
    else:
        with pytest.raises(hfg.errors.Stalled if on_error == "skip" else hfg.errors.NodeError):
            hfg.run(graph, clock="virtual")
    assert len(asked) <= 3


@pytest.mark.parametrize("error", [asyncio.CancelledError, GeneratorExit, KeyboardInterrupt, SystemExit])
@pytest.mark.parametrize("where", ["loop", "thread"])
def test_code_that_raises_what_is_no_exception_does_not_hang(error: type[BaseException], where: str) -> None:
    torn_down: list[str] = []

    class Odd(hfg.Node):
        def process(self, value: int) -> None:
            raise error("odd")

        def teardown(self) -> None:
            torn_down.append("odd")

    graph = hfg.Graph()
    graph.group("thread", threads=1)
    node = graph.add(Odd(), group=where)
    graph.connect(graph.add(numbers()).out, node.ports.inputs["value"])
    leaves = where == "loop" and error is KeyboardInterrupt
    with pytest.raises(error if leaves else hfg.errors.NodeError, match="odd"):
        hfg.run(graph, clock="virtual")
    assert torn_down == ["odd"]
