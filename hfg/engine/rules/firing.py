"""What a node does next: a firing (rules F1-F4, F9, F11, P6, P8, A6, A11, T5).

The interpreted way; the wing `fusion` shortens it for plain shapes, and falls back to it. Depends on `ending` and
`calls`; a node's code is run by the host.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from types import CoroutineType
from typing import Any

from hfg.base.token import END, NO_MESSAGE, Marker, Token
from hfg.base.values import own_copy
from hfg.engine.model.records import SAME_MOMENT_S
from hfg.engine.model.running_node import DISABLED, NO_CALLS, UNREADY, RunningNode
from hfg.engine.rules import sharing
from hfg.engine.rules.agenda import consider, idle_again
from hfg.engine.rules.calls import call, refuse_coroutine, set_parameter
from hfg.engine.rules.ending import end, end_itself, ends_itself
from hfg.engine.rules.modifiers import derive_scopes, receive, touch
from hfg.engine.rules.releasing import make_room, release
from hfg.engine.rules.sending import announce, put_outputs, put_value, send_automatic, unwrapped
from hfg.engine.rules.wiring import rewire
from hfg.errors import EndOfStream, UsageError
from hfg.ports.edges import VALUE, AnyEdge
from hfg.trace import FiringEnded, FiringKind, FiringOutcome, FiringStarted, TokenTaken
from hfg.types import accepts, describe, describe_value

__all__ = [
    "arguments_of",
    "complete_firing",
    "entry_of",
    "finish_firing",
    "fire",
    "merge",
    "newest_stamp",
    "note_start",
    "receive_modifiers",
    "step",
    "take",
    "values_of",
    "when_done",
    "write",
    "writer",
]


_OF_ITS_OWN_KIND = frozenset({Token, CoroutineType})
"""What a function may give back that does not simply leave: a token passed on, code that is still to be awaited."""


def step(worker: RunningNode) -> None:
    """Do the next piece of work on the agenda of a worker that was taken from its run queue."""
    worker.dequeued()
    if worker.busy:
        return
    calls = worker.calls
    if worker.fireable and not (calls and worker.calls_before):
        if worker.ready_hook is None:
            fire(worker)
        else:
            _ask_ready(worker)
    elif calls and worker.blocked < NO_CALLS:
        call(worker)
    else:
        worker.clear_next()  # what it stood there for was taken from it meanwhile (F10, R4)


def _ask_ready(worker: RunningNode) -> None:
    """F1: the node's own `ready()` is asked last."""
    hook = worker.ready_hook
    assert hook is not None
    worker.be_busy("asking")

    def answered(ready: object, error: BaseException | None) -> None:
        worker.rest()
        if isinstance(error, EndOfStream) and worker.is_source and worker.fireable:
            worker.begin_firing()
            end_itself(worker)
        elif isinstance(error, EndOfStream) and worker.fireable:
            fire(worker, ends=True)
        elif error is not None:  # no answer is no: else it would be asked, and fail, without end
            worker.block(UNREADY)
            worker.core.rules.fail(worker, "ready()", error, answer=False)
            if not worker.busy:  # else its restart has begun
                idle_again(worker, asked=True)
        elif ready and worker.fireable and worker.idle_callbacks is None:
            fire(worker)
        elif ready and worker.fireable:  # an edit was faster, and asks to be before the firing
            idle_again(worker)
        elif worker.fireable:
            worker.block(UNREADY)
            idle_again(worker, asked=True)
        else:
            idle_again(worker)

    worker.core.code.execute(worker, hook, (), answered)


