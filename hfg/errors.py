"""All exceptions of hfg, in one tree.

    HfgError
    ├── DeclarationError      a node type cannot be what it says (raised where it is declared)
    ├── GraphError            the structure is wrong (raised where it is built, or by a check)
    │   ├── ConnectionError   an edge that rules P1-P9 refuse
    │   └── CheckFailed       a check found errors; `problems` holds all of them
    ├── MachineError          a description or a graph that is not a state machine; `problems` lists everything wrong
    ├── UsageError            a call at the wrong moment (a port outside a run, a second run, ...)
    │   └── NotRunning        the run that the call needs has not started or is over
    ├── EncodingError         a value that cannot be data, or data that is not a value of its type
    ├── SharedMemoryError     shared memory that is full, gone, not announced or unavailable here
    ├── FileError             a graph file without a graph, or a graph that no file can hold; see `problems`
    ├── TargetError           a TARGET of the command line that cannot be found or imported
    ├── RunError              a run that did not end well
    │   ├── NodeError         a node's own code failed; `__cause__` is its exception (rule X1)
    │   │   └── FiringTimeout a firing took longer than its `max_duration_s` (rule X2)
    │   ├── Stalled           quiet, and something is left that can never move (rule R5)
    │   ├── Aborted           the graph's slot `abort` was called (rule A10)
    │   ├── QueueLimit        a queue would have grown over its `capacity_limit` (rule F8)
    │   └── TeardownError     nodes failed while they were torn down (rule X3)
    ├── TransportError        a transport cannot do what was asked: closed, no route to the other side, ...
    │   ├── MessageTooLarge   more bytes than it carries at once
    │   ├── NoAnswer          no answer to a question, or not in time
    │   └── QueryRefused      the answer to a question is a refusal; the text says why
    ├── QueueOverflow         policy `error`: the queue is full, nothing of the trigger was sent (rule P5)
    ├── EndOfStream           raised *by* a node to end its stream (rule F2)
    └── EngineInternalError   a fault of hfg, never of the user

There is a class for each error that you may want to catch separately. Each message names the path in the graph, what
was expected, what was found, and what to do.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
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
    "MonitorViolated",
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
"""The most severe first."""


class Problem(msgspec.Struct, frozen=True):
    """One problem found by `graph.check()`.

    Attributes:
      path: path of the node, port or edge.
      severity: "error": the graph cannot run. "warning": the graph does not work as drawn; reported, but it runs.
        "hint": it may be intended.
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


_SHOWN = 20  # problems of a check that a message lists


class HfgError(Exception):
    """Base of all exceptions that hfg raises on purpose."""


class DeclarationError(HfgError):
    """A node type, port or parameter is declared in a way that cannot work."""


class GraphError(HfgError):
    """The structure of a graph is wrong; unlike `DeclarationError` the types themselves are fine."""


class ConnectionError(GraphError):  # noqa: A001 - the paper's word; always used as hfg.errors.ConnectionError
    """An edge was refused; nothing was changed.

    Attributes:
      path: the target, if it is known which; "" otherwise.
      expected: the type that the target expects; "" if the types are not the reason.
      sent: the type that the source sends.
      reason: why the two do not fit.
    """

    def __init__(self, message: str, *, path: str = "", expected: str = "", sent: str = "", reason: str = "") -> None:
        super().__init__(message)
        self.path = path
        self.expected = expected
        self.sent = sent
        self.reason = reason


