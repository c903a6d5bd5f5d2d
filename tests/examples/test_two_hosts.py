"""The graph on two hosts: in virtual time without any, and in network namespaces where they can be made."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import hfg
from hfg.cli.target import load_graph
from tests.limits import patience

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "two_hosts"


def test_without_a_host_the_squares_come_back_in_order(capsys: pytest.CaptureFixture[str]) -> None:
    report = hfg.run(load_graph(str(FOLDER / "robot.py"), ["count=5"]), clock="virtual")
    assert report.outcome == "done"
    assert capsys.readouterr().out.split() == ["0", "1", "4", "9", "16"]


@pytest.mark.soak
@pytest.mark.rule("L1", "L3")
def test_a_cable_that_is_pulled_loses_nothing() -> None:
    told = subprocess.run(
        [sys.executable, str(FOLDER / "two_hosts.py"), "--count", "100", "--out", "2"],
        capture_output=True,
        text=True,
        timeout=patience(120),
        check=False,
    )
    if told.returncode == 2:
        pytest.skip(told.stderr.strip())
    assert "100 of 100 numbers came back, once and in order" in told.stdout, told.stdout + told.stderr