def fire(worker: RunningNode, *, ends: bool = False) -> None:
    """Take one token from every live input and decide by F4 what becomes of them; `ends`: its `ready()` ends it."""
    core = worker.core
    shape = worker.shape
    if shape.plain and not worker.special and core.trace is None and not ends:
        _fire_plainly(worker)
        return
    worker.begin_firing()
    edges = worker.live_inputs
    tokens = [take(edge) for edge in edges]
    now = core.now()
    worker.took(shape.sequential, now if worker.is_source else newest_stamp(tokens, now))
    if core.sharing is not None:
        sharing.taken(worker, edges, tokens)
        if core.over:
            return
    modifiers = [token.activity for token in tokens if token.activity]
    kind: Any = "end" if ends else _kind(worker, edges, tokens)
    if core.trace is not None:
        core.trace(FiringStarted(now, worker.path, worker.counts.firings, kind))
        for edge, token in zip(edges, tokens, strict=True):
            core.trace(TokenTaken(now, edge.label, token))
    _free_places(worker, edges)
    if worker.concurrent is None:
        _note(worker, kind)
    if modifiers:
        receive_modifiers(worker, modifiers)
    refused = _set_parameters(worker, edges, tokens)
    if worker.concurrent is not None:
        core.rules.begin_concurrent(worker, kind, edges, tokens, refused)
    elif kind == "end":
        end(worker, edges, tokens)
    elif refused is not None:
        if worker.attempts is not None:
            worker.attempts.begin((), made=0)
        core.rules.fail(worker, f"firing {worker.counts.firings}", refused, answer=True)
    elif kind == "silent":
        worker.counts.add_silent()
        put_outputs(worker, None)
        finish_firing(worker, "silent")
    else:
        _run_process(worker, edges, tokens)


def _note(worker: RunningNode, kind: FiringKind) -> None:
    """Prepare the next firing, after one of that kind."""
    if kind == "process":
        note_start(worker)
    if kind != "end":
        _place_next(worker)


def note_start(worker: RunningNode) -> None:
    """F11, A11: a firing whose function runs begins now."""
    rate_hz = worker.options.max_rate_hz
    if rate_hz:
        worker.rate.start(worker.core.now(), rate_hz)
    worker.rate.start_gated(worker.core.now())
    if worker.paced:
        worker.drop_firing()  # what an input that has ended gave a place to is held by the rate from now on


def _fire_plainly(worker: RunningNode) -> None:
    """The same where the wiring leaves nothing to decide (`Shape.plain`) and no marker lies before the worker.

    All that is taken are values, one for each input, so the function is run (F4); nobody listens.
    """
    worker.begin_firing()
    shape, inputs = worker.shape, worker.inputs
    tokens = []
    for edge in worker.live_inputs:
        tokens.append(edge.take())
        inputs.expect()
    if tokens:
        stamp = tokens[0].stamp
        for token in tokens:
            if token.stamp > stamp:
                stamp = token.stamp
    else:
        stamp = worker.core.now()
    worker.took(shape.sequential, stamp)
    if shape.pipelined:
        release(shape.pipelined)
    if worker.calls is not None:
        _place_next(worker)
    for token in tokens:
        if token.activity:
            receive_modifiers(worker, [one.activity for one in tokens if one.activity])
            break
    if not shape.direct:
        _run_process(worker, worker.live_inputs, tokens)
    elif worker.is_async or worker.group.threaded:
        worker.core.code.execute(worker, worker.process, [token.value for token in tokens], when_done(worker))  # type: ignore[arg-type]
    else:
        _call_at_once(worker, [token.value for token in tokens])


def _call_at_once(worker: RunningNode, values: list[Any]) -> None:
    """Run a plain function on the loop: `execute` for a firing that does not wait and cannot be given up."""
    core = worker.core
    core.current = worker
    try:
        result = worker.process(*values)  # type: ignore[misc]  # who fires has one
    except Exception as error:
        core.current = None
        when_done(worker)(None, error)
        return
    core.current = None
    complete_firing(worker, result)


def _free_places(worker: RunningNode, edges: Sequence[Any]) -> None:
    """Release the tokens taken from edges that wait for no more than that (F5 pipelined, F6)."""
    for edge in edges:
        make_room(edge)
        if not edge.live and not edge.untaken:  # the last that a source sent that is disabled by now (F10)
            rewire(worker)


def receive_modifiers(worker: RunningNode, modifiers: Sequence[int]) -> None:
    """A6: what a firing has taken acts, and by that on the subgraphs around."""
    if worker.scopes:
        touch(worker.core, worker.scopes)
    receive(worker, modifiers)
    derive_scopes(worker.core)


