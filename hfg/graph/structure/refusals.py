"""Refusals that are kept instead of raised, so that the check of a graph that cannot be built tells all at once.

Normally a graph raises an error in the call that is refused. Inside `keep_refusals` errors are collected, and building
continues as well as it can. Depends on naming.
"""

from __future__ import annotations

import inspect
import linecache
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from types import FrameType

from hfg.errors import GraphError, Problem
from hfg.graph.structure.naming import path_of
from hfg.nodetypes.node import Node

_kept: ContextVar[list[Problem] | None] = ContextVar("hfg.refusals", default=None)
_OURS = str(Path(__file__).resolve().parents[2])


@contextmanager
def keep_refusals() -> Iterator[list[Problem]]:
    """Write down what graphs refuse to the code inside; gives the list."""
    problems: list[Problem] = []
    token = _kept.set(problems)
    try:
        yield problems
    finally:
        _kept.reset(token)


@contextmanager
def raise_refusals() -> Iterator[None]:
    """Raise them all the same: whoever builds inside tells them itself, with the line of a file."""
    token = _kept.set(None)
    try:
        yield
    finally:
        _kept.reset(token)


class Refusable:
    """Around what a graph may refuse; `ends` are what the path of the finding is made of.

    Examples:
      >>> with keep_refusals() as problems:
      ...     with Refusable("a.out", "b.in"):
      ...         raise GraphError("types do not fit; put a node between them")
      >>> problems[0].path, problems[0].remedy
      ('a.out -> b.in', 'put a node between them')
    """

    __slots__ = ("_ends",)

    def __init__(self, *ends: object) -> None:
        self._ends = ends

    def __enter__(self) -> None:
        pass

    def __exit__(self, _type: object, error: BaseException | None, _traceback: object) -> bool:
        problems = _kept.get() if isinstance(error, GraphError) else None
        if problems is None:
            return False
        path = " -> ".join(map(_name_of, self._ends))
        problems.append(problem_of(error, path, f"the graph refused it at {_where()}"))
        return True


def problem_of(error: BaseException | None, path: str, why: str) -> Problem:
    """Turn a refusal into a finding: its sentence ends in the remedy."""
    what, _, remedy = str(error).rpartition("; ")
    return Problem(
        path=path,
        severity="error",
        what=what or remedy,
        why=why,
        remedy=remedy if what else "say what is allowed there",
        check="refused",
    )


def _where() -> str:
    """The user's line that is being executed."""
    frame: FrameType | None = inspect.currentframe()
    while frame is not None and frame.f_code.co_filename.startswith(_OURS):
        frame = frame.f_back
    if frame is None:
        return "an unknown line"
    file, line = frame.f_code.co_filename, frame.f_lineno
    code = linecache.getline(file, line).strip()
    return f"{Path(file).name}, line {line}" + (f", {code}" if code else "")


def _name_of(end: object) -> str:
    """Return the name of a refused port, node or name, whatever it is."""
    if isinstance(end, str):
        return end
    path = path_of(end) if isinstance(end, Node) else getattr(end, "path", None)
    return path if isinstance(path, str) else f"{end!r:.40}"
