"""What another user of the computer can do, in a process of his own. Run as root: `Stranger` becomes uid 65534."""

from __future__ import annotations

import json
import os
import socket
import sys
import traceback
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

NOBODY = 65534


def as_nobody(attack: Callable[[], Any]) -> Any:
    """Run something in a forked process as another user, and return what it returns, by way of JSON."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        code = 1
        try:
            os.setgroups([])
            os.setgid(NOBODY)
            os.setuid(NOBODY)
            answer = json.dumps(attack())
            code = 0
        except BaseException:
            answer = json.dumps(traceback.format_exc())
        with os.fdopen(writing, "w") as pipe:
            pipe.write(answer)
        os._exit(code)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        told = json.load(pipe)
    _, status = os.waitpid(child, 0)
    assert status == 0, told
    return told


def family(process: int) -> set[int]:
    """Return a process and all that it has begun."""
    found = {process}
    for task in Path(f"/proc/{process}/task").iterdir():
        for child in (task / "children").read_text().split():
            found |= family(int(child))
    return found


def sockets_of(processes: set[int]) -> set[str]:
    """Return the inodes of all sockets that processes have."""
    found = set()
    for process in processes:
        for handle in Path(f"/proc/{process}/fd").iterdir():
            try:
                where = str(handle.readlink())
            except OSError:  # it was closed meanwhile
                continue
            if where.startswith("socket:["):
                found.add(where[len("socket:[") : -1])
    return found


def network_addresses(processes: set[int]) -> list[str]:
    """Return each line of the system's tables about a network socket of these processes, also those not listening."""
    mine, found = sockets_of(processes), []
    for table in ("tcp", "tcp6", "udp", "udp6", "raw", "raw6", "packet"):
        file = Path("/proc/net") / table
        if file.exists():
            lines = file.read_text().splitlines()[1:]
            found += [f"{table}: {line}" for line in lines if mine & set(line.split())]
    return found


def unix_names(processes: set[int]) -> list[str]:
    """Return the names of all local sockets of these processes; those that begin with "@" have no file."""
    mine, found = sockets_of(processes), set()
    for line in Path("/proc/net/unix").read_text().splitlines()[1:]:
        fields = line.split(maxsplit=7)
        if fields[6] in mine and len(fields) > 7:
            found.add(fields[7])
    return sorted(found)


def connects(name: str) -> str:
    """Try to connect to a local socket; returns what comes of it."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as one:
        one.settimeout(1)
        try:
            one.connect("\0" + name[1:] if name.startswith("@") else name)
        except OSError as error:
            return type(error).__name__
        try:
            return f"connected, and heard {one.recv(100)!r}"
        except OSError as error:
            return f"connected, and {type(error).__name__}"


def everything_readable(folder: str) -> list[str]:
    """Return all below a folder that can be listed or opened."""
    found = []
    for place, folders, files in os.walk(folder):
        found += [str(Path(place) / name) for name in folders if os.access(Path(place) / name, os.R_OK | os.X_OK)]
        found += [str(Path(place) / name) for name in files if os.access(Path(place) / name, os.R_OK)]
    return found


def spoils(folder: str) -> list[str]:
    """Try to write, remove or exchange anything below a folder; returns what was possible."""
    done = []
    for place, folders, files in os.walk(folder):
        for name in folders + files:
            path = Path(place) / name
            for act in (
                partial(path.rename, f"{path}.stolen"),
                path.unlink,
                partial(os.truncate, path, 0),
                (path / "mine").touch,
                partial(path.chmod, 0o777),
            ):
                try:
                    act()
                except OSError:
                    continue
                done.append(f"{act} {path}")
    return done


if sys.platform != "linux":
    raise ImportError("the tables of sockets are Linux's")