def _place_next(worker: RunningNode) -> None:
    """What the next firing asks for may hold already: then it has its place before the calls that come now (F9).

    Those are the calls that come of what was taken, too: of the activity that it brings to subgraphs around (A6, G2).
    """
    if worker.calls is not None and not worker.inputs.missing:
        consider(worker)


def take(edge: AnyEdge) -> Token[Any]:
    """Remove the oldest token (rule F3); its place is freed by the caller once the firing is on record."""
    token = edge.take()
    if not edge.untaken:
        edge.target.inputs.expect()
    elif type(edge.queue[0][VALUE]) is Marker:  # type: ignore[union-attr]  # of two tokens one is behind
        edge.target.mark_special()
    return token


def newest_stamp(tokens: Sequence[Token[Any]], now: float) -> float:
    """T5: the newest stamp of the values it took, else of all it took."""
    values = [token.stamp for token in tokens if type(token.value) is not Marker]
    return max(values or [token.stamp for token in tokens], default=now)


def _kind(worker: RunningNode, edges: Sequence[Any], tokens: Sequence[Token[Any]]) -> FiringKind:
    """F4: what becomes of a firing; a closed gate makes it silent (A11)."""
    for edge, token in zip(edges, tokens, strict=True):
        edge.end(token.value is END)
    if any(edge.ended for edge in worker.in_edges):
        if any(edge.ended and edge.mandatory for edge in edges) or _all_ended(worker, edges):
            return "end"
        if any(edge.ended for edge in edges):
            rewire(worker)
    if _lacks_values(edges, tokens) or (worker.gates_over and _is_held_by_gate(worker)):
        return "silent"
    return "process"


def _lacks_values(edges: Sequence[Any], tokens: Sequence[Token[Any]]) -> bool:
    """F4(2): a mandatory input holds NO_MESSAGE, or there is none and no input holds a value."""
    absent = bool(edges)
    for edge, token in zip(edges, tokens, strict=True):
        if edge.mandatory and token.value is NO_MESSAGE:
            return True
        if edge.mandatory or type(token.value) is not Marker:
            absent = False
    return absent


def _is_held_by_gate(worker: RunningNode) -> bool:
    """A11: a gate over it is closed, and no throttled firing is due; sources rest instead."""
    return not worker.is_source and any(
        not gate.state.active and not _idle_turn(worker, gate.idle_rate_hz) for gate in worker.gates_over
    )


def _idle_turn(worker: RunningNode, idle_rate_hz: float | None) -> bool:
    """A11: a throttled node runs its function as often as the idle rate allows."""
    return idle_rate_hz is not None and worker.core.now() + SAME_MOMENT_S >= worker.rate.gate_next + 1.0 / idle_rate_hz


def _all_ended(worker: RunningNode, taking_part: Sequence[Any]) -> bool:
    """F4(1): every live input has ended; edges with initial tokens do not count, and one other must have.

    Args:
      worker: whose inputs.
      taking_part: the edges of this firing; also one whose source was disabled and that still delivers (F10).
    """
    live = [edge for edge in worker.in_edges if edge in taking_part or (edge.live and edge.joins())]
    counted = [edge for edge in live if not getattr(edge, "initial", ())]
    return bool(counted) and all(edge.ended for edge in counted)


def _set_parameters(worker: RunningNode, edges: Sequence[Any], tokens: Sequence[Token[Any]]) -> Exception | None:
    """P8: a token sets the parameter when it is taken, also in a silent firing; gives why one cannot be set."""
    for edge, token in zip(edges, tokens, strict=True):
        if edge.target_kind == "parameter" and type(token.value) is not Marker:
            try:
                set_parameter(worker, edge.port_name, token.value)
            except Exception as error:
                return error
    return None


def arguments_of(worker: RunningNode, edges: Sequence[Any], tokens: Sequence[Token[Any]]) -> list[Any]:
    """One argument per declared input: the value, the token if asked for, the default if absent (P6)."""
    arguments = list(worker.unset)
    for edge, token in zip(edges, tokens, strict=True):
        if edge.target_kind == "input" and type(token.value) is not Marker:
            arguments[edge.position] = token if worker.wants_token[edge.position] else token.value
    return arguments


