"""Another user of the same computer can do nothing to a run, an agent or a publisher, nor slow them down (rule L5).

Real programs, attacked by a process of uid 65534; only root can begin one.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from hfg.errors import TransportError
from hfg.links.local import LocalTransport

pytest.importorskip("tests.attacks.another_user", exc_type=ImportError)
from tests.attacks.another_user import (
    NOBODY,
    as_nobody,
    connects,
    everything_readable,
    family,
    network_addresses,
    spoils,
    unix_names,
)
from tests.limits import patience

pytestmark = [
    pytest.mark.rule("L5"),
    pytest.mark.skipif(
        not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can begin a process of another user"
    ),
]

PORTS = (7446, 7447)
PROGRAMS = {
    "run": """
        import time, sys
        from collections.abc import Iterator
        import numpy as np, hfg
        from numpy.typing import NDArray

        @hfg.node
        def pictures(*, count: int = 10**6) -> Iterator[NDArray[np.uint8]]:
            for number in range(count):
                if number == 20:
                    print("ready", flush=True)
                time.sleep(0.005)
                yield np.full((512, 512), number % 256, np.uint8)

        @hfg.node
        def largest(picture: NDArray[np.uint8]) -> int:
            return int(picture.max())

        @hfg.node
        def twice(value: int) -> int:
            return 2 * value

        if __name__ == "__main__":
            graph = hfg.Graph("victim")
            graph.group("one", process=True, ledger=True)
            graph.group("other", process=True)
            source = graph.add(pictures())
            sees, doubles = graph.add(largest(), group="other"), graph.add(twice(), group="one")
            graph.connect(source.out, sees.picture)
            graph.connect(sees.out, doubles.value)
            print(hfg.run(graph).outcome)
    """,
    "publisher": """
        import time
        from collections.abc import Iterator
        import hfg

        @hfg.node
        def numbers(*, count: int = 10**6) -> Iterator[int]:
            for number in range(count):
                if number == 20:
                    print("ready", flush=True)
                time.sleep(0.005)
                yield number

        if __name__ == "__main__":
            graph = hfg.Graph("publisher")
            hfg.publish("camera/front", graph.add(numbers()).out)
            hfg.run(graph)
    """,
}


class Victims:
    """A run with two processes, an agent and a publisher of root's, in places through which everybody may pass."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.temporary, self.state = folder / "tmp", folder / "state"
        for place, mode in ((folder, 0o755), (self.temporary, 0o1777), (self.state, 0o755)):
            place.mkdir(exist_ok=True)
            place.chmod(mode)
        self.environment = {
            **{name: value for name, value in os.environ.items() if name != "XDG_RUNTIME_DIR"},
            "TMPDIR": str(self.temporary),
            "XDG_STATE_HOME": str(self.state),
            "PYTHONUNBUFFERED": "1",
        }
        self.programs: dict[str, subprocess.Popen[str]] = {}

    def begin(self, name: str, *command: str) -> None:
        """Begin one in a session of its own."""
        self.programs[name] = subprocess.Popen(
            [sys.executable, *command],
            cwd=self.folder,
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            umask=0,  # what others must not read or change has its permissions by itself
        )

    def wait_ready(self) -> None:
        """Wait until all are at work."""
        for name, program in self.programs.items():
            assert program.stdout is not None
            for line in program.stdout:
                if "ready" in line:
                    break
            else:
                raise AssertionError(f"{name} has ended with {program.wait()}")

    @property
    def sockets(self) -> list[str]:
        """The files of all their local sockets."""
        return [str(file) for file in self.folder.rglob("*") if file.is_socket()]

    @property
    def processes(self) -> set[int]:
        """All processes of all of them."""
        return set().union(*(family(one.pid) for one in self.programs.values()))

    def end(self) -> None:
        """End them."""
        for program in self.programs.values():
            program.terminate()
        for program in self.programs.values():
            with contextlib.suppress(subprocess.TimeoutExpired):
                program.communicate(timeout=patience(60))
            program.kill()


@pytest.fixture(scope="module")
def listening() -> Iterator[list[socket.socket]]:
    """The other user listens where programs of hfg once went by themselves."""
    with contextlib.ExitStack() as stack:
        taken = []
        for port in PORTS:
            with contextlib.suppress(OSError):  # another program has it
                one = stack.enter_context(socket.create_server(("127.0.0.1", port)))
                one.settimeout(0)
                taken.append(one)
        yield taken


@pytest.fixture(scope="module")
def victims(listening: list[socket.socket]) -> Iterator[Victims]:
    folder = Path(tempfile.mkdtemp(prefix="hfg-attack-", dir="/tmp"))
    one = Victims(folder)
    try:
        for name, text in PROGRAMS.items():
            file = folder / f"{name}.py"
            file.write_text(textwrap.dedent(text))
            one.begin(name, str(file))
        one.begin("agent", "-m", "hfg", "agent")
        one.wait_ready()
        yield one
    finally:
        one.end()
        shutil.rmtree(folder, ignore_errors=True)


def test_none_of_them_has_a_network_socket(victims: Victims) -> None:
    assert network_addresses(victims.processes) == []


def test_nobody_has_connected_to_where_programs_of_hfg_once_went_by_themselves(
    victims: Victims, listening: list[socket.socket]
) -> None:
    for one in listening:
        with pytest.raises(BlockingIOError):
            one.accept()


