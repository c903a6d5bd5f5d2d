"""Agents, hosts and realms used wrongly: one sentence each."""

from __future__ import annotations

import socket
import sys
from pathlib import Path

import pytest

import hfg
from hfg.cli import main, runs
from hfg.errors import FileError, GraphError, UsageError
from hfg.parts.hosts import hosting
from tests.transports.zenoh.conftest import free_port

pytest.importorskip("zenoh", reason="agents speak over Zenoh")


@pytest.fixture
def alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Settings of a realm with nobody in it."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setattr(runs, "FINDS_S", 0.1)
    file = tmp_path / "cell.toml"
    file.write_text(f'realm = "{tmp_path.name}"\nhost = "here"\n')
    return file


def test_a_host_is_a_name() -> None:
    with pytest.raises(GraphError, match='host must be the name of an agent, as in host="arm", got 7'):
        hfg.Graph().group("far", host=7)  # type: ignore[arg-type]


def test_settings_are_a_file() -> None:
    with pytest.raises(UsageError, match='^settings must be the file of a realm, as in settings="cell.toml", got 7'):
        hfg.run(hfg.Graph(), settings=7)  # type: ignore[arg-type]


def test_settings_that_are_not_there(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="it cannot be read: No such file or directory; name a file that is there"):
        hfg.run(hfg.Graph(), settings=tmp_path / "cell.toml")


def test_an_agent_whose_port_is_taken(alone: Path, capsys: pytest.CaptureFixture[str]) -> None:
    port = free_port()
    alone.write_text(f'listen = ["tcp/127.0.0.1:{port}"]\ninsecure = true\n')
    with socket.create_server(("127.0.0.1", port)):
        assert main(["agent", "--settings", str(alone)]) == 1
    assert "is taken by another program; is an hfg agent running already?" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "code", "sentence"),
    [
        (["ps"], 0, "the realm is empty: hfg agent starts an agent"),
        (["stop", "robot"], 2, 'no run "robot" is in the realm, nor any other: hfg deploy starts one'),
        (["logs", "robot"], 2, 'no run "robot" is in the realm'),
        (["top", "robot"], 2, 'no run "robot" is in the realm'),
        (["restart", "robot/far"], 2, 'no run "robot" is in the realm'),
        (["restart", "robot"], 2, '"robot" names no group of a run: write RUN/GROUP, as hfg ps shows them'),
    ],
)
def test_a_realm_in_which_nobody_is(
    alone: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], code: int, sentence: str
) -> None:
    assert main([*arguments, "--settings", str(alone)]) == code
    assert sentence in capsys.readouterr().err


@pytest.mark.rule("L5")
def test_an_address_at_which_nobody_proves_who_he_is(alone: Path, capsys: pytest.CaptureFixture[str]) -> None:
    alone.write_text('listen = ["tcp/127.0.0.1:7447"]\n')
    assert main(["agent", "--settings", str(alone)]) == 2
    assert '"tcp/127.0.0.1:7447" is open: whoever connects there' in capsys.readouterr().err


@pytest.mark.rule("L5")
@pytest.mark.parametrize(
    "verb",
    [
        ["agent"],
        ["run", "robot.py"],
        ["ps"],
        ["deploy", "robot.py"],
        ["logs", "robot"],
        ["stop", "robot"],
        ["restart", "robot/far"],
        ["top", "robot"],
    ],
    ids=lambda verb: verb[0],
)
def test_each_verb_says_in_which_file_an_open_address_would_be_allowed(
    alone: Path, capsys: pytest.CaptureFixture[str], verb: list[str]
) -> None:
    (alone.parent / "robot.py").write_text(
        "import hfg\nfrom hfg.testing.nodes import Script\ngraph = hfg.Graph()\n"
        "graph.group('far', host='arm')\ngraph.add(Script(count=1), group='far')\n"
    )
    alone.write_text('connect = ["tcp/127.0.0.1:7447"]\n')
    arguments = [one.replace("robot.py", str(alone.parent / "robot.py")) for one in verb]
    assert main([*arguments, "--settings", str(alone)]) in (1, 2)
    said = capsys.readouterr().err
    assert '"tcp/127.0.0.1:7447" is open: whoever listens there' in said
    assert f"{alone}:1:" in said
    assert "or insecure = true if all of them are to be trusted" in said


def test_a_folder_for_logs_that_cannot_be(alone: Path) -> None:
    file = alone.parent / "file"
    file.touch()
    with pytest.raises(hfg.errors.TransportError, match=r"output of parts, cannot be used \(.*XDG_STATE_HOME"):
        hosting.Journal(file / "logs", "here").open()


@pytest.mark.parametrize(
    ("module", "found"),
    [
        ("robot", True),
        ("arm.hand", True),
        ("arm.foot", False),
        ("robot.hand", False),
        ("no_such", False),
        ("numpy.linalg", True),
    ],
)
def test_modules_are_found_without_importing_them(tmp_path: Path, module: str, found: bool) -> None:
    (tmp_path / "robot.py").write_text("raise SystemExit")
    (tmp_path / "arm").mkdir()
    (tmp_path / "arm" / "__init__.py").write_text("raise SystemExit")
    (tmp_path / "arm" / "hand.py").touch()
    assert hosting.is_importable(module, [str(tmp_path), *sys.path]) == found
