"""The settings file: which realm, which addresses, which certificates, and who may do what.

A TOML file of which every key may be left out. What is wrong is found all at once, each with its line:

    realm = "cell-4"                         # programs of other realms are not heard
    host = "arm"                             # what this computer is called; its own name if left out
    listen = ["tls/arm.local:7447"]          # where the agent of this host is reached
    agents = ["tls/base.local:7447"]         # the agents of other hosts
    connect = ["tls/arm.local:7447"]         # where workers and viewers go; where this host's agent listens if left out

    [tls]
    authority = "keys/authority.pem"         # paths are seen from the folder of the settings
    certificate = "keys/arm.pem" key = "keys/arm.key"

    [access]
    write = ["arm", "base"]                  # names in certificates: may do everything
    read = ["viewer"]                        # may look: values, who is there, and questions "…/ro/<verb>"

Instead of [tls], key = "cell.key" names a file with a secret that all programs have. Without an address nothing listens
and nothing leaves this computer. Depends on errors and problems; does not depend on Zenoh.
"""

from __future__ import annotations

import difflib
import os
import re
import socket
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias

import msgspec

from hfg.base.private import is_open_to_others
from hfg.errors import FileError, Problem

Mode: TypeAlias = Literal["router", "peer", "client"]
"""How a session takes part: as the agent that others meet at; with connections to everybody; through an agent alone."""

_ADDRESS: Final = re.compile(r"(?P<protocol>[a-z-]+)/(?P<place>[^?#]+)(?P<rest>[?#].*)?")
_PLACE: Final = re.compile(r"(?P<host>\[[^\]]+\]|[^:\[\]]+):(?P<port>[0-9]{1,5})")
_PROTOCOLS: Final = ("tcp", "tls", "unixsock-stream")
"""Not udp, which loses fragments of whatever is longer than a packet and then waits for them for ever."""
_LAST_PORT: Final = 65535
_TINY, _HUGE = 64 * 1024, 2**30


