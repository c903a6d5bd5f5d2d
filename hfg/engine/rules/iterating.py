"""When the border of a subgraph that iterates lets the next element in (rule G4).

Outside it is one node that fires; its firing is over when the last element has gone to quiet inside. Depends on
`firing` and `quiet`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hfg.base.token import NO_MESSAGE, Marker
from hfg.engine.model import Core, Iteration, RunningNode
from hfg.engine.rules import firing, quiescence, rings, waits
from hfg.engine.rules.releasing import take_from_reader
from hfg.engine.rules.sending import put_outputs

__all__ = ["begin", "settle", "step"]


def begin(worker: RunningNode, arguments: Sequence[Any]) -> None:
    """The subgraph fires: its first element goes in. Collections of unequal length are an error of the firing (X1)."""
    iteration = worker.iteration
    assert iteration is not None
    try:
        iteration.begin(dict(zip(worker.type.inputs, arguments, strict=True)), worker.options.iterate_over)
    except Exception as error:  # a value that is not a collection may raise anything
        worker.core.rules.fail(worker, f"firing {worker.counts.firings}", error, answer=True)
        return
    worker.core.iterating.append(iteration)
    _go_on(iteration)


def settle(core: Core) -> bool:
    """Go on with those firings of what iterates whose inside is quiet, the inner ones first.

    Whether there were any.
    """
    went_on = False
    for iteration in reversed(list(core.iterating)):
        went_on |= _settle(iteration)
    return went_on


def step(worker: RunningNode) -> None:
    """The next piece of work of a worker inside; if nothing moves there any more, the next element follows at once."""
    if worker.is_boundary_output:
        _collect(worker)
    else:
        firing.step(worker)
    around: Iteration | None = worker.within
    while around is not None and _settle(around) and not around.is_under_way:
        around = around.worker.within  # its end may have been the last that moved there


def _settle(iteration: Iteration) -> bool:
    """If the inside is quiet, and no ring there waits for a longer queue (F8), go on; whether it was."""
    core = iteration.worker.core
    if not iteration.is_under_way or core.over or iteration.is_moving():
        return False
    if core.full_edges and any([waits.is_held(worker) for worker in iteration.members]):  # noqa: C419 - each sets its timer
        if rings.resolve(core):
            return True
        if iteration.is_moving():
            return False
    _go_on(iteration)
    return True


def _go_on(iteration: Iteration) -> None:
    """Let the next element in; after the last one, the firing is over.

    An edge of the border holds one token, as any synchronous one does (P4): an element before which the last one lies
    untaken, where nothing moves any more, is an error of the firing (X1).
    """
    worker = iteration.worker
    if iteration.next_element():
        occupied = [edge for feed in iteration.feeds for edge in feed.all_out_edges() if edge.unprocessed]
        if occupied:
            _fail(iteration, occupied)
            return
        for feed in iteration.feeds:
            value = iteration.value(feed.port_name)
            put_outputs(feed, [(NO_MESSAGE if value is None else value, None, worker.stamp)])
        return
    worker.core.iterating.remove(iteration)
    for position, values in enumerate(iteration.end().values()):
        worker.write(position, (values, None, None))
    firing.complete_firing(worker, None)


def _fail(iteration: Iteration, occupied: Sequence[Any]) -> None:
    """The present element cannot go in."""
    worker = iteration.worker
    labels = ", ".join(f'"{edge.label}"' for edge in occupied[:3])
    target: RunningNode = occupied[0].target
    who = "" if target.is_boundary_output else f'"{target.path}" '
    problem = ValueError(
        f"element {iteration.position} of {iteration.count} cannot go in, for the one before lies untaken on {labels} "
        f"and nothing moves inside any more: {who}{quiescence.waits_for(target)}; let each element be taken"
    )
    worker.core.iterating.remove(iteration)
    iteration.end()
    worker.core.rules.fail(worker, f"firing {worker.counts.firings}", problem, answer=True)


def _collect(reader: RunningNode) -> None:
    """A token at an output of the inside comes out."""
    reader.dequeued()
    iteration = reader.within
    assert iteration is not None
    while reader.live_inputs and not reader.inputs.missing:
        token = take_from_reader(reader)
        if type(token.value) is not Marker:
            iteration.keep(reader.port_name, token.value)
