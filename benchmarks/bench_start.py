"""How long programs and commands take to start: processor time of fresh processes, interpreter included.

Measured: the least of several processes, after one that fills the caches (bytecode, the index of node types). "The
  dependencies" are all modules that are not of hfg and that `from hfg import *` imports, without hfg.
Not measured: the time until a disk has answered.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from collections.abc import Callable, Sequence
from functools import cache, partial

from benchmarks.goals import Goal, Side
from benchmarks.measure import ROOT, Case

DISTRIBUTIONS = ("hfg", "numpy", "reactivex", "typer")
PROCESSES = 7
SHOWS_CASES = True
SKIPPED: dict[str, str] = {}

NAMES_OF_DEPENDENCIES = """
import sys
before = set(sys.modules)
from hfg import *
print(*(name for name in sys.modules if name not in before and name.partition(".")[0] != "hfg"))
"""
"""Modules in the order in which they were imported, so those that others need come first."""
IMPORT = """
import importlib, sys
for name in sys.argv[1:]:
    importlib.import_module(name)
"""


def processor_time(command: Sequence[str], processes: int) -> dict[str, float]:
    """Run a command again and again; gives the least processor time in seconds."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    times = []
    for _ in range(processes + 1):
        before = _of_children()
        subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, check=True)
        times.append(_of_children() - before)
    return {"cpu": min(times[1:])}


def _of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def python(code: str, processes: int) -> dict[str, float]:
    """Run a line of Python."""
    return processor_time([sys.executable, "-c", code], processes)


def dependencies(processes: int) -> dict[str, float]:
    """Import all that hfg needs, without hfg."""
    return processor_time([sys.executable, "-c", IMPORT, *_names()], processes)


@cache
def _names() -> Sequence[str]:
    command = [sys.executable, "-c", NAMES_OF_DEPENDENCIES]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    return [name for name in done.stdout.split() if not name.startswith(("_distutils", "__"))]


def hfg(*arguments: str) -> partial[dict[str, float]]:
    """Run a command of hfg."""
    return partial(processor_time, [sys.executable, "-m", "hfg", *arguments])


WORKS: dict[str, Callable[[int], dict[str, float]]] = {
    "python": partial(python, "pass"),
    "the dependencies": dependencies,
    "import hfg": partial(python, "import hfg"),
    "all names of hfg": partial(python, "from hfg import *"),
    "hfg --help": hfg("--help"),
    "hfg nodes --search": hfg("nodes", "--search", "blur"),
    "hfg run hello.py": hfg("run", "examples/hello.py"),
}
CASES = {name: Case(run, PROCESSES, "s") for name, run in WORKS.items()}
GOALS = [
    Goal("`import hfg`, compared with its dependencies", Side("import hfg"), Side("the dependencies"), 1.3),
    Goal("`hfg --help`, of 0.3 s", Side("hfg --help"), 0.3, 1.0),
    Goal("`hfg nodes --search WORD`, of 0.3 s", Side("hfg nodes --search"), 0.3, 1.0),
    Goal("`hfg run examples/hello.py`, of 0.4 s", Side("hfg run hello.py"), 0.4, 1.0),
]
