"""The live table of `hfg run`: what watching costs.

Measured: CPU time of the process, in percent of one core, that a run on the real clock takes more with the table than
  without, in the same process one after the other. The graph: chains of ten functions, ten tokens per second each. The
  table is drawn four times a second on a terminal of 120 columns and 50 rows, and includes the measuring of the nodes'
  code that it asks for.
Not measured: the terminal that shows it.
"""

from __future__ import annotations

import fcntl
import os
import struct
import subprocess
import termios
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import hfg
from benchmarks.measure import Case
from benchmarks.nodes import numbers, through
from hfg.cli.live import Live
from hfg.cli.terminal import Foot

DISTRIBUTIONS = ("hfg", "rich")
CHAIN = 10
RATE_HZ = 10
SECONDS_A_NODE = 0.02  # ten seconds for 500


@contextmanager
def terminal(columns: int = 120, rows: int = 50) -> Iterator[Foot]:
    """Open a terminal that another process reads."""
    reading, writing = os.openpty()
    fcntl.ioctl(writing, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
    with subprocess.Popen(["cat"], stdin=reading, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as reader:
        os.close(reading)
        with os.fdopen(writing, "w", encoding="utf-8") as stream:
            yield Foot(stream)
        reader.kill()


def spent(nodes: int, seconds: float, begin: Callable[[hfg.Run], None] | None = None) -> float:
    """Run the graph for so long; gives the share of one core that it took."""
    graph = hfg.Graph("watched")
    for _ in range(max(1, nodes // CHAIN)):
        port = graph.add(numbers(count=10**9), max_rate_hz=RATE_HZ).out
        for _ in range(CHAIN - 1):
            node = graph.add(through())
            graph.connect(port, node.ports.inputs["value"])
            port = node.out
    began = time.process_time()
    hfg.run(graph, until_s=seconds, begin=begin)
    return (time.process_time() - began) / seconds


def table(nodes: int) -> dict[str, float]:
    """Run without the table and with it."""
    seconds = nodes * SECONDS_A_NODE
    without = 100 * spent(nodes, seconds)
    with terminal() as foot:
        live = Live(foot)
        with_table = 100 * spent(nodes, seconds, live.begin)
        live.end()
    return {"value": with_table - without, "with": with_table, "without": without}


CASES = {"500 nodes at 4 Hz": Case(table, 500, "%")}