def test_no_local_socket_can_be_connected_to_and_none_is_without_a_file(victims: Victims) -> None:
    files, names = victims.sockets, unix_names(victims.processes)
    assert len(files) >= 5  # of three parts, an agent and a publisher
    assert len(names) >= 5
    assert as_nobody(lambda: {name: connects(name) for name in files}) == dict.fromkeys(files, "PermissionError")
    assert not [one for one in as_nobody(lambda: [connects(name) for name in names]) if not one.endswith("Error")]
    assert not [name for name in names if name.startswith("@")]


def test_a_flood_of_connections_is_refused_by_the_system_and_costs_nobody_anything(victims: Victims) -> None:
    names = victims.sockets
    tried = as_nobody(lambda: sorted({connects(name) for _ in range(500) for name in names}))
    assert tried == ["PermissionError"]  # so that not one has reached a process, which would count it


def test_nothing_can_be_read_written_or_exchanged_where_they_meet(victims: Victims) -> None:
    places = [str(victims.temporary), str(victims.state)]
    secrets = [file for place in places for file in Path(place).rglob("secret")]
    assert len(secrets) >= 2  # of the run and of the user
    assert as_nobody(lambda: [spoils(place) for place in places]) == [[], []]
    readable = as_nobody(lambda: [everything_readable(place) for place in places])
    assert not [path for paths in readable for path in paths if "meet" in path and not path.endswith("/hfg")]


def test_shared_memory_can_be_opened_by_its_user_alone(victims: Victims) -> None:
    segments = [str(file) for file in Path("/dev/shm").glob("hfg-run-*")]
    assert segments, "the run has pictures in shared memory"
    assert not as_nobody(lambda: [name for name in segments if os.access(name, os.R_OK) or os.access(name, os.W_OK)])


def test_no_secret_is_told_by_a_command_line_or_an_environment(victims: Victims) -> None:
    secrets = [file.read_bytes() for file in victims.folder.rglob("secret")]
    told = [
        Path(f"/proc/{process}/{what}").read_bytes() for process in victims.processes for what in ("cmdline", "environ")
    ]
    for secret in secrets:
        assert not [one for one in told if secret in one or secret.hex().encode() in one]
    some = min(victims.processes)

    def reads() -> list[str]:
        kept = []
        for what in ("environ", "mem", "maps"):
            with contextlib.suppress(OSError):
                Path(f"/proc/{some}/{what}").read_bytes()
                kept.append(what)
        return kept

    assert as_nobody(reads) == []


def test_none_of_them_has_failed_meanwhile(victims: Victims) -> None:
    assert {name: program.poll() for name, program in victims.programs.items()} == dict.fromkeys(victims.programs)


# --- places that the other user has made first


@pytest.mark.slow
@pytest.mark.parametrize("how", ["folder", "link", "link to a folder of mine", "open folder"])
def test_a_place_that_another_user_has_made_first_is_refused_in_a_sentence(how: str) -> None:
    folder = Path(tempfile.mkdtemp(prefix="hfg-attack-", dir="/tmp"))
    try:
        folder.chmod(0o1777)
        mine = folder / "mine"
        mine.mkdir(mode=0o700)
        squatted = folder / "state"

        def squat() -> None:
            if how == "folder":
                squatted.mkdir(mode=0o700)
            elif how == "open folder":
                squatted.mkdir(mode=0o777)
                squatted.chmod(0o777)
            else:
                (folder / "his").mkdir(mode=0o777)
                squatted.symlink_to(mine if "mine" in how else folder / "his")

        as_nobody(squat)
        begun = subprocess.run(
            [sys.executable, "-m", "hfg", "agent"],
            env=os.environ | {"XDG_STATE_HOME": str(squatted), "TMPDIR": str(folder)},
            capture_output=True,
            text=True,
            timeout=patience(120),
            check=False,
        )
        assert begun.returncode == 1
        assert "in which programs of this user meet" in begun.stderr
        assert "Traceback" not in begun.stderr
        assert not list(mine.iterdir())
        assert not list(folder.rglob("secret"))
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@pytest.mark.slow
def test_a_run_of_another_user_is_another_world(victims: Victims) -> None:
    """He may use hfg himself; the two do not meet."""
    place = Path(tempfile.mkdtemp(prefix="hfg-attack-", dir="/tmp"))
    try:
        os.chown(place, NOBODY, NOBODY)

        async def opened(folder: Path | None) -> list[str]:
            try:
                session = await LocalTransport().open(folder=folder)
            except TransportError as error:
                return [str(error)]
            there: list[str] = []
            session.watch("agents", lambda seen: there.extend(one.name for one in seen))
            await session.close()
            return there

        def looks(folder: Path | None) -> list[str]:
            os.environ.update(XDG_STATE_HOME=str(place), TMPDIR=str(victims.temporary))
            return asyncio.run(opened(folder))

        assert as_nobody(lambda: looks(None)) == []
        for folder in {Path(file).parent for file in victims.sockets}:
            (sentence,) = as_nobody(partial(looks, folder))
            assert "in which programs of this user meet" in sentence
    finally:
        shutil.rmtree(place, ignore_errors=True)
