"""Everything hfg raises: one tree, one sentence each.

    HfgError
    ├── DeclarationError      a node type cannot be what it says (raised where it is declared)
    ├── GraphError            the structure is wrong (raised where it is built, or by a check)
    │   ├── ConnectionError   an edge that rules P1-P9 refuse
    │   └── CheckFailed       a check found errors; `problems` holds all of them
    ├── MachineError          what is no state machine, as a description or a graph; `problems` holds all that is wrong
    ├── UsageError            a call at the wrong moment (a port outside a run, a second run, ...)
    │   └── NotRunning        the run that the call needs has not begun or is over
    ├── EncodingError         a value that is no data, or data that is no value of the type it should be
    ├── SharedMemoryError     shared memory that is full, gone, not announced or not to be had here
    ├── FileError             a graph file without a graph, a graph that no file can say; `problems` holds all of it
    ├── TargetError           a TARGET of the command line that cannot be found or imported
    ├── RunError              a run that did not end well
    │   ├── NodeError         a node's own code failed; `__cause__` is its exception (rule X1)
    │   │   └── FiringTimeout a firing took longer than its `max_duration_s` (rule X2)
    │   ├── Stalled           quiet, and something is left that can never move (rule R5)
    │   ├── Aborted           the graph's slot `abort` was called (rule A10)
    │   ├── QueueLimit        a queue would have grown over its `capacity_limit` (rule F8)
    │   └── TeardownError     nodes failed while they were torn down (rule X3)
    ├── TransportError        a transport cannot do what it is asked: closed, no way to the other side, ...
    │   ├── MessageTooLarge   more bytes than it carries at once
    │   ├── NoAnswer          a question that nobody answers, or not in time
    │   └── QueryRefused      a question whose answer is a refusal; the text says why
    ├── QueueOverflow         policy `error`: the queue is full, nothing of the trigger was sent (rule P5)
    ├── EndOfStream           raised *by* a node to say that it has ended (rule F2)
    └── EngineInternalError   a fault of hfg, never of the user

A class exists when somebody would catch it apart from its neighbours. Each message names the path in the graph, what
was expected, what was found, and what to do.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, Literal, NamedTuple

import msgspec

__all__ = [
    "SEVERITIES",
    "Aborted",
    "CheckFailed",
    "ConnectionError",
    "DeclarationError",
    "EncodingError",
    "EndOfStream",
    "EngineInternalError",
    "Failure",
    "FileError",
    "FiringTimeout",
    "GraphError",
    "HfgError",
    "MachineError",
    "MessageTooLarge",
    "NoAnswer",
    "NodeError",
    "NotRunning",
    "Problem",
    "QueryRefused",
    "QueueLimit",
    "QueueOverflow",
    "RunError",
    "SharedMemoryError",
    "Stalled",
    "TargetError",
    "TeardownError",
    "TransportError",
    "UsageError",
    "in_words",
    "shown",
]

SEVERITIES: Final = ("error", "warning", "hint")
"""The worst first."""


class Problem(msgspec.Struct, frozen=True):
    """One finding of `graph.check()`.

    Attributes:
      path: the node, port or edge it is about.
      severity: a run refuses graphs with an "error"; a "warning" is only told, for what does not work as it is drawn;
        a "hint" is for what may be meant so.
      what: the fact, in a few words.
      why: the rule or the consequence.
      remedy: what to do.
      check: the name of the check that found it, as docs/howto/checks.md lists them.
    """

    path: str
    severity: Literal["error", "warning", "hint"]
    what: str
    why: str
    remedy: str
    check: str = ""

    def __str__(self) -> str:
        return f'{self.severity} at "{self.path}": {self.what}: {self.why}; {self.remedy}'


_SHOWN = 20  # findings of a check that a message lists


class HfgError(Exception):
    """Whatever hfg raises on purpose."""


class DeclarationError(HfgError):
    """A node type, port or parameter is declared in a way that cannot work."""


class GraphError(HfgError):
    """The structure of a graph is wrong; unlike `DeclarationError` the types themselves are fine."""


class ConnectionError(GraphError):  # noqa: A001 - the paper's word; always used as hfg.errors.ConnectionError
    """An edge was refused; nothing was changed."""


class CheckFailed(GraphError):
    """A check found errors; nothing was started.

    Attributes:
      problems: every finding, warnings too, in the order of the check.
    """

    def __init__(self, problems: Sequence[Problem]) -> None:
        self.problems = tuple(problems)
        errors = [problem for problem in self.problems if problem.severity == "error"]
        count = "1 error" if len(errors) == 1 else f"{len(errors)} errors"
        lines = [f"  {problem}" for problem in errors[:_SHOWN]]
        if len(errors) > _SHOWN:
            lines.append(f"  ... and {len(errors) - _SHOWN} more: graph.check() lists them all")
        super().__init__("\n".join([f"the graph has {count}:", *lines]))


class MachineError(HfgError):
    """What should be a state machine is none: a description, a dict or a region of a graph.

    Attributes:
      problems: every finding, errors first.
    """

    def __init__(self, sentence: str, problems: Sequence[Problem]) -> None:
        self.problems = tuple(problems)
        count = "1 finding" if len(self.problems) == 1 else f"{len(self.problems)} findings"
        lines = [f"  {problem}" for problem in self.problems[:_SHOWN]]
        if len(self.problems) > _SHOWN:
            lines.append(f"  ... and {len(self.problems) - _SHOWN} more: the error's problems hold them all")
        super().__init__("\n".join([f"{sentence}, {count}:", *lines]))


class FileError(HfgError):
    """A graph file says no graph, or a graph holds what no file can say; nothing was made or written.

    Attributes:
      problems: every finding, with its file and line, in their order.
      wants: the modules that the file would import and may not, as `allow` names them.
    """

    def __init__(self, sentence: str, problems: Sequence[Problem], wants: Sequence[str] = ()) -> None:
        self.problems = tuple(problems)
        self.wants = tuple(wants)
        lines = [f"  {problem}" for problem in self.problems[:_SHOWN]]
        if len(self.problems) > _SHOWN:
            lines.append(f"  ... and {len(self.problems) - _SHOWN} more: the error's problems hold them all")
        many = "\n".join([f"{sentence}, {len(self.problems)} findings:", *lines])
        super().__init__(str(self.problems[0]) if len(self.problems) == 1 else many)


class UsageError(HfgError):
    """A call that is right elsewhere, made where or when it cannot work."""


class NotRunning(UsageError):
    """The call needs a run that has begun and is not over."""


class EncodingError(HfgError, ValueError):
    """A value that cannot be stored as plain data, or data that is no value of the type it should be."""


class SharedMemoryError(HfgError):
    """Shared memory cannot be made or opened; arrays can still be copied."""


class TargetError(HfgError):
    """What `hfg run TARGET` names cannot be found, imported or is no graph."""


class RunError(HfgError):
    """A run did not end well."""


class NodeError(RunError):
    """The code of a node failed; the exception it raised is the `__cause__`.

    Attributes:
      path: the node's path in the graph.
      what: where in its life it failed: "firing 3", "slot look, call 2", "setup" ...
    """

    def __init__(self, path: str, what: str, cause: BaseException | str) -> None:
        self.path = path
        self.what = what
        reason = cause if isinstance(cause, str) else in_words(cause)
        super().__init__(f'node "{path}" failed in {what}: {reason}')


def in_words(error: BaseException) -> str:
    """Name an exception of a user's, whose text may be empty or may itself raise."""
    if isinstance(error, SystemExit):
        return "it left the program (sys.exit): end the run by an event that is connected to graph.stop"
    try:
        text = _of_what_is_not_there(error) or str(error)
    except Exception as fault:
        text = f"its text cannot be made ({type(fault).__name__})"
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def shown(value: object, most: int = 80) -> str:
    """Print a value of a user's for a message: at most so many characters of it, whatever its `repr` does."""
    try:
        return f"{value!r:.{most}}"
    except Exception as fault:
        return f"<{type(value).__name__}, whose repr raises {type(fault).__name__}>"


