"""Parts of a graph as programs of their own, which a supervisor starts and restarts in any order (rules L2, L3, L5)."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

import hfg
from hfg.errors import RunError, TransportError, UsageError
from hfg.parts.hosts import requests
from hfg.parts.hosts.agent import Agent
from hfg.parts.hosts.health import address_of, answer, healthy
from hfg.parts.hosts.realm import Realm, RunIs, run_id, run_place
from hfg.parts.hosts.supervised import SupervisedPart
from hfg.transport import Session
from hfg_transports.memory import Network
from tests.limits import patience
from tests.parts.supervisor import ROBOT, Supervised, totals, written
from tests.parts.test_hosts import children_of, is_there

HOSTS = {"arm": "right", "eye": "left"}


class Begun:
    """Stands for a process; the test decides when it has ended."""

    process = 7

    def __init__(self) -> None:
        self.gone: asyncio.Future[str] = asyncio.get_running_loop().create_future()

    async def wait(self) -> str:
        return await asyncio.shield(self.gone)

    def begins(self) -> None: ...

    async def end(self) -> None:
        if not self.gone.done():
            self.gone.set_result("process 7 was ended by SIGTERM")


class Computer:
    """Begins nothing really; a main part is announced as a real one would announce itself."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.mains: list[Begun] = []
        self.parts: list[Begun] = []

    async def part(self, order: requests.Start) -> Any:
        self.parts.append(Begun())
        return self.parts[-1]

    async def main(self, order: requests.Deploy) -> Any:
        me = RunIs(run_id(order.run), "robot", order.target, self.session.host, 7)
        self.session.announce(run_place(order.run), msgspec.msgpack.encode(me))
        self.mains.append(Begun())
        return self.mains[-1]

    def missing(self, modules: list[str]) -> requests.Missing:
        return requests.Missing([], "")

    def read_log(self, run: str, offset: int) -> requests.Chunk:
        return requests.Chunk("", 0)

    def forget(self, run: str) -> None: ...

    async def close(self) -> None: ...


class Cell:
    """A network with parts of the graph "robot"."""

    def __init__(self) -> None:
        self.network = Network(lease_s=1.0)
        self.open: list[SupervisedPart] = []

    async def part(self, name: str, graph: str = "robot") -> tuple[SupervisedPart, Computer]:
        session = await self.network.open(host=name or "base")
        computer = Computer(session)
        one = SupervisedPart(session, computer, graph, name, HOSTS)
        await one.open()
        self.open.append(one)
        return one, computer

    async def close(self) -> None:
        for one in self.open:
            await one.close()


def in_a_cell(story: Any) -> None:
    async def main() -> None:
        cell = Cell()
        try:
            await story(cell)
        finally:
            await cell.close()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())


@pytest.mark.rule("L2")
@pytest.mark.parametrize("order", [["", "arm", "eye"], ["eye", "", "arm"], ["eye", "arm", ""]], ids=str)
def test_main_part_begins_when_all_others_are_there_whatever_the_order(order: list[str]) -> None:
    async def story(cell: Cell) -> None:
        there = {}
        running: asyncio.Future[None] | None = None
        for name in order:
            assert running is None or not there[""][1].mains
            there[name] = await cell.part(name)
            if not name:
                assert there[""][0].state()[1]["state"] in ("waiting", "starting")
                running = asyncio.ensure_future(there[""][0].run("robot.py", [], ""))
            await asyncio.sleep(1)
        main, computer = there[""]
        assert main.state() == (True, {"graph": "robot", "part": "main", "state": "running"})
        assert there["arm"][0].state() == (True, {"graph": "robot", "part": "arm", "state": "waiting for a run"})
        computer.mains[0].gone.set_result("process 7 has ended with code 0")
        assert running is not None
        await running

    in_a_cell(story)


