"""What a node does next: a firing (rules F1-F4, F9, F11, P6, P8, A6, A11, T5).

The interpreted way; the wing `fusion` shortens it for plain shapes, and falls back to it. Depends on `ending` and
`calls`; a node's code is run by the host.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from types import CoroutineType
from typing import Any

from hfg.base.token import Marker, Token
from hfg.engine.model.running_node import DISABLED, NO_CALLS, UNREADY, RunningNode
from hfg.engine.rules import sharing
from hfg.engine.rules.agenda import consider, idle_again
from hfg.engine.rules.calls import call, refuse_coroutine, set_parameter
from hfg.engine.rules.ending import end, end_itself, ends_itself
from hfg.engine.rules.firing_kinds import kind_of
from hfg.engine.rules.modifiers import derive_scopes, receive, touch
from hfg.engine.rules.outputs import merge
from hfg.engine.rules.releasing import make_room, release
from hfg.engine.rules.sending import announce, put_outputs, put_value, send_automatic
from hfg.engine.rules.wiring import rewire
from hfg.errors import EndOfStream
from hfg.ports.edges import VALUE, AnyEdge
from hfg.trace import FiringEnded, FiringKind, FiringOutcome, FiringStarted, TokenTaken

__all__ = [
    "arguments_of",
    "complete_firing",
    "finish_firing",
    "fire",
    "newest_stamp",
    "note_start",
    "receive_modifiers",
    "step",
    "take",
    "values_of",
    "when_done",
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
    kind: Any = "end" if ends else kind_of(worker, edges, tokens)
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
    _carry_out(worker, kind, edges, tokens, refused)


def _carry_out(
    worker: RunningNode, kind: Any, edges: Sequence[AnyEdge], tokens: Sequence[Token[Any]], refused: Exception | None
) -> None:
    """Do what F4 has decided; `refused`: a parameter could not be set, so the firing fails (P8)."""
    core = worker.core
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


def _free_places(worker: RunningNode, edges: Sequence[AnyEdge]) -> None:
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


def _set_parameters(worker: RunningNode, edges: Sequence[AnyEdge], tokens: Sequence[Token[Any]]) -> Exception | None:
    """P8: a token sets the parameter when it is taken, also in a silent firing; gives why one cannot be set."""
    for edge, token in zip(edges, tokens, strict=True):
        if edge.target_kind == "parameter" and type(token.value) is not Marker:
            try:
                set_parameter(worker, edge.port_name, token.value)
            except Exception as error:
                return error
    return None


def arguments_of(worker: RunningNode, edges: Sequence[AnyEdge], tokens: Sequence[Token[Any]]) -> list[Any]:
    """One argument per declared input: the value, the token if asked for, the default if absent (P6)."""
    arguments = list(worker.unset)
    for edge, token in zip(edges, tokens, strict=True):
        if edge.target_kind == "input" and type(token.value) is not Marker:
            arguments[edge.position] = token if worker.wants_token[edge.position] else token.value
    return arguments


def values_of(edges: Sequence[AnyEdge], tokens: Sequence[Token[Any]]) -> dict[str, Any]:
    """Return the values that were taken, by the name of the input."""
    return {
        edge.port_name: token.value
        for edge, token in zip(edges, tokens, strict=True)
        if edge.target_kind == "input" and type(token.value) is not Marker
    }


def _run_process(worker: RunningNode, edges: Sequence[AnyEdge], tokens: Sequence[Token[Any]]) -> None:
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