def _of_what_is_not_there(error: BaseException) -> str:
    """Of an attribute that a node or a port does not have, say what they say of it, as Python names their class alone.

    (A `__getattr__` of theirs could say it at once, but would make each attribute of each node five times as slow.)
    """
    if not isinstance(error, AttributeError):
        return ""
    without = getattr(type(error.obj), "_without", None)
    if without is None or str(error) != f"'{type(error.obj).__name__}' object has no attribute '{error.name}'":
        return ""  # another's, or in somebody's own words
    return str(without(error.obj, error.name))


class Failure(NamedTuple):
    """What the event `failed` of a node carries: enough to answer for it, or to try again (rule X1).

    Attributes:
      error: what went wrong; the exception is its `__cause__`. In another process than that of the node there is no
        exception, but its text in the sentence, and where it was raised in the notes.
      taken: what the firing had taken, value by name of the input; empty if no firing failed but a hook or an operator.
        In another process without those whose declared type cannot cross, which the notes name.
    """

    error: NodeError
    taken: dict[str, Any]


class FiringTimeout(NodeError):
    """A firing took longer than its node's `max_duration_s`; it was cancelled or abandoned."""


class Stalled(RunError):
    """Nothing can move any more, yet a source has not ended or tokens are left."""


class Aborted(RunError):
    """The graph said so itself: its slot `abort` was called."""


class QueueLimit(RunError):
    """Only a longer queue could go on, and its `capacity_limit` forbids it."""


class TeardownError(RunError):
    """One or more nodes failed while they were torn down; `errors` holds each."""

    def __init__(self, errors: Sequence[NodeError]) -> None:
        self.errors = tuple(errors)
        super().__init__("; ".join(str(error) for error in errors))


class TransportError(HfgError):
    """A transport cannot do what it is asked, now or at all; nothing was sent."""


class MessageTooLarge(TransportError):
    """A datagram of more bytes than the transport carries; a smaller one would go."""


class NoAnswer(TransportError):
    """Nobody answers to the name, who did has gone, or it took too long; asking again may help."""


class QueryRefused(TransportError):
    """Who was asked has refused, in words of its own; asking again will not help."""


class QueueOverflow(HfgError):
    """A trigger found a full queue with policy `error`; nothing of it was sent."""


class EndOfStream(HfgError):
    """Raise it in the process function or in `ready()` of a node to say that nothing more will come of it."""


class EngineInternalError(HfgError):
    """A fault of hfg: please report it, with the trace if you have one."""