def values_of(edges: Sequence[Any], tokens: Sequence[Token[Any]]) -> dict[str, Any]:
    """Return the values that were taken, by the name of the input."""
    return {
        edge.port_name: token.value
        for edge, token in zip(edges, tokens, strict=True)
        if edge.target_kind == "input" and type(token.value) is not Marker
    }


def _run_process(worker: RunningNode, edges: Sequence[Any], tokens: Sequence[Token[Any]]) -> None:
    arguments = tuple(arguments_of(worker, edges, tokens))
    if worker.attempts is not None:
        worker.attempts.begin(arguments)
    if worker.shape.remembers:
        worker.execution.remember(values_of(edges, tokens))
    if worker.iteration is not None:
        worker.core.rules.iterate(worker, arguments)
        return
    kind = worker.type.process_kind
    call: Any = worker.process
    if kind in ("generator", "async generator"):
        step: Any = next if kind == "generator" else anext
        if worker.execution.generator is None:
            call = partial(_open, worker, step)
        else:
            call, arguments = step, (worker.execution.generator,)
    worker.core.code.execute(worker, call, arguments, when_done(worker))


def _open(worker: RunningNode, step: Callable[[Any], object]) -> object:
    """Begin a source that is a generator, or a function that returns an iterator, and take its first value."""
    iterator = worker.process()  # type: ignore[misc]  # a source has one
    method = "__next__" if step is next else "__anext__"
    if not hasattr(iterator, method):
        if type(iterator) is CoroutineType:
            iterator.close()
        raise TypeError(
            f"it is annotated as an iterator but gave back {type(iterator).__name__}, not one; write `yield` in it, or "
            "`return iter(...)`"
        )
    worker.execution.draw_from(iterator)
    return step(iterator)


def when_done(worker: RunningNode) -> Callable[[Any, BaseException | None], None]:
    """What follows when the process function is over."""
    ticket = worker.ticket

    def done(result: object, error: BaseException | None) -> None:
        if worker.ticket != ticket:
            return  # X2: it came too late, its firing was given up
        if error is None:
            complete_firing(worker, result)
        elif ends_itself(worker, error):
            end_itself(worker)
        else:
            worker.core.rules.fail(worker, f"firing {worker.counts.firings}", error, answer=True)

    return done


def complete_firing(worker: RunningNode, result: object) -> None:
    """The process function ran to its end: its outputs leave together (F3)."""
    if type(result) is CoroutineType and not worker.group.threaded:
        # a plain function has called an async one, or a generator has yielded a call of one
        worker.core.code.drive(worker, result, when_done(worker))
        return
    if worker.shape.single and worker.written is None and type(result) not in _OF_ITS_OWN_KIND:
        put_value(worker, result)
        written = [None if result is None else (result, None, None)] if worker.shape.announced else None
    else:
        try:
            if type(result) is CoroutineType:
                raise refuse_coroutine(worker, result)
            written = merge(worker, result, worker.written)
        except Exception as error:
            worker.core.rules.fail(worker, f"firing {worker.counts.firings}", error, answer=True)
            return
        put_outputs(worker, written)
    if worker.shape.announced:
        announce(worker, written)
    if worker.shape.remembers:
        worker.execution.recall()
    finish_firing(worker, "done")


def merge(
    worker: RunningNode, result: object, written: list[Any] | None, parameters: dict[str, Any] | None = None
) -> list[Any] | None:
    """Join what was returned with what was sent; both for one output is writing twice (F3).

    Args:
      worker: whose firing is over.
      result: the result of its function.
      written: what it has sent, by output.
      parameters: what the node's were in this firing; by default as they are now.
    """
    node_type = worker.type
    if result is not None:
        values = worker.node._split(result)
        if written is None:
            written = [None] * len(worker.out_edges)
        for position, value in enumerate(values):
            if value is None:
                continue
            if written[position] is not None:
                raise UsageError(
                    f'output "{worker.path}.{worker.out_names[position]}" was written twice in one '
                    f"firing: return or send, once"
                )
            written[position] = unwrapped(value)
    if worker.core.debug:
        _check_values(worker, written)
    if node_type is not None and node_type.parameters:
        written = _add_parameters(worker, written, worker.node._parameters if parameters is None else parameters)
    return written