def test_what_the_main_part_waits_for_is_in_its_state() -> None:
    async def story(cell: Cell) -> None:
        main, _ = await cell.part("")
        await cell.part("eye")
        await cell.part("arm", graph="another")
        await asyncio.sleep(1)
        assert main.state() == (False, {"graph": "robot", "part": "main", "state": "waiting", "for": ["arm"]})

    in_a_cell(story)


@pytest.mark.rule("X3")
def test_a_run_that_fails_ends_the_program_of_the_main_part_with_an_error() -> None:
    async def story(cell: Cell) -> None:
        for name in HOSTS:
            await cell.part(name)
        main, computer = await cell.part("")
        running = asyncio.ensure_future(main.run("robot.py", [], ""))
        await asyncio.sleep(1)
        computer.mains[0].gone.set_result("process 7 was ended by SIGKILL")
        with pytest.raises(RunError, match='graph "robot" is over: process 7 was ended by SIGKILL on host "base"'):
            await running

    in_a_cell(story)


@pytest.mark.rule("L5")
def test_a_part_serves_no_other_part_and_no_second_program_serves_it() -> None:
    async def story(cell: Cell) -> None:
        await cell.part("arm")
        with pytest.raises(TransportError, match="serves this part already"):
            await cell.part("arm")
        session = await cell.network.open(host="base")
        realm = Realm(session)
        agent = await realm.agent("right", part=("robot", "arm"))
        with pytest.raises(TransportError, match='host "right" has no agent that can be reached'):
            await realm.agent("right", 1.0, ("robot", "leg"))
        with pytest.raises(TransportError, match='only group "arm", not group "leg"'):
            await requests.ask(
                session, f"agents/right/{agent.incarnation}", requests.Start("hfg/1", "leg", (1, 1), [], 0)
            )
        realm.close()

    in_a_cell(story)


def test_a_host_with_an_agent_and_a_program_for_a_part_is_refused() -> None:
    async def story(cell: Cell) -> None:
        await cell.part("arm")
        session = await cell.network.open(host="right")
        agent = Agent(session, Computer(session))
        await agent.open()
        realm = Realm(session)
        with pytest.raises(TransportError, match='2 agents are named "right"'):
            await realm.agent("right", part=("robot", "arm"))
        assert await realm.agent("right", part=("robot", "leg")) == agent.me
        realm.close()
        await agent.close()

    in_a_cell(story)


# --- health ---


@pytest.mark.rule("L5")
@pytest.mark.parametrize(
    ("head", "is_ready", "status"),
    [
        (b"GET /live HTTP/1.1\r\n\r\n", False, 200),
        (b"GET /ready HTTP/1.1\r\n\r\n", True, 200),
        (b"GET /ready HTTP/1.1\r\n\r\n", False, 503),
        (b"HEAD /ready HTTP/1.1\r\n\r\n", True, 200),
        (b"POST /live HTTP/1.1\r\n\r\n", True, 405),
        (b"GET /metrics HTTP/1.1\r\n\r\n", True, 404),
        (b"GET /live HTTP/1.1\r\nOrigin: http://evil.example\r\n\r\n", True, 403),
        (b"\xff\xfe\r\n\r\n", True, 405),
        (b"\r\n\r\n", True, 405),
    ],
)
def test_health_answers(head: bytes, is_ready: bool, status: int) -> None:
    said = answer(head, lambda: (is_ready, {"state": "running"}))
    assert said.startswith(f"HTTP/1.1 {status} ".encode())
    body = said.partition(b"\r\n\r\n")[2]
    assert f"Content-Length: {len(body)}".encode() in said or head.startswith(b"HEAD")
    assert not body or json.loads(body)


@pytest.mark.parametrize("text", ["", "8080", ":8080", "localhost:", "localhost:99999", "localhost:-1", "a:b", "a:٣"])
def test_what_is_no_address_for_the_health_check(text: str) -> None:
    with pytest.raises(UsageError, match="write host:port, as in 127.0.0.1:8080"):
        address_of(text)


