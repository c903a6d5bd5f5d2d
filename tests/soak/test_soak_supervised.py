"""The parts of a graph in three network namespaces under a supervisor, started in every order, each killed 20 times.

By `make soak`, as root, on Linux with iproute2. The values are the same as with agents that live.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import random
import secrets
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from examples.two_hosts.two_hosts import missing
from tests.limits import patience
from tests.parts.supervisor import ROBOT, Supervised, totals, written

pytest.importorskip("zenoh", reason="hosts speak over Zenoh")

KILLS = 20
SPACES = {"main": "10.78.0.1", "eye": "10.78.0.2", "arm": "10.78.0.3"}
HOSTS = {"main": "base", "eye": "left", "arm": "right"}
ORDERS = list(itertools.permutations(SPACES))


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True)


@pytest.fixture(scope="module")
def spaces() -> Iterator[dict[str, str]]:
    """Three namespaces at one switch; gives their names by part."""
    problem = missing()
    if problem:
        pytest.skip(problem)
    mark = secrets.token_hex(2)
    switch = f"hfg-switch-{mark}"
    made = {part: f"hfg-{part}-{mark}" for part in SPACES}
    try:
        ip("netns", "add", switch)
        ip("-n", switch, "link", "add", "switch", "type", "bridge")
        ip("-n", switch, "link", "set", "switch", "up")
        for number, (part, space) in enumerate(made.items()):
            ip("netns", "add", space)
            ip("link", "add", "cable", "netns", space, "type", "veth", "peer", "name", f"port{number}", "netns", switch)
            ip("-n", switch, "link", "set", f"port{number}", "master", "switch", "up")
            ip("-n", space, "address", "add", f"{SPACES[part]}/24", "dev", "cable")
            ip("-n", space, "link", "set", "lo", "up")
            ip("-n", space, "link", "set", "cable", "up")
        yield made
    finally:
        for space in [*made.values(), switch]:
            subprocess.run(["ip", "netns", "delete", space], capture_output=True, check=False)


class Field:
    """A folder with the graph, its settings and a key, and what is run there."""

    def __init__(self, folder: Path, spaces: dict[str, str]) -> None:
        self.folder = folder
        self.spaces = spaces
        self.units: dict[str, Supervised] = {}
        (folder / "robot.py").write_text(ROBOT)
        subprocess.run([sys.executable, "-m", "hfg", "keys", "secret", "cell.key"], cwd=folder, check=True)

    def settle(self, host_of: Callable[[str], str]) -> None:
        """Write the settings of each part, as `hfg deploy --write` does; agents are named like their hosts."""
        for part in SPACES:
            others = ", ".join(f'"tls/{address}:7447"' for one, address in SPACES.items() if one != part)
            (self.folder / f"{part}.toml").write_text(
                f'realm = "{self.folder.name}"\nhost = "{host_of(part)}"\nkey = "cell.key"\n'
                f'listen = ["tls/{SPACES[part]}:7447"]\nagents = [{others}]\n'
            )

    def begin(self, part: str, command: list[str], *, ends: bool = False) -> Supervised:
        inside = ["ip", "netns", "exec", self.spaces[part], sys.executable, "-m", "hfg", *command]
        unit = self.units[part] = Supervised(inside, self.folder, self.folder / f"{part}.log", ends=ends)
        unit.look()
        return unit

    def until(self, condition: Callable[[], object], within_s: float = 120.0) -> None:
        end = time.monotonic() + patience(within_s)
        while not condition():
            for unit in self.units.values():
                unit.look()
            assert time.monotonic() < end, "\n".join(log.read_text()[-3000:] for log in self.folder.glob("*.log"))
            time.sleep(0.05)

    def come(self, file: Path, more: int) -> None:
        """Wait until more values have been written."""
        seen = len(written(file))
        self.until(lambda: len(written(file)) > seen + more)

    def close(self) -> None:
        for unit in self.units.values():
            if unit.process is not None:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(unit.process.pid, signal.SIGKILL)
                unit.process.wait()


@pytest.fixture
def field(tmp_path: Path, spaces: dict[str, str]) -> Iterator[Field]:
    one = Field(tmp_path, spaces)
    try:
        yield one
    finally:
        one.close()


def with_agents(field: Field, count: int) -> list[int]:
    """Return the values with agents that live."""
    file = field.folder / "with agents"
    field.settle(HOSTS.__getitem__)
    others = ", ".join(f'"tls/{SPACES[part]}:7447"' for part in ("eye", "arm"))
    (field.folder / "main.toml").write_text(  # a host that only starts graphs has no agent
        f'realm = "{field.folder.name}"\nhost = "{HOSTS["main"]}"\nkey = "cell.key"\nconnect = [{others}]\n'
    )
    for part in ("eye", "arm"):
        field.begin(part, ["agent", "--settings", f"{part}.toml"])
    time.sleep(3)
    arguments = ["--arg", f"into={file}", "--arg", f"count={count}", "--arg", "apart=true"]
    main = field.begin("main", ["run", "robot.py", "--settings", "main.toml", *arguments], ends=True)
    field.until(lambda: main.done)
    for unit in field.units.values():
        unit.end()
    return list(written(file).values())


@pytest.mark.soak
@pytest.mark.rule("L2", "L3", "X3")
@pytest.mark.timeout(7200)
def test_parts_started_in_every_order_and_killed_again_and_again_give_what_agents_give(field: Field) -> None:
    field.settle(lambda part: part)
    file, enough = field.folder / "written", field.folder / "enough"
    kept = field.folder / "kept"
    kept.mkdir(mode=0o700)
    arguments = ["--settings", "", "--arg", f"into={file}", "--arg", f"enough={enough}", "--arg", "apart=true"]
    arguments += ["--arg", f"kept={kept}"]
    chance = random.Random(31)
    kills = dict.fromkeys(SPACES, 0)
    rounds: dict[tuple[str, ...], int] = {}
    while min(kills.values()) < KILLS:
        order = ORDERS[len(rounds)] if len(rounds) < len(ORDERS) else chance.choice(ORDERS)
        for part in order:  # all begin in this order; those that are there already are ended before
            if part in field.units:
                field.units[part].end()
        for part in order:
            arguments[1] = f"{part}.toml"
            field.begin(part, ["part", "robot.py", part, *arguments], ends=part == "main")
            time.sleep(chance.uniform(0, 1.5))
        rounds[order] = rounds.get(order, 0) + 1
        for part in [*chance.sample(sorted(SPACES), 3), min(kills, key=kills.__getitem__)]:
            field.come(file, 2)
            field.units[part].kill()
            kills[part] += 1
    field.come(file, 5)
    enough.touch()
    field.until(lambda: field.units["main"].done)
    found = written(file)
    codes = [field.units[part].end() for part in ("eye", "arm")]
    lines = len(file.read_text().splitlines())
    print(f"kills {kills}, orders {len(rounds)}, values {len(found)}, lines written twice {lines - len(found)}")
    assert list(found.values()) == totals(len(found))
    assert codes == [0, 0]
    few = min(len(found), 200)
    assert with_agents(field, few) == list(found.values())[:few]
