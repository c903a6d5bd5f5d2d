"""Examples and the robot are recorded on the real clock for a short while and played back: sources send the same."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import hfg
from hfg.cli.target import load_graph
from hfg.recording import File, Playing, play_into

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
OF_TIME = {"began", "call", "last", "sequence", "silent", "stamp", "time", "timestamp", "waited"}
DETERMINISTIC = ("hello", "word_count", "many_requests")
"""Examples with synchronous graphs whose nodes depend on their inputs only: everything that passes is the same (F7)."""

EXAMPLES = (
    *DETERMINISTIC,
    "async_requests",
    "cleaner",
    "controller",
    "fetch",
    "mission",
    "photographs",
    "video",
    "wait_for_start",
)
RECORDED_S = 0.7


@pytest.fixture(autouse=True)
def quiet() -> Iterator[None]:
    logging.disable(logging.CRITICAL)
    yield
    logging.disable(logging.NOTSET)


def passed(file: Path) -> dict[str, list[Any]]:
    """What passed each port, without what depends on when."""
    found: dict[str, list[Any]] = {}
    with File(file) as recording:
        for number, _, data in recording.messages():
            message = json.loads(data)
            topic = recording.channels[number].topic
            if topic != "hfg/events":
                what = {name: value for name, value in message.items() if name not in OF_TIME}
                found.setdefault(message.get("port", topic), []).append(what)
    return found


def record_and_play(build: Callable[[], hfg.Graph], folder: Path) -> tuple[Playing, dict[str, Any], dict[str, Any]]:
    """Record a while on the real clock, play that in virtual time, and record it again."""
    first, second = folder / "first.mcap", folder / "second.mcap"
    hfg.run(build(), until_s=RECORDED_S, block_warning_s=0, begin=lambda run: run.record(first))
    graph = build()
    playing = play_into(graph, first)
    hfg.run(graph, clock="virtual", until_s=RECORDED_S, begin=lambda run: run.record(second))
    return playing, passed(first), passed(second)


def differences(ports: Any, first: dict[str, Any], second: dict[str, Any]) -> list[str]:
    """Ports that something else has passed; what the end of a run finds under way has passed or not."""
    found = []
    for port in ports:
        ours, theirs = first.get(port, []), second.get(port, [])
        both = min(len(ours), len(theirs))
        if ours[:both] != theirs[:both] or both < len(ours) - 2:
            found.append(f"{port}: {len(ours)} tokens, {len(theirs)} when it was played")
    return found


@pytest.mark.rule("F3", "F7")
@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_recorded_on_the_real_clock_is_played_back(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    playing, first, second = record_and_play(lambda: load_graph(str(ROOT / f"examples/{name}.py"), []), tmp_path)
    assert playing.played
    assert not playing.warnings
    assert differences(first if name in DETERMINISTIC else playing.played, first, second) == []


@pytest.mark.rule("F3")
def test_the_robot_recorded_on_the_real_clock_is_played_back(tmp_path: Path) -> None:
    from examples.fetch_delivery.mission.robot import build

    playing, first, second = record_and_play(build, tmp_path)
    assert sum(port.startswith("world.") for port in playing.played) > 3
    assert not playing.warnings
    assert differences(playing.played, first, second) == []
