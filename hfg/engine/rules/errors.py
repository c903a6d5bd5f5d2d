"""What becomes of a failure in a node's code: stop, skip, disable or restart (rules X1, X2).

Depends on `sending`; the firing and calling modules bring failures here.
"""

from __future__ import annotations

import dis
from collections.abc import Callable

from hfg.base.frames import users_part
from hfg.base.logs import node_log
from hfg.engine.model.iteration import amid_element
from hfg.engine.model.running_node import BACKOFF, BETWEEN_FIRINGS, RunningNode
from hfg.engine.rules import calls, firing, node_lifecycle
from hfg.engine.rules.modifiers import automatic, report_error
from hfg.engine.rules.retries import retry
from hfg.engine.rules.sending import put_outputs, send_automatic
from hfg.errors import EndOfStream, Failure, FiringTimeout, NodeError, QueueLimit, in_words, shown
from hfg.ports.edges import EventEdge
from hfg.trace import FiringOutcome
from hfg.types import accepts, describe

_WHAT_FOLLOWS = {
    "skip": "the node goes on",
    "disable": "the node is switched off",
    "restart": "the node is restarted",
}

__all__ = [
    "apply_policy",
    "as_node_error",
    "begin_over",
    "fail",
    "fail_beside",
    "fail_call",
    "follow",
    "judge",
    "operator_failed",
    "outcome_of",
    "time_out",
]


def as_node_error(worker: RunningNode, what: str, error: BaseException) -> NodeError:
    """Wrap what was raised so that it names the path and the firing (X1)."""
    if isinstance(error, NodeError):
        return error
    cause: BaseException | str = error
    if isinstance(error, EndOfStream):
        cause = (
            "EndOfStream was raised, but a node ends in process() or ready() alone: keep it in mind, and raise it there"
        )
    elif isinstance(error, Exception) and what.startswith("firing") and worker.iteration is None:
        blame = _wrong_value(worker, error)
        cause = f"{in_words(error)}; {blame}" if blame else error
    if worker.core.sharing is not None:
        cause = worker.core.sharing.explain(worker, error) or cause
    problem = NodeError(worker.path, what + amid_element(worker), cause)
    problem.__cause__ = error
    return problem


def _wrong_value(worker: RunningNode, error: Exception) -> str:
    """Say which value the code was given that its input was never declared for: the fault of whoever has sent it.

    The values are looked up where the code failed, so that a firing that does not fail keeps none of them.
    """
    code = getattr(getattr(worker.type.origin, "function", type(worker.node).process), "__code__", None)
    traceback = error.__traceback__
    while traceback is not None and traceback.tb_frame.f_code is not code:
        traceback = traceback.tb_next
    if code is None or traceback is None:
        return ""
    written = {step.argval for step in dis.get_instructions(code) if step.opname.startswith("STORE_FAST")}
    given = traceback.tb_frame.f_locals
    for edge in worker.in_edges:
        name = edge.port_name
        spec = worker.type.inputs.get(name)
        if spec is None or spec.token or name not in given or name in written or accepts(given[name], spec.type):
            continue
        source = edge.label.partition(" -> ")[0]
        return (
            f'its input "{name}" is declared {describe(spec.type)} and was given {shown(given[name])} by "{source}": '
            "look there, with debug=True the run does it"
        )
    return ""


def fail(
    worker: RunningNode, what: str, error: BaseException, *, answer: bool, then: Callable[[], None] | None = None
) -> None:
    """A firing (`answer`: it still owes its outputs) or other code of the node has failed; see `apply_policy`."""
    if isinstance(error, QueueLimit):
        worker.core.runtime.finish("failed", error)
        return
    if answer and retry(worker, error):
        return
    worker.counts.add_failure()
    apply_policy(worker, as_node_error(worker, what, error), answer=answer, then=then)


def fail_beside(worker: RunningNode, what: str, error: BaseException) -> None:
    """A task of the node has failed, perhaps during a firing, which continues; the node's policy decides (X1)."""
    if isinstance(error, QueueLimit):
        worker.core.runtime.finish("failed", error)
        return
    worker.counts.add_failure()
    problem = as_node_error(worker, what, error)
    policy = judge(worker, problem)
    if policy == "stop":
        return
    automatic(worker, "failed", Failure(problem, {}))
    restarts = begin_over(worker, policy)
    if worker.busy in BETWEEN_FIRINGS:  # else it follows the firing or call in progress (A9)
        send_automatic(worker)
    follow(worker, policy, restarts=restarts)