class CheckFailed(GraphError):
    """A check found errors; nothing was started.

    Attributes:
      problems: every problem, including warnings, in the order of the check.
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
    """Not a state machine: a description, a dict or a region of a graph.

    Attributes:
      problems: every problem, errors first.
    """

    def __init__(self, sentence: str, problems: Sequence[Problem]) -> None:
        self.problems = tuple(problems)
        count = "1 finding" if len(self.problems) == 1 else f"{len(self.problems)} findings"
        lines = [f"  {problem}" for problem in self.problems[:_SHOWN]]
        if len(self.problems) > _SHOWN:
            lines.append(f"  ... and {len(self.problems) - _SHOWN} more: the error's problems lists them all")
        super().__init__("\n".join([f"{sentence}, {count}:", *lines]))


class FileError(HfgError):
    """A graph file does not describe a graph, or a file cannot hold part of a graph; nothing was made or written.

    Attributes:
      problems: every problem, with its file and line, in order.
      wants: the modules that the file would import but may not, in the form that `allow` takes.
    """

    def __init__(self, sentence: str, problems: Sequence[Problem], wants: Sequence[str] = ()) -> None:
        self.problems = tuple(problems)
        self.wants = tuple(wants)
        lines = [f"  {problem}" for problem in self.problems[:_SHOWN]]
        if len(self.problems) > _SHOWN:
            lines.append(f"  ... and {len(self.problems) - _SHOWN} more: the error's problems lists them all")
        many = "\n".join([f"{sentence}, {len(self.problems)} findings:", *lines])
        super().__init__(str(self.problems[0]) if len(self.problems) == 1 else many)


class UsageError(HfgError):
    """A call that cannot work here or now, although it can elsewhere."""


class NotRunning(UsageError):
    """The call needs a run that has started and is not over."""


class EncodingError(HfgError, ValueError):
    """A value that cannot be stored as plain data, or data that is not a value of the type it should have."""


class SharedMemoryError(HfgError):
    """Shared memory cannot be made or opened; arrays can still be copied."""


class TargetError(HfgError):
    """The TARGET of `hfg run` cannot be found or imported, or is not a graph.

    Attributes:
      choices: the names of the graphs that code holds, if the TARGET names none of several.
    """

    def __init__(self, message: str, choices: Iterable[str] = ()) -> None:
        super().__init__(message)
        self.choices = tuple(choices)


class RunError(HfgError):
    """A run did not end well."""


class NodeError(RunError):
    """The code of a node failed; the exception it raised is the `__cause__`.

    Attributes:
      path: the node's path in the graph.
      what: where it failed: "firing 3", "slot look, call 2", "setup" ...
    """

    def __init__(self, path: str, what: str, cause: BaseException | str) -> None:
        self.path = path
        self.what = what
        reason = cause if isinstance(cause, str) else in_words(cause)
        super().__init__(f'node "{path}" failed in {what}: {reason}')


def in_words(error: BaseException) -> str:
    """Return an exception in words, even if its text is empty or making the text raises."""
    if isinstance(error, SystemExit):
        return "it called sys.exit: to end the run, connect an event to graph.stop"
    try:
        text = _of_what_is_not_there(error) or str(error)
    except Exception as fault:
        text = f"its text cannot be made ({type(fault).__name__})"
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def shown(value: object, most: int = 80) -> str:
    """Return the repr of a user's value for a message: at most `most` characters, even if its `repr` raises."""
    try:
        return f"{value!r:.{most}}"
    except Exception as fault:
        return f"<{type(value).__name__}, whose repr raises {type(fault).__name__}>"


def _of_what_is_not_there(error: BaseException) -> str:
    """Return the message of a node or port for an attribute that it lacks; Python names only the class.

    (A `__getattr__` could raise the message itself, but would make every attribute access five times as slow.)
    """
    if not isinstance(error, AttributeError):
        return ""
    without = getattr(type(error.obj), "_without", None)
    if without is None or str(error) != f"'{type(error.obj).__name__}' object has no attribute '{error.name}'":
        return ""  # another object's, or with a message of its own
    return str(without(error.obj, error.name))


class Failure(NamedTuple):
    """The value of a node's event `failed`: enough to handle the error, or to try again (rule X1).

    Attributes:
      error: the error; the exception is its `__cause__`. In another process than the node's there is no exception: the
        message contains its text, and the notes say where it was raised.
      taken: the values that the firing had taken, by name of the input; empty if a hook or an operator failed instead.
        In another process, values whose declared type cannot be transferred are missing, and the notes name them.
    """

    error: NodeError
    taken: dict[str, Any]


class FiringTimeout(NodeError):
    """A firing took longer than its node's `max_duration_s`; it was cancelled or abandoned."""


class Stalled(RunError):
    """Nothing can run any more, but a source has not ended or tokens are left."""


class Aborted(RunError):
    """The graph aborted itself: its slot `abort` was called."""


class QueueLimit(RunError):
    """The run could continue only with a longer queue, and its `capacity_limit` forbids it."""


class MonitorViolated(RunError):
    """A property that a monitor watches did not hold; the message has the stretch of the run that shows it."""


class TeardownError(RunError):
    """One or more nodes failed during teardown; `errors` holds each error."""

    def __init__(self, errors: Sequence[NodeError]) -> None:
        self.errors = tuple(errors)
        super().__init__("; ".join(str(error) for error in errors))


class TransportError(HfgError):
    """A transport cannot do what was asked, now or at all; nothing was sent."""


class MessageTooLarge(TransportError):
    """A datagram has more bytes than the transport carries; a smaller one can be sent."""


class NoAnswer(TransportError):
    """No program answers to the name, the one that did has gone, or it took too long; asking again may help."""


class QueryRefused(TransportError):
    """The program that was asked has refused, with a message of its own; asking again will not help."""


class QueueOverflow(HfgError):
    """A trigger found a full queue with policy `error`; its signal was not sent to any edge."""


class EndOfStream(HfgError):
    """Raise it in the process function or in `ready()` of a node to end the node's stream."""


class EngineInternalError(HfgError):
    """A fault of hfg: please report it, with the trace if you have one."""
