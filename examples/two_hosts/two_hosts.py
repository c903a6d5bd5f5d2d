"""Two hosts on one computer: network namespaces with a cable between them, which is pulled for a while amid the run.

An agent waits on the host "arm"; the graph of `robot.py` runs on the host "base", with one group on "arm". While the
cable is out nothing gets through, and the numbers wait (lossless edges hold their producer back). When it is in again
the run goes on, and all numbers come back, once and in order.

Run it as root, on Linux with iproute2: `python examples/two_hosts/two_hosts.py [--count 200] [--out 3]`
"""

from __future__ import annotations

import argparse
import contextlib
import os
import secrets
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

HERE = Path(__file__).parent
HFG = (sys.executable, "-m", "hfg")
ADDRESSES = {"arm": "10.77.0.1", "base": "10.77.0.2"}


def missing() -> str:
    """Say what keeps this example from running here; "" if nothing does."""
    if not sys.platform.startswith("linux") or shutil.which("ip") is None:
        return "network namespaces need Linux with iproute2 (on Debian and Ubuntu the package iproute2)"
    if os.geteuid() != 0:
        return "network namespaces need root: run this with sudo"
    probe = f"hfg-probe-{secrets.token_hex(3)}"
    made = subprocess.run(["ip", "netns", "add", probe], capture_output=True, text=True, check=False)
    if made.returncode != 0:
        return f"network namespaces cannot be made here: {made.stderr.strip()}"
    _ip("netns", "delete", probe)
    return ""


def _ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True)


@contextlib.contextmanager
def two_hosts() -> Iterator[dict[str, str]]:
    """Two namespaces with a cable; gives their names by host. Nothing of them is left behind."""
    mark = secrets.token_hex(2)
    spaces = {host: f"hfg-{host}-{mark}" for host in ADDRESSES}
    try:
        for space in spaces.values():
            _ip("netns", "add", space)
        arm, base = spaces.values()
        _ip("link", "add", f"hfga{mark}", "netns", arm, "type", "veth", "peer", "name", f"hfgb{mark}", "netns", base)
        for host, end in (("arm", f"hfga{mark}"), ("base", f"hfgb{mark}")):
            _ip("-n", spaces[host], "link", "set", end, "name", "cable")
            _ip("-n", spaces[host], "address", "add", f"{ADDRESSES[host]}/24", "dev", "cable")
            _ip("-n", spaces[host], "link", "set", "lo", "up")
            _ip("-n", spaces[host], "link", "set", "cable", "up")
        yield spaces
    finally:
        for space in spaces.values():
            subprocess.run(["ip", "netns", "delete", space], capture_output=True, check=False)


def write_settings(folder: Path) -> None:
    """Write what each host needs to know; no other computer can reach them, so they need no keys."""
    address = f"tcp/{ADDRESSES['arm']}:7447"
    (folder / "arm.toml").write_text(f'realm = "cell"\nhost = "arm"\nlisten = ["{address}"]\ninsecure = true\n')
    (folder / "base.toml").write_text(f'realm = "cell"\nhost = "base"\nconnect = ["{address}"]\ninsecure = true\n')


@contextlib.contextmanager
def agent(space: str, folder: Path) -> Iterator[None]:
    """An agent on the host "arm", from when it is ready."""
    command = ["ip", "netns", "exec", space, *HFG, "agent", "--settings", str(folder / "arm.toml")]
    with subprocess.Popen(command, cwd=HERE, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            print(process.stdout.readline().strip() or 'the agent of host "arm" has not begun')
            yield
        finally:
            process.terminate()


def main() -> int:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200, help="how many numbers go round")
    parser.add_argument("--out", type=float, default=3.0, help="for how many seconds the cable is out")
    said = parser.parse_args()
    problem = missing()
    if problem:
        print(problem, file=sys.stderr)
        return 2
    expected = [number * number for number in range(said.count)]
    with tempfile.TemporaryDirectory() as name, two_hosts() as spaces:
        folder = Path(name)
        write_settings(folder)
        with agent(spaces["arm"], folder):
            found = run(spaces["base"], folder, said.count, said.out)
    order = "once and in order" if found == expected else "BUT NOT ALL ONCE AND IN ORDER"
    print(f"{len(found)} of {said.count} numbers came back, {order}")
    return 0 if found == expected else 1


def run(space: str, folder: Path, count: int, out_s: float) -> list[int]:
    """Run the graph on the host "base", and pull the cable when a tenth has come back; gives what has."""
    command = ["ip", "netns", "exec", space, *HFG, "run", "robot.py", "--settings", str(folder / "base.toml")]
    with subprocess.Popen(
        [*command, "--arg", f"count={count}"], cwd=HERE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        found = []
        for line in process.stdout:
            if not line.strip().isdigit():
                continue  # what is said at the end
            found.append(int(line))
            if len(found) == max(count // 10, 1):
                print(f"the cable is out for {out_s:g} s")
                _ip("-n", space, "link", "set", "cable", "down")
                time.sleep(out_s)
                _ip("-n", space, "link", "set", "cable", "up")
                print("the cable is in again")
    return found


if __name__ == "__main__":
    sys.exit(main())
