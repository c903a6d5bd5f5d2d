"""`hfg record`, `hfg info` and `hfg play`, as they are typed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from hfg.recording import File
from tests.limits import patience

pytestmark = pytest.mark.slow

Command = Callable[..., "subprocess.CompletedProcess[str]"]


def test_a_run_is_recorded_told_of_and_played_back(program: Path, command: Command) -> None:
    done = command("record", "robot.py", "-o", "run.mcap", "--clock", "virtual")
    assert done.returncode == 0, done.stderr
    assert "run.mcap: 42 tokens of 2 ports" in done.stderr
    told = command("info", "run.mcap")
    assert 'graph "robot", virtual clock, done' in told.stdout
    assert [line.split()[:4] for line in told.stdout.splitlines() if line.startswith("camera.out")] == [
        ["camera.out", "output", "int", "20"]
    ]
    found = json.loads(command("info", "run.mcap", "--json").stdout)
    assert found["whole"] is True
    assert [port["values"] for port in found["ports"]] == [20, 20]
    played = command("play", "run.mcap", "--into", "robot.py", "--clock", "virtual", "-o", "again.mcap")
    assert played.returncode == 0, played.stderr
    with File(program.parent / "run.mcap") as first, File(program.parent / "again.mcap") as second:
        ours = [(first.channels[number].topic, data) for number, _, data in first.messages()]
        theirs = [(second.channels[number].topic, data) for number, _, data in second.messages()]
    assert theirs == ours


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["info", "nowhere.mcap"], "hfg: cannot open the recording nowhere.mcap: No such file or directory\n"),
        (
            ["info", "robot.py"],
            "hfg: robot.py is not an MCAP file; hfg record writes such files, and so do many other programs\n",
        ),
        (
            ["record", "robot.py", "-o", "robot.py"],
            "hfg: robot.py already exists: choose another name, or overwrite it with --force or force=True\n",
        ),
        (
            ["record", "robot.py", "-o", "run.mcap", "--select", "lidar*"],
            'hfg: no port matches "lidar*"; the sending ports are "camera.out", "double.out"\n',
        ),
        (
            ["play", "robot.py", "--into", "robot.py", "--speed", "fast"],
            "hfg: --speed takes a number above 0, or max, got 'fast'\n",
        ),
        (
            ["play", "robot.py", "--into", "robot.py", "--map", "camera.out"],
            "hfg: --map takes FROM=TO, a recorded port and one of the graph, got 'camera.out'\n",
        ),
    ],
)
def test_what_cannot_be_is_one_sentence(program: Path, command: Command, arguments: list[str], sentence: str) -> None:
    done = command(*arguments)
    assert (done.returncode, done.stderr, done.stdout) == (2, sentence, "")


ENDLESS = """
from hfg.cli.app import main
import sys
sys.exit(main(["record", "robot.py:build", "-o", "run.mcap", "--arg", "count=100000000", "--arg", "rate=2000"]))
"""


@pytest.mark.parametrize(("how", "whole"), [(signal.SIGKILL, False), (signal.SIGINT, True)])
def test_a_recorder_that_is_killed_or_interrupted_leaves_a_file_that_opens(
    program: Path, how: signal.Signals, whole: bool
) -> None:
    file = program.parent / "run.mcap"
    with subprocess.Popen(
        [sys.executable, "-c", ENDLESS], cwd=program.parent, stderr=subprocess.PIPE, env=dict(os.environ)
    ) as process:
        while process.poll() is None and not _has_values(file):
            try:
                process.wait(0.05)
            except subprocess.TimeoutExpired:
                continue
        process.send_signal(how)
        code = process.wait(patience(30))
    with File(file) as recording:
        found = recording.info()
    assert found.whole is whole
    assert found.ports[0].values > 0
    assert code == (1 if whole else -signal.SIGKILL)


def _has_values(file: Path) -> bool:
    if not file.exists() or file.stat().st_size < 5000:
        return False
    with File(file) as recording:
        return any(port.values for port in recording.info().ports)


@pytest.mark.skipif(sys.platform != "linux", reason="limits the size of files")
def test_a_full_disk_is_one_sentence_and_what_was_written_opens(program: Path, command: Command) -> None:
    limit = "import resource, signal\nsignal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
    limit += "resource.setrlimit(resource.RLIMIT_FSIZE, (300000, 300000))\n"
    limit += "import hfg.recording.writing as writing\nwriting._CHUNK_BYTES = 50000"
    done = command("record", "robot.py", "-o", "run.mcap", "--clock", "virtual", "--arg", "count=100000", before=limit)
    assert done.returncode == 1
    assert "the recording in run.mcap is not whole: File too large; it opens up to its last chunk" in done.stderr
    with File(program.parent / "run.mcap") as recording:
        assert recording.info().messages > 1000


@pytest.mark.skipif(sys.platform != "linux", reason="limits the size of files")
def test_a_disk_that_is_full_before_the_first_chunk_leaves_nothing_to_read(program: Path, command: Command) -> None:
    limit = "import resource, signal\nsignal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
    limit += "resource.setrlimit(resource.RLIMIT_FSIZE, (4000, 4000))\n"
    done = command("record", "robot.py", "-o", "run.mcap", "--clock", "virtual", "--arg", "count=10000", before=limit)
    assert done.returncode == 1
    assert "the recording in run.mcap is not whole: File too large; nothing in it can be read" in done.stderr