def fail_call(worker: RunningNode, slot: str, error: BaseException) -> None:
    """A slot call has failed: it owes no outputs, so with every policy but `stop` it is only counted."""
    worker.counts.add_failure(of_call=True)
    problem = as_node_error(worker, f"slot {slot}, call {worker.counts.calls}", error)
    policy = _policy(worker, problem)
    report_error(worker, problem.what, in_words(error), policy)
    if policy == "stop":
        worker.core.runtime.finish("failed", problem)
        return
    _log(worker, problem, f'the call is only counted (on_error="{policy}")')
    worker.core.errors.append(problem)
    calls.finish_call(worker, "failed")


def _log(worker: RunningNode, problem: NodeError, consequence: str) -> None:
    """Tell of an error that ends nothing as it happens, with the frames of the user's code (X1)."""
    cause = problem.__cause__
    node_log(worker.path).error(
        "%s; %s",
        problem,
        consequence,
        exc_info=None if cause is None else (type(cause), cause, users_part(cause.__traceback__)),
    )


def _policy(worker: RunningNode, problem: NodeError) -> str:
    """Who ends a task or the program on purpose has raised no error that a policy could get over."""
    if worker.options is None or not isinstance(problem.__cause__, Exception | None):
        return "stop"
    return worker.options.on_error  # type: ignore[no-any-return]


def judge(worker: RunningNode, problem: NodeError) -> str:
    """X1: what the node's policy says is told to those who listen; "stop" has ended the run."""
    core = worker.core
    policy = _policy(worker, problem)
    if policy == "restart" and not worker.blocked & BACKOFF and worker.counts.restarts >= worker.options.restart_limit:
        policy = "stop"
    report_error(worker, problem.what, in_words(problem.__cause__ or problem), policy)
    if policy == "stop":
        core.runtime.finish("failed", problem)
    else:
        _log(worker, problem, f'{_WHAT_FOLLOWS[policy]} (on_error="{policy}")')
        core.errors.append(problem)
    return policy


def outcome_of(problem: NodeError) -> FiringOutcome:
    """How the trace calls the end of a firing that has failed: one that took too long was given up (X2)."""
    return "abandoned" if isinstance(problem, FiringTimeout) else "failed"


def begin_over(worker: RunningNode, policy: str) -> bool:
    """X1: whether the node is to be restarted, and that is not under way already; from here on nothing of it begins."""
    restarts = policy == "restart" and not worker.blocked & BACKOFF
    if restarts:
        worker.counts.add_restart()
        worker.block(BACKOFF)
    return restarts


def follow(worker: RunningNode, policy: str, *, restarts: bool) -> None:
    """X1: what becomes of the node when its failed firing is over."""
    if policy == "disable":
        node_lifecycle.disable(worker)
    elif restarts:
        node_lifecycle.restart(worker, worker.options.restart_backoff_s * 2 ** (worker.counts.restarts - 1))


def apply_policy(
    worker: RunningNode, problem: NodeError, *, answer: bool, then: Callable[[], None] | None = None
) -> None:
    """X1: the node's policy decides; where no answer is owed `then` comes before a node is disabled or restarted."""
    policy = judge(worker, problem)
    worker.take_written()
    if policy == "stop":
        return
    automatic(worker, "failed", Failure(problem, worker.execution.recall() if answer else {}))
    if answer and policy != "disable":
        put_outputs(worker, None)
    restarts = begin_over(worker, policy)
    if answer:
        firing.finish_firing(worker, outcome_of(problem))
    elif then is not None:
        then()
    elif not worker.busy:
        send_automatic(worker)
    follow(worker, policy, restarts=restarts)


def time_out(worker: RunningNode) -> None:
    """X2: the firing has taken longer than `max_duration_s`: it is given up, its late result ignored."""
    worker.give_up_firing()
    limit = worker.options.max_duration_s
    what = f"firing {worker.counts.firings}{amid_element(worker)}"
    worker.core.code.interrupt(worker)
    problem = FiringTimeout(worker.path, what, f"it took longer than max_duration_s = {limit:g} s and was given up")
    if retry(worker, problem):
        return
    worker.counts.add_failure()
    apply_policy(worker, problem, answer=True)


def operator_failed(edge: EventEdge, error: BaseException) -> None:
    """An operator on the edge raised: the consumer's `on_error` decides (P9, X1)."""
    target: RunningNode = edge.target
    problem = NodeError(target.path, f'an operator on edge "{edge.label}"{amid_element(target)}', error)
    problem.__cause__ = error
    if target in (target.core.current, target.core.running_node):  # it has triggered into itself: that is over first
        target.core.after(0.0, lambda: apply_policy(target, problem, answer=False))
    else:
        apply_policy(target, problem, answer=False)