@pytest.mark.rule("L5")
def test_health_check_cuts_off_long_heads_and_says_so_if_its_port_is_taken() -> None:
    async def main() -> None:
        async with healthy("127.0.0.1:0", lambda: (True, {})) as port:
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(b"GET /live HTTP/1.1\r\n" + b"x" * 10_000)
            with pytest.raises((asyncio.IncompleteReadError, ConnectionError)):
                await reader.readexactly(1)
            writer.close()
            with pytest.raises(UsageError, match="cannot listen at"):
                async with healthy(f"127.0.0.1:{port}", lambda: (True, {})):
                    pass

    asyncio.run(main())


# --- real programs ---


class Supervisor:
    """The programs of the graph in a folder."""

    def __init__(self, folder: Path) -> None:
        from tests.transports.zenoh.conftest import free_port

        self.folder = folder
        self.health = free_port()
        (folder / "robot.py").write_text(ROBOT)
        main, arm = free_port(), free_port()
        for name, own, other in (("main", main, arm), ("arm", arm, main)):
            (folder / f"{name}.toml").write_text(
                f'realm = "{folder.name}"\ninsecure = true\nlease_s = 1.0\nhost = "{name}"\n'
                f'listen = ["tcp/127.0.0.1:{own}"]\nagents = ["tcp/127.0.0.1:{other}"]\n'
            )
        self.units = {name: self.unit(name) for name in ("main", "arm")}

    def unit(self, name: str) -> Supervised:
        command = [sys.executable, "-m", "hfg", "part", "robot.py", name, "--settings", f"{name}.toml"]
        command += ["--arg", f"into={self.folder}/written", "--arg", "count=60"]
        if name == "main":
            command += ["--health", f"127.0.0.1:{self.health}"]
        return Supervised(command, self.folder, self.folder / f"{name}.log", ends=name == "main")

    def until(self, condition: Any) -> None:
        end = time.monotonic() + patience(60)
        while not condition():
            for unit in self.units.values():
                unit.look()
            assert time.monotonic() < end, "".join(log.read_text() for log in sorted(self.folder.glob("*.log")))
            time.sleep(0.05)

    def told(self, path: str) -> tuple[int, Any]:
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{self.health}/{path}") as response:
                return response.status, json.load(response)
        except urllib.error.HTTPError as error:
            with error:
                return error.code, json.load(error)
        except OSError:
            return 0, {}


@pytest.fixture
def supervisor(tmp_path: Path) -> Iterator[Supervisor]:
    pytest.importorskip("zenoh", reason="hosts speak over Zenoh")
    if not Path("/proc").exists():
        pytest.skip("looks at processes as Linux has them")
    one = Supervisor(tmp_path)
    try:
        yield one
    finally:
        for unit in one.units.values():
            if unit.process is not None:
                os.killpg(unit.process.pid, signal.SIGKILL)
                unit.process.wait()


@pytest.mark.slow
@pytest.mark.rule("L2", "L3", "X3")
@pytest.mark.timeout(300)
def test_two_parts_in_two_orders_lose_nothing_though_one_is_killed(supervisor: Supervisor) -> None:
    file, units = supervisor.folder / "written", supervisor.units
    arm = units.pop("arm")
    supervisor.until(lambda: supervisor.told("ready") == (503, WAITS))  # the main part first
    assert supervisor.told("live")[0] == 200
    units["arm"] = arm
    supervisor.until(lambda: len(written(file)) > 5)
    assert supervisor.told("ready")[0] == 200
    arm.kill()
    supervisor.until(lambda: units["main"].done)
    assert list(written(file).values()) == totals(60)
    assert arm.starts == 2

    file.unlink()
    units["main"] = supervisor.unit("main")  # the other part first: it is there already, and serves the next run
    supervisor.until(lambda: units["main"].done)
    assert list(written(file).values()) == totals(60)
    assert arm.process is not None
    process = arm.process.pid
    begun = children_of([process])
    assert arm.end() == 0  # SIGTERM
    assert not any(map(is_there, begun))


WAITS = {"graph": "robot", "part": "main", "state": "waiting", "for": ["arm"]}
