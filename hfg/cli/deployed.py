"""The process of a run that an agent has begun: `python -m hfg.cli.deployed`, which reads from its input what to run.

It is `hfg run`, and ends as that does by SIGTERM when its standard input ends: then the agent is gone, or wants it to
end. Depends on `app`.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from typing import Final

import msgspec

from hfg.cli.app import main as command
from hfg.parts.hosts.hosting import Deployed
from hfg.parts.hosts.remote_parts import deployed_as

_LONGEST: Final = 2**20
_PATIENCE_S: Final = 10.0


def main() -> int:
    """Run what the agent says."""
    try:
        told = msgspec.json.decode(sys.stdin.buffer.readline(_LONGEST), type=Deployed)
    except msgspec.DecodeError:
        raise SystemExit("hfg.cli.deployed runs a graph for an agent and is begun by that; use hfg deploy") from None
    os.chdir(told.folder)
    sys.argv[1:] = ["run", *told.arguments]
    sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]  # what nodes print is in the log at once
    deployed_as.set(told.run)
    threading.Thread(target=_watch, daemon=True, name="hfg watch of the agent").start()
    return command(["run", *told.arguments, "--settings", told.settings, "--no-table"])


def _watch() -> None:
    os.read(sys.stdin.fileno(), 1)
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(_PATIENCE_S)
    os._exit(1)


if __name__ == "__main__":
    sys.exit(main())
