"""The options of edges, nodes, groups and monitors. Add one here; for a run, see `engine.runtime.settings`.

Each is declared once, as a field with an `Option`: its type, default, limits, unit, meaning, who may have it and how a
drawing shows it. The arguments of a call are declared above it for type checkers, by name and type. Everything else is
derived from the declarations: commands, graph files and their schema, saving and loading, editing, grouping and
cutting, labels in drawings, and the tables in docs/reference.md.

Depends on `option`, not on nodes or ports.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Iterable, Sequence
from typing import Annotated, Any, Final, Generic, Literal, TypeAlias, TypedDict

import msgspec
from typing_extensions import TypeVar

from hfg.graph.structure.option import Fields, Option, documented
from hfg.monitors.properties import Property

Errors: TypeAlias = Iterable[type[Exception] | str] | type[Exception] | str
OnViolation: TypeAlias = Literal["note", "fail"]
OnError: TypeAlias = Literal["stop", "skip", "disable", "restart"]
Release: TypeAlias = Literal["auto", "sequential", "pipelined"]
Overflow: TypeAlias = Literal["wait", "drop_oldest", "drop_newest", "latest", "error"]
Policy: TypeAlias = Literal["fifo", "priority", "deadline", "fair", "random"]

T = TypeVar("T", default=Any)
O = TypeVar("O", default=Any)  # noqa: E741 - operators

_LONGEST: Final = 40  # characters of an initial value in a drawing


# --- edges ---


class EdgeGiven(TypedDict, Generic[T, O], total=False):
    """The options of an edge, with initial values of type T and operators of type O."""

    active: bool
    capacity: int
    overflow: Overflow
    capacity_limit: int | None
    buffer: int
    initial: Iterable[T]
    through: Iterable[O]
    deadline_s: float | None


def _values(values: Sequence[object]) -> str:
    texts = [repr(value) for value in values[:4]]
    text = ", ".join(one if len(one) <= _LONGEST else f"{one[: _LONGEST - 1]}…" for one in texts)
    return f"initial {text}" + (f" and {len(values) - 4} more" if len(values) > 4 else "")


def _count(operators: Sequence[object]) -> str:
    return "1 operator" if len(operators) == 1 else f"{len(operators)} operators"


class EdgeFields(Fields[EdgeGiven[Any, Any]], kw_only=True):
    """How an edge transports."""

    active: Annotated[bool, Option("The edge also carries activity (a double line in drawings).", border="every")] = (
        False
    )
    capacity: Annotated[
        int,
        Option(
            "Maximum number of untaken signals in the queue (rule P5).", least=1, only="events", badge="capacity {}"
        ),
    ] = 16
    overflow: Annotated[
        Overflow,
        Option(
            'What to do when the queue is full; "wait" loses nothing (rules P5, F8).',
            only="events",
            badge="{}",
            rank=-1,
        ),
    ] = "wait"
    capacity_limit: Annotated[
        int | None,
        Option(
            'The size up to which "wait" may let the queue grow (rule F8).', least=1, only="events", badge="at most {}"
        ),
    ] = None
    buffer: Annotated[
        int,
        Option(
            "How many tokens the producer may run ahead (rule P4).",
            least=0,
            only="data",
            border="sum",
            badge="buffer {}",
            rank=1,
        ),
    ] = 0
    initial: Annotated[
        tuple[Any, ...],
        Option(
            "Values that are on the edge at the start, oldest first (rule P7).",
            expects="[0]",
            border="target",
            badge=_values,
            rank=1,
        ),
    ] = ()
    through: Annotated[
        tuple[Any, ...],
        Option(
            "Reactivex operators before the queue (rule P9).",
            expects="[ops.debounce(0.2)]",
            only="events",
            border="along",
            badge=_count,
        ),
    ] = ()
    deadline_s: Annotated[
        float | None,
        Option(
            "The latency budget up to the edge's target: how old a token may be when the target is done with it, "
            "counted from the firing of its source.",
            above=0,
            border="least",
            badge="within {:g} s",
            rank=2,
        ),
    ] = None

    def said(self) -> EdgeGiven[Any, Any]:
        """Return the options whose values differ from their defaults, by name."""
        found = super().said()
        if self.overflow == "latest":
            found.pop("capacity", None)  # which is then 1
        return found


@documented
class EdgeOptions(EdgeFields, frozen=True):  # type: ignore[misc]  # the same fields, which nobody changes any more
    """How an edge transports, checked."""


# --- nodes ---


class NodeGiven(TypedDict, total=False):
    """The options of a node."""

    group: str | None
    priority: int
    max_rate_hz: float | None
    on_error: OnError
    restart_limit: int
    restart_backoff_s: float
    max_duration_s: float | None
    retries: int
    retry_on: Errors
    retry_backoff_s: float
    retry_backoff_max_s: float
    retry_jitter: float
    concurrency: int
    ordered: bool
    release: Release
    active_for_s: float | None
    deadline_s: float | None
    takes_s: float | None
    enabled: bool
    iterate_over: Iterable[str]


def _each(names: Sequence[str]) -> str:
    return f"for each of {', '.join(names)}"


class NodeFields(Fields[NodeGiven], kw_only=True):
    """How a node runs; nothing of it belongs to its type."""

    group: Annotated[
        str | None,
        Option(
            "The group in which the node runs, declared with `graph.group`; by default that of the surrounding "
            "subgraph, or else the loop.",
            expects="the name of a group",
            remedy='declare it with graph.group("vision", threads=1)',
            only="any",
        ),
    ] = None
    priority: Annotated[
        int, Option('Nodes with a higher priority run first, in a group with policy "priority" (rule R2).')
    ] = 0
    max_rate_hz: Annotated[
        float | None, Option("Maximum number of firings per second (rule F11).", above=0, badge="{:g} Hz")
    ] = None
    on_error: Annotated[OnError, Option("What to do when the node's code fails (rule X1).")] = "stop"
    restart_limit: Annotated[int, Option('For "restart": the maximum number of restarts.', least=0)] = 5
    restart_backoff_s: Annotated[
        float, Option('For "restart": the first pause.', least=0, remedy="0 restarts at once")
    ] = 0.1
    max_duration_s: Annotated[
        float | None, Option("The time limit of a firing, and of each attempt at it (rule X2).", above=0)
    ] = None
    retries: Annotated[
        int, Option("How often a failed firing is retried before `on_error` applies (rule X1).", least=0)
    ] = 0
    retry_on: Annotated[
        tuple[str, ...],
        Option(
            "Retry only after these errors and those derived from them: classes or their names, "
            '"ConnectionError", "my_robot.nodes:NoAnswer"; by default, after all errors.',
            expects="[ConnectionError]",
        ),
    ] = ()
    retry_backoff_s: Annotated[
        float,
        Option(
            "The pause before the first retry; it doubles with each further retry.",
            least=0,
            remedy="0 tries again at once",
        ),
    ] = 0.1
    retry_backoff_max_s: Annotated[
        float, Option("The maximum pause between retries.", least=0, remedy="0 makes no pause at all")
    ] = 30.0
    retry_jitter: Annotated[
        float,
        Option(
            "The share of a pause by which it may be shortened at random.",
            least=0,
            most=1,
            remedy="0.5 makes pauses up to a half shorter",
        ),
    ] = 0.0
    concurrency: Annotated[
        int,
        Option(
            "How many firings of the node may be in progress at once: for an async function, or in a group with as "
            "many threads (rule F14).",
            least=1,
        ),
    ] = 1
    ordered: Annotated[bool, Option("With concurrency: outputs leave in the order in which the firings started.")] = (
        True
    )
    release: Annotated[Release, Option("When the tokens that the node takes count as processed (rule F5).")] = "auto"
    active_for_s: Annotated[
        float | None,
        Option(
            "How long the node may stay active before its `timeout` (rule A12).",
            above=0,
            badge="active for {:g} s",
            only="any",
        ),
    ] = None
    deadline_s: Annotated[
        float | None,
        Option(
            "How old the data may be when the node is done with it, counted from the firing of the source. Policy "
            '"deadline" (rule R2) and `hfg check --time` look at it.',
            above=0,
        ),
    ] = None
    takes_s: Annotated[
        float | None,
        Option(
            "How long a firing or call of the node takes at most, on the machine that runs it, for `hfg check --time`.",
            least=0,
        ),
    ] = None
    enabled: Annotated[bool, Option("The node is enabled when a run starts.", badge="disabled", only="any")] = True
    iterate_over: Annotated[
        tuple[str, ...],
        Option("The inputs that take collections (rule G4).", expects='["items"]', only="subgraph", badge=_each),
    ] = ()


@documented
class NodeOptions(NodeFields, frozen=True):  # type: ignore[misc]  # the same fields, which nobody changes any more
    """How a node runs, checked."""


# --- groups ---


class GroupGiven(TypedDict, total=False):
    """The options of a group; None is the default."""

    threads: int | None
    policy: Policy
    seed: int | None
    deadline_s: float | None
    process: bool
    host: str | None
    ledger: bool | str | os.PathLike[str]
    may_misalign: bool


class GroupFields(Fields[GroupGiven], kw_only=True):
    """Where nodes run, and which of them comes first (rules R1, R2)."""

    threads: Annotated[
        int,
        Option(
            "How many threads run the nodes of the group: with n threads, n nodes at once.",
            usual="1; 0 where there is a process",
            least=0,
            expects="0 (on the loop), 1 (a thread of its own) or the number of its threads",
            remedy="with n threads up to n of its nodes run at the same time",
        ),
    ] = 0
    policy: Annotated[Policy, Option("Which node runs next when several can (rule R2).")] = "fifo"
    seed: Annotated[
        int | None, Option('The seed for policy "random"; by default that of the run.', expects="a whole number")
    ] = None
    deadline_s: Annotated[
        float | None,
        Option(
            "The `deadline_s` of each node of the group at which a way ends and where nothing else is declared. "
            'That of the group "loop" is one for the whole graph: it also holds in groups that declare none.',
            above=0,
        ),
    ] = None
    process: Annotated[
        bool,
        Option(
            "The group has a process of its own; edges to and from its nodes become links (rule L1).",
            remedy="host= names another host than this",
        ),
    ] = False
    host: Annotated[
        str,
        Option(
            'The agent that runs the process, as in host="arm"; implies `process`.',
            expects='the name of an agent, as in host="arm"',
            fits=lambda host: "/" not in host,
        ),
    ] = ""
    ledger: Annotated[
        bool | str,
        Option(
            "Save the state of the nodes and the positions on all edges together. If the process dies, another resumes "
            "from there, and nothing is lost or duplicated. With a file, the next run resumes from it, too.",
            expects='True (kept by the run) or the path of a file, as in ledger="writer.ledger"',
        ),
    ] = False
    may_misalign: Annotated[
        bool,
        Option(
            "Let the run continue when the process dies, even if the number of lost tokens cannot be known and a join "
            "may pair the wrong tokens; without it, the run fails (rule L2). `hfg check` reports where this can happen."
        ),
    ] = False


@documented
class GroupSpec(GroupFields, frozen=True):  # type: ignore[misc]
    """Where nodes run, and which of them comes first (rules R1, R2), checked."""

    name: str


# --- monitors ---


class MonitorGiven(TypedDict, total=False):
    """The options of a monitor."""

    on_violation: OnViolation
    triggers: str


class MonitorFields(Fields[MonitorGiven], kw_only=True):
    """The reaction to a violation that a monitor finds."""

    on_violation: Annotated[
        OnViolation, Option('Whether a violation is only noted, or ends the run as failed ("fail").')
    ] = "note"
    triggers: Annotated[
        str,
        Option(
            "The slot or event that a violation triggers, by its path from the whole graph. Its value is the text of "
            "the violation, where a text fits its type.",
            expects='the path of a slot or event, "drive.halt"',
        ),
    ] = ""


@documented
class MonitorSpec(MonitorFields, frozen=True):  # type: ignore[misc]
    """A property that must hold of each run of a graph, checked."""

    name: str
    property: Property


PLAIN: Final = EdgeOptions()
ACTIVE: Final = EdgeOptions(active=True)
PLAIN_NODE: Final = NodeOptions()


@functools.lru_cache(maxsize=1024)
def in_group(options: NodeOptions, group: str | None) -> NodeOptions:
    """Return the same options in another group, or in that of the subgraph around."""
    return msgspec.structs.replace(options, group=group)
