"""`hfg keys new DIR` and `hfg keys add DIR NAME`: certificates to try links between hosts. Depends on certificates."""

from __future__ import annotations

import os
import secrets
import socket
from pathlib import Path
from typing import Annotated

import typer

from hfg.cli import show
from hfg.cli.certificates import AUTHORITY, Kind, make_authority, make_certificate, need_safe
from hfg.errors import TargetError

verbs = typer.Typer()

_NEXT = """{folder} holds authority, agent, worker and viewer, each with a .pem and a .key. Settings of an agent say:

listen = ["tls/{host}:7447"]

[tls]
authority = "{authority}.pem"
certificate = "{folder}/agent.pem"
key = "{folder}/agent.key"

[access]
write = ["agent", "worker"]
read = ["viewer"]

Whoever can read {authority}.key can be anybody: it is for tests, and belongs on one computer.
"""


@verbs.callback()
def keys() -> None:
    """Create certificates for agents, workers and viewers, signed by an authority for tests."""


@verbs.command("secret")
def _secret(file: Annotated[Path, typer.Argument(help="the file to create; it must not exist")]) -> int:
    """Create a secret shared by all programs of a realm, instead of certificates: key = "..." in settings."""
    need_safe(file)
    try:
        with os.fdopen(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="ascii") as stream:
            stream.write(secrets.token_hex(32) + "\n")
    except OSError as error:
        raise TargetError(f"{file} cannot be written: {error.strerror}") from None
    show.write(f'{file} is there: copy it to all hosts, and write key = "{file.name}" in their settings\n')
    return 0


Folder = Annotated[Path, typer.Argument(help="folder of the authority and the certificates")]
Hosts = Annotated[
    list[str] | None,
    typer.Option("--host", help="a name or address of the agent; can be repeated"),
]
Days = Annotated[int, typer.Option(help="days for which they are valid", min=1, max=3650)]


@verbs.command("new")
def _new(folder: Folder, host: Hosts = None, days: Days = 365) -> int:
    """Create an authority, and a certificate each for an agent, a worker and a viewer."""
    make_authority(folder, days=days)
    for name in ("agent", "worker", "viewer"):
        make_certificate(folder, name, name, hosts=_hosts(host), days=days)
    show.write(_NEXT.format(folder=folder.as_posix(), authority=(folder / AUTHORITY).as_posix(), host=_hosts(host)[0]))
    return 0


@verbs.command("add")
def _add(
    folder: Folder,
    name: Annotated[str, typer.Argument(help="its name in [access]")],
    kind: Annotated[Kind, typer.Option(help="its purpose")] = "agent",
    host: Hosts = None,
    days: Days = 365,
) -> int:
    """Create another certificate with the existing authority, for example for another host's agent."""
    make_certificate(folder, name, kind, hosts=_hosts(host), days=days)
    show.write(f"{folder / name}.pem and {folder / name}.key are there\n")
    return 0


def _hosts(said: list[str] | None) -> list[str]:
    """By default this computer, by all its names."""
    return said or list(dict.fromkeys(("localhost", socket.gethostname(), "127.0.0.1", "::1")))