class Tls(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Certificates.

    Attributes:
      authority: the certificate of the authority that has signed all others; a file.
      certificate: of this program; a file.
      key: to it; a file.
      mutual: whether those who connect have to show a certificate too.
    """

    authority: str
    certificate: str
    key: str
    mutual: bool = True


class Access(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Permissions, by the common name of the certificate; the agents refuse all other programs.

    Attributes:
      write: may do everything.
      read: may subscribe, see who is there, and ask for names that end in "ro/<verb>".
    """

    write: tuple[str, ...] = ()
    read: tuple[str, ...] = ()


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The network settings of all programs of a system; see the module.

    Attributes:
      realm: who hears whom.
      host: what this computer is called.
      listen: where its agent is reached.
      agents: where those of other hosts are.
      connect: addresses that all other programs connect to; empty: to `listen`.
      meet: where programs meet without an agent; the first listens there, and the others at a free port of the same
        address. Rarely needed: programs of one user on one computer meet without any address.
      key: a file with a secret that all programs of the realm have, by which both ends prove who they are and which
        encrypts what is sent; "" for none.
      tls: certificates, instead of a key.
      access: the rights of each name; None: every program may do everything.
      insecure: whether there may be addresses without TLS: any program that can connect there can run code as this
        user.
      largest_message: bytes of header and payload that are sent and received at most.
      lease_s: after how many seconds of silence a program counts as gone.
      shared_memory: bytes that long messages between programs of one host go through; 0: none. Segments that a killed
        program leaves in /dev/shm stay there.
    """

    realm: str = "default"
    host: str = msgspec.field(default_factory=socket.gethostname)
    listen: tuple[str, ...] = ()
    agents: tuple[str, ...] = ()
    connect: tuple[str, ...] = ()
    meet: tuple[str, ...] = ()
    key: str = ""
    tls: Tls | None = None
    access: Access | None = None
    insecure: bool = False
    largest_message: int = 64 * 2**20
    lease_s: float = 2.0
    shared_memory: int = 0


class SettingsProblem(Problem, frozen=True):
    """One finding about settings; its `path` is the key, as in "tls.key".

    Attributes:
      file: as it was named; empty if they come from no file.
      line: from 1; 0 if there is none.
    """

    file: str = ""
    line: int = 0

    def __str__(self) -> str:
        where = f"{self.file}:{self.line}: " if self.line else f"{self.file}: " if self.file else ""
        path = f'"{self.path}": ' if self.path else ""
        return f"{where}{path}{self.what}; {self.remedy}"


def read_settings(file: Path | str) -> Settings:
    """Read a settings file.

    Raises:
      FileError: it cannot be read, or something in it is wrong; `problems` holds every finding.
    """
    file = Path(file)
    try:
        with file.open(encoding="utf-8") as stream:
            status = os.fstat(stream.fileno())
            text = stream.read()
    except OSError as error:
        raise _refused(
            file, [_problem("", f"it cannot be read: {error.strerror}", "name a file that is there")]
        ) from None
    except UnicodeDecodeError as error:
        raise _refused(file, [_problem("", f"it is no UTF-8 at byte {error.start}", "save it as UTF-8")]) from None
    if is_open_to_others(status):
        what = "other users can change it, and so decide who may connect to this computer"
        raise _refused(file, [_problem("", what, f"write chmod go-w {file}")])
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        found = re.search(r"line (\d+)", str(error))
        said = re.sub(r" \(at .*\)$", "", str(error))
        finding = _problem("", f"it is no TOML: {said[:1].lower()}{said[1:]}", "correct the line")
        raise _refused(file, [finding], [int(found[1]) if found else max(1, len(text.splitlines()))]) from None
    values: dict[str, Any] = {}
    problems = _convert(Settings, data, "", values)
    settings = Settings(**{name: one for name, one in values.items() if one is not None})
    problems += problems_of(settings, broken={one.path.split(".")[0] for one in problems})
    if problems:
        raise _refused(file, problems, [_line_of(text, one.path) for one in problems])
    folder = file.parent
    if settings.key:
        settings = msgspec.structs.replace(settings, key=str(folder / settings.key))
    if settings.tls is not None:
        tls = settings.tls
        files = {name: str(folder / getattr(tls, name)) for name in ("authority", "certificate", "key")}
        settings = msgspec.structs.replace(settings, tls=msgspec.structs.replace(tls, **files))
    return settings


def _refused(file: Path, problems: list[SettingsProblem], lines: list[int] | None = None) -> FileError:
    lines = lines or [0] * len(problems)
    named = [msgspec.structs.replace(one, file=str(file), line=line) for one, line in zip(problems, lines, strict=True)]
    return FileError(f"{file} cannot be used as settings", sorted(named, key=_line))


def _line(problem: Problem) -> int:
    return problem.line if isinstance(problem, SettingsProblem) else 0


def _problem(path: str, what: str, remedy: str) -> SettingsProblem:
    return SettingsProblem(path=path, severity="error", what=what, why="", remedy=remedy, check="settings")


# --- each key by itself ---

_TABLES: Final[dict[str, type[msgspec.Struct]]] = {"tls": Tls, "access": Access}


def _convert(
    struct: type[msgspec.Struct], data: Mapping[str, Any], above: str, into: dict[str, Any]
) -> list[SettingsProblem]:
    """Convert each key of a table by itself, so that all that is wrong is found; what is right goes into `into`."""
    fields = {one.name: one for one in msgspec.structs.fields(struct)}
    problems = []
    for name, value in data.items():
        path = f"{above}{name}"
        if name not in fields:
            close = difflib.get_close_matches(name, fields, n=1)
            remedy = f'did you mean "{close[0]}"?' if close else f"there are {', '.join(fields)}"
            problems.append(_problem(path, "there is no such key", remedy))
            continue
        table = _TABLES.get(path)
        if table is not None and isinstance(value, Mapping):
            inner: dict[str, Any] = {}
            wrong = _convert(table, value, f"{path}.", inner)
            wrong += [
                _problem(path, f'"{one.name}" is missing', f"add {one.name} = ...")
                for one in msgspec.structs.fields(table)
                if one.required and one.name not in value
            ]
            into[name] = None if wrong else table(**inner)
            problems += wrong
            continue
        try:
            into[name] = msgspec.convert(value, fields[name].type)
        except msgspec.ValidationError as error:
            said = re.sub(r" - at `\$(.*)`$", lambda found: f" at {found[1]}", str(error))
            problems.append(_problem(path, f"{said[:1].lower()}{said[1:]}", _EXAMPLES.get(path, "correct the value")))
    return problems


_EXAMPLES: Final = {
    "realm": 'write realm = "cell-4"',
    "host": 'write host = "arm"',
    "listen": 'write listen = ["tls/arm.local:7447"]',
    "agents": 'write agents = ["tls/base.local:7447"]',
    "connect": 'write connect = ["tls/arm.local:7447"]',
    "meet": 'write meet = ["unixsock-stream//run/cell/meet"]',
    "key": 'write key = "cell.key"',
    "tls": "begin a table with [tls]",
    "access": "begin a table with [access]",
    "access.write": 'write write = ["arm"]',
    "access.read": 'write read = ["viewer"]',
}


def _line_of(text: str, path: str) -> int:
    """Find the line of a key: tomllib tells none. 0 if it is written in some rarer way."""
    table, _, key = path.rpartition(".")
    current = ""
    first_of_table = 0
    for number, line in enumerate(text.splitlines(), start=1):
        if header := re.match(r"\s*\[\s*([^\[\]]+?)\s*\]", line):
            current = header[1].strip("\"'")
            first_of_table = number if current == path else first_of_table
        elif (said := re.match(r"\s*([^\s=#]+)\s*=", line)) and (
            (current == table and said[1].strip("\"'") == key) or f"{current}.{said[1]}".strip(".") == path
        ):
            return number
    return first_of_table


# --- what they say together ---


def problems_of(settings: Settings, broken: set[str] | frozenset[str] = frozenset()) -> list[SettingsProblem]:
    """Find what is wrong with settings whose types are right.

    Args:
      settings: they.
      broken: keys of which something is known to be wrong.
    """
    problems: list[SettingsProblem] = []
    for name in ("realm", "host"):
        value = getattr(settings, name)
        if not value or "/" in value:
            problems.append(_problem(name, f'"{value}" is no name', 'take any text without "/"'))
    if not _TINY <= settings.largest_message <= _HUGE:
        what = f"{settings.largest_message} bytes cannot be kept"
        problems.append(_problem("largest_message", what, f"take {_TINY} to {_HUGE}"))
    if not 0.2 <= settings.lease_s <= 60:
        problems.append(_problem("lease_s", f"{settings.lease_s} s is no time to wait", "take 0.2 to 60"))
    if not 0 <= settings.shared_memory <= 2**40:
        problems.append(_problem("shared_memory", f"{settings.shared_memory} bytes cannot be had", "take 0 for none"))
    if settings.key and settings.tls is not None:
        problems.append(_problem("key", "there is a table [tls] too", "take one of the two"))
    if settings.tls is not None and not settings.tls.mutual and not settings.insecure:
        what = "whoever connects proves nothing, and can run code as this user"
        problems.append(_problem("tls.mutual", what, "leave it out, or write insecure = true"))
    for name in ("listen", "agents", "connect", "meet"):
        for address in getattr(settings, name):
            problems += _wrong_address(name, address, settings, tls_broken="tls" in broken)
    if settings.access is not None and "tls" not in broken:
        problems += _wrong_access(settings, settings.access)
    return [one for one in problems if one.path not in broken]


def _wrong_address(name: str, address: str, settings: Settings, *, tls_broken: bool) -> list[SettingsProblem]:
    found = _ADDRESS.fullmatch(address)
    if found is None:
        return [_problem(name, f'"{address}" is no address', 'write "protocol/host:port", as in tls/arm.local:7447')]
    protocol, place = found["protocol"], found["place"]
    if found["rest"]:
        what = f'"{address}" ends in options of Zenoh, which could switch off that both ends prove who they are'
        return [_problem(name, what, f'write "{protocol}/{place}"')]
    if protocol not in _PROTOCOLS:
        return [_problem(name, f'"{address}": "{protocol}" is not spoken here', f"take {', '.join(_PROTOCOLS)}")]
    if protocol == "unixsock-stream":
        return []
    split = _PLACE.fullmatch(place)
    if split is None:
        remedy = f'write "{protocol}/{place.rpartition(":")[0] or place}:7447"'
        return [_problem(name, f'"{address}" has no host and port', remedy)]
    problems = []
    if int(split["port"]) > _LAST_PORT:
        problems.append(_problem(name, f'"{address}": there is no port {split["port"]}', "take one below 65536"))
    if protocol == "tls" and settings.tls is None and not settings.key and not tls_broken:
        what = f'"{address}" needs certificates or a key'
        problems.append(_problem(name, what, "add a table [tls] or key = ...; hfg keys new makes some"))
    if protocol == "tcp" and not settings.insecure:
        who = "whoever connects there" if name in ("listen", "meet") else "whoever listens there"
        what = f'"{address}" is open: {who}, other users of the same computer too, can run code as this user'
        remedy = f'write "tls/{place}" with key = ... or [tls], or insecure = true if all of them are to be trusted'
        problems.append(_problem(name, what, remedy))
    return problems


def _wrong_access(settings: Settings, access: Access) -> list[SettingsProblem]:
    problems: list[SettingsProblem] = []
    if settings.tls is None or not settings.tls.mutual:
        what = "names are those of certificates, and nobody has to show one"
        remedy = "add a table [tls]" if settings.tls is None else "leave out mutual = false in [tls]"
        return [_problem("access", what, remedy)]
    problems += [
        _problem(f"access.{name}", "a name is empty", "leave it out")
        for name in ("write", "read")
        if not all(getattr(access, name))
    ]
    both = sorted(set(access.write) & set(access.read))
    if both:
        problems.append(_problem("access.read", f'"{both[0]}" may write too', "name it once"))
    if not access.write:
        problems.append(_problem("access", "nobody may write, so nothing could run", 'add write = ["arm"]'))
    for address in settings.listen:
        if not address.startswith("tls/"):
            what = f'"{address}" asks for no certificate, so [access] would refuse all who come there'
            problems.append(_problem("listen", what, f'write "tls/{address.partition("/")[2]}"'))
    return problems


def open_addresses(settings: Settings) -> list[str]:
    """Return the addresses at which whoever connects proves nothing."""
    named = (*settings.listen, *settings.agents, *settings.connect, *settings.meet)
    is_one_sided = settings.tls is not None and not settings.tls.mutual
    open_ones = ("tcp/", "tls/") if is_one_sided else ("tcp/",)
    return [address for address in dict.fromkeys(named) if address.startswith(open_ones)]


def is_loopback(address: str) -> bool:
    """Say whether only this computer can reach an address."""
    found = _ADDRESS.fullmatch(address)
    if found is None or found["protocol"] == "unixsock-stream":
        return found is not None
    host = found["place"].rpartition(":")[0].strip("[]")
    return host in ("localhost", "::1") or re.fullmatch(r"127(\.\d{1,3}){3}", host) is not None
