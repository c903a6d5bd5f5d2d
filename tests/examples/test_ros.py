"""The robot of ROS 2 that runs without ROS."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.limits import patience

pytest.importorskip("rosbags", reason="rosbags is part of hfg[ros2]")


@pytest.mark.slow
def test_the_driver_stops_the_simulated_robot_before_the_wall() -> None:
    file = Path(__file__).resolve().parent.parent.parent / "examples" / "ros" / "robot.py"
    ran = subprocess.run([sys.executable, str(file)], capture_output=True, text=True, check=False, timeout=patience(50))
    assert (ran.returncode, ran.stdout) == (0, "stopped before the wall: True\n"), ran.stderr