def _check_values(worker: RunningNode, written: list[Any] | None) -> None:
    """In debug mode: what leaves is of its output's type, and what was taken is as it was (T1)."""
    sharing.need_unchanged(worker)
    for position, (name, spec) in enumerate(worker.type.outputs.items() if written is not None else ()):
        entry = written[position]  # type: ignore[index]
        if entry is None:
            continue
        if not accepts(entry[0], spec.type):
            raise TypeError(
                f'output "{worker.path}.{name}" is declared {describe(spec.type)}, got {describe_value(entry[0])}'
            )
        sharing.need_unwritten(worker, name, entry[0])


def _add_parameters(worker: RunningNode, written: list[Any] | None, parameters: dict[str, Any]) -> list[Any]:
    """P8: a connected parameter sends its value with each firing that is not silent."""
    if written is None:
        written = [None] * len(worker.out_edges)
    for position in range(len(worker.type.outputs), len(worker.out_names)):
        value = parameters[worker.out_names[position]]
        written[position] = (own_copy(value), None, None)  # the node may change its own (T1)
    return written


def writer(worker: RunningNode, position: int) -> Callable[[Any, int | None, float | None], None]:
    """What the `send` of an output does: `write`, with the plain case at hand."""

    def emit(value: Any, activity: int | None, stamp: float | None) -> None:
        if worker.busy == "firing" and worker.written is None and value is not None and type(value) is not Token:
            worker.write(position, (value, activity, stamp))
        else:
            write(worker, position, value, activity, stamp)

    return emit


def write(worker: RunningNode, position: int, value: object, activity: int | None, stamp: float | None) -> None:
    """A node's code writes to an output: it leaves when the firing is over (F3).

    Raises:
      UsageError: outside a firing (also in a slot handler, F9), or twice in one firing.
    """
    if worker.busy not in ("firing", "ending") and (worker.region is None or not worker.region.is_sending(worker)):
        called = worker.busy == "call" or (not worker.busy and worker.stamp is not None)  # the fast path of calls
        where = "in a slot handler" if called else "outside a firing"
        raise UsageError(
            f'output "{worker.path}.{worker.out_names[position]}" was written {where}: outputs belong to process() and '
            "end(); trigger an event instead"
        )
    entry = entry_of(worker, position, worker.written, value, activity, stamp)
    if entry is not None:
        worker.write(position, entry)


def entry_of(
    worker: RunningNode, position: int, written: list[Any] | None, value: Any, activity: int | None, stamp: float | None
) -> tuple[Any, int | None, float | None] | None:
    """What a node's code writes to an output of which nothing was written before; None is silence (T2).

    Raises:
      UsageError: something was.
    """
    if value is None:
        return None
    if written is not None and written[position] is not None:
        raise UsageError(
            f'output "{worker.path}.{worker.out_names[position]}" was written twice in one firing: it takes one token, '
            "merge the values or use an event"
        )
    return unwrapped(value, activity, stamp)


def finish_firing(worker: RunningNode, outcome: FiringOutcome) -> None:
    """The automatic events follow (A9), then the firing is over and releases what it took (F5)."""
    core = worker.core
    if worker.execution.limit_timer is not None:
        worker.execution.end_limit()
    if worker.events_due is not None:
        send_automatic(worker)
    if core.trace is not None:
        if outcome == "done" and worker.blocked & DISABLED:
            outcome = "abandoned"  # disabled meanwhile, with a subgraph around it: its outputs went nowhere (F10)
        core.trace(FiringEnded(core.now(), worker.path, worker.counts.firings, outcome))
    released = worker.end_firing()
    if released:
        release(released)
    worker.leave()
    idle_again(worker)
    if core.sharing is not None:
        core.sharing.sweep()
