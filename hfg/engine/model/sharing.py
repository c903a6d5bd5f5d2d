"""Values that are shared do not change (rule T1): debug mode locks arrays, and finds out what changes all the same.

While a value is on an edge, or the node that has taken it works, the arrays in it are read-only. Other values that can
be inspected cheaply are compared with what they were when they were sent. Who still works is read from the edges and
nodes themselves, so nothing stays locked, whatever happens to a token.
"""

from __future__ import annotations

import gc
import inspect
import re
import sys
import weakref
from collections import deque
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import chain, islice
from types import FrameType
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from hfg.base.token import Marker, Token
from hfg.engine.model.running_node import RunningNode
from hfg.errors import in_words
from hfg.nodetypes.node import Node
from hfg.ports.edges import NUMBER, Edge, Lying, SyncEdge

__all__ = ["DEPTH", "Sharing"]

Array = npt.NDArray[Any]

DEPTH: Final = 4
"""How many containers deep arrays are looked for, and values compared."""

_MOST_PARTS: Final = 1000  # of one value
_SAMPLE: Final = 4096  # elements of an array, spread over it: a megapixel takes some 20 us
_SMALL_AXIS: Final = 16  # that short an axis, as of colours, is not thinned out
_MOST_REMEMBERED: Final = 256
_READ_ONLY: Final = re.compile("read-?only")
_CANNOT_CHANGE: Final = frozenset({int, float, complex, bool, str, bytes, type(None), Marker})


class _Look:
    """One walk through a value."""

    def __init__(self) -> None:
        self.arrays: list[Array] = []  # those that were found
        self._left = _MOST_PARTS

    def of(self, value: object) -> object:
        """Return a snapshot of the value to compare later; for a value that cannot be inspected, its identity."""
        try:
            return self._at(value, DEPTH)
        except RuntimeError:  # a thread changes it at this moment
            return object()
        except Exception:  # it cannot be inspected
            return id(value)

    def _at(self, value: object, depth: int) -> object:
        kind = type(value)
        if kind in _CANNOT_CHANGE:
            return value
        if isinstance(value, np.ndarray):
            self.arrays.append(value)
            return _sample(value)
        if isinstance(value, bytearray):
            return len(value), bytes(value[:_SAMPLE])
        parts = _parts(value) if depth else None
        if parts is None:
            return id(value)
        found: list[Any] = [kind, len(parts)]
        for part in parts:
            self._left -= 1
            if self._left < 0:
                break
            found.append(self._at(part, depth - 1))
        return tuple(found)


def _parts(value: object) -> Collection[object] | None:
    """Return the parts of a container or record, as something with a length; None: it cannot be inspected."""
    kind: Any = type(value)
    if isinstance(value, dict):
        return [part for item in islice(list(value.items()), _MOST_PARTS) for part in item] + [len(value)]
    if isinstance(value, list | tuple | deque | set | frozenset):
        return value
    for names in ("__dataclass_fields__", "__struct_fields__"):
        if hasattr(kind, names):
            return [getattr(value, name, None) for name in getattr(kind, names)]
    if hasattr(kind, "__attrs_attrs__"):
        return [getattr(value, one.name, None) for one in kind.__attrs_attrs__]
    return None


def _sample(array: Array) -> object:
    large = sum(length > _SMALL_AXIS for length in array.shape)
    if array.size > _SAMPLE and large:
        step = int(np.ceil((array.size / _SAMPLE) ** (1 / large)))
        array = array[tuple(slice(None, None, step if length > _SMALL_AXIS else 1) for length in array.shape)]
    return array.shape, hash(array.tobytes())


def _whole(array: Array) -> list[Array]:
    """Return the array and those that it is a view of, the owner of the memory first."""
    found = [array]
    while isinstance(found[-1].base, np.ndarray):
        found.append(found[-1].base)
    found.reverse()
    return found


def _can_be_unlocked(owner: Array) -> bool:
    """Return whether numpy would let us make it writeable again; borrowed memory may not be."""
    if owner.base is None:
        return owner.flags.owndata
    try:
        with memoryview(owner.base) as lent:  # type: ignore[arg-type]
            return not lent.readonly
    except (TypeError, BufferError, ValueError):
        return False


@dataclass(slots=True, eq=False)
class _Lock:
    """Keeps one piece of memory read-only as long as anything holds it."""

    arrays: dict[int, Array] = field(default_factory=dict)  # those that were writeable, the owner of the memory first
    holders: int = 0

    def hold(self, arrays: Iterable[Array]) -> None:
        """Add a holder."""
        self.holders += 1
        for array in arrays:
            if array.flags.writeable:
                array.flags.writeable = False
                self.arrays[id(array)] = array

    def release(self) -> None:
        """Remove a holder. The last one makes arrays writeable again, owners before their views, as numpy requires."""
        self.holders -= 1
        if not self.holders:
            for array in self.arrays.values():
                with suppress(ValueError):  # something else has made its owner read-only meanwhile
                    array.flags.writeable = True
            self.arrays.clear()


@dataclass(slots=True, eq=False)
class _Lease:
    """One token in use: on its edge, then by the firing or call that has taken it."""

    edge: Edge
    number: int  # of the token on its edge
    value: object
    looks: object  # a snapshot of the value when it was sent
    locks: list[int] = field(default_factory=list)  # by owner of memory
    ticket: int = 0  # of the firing or call that has taken it
    firing: int = 0  # its number, because several may be in progress at once (F14); 0: a call
    senders_ticket: int = 0  # the ticket of its sender at that time

    def take(self, node: RunningNode) -> None:
        """The current firing or call of the node has taken it."""
        self.ticket = node.ticket
        self.firing = node.counts.firings if node.busy == "firing" else 0
        self.senders_ticket = self.edge.source.ticket

    def is_changed(self) -> bool:
        """Return whether the value differs from the last snapshot; each difference is reported once."""
        before, self.looks = self.looks, _Look().of(self.value)
        return bool(self.looks != before)


@dataclass(slots=True, eq=False)
class _Sent:
    """Memory that was sent."""

    array: weakref.ref[Array]
    looks: object  # a snapshot of its content
    refs: dict[int, int] = field(default_factory=dict)  # references then, by call stack: each stack holds some itself

    def is_held_beside(self, array: Array, way: int, refs: int) -> bool:
        """Return whether something holds it besides the node that sends this array over the same memory now."""
        known = self.array()
        if known is None:
            return False
        return known is not array or self.refs.get(way, refs) < refs

    def sent_again(self, looks: object, way: int, refs: int) -> None:
        """It is sent with this content, from this call stack."""
        self.looks = looks
        self.refs.setdefault(way, refs)


class Sharing:
    """Which nodes use which values of a run; only on the loop."""

    def __init__(self) -> None:
        self._lying: dict[Edge, deque[_Lease]] = {}
        self._at_work: dict[RunningNode, list[_Lease]] = {}
        self._locks: dict[int, _Lock] = {}
        self._sent: dict[Any, _Sent] = {}
        self._last_locked: dict[int, tuple[weakref.ref[Array], Edge]] = {}

    # --- the way of a value -----------------------------------------------------------------------------------------

    def rewritten(self, value: object) -> bool:
        """Return whether a node sends memory again, with other content, while something holds what it sent before."""
        if type(value) in _CANNOT_CHANGE:
            return False
        self.sweep()
        look = _Look()
        look.of(value)
        found = False
        while look.arrays:
            array = look.arrays.pop()
            found = self._is_rewritten(array) or found
        return found

    def _is_rewritten(self, array: Array) -> bool:
        where = array.__array_interface__["data"][0], array.shape, array.strides
        looks, way = _sample(array), _way()
        before = self._sent.get(where)
        refs = self._count(array)
        held = before is not None and before.looks != looks and before.is_held_beside(array, way, refs)
        if held and before is not None:
            gc.collect()  # references from garbage do not count
            refs = self._count(array)
            held = before.is_held_beside(array, way, refs)
        if before is None or before.array() is not array:
            before = self._sent[where] = _Sent(weakref.ref(array, lambda _: self._sent.pop(where, None)), looks)
        before.sent_again(looks, way, refs)
        return held

    def _count(self, array: Array) -> int:
        """Return the number of references to it, without its lock."""
        return sys.getrefcount(array) - any(id(array) in lock.arrays for lock in self._locks.values())

    def sent(self, edge: Edge, token: Token[Any]) -> None:
        """A token is put on an edge: from now on it is shared."""
        value = token.value
        if type(value) in _CANNOT_CHANGE:
            return
        look = _Look()
        lease = _Lease(edge, token.sequence, value, look.of(value))
        for array in look.arrays:
            whole = _whole(array)
            owner = id(whole[0])
            if owner in self._locks or (whole[0].flags.writeable and _can_be_unlocked(whole[0])):
                self._remember(edge, whole[0])
                self._locks.setdefault(owner, _Lock()).hold(whole)
                lease.locks.append(owner)
        self._lying.setdefault(edge, deque()).append(lease)

    def _remember(self, edge: Edge, owner: Array) -> None:
        """Remember what was locked: a thread may notice it only after the lock is gone."""
        if len(self._last_locked) > _MOST_REMEMBERED:
            self._last_locked.clear()
        self._last_locked[id(owner)] = weakref.ref(owner), edge

    def take(self, worker: RunningNode, edges: Sequence[Edge], tokens: Sequence[Token[Any]]) -> list[Edge]:
        """A firing or call has taken these tokens. Return the edges on which a value was changed meanwhile."""
        changed = []
        for edge, token in zip(edges, tokens, strict=True):
            leases = self._lying.get(edge)
            while leases and leases[0].number < token.sequence:
                self._end(leases.popleft())
            if leases and leases[0].number == token.sequence:
                lease = leases.popleft()
                lease.take(worker)
                self._at_work.setdefault(worker, []).append(lease)
                if lease.is_changed():
                    changed.append(edge)
        self.sweep()
        return changed

    def changed_by(self, worker: RunningNode) -> tuple[Edge, bool] | None:
        """Its code has ended. Return the edge of a value that it took and that has changed, if there is one.

        Also return whether the sender's code ran meanwhile.
        """
        for lease in self._at_work.get(worker, ()):
            if lease.is_changed():
                return lease.edge, lease.edge.source.ticket != lease.senders_ticket
        return None

    def sweep(self) -> None:
        """Release what is not in use any more."""
        for edge, leases in list(self._lying.items()):
            oldest = _oldest(edge)
            while leases and (oldest is None or leases[0].number < oldest):
                self._end(leases.popleft())
            if not leases:
                del self._lying[edge]
        for worker, taken in list(self._at_work.items()):
            ticket = worker.ticket if worker.busy else None
            beside = () if worker.concurrent is None else {one.number for one in worker.concurrent if not one.outcome}
            going_on = [lease for lease in taken if lease.ticket == ticket or lease.firing in beside]
            if len(going_on) == len(taken):
                continue
            for lease in taken:
                if lease not in going_on:
                    self._end(lease)
            if going_on:
                self._at_work[worker] = going_on
            else:
                del self._at_work[worker]

    def end(self) -> None:
        """The run is over: release everything."""
        for lease in chain(*self._lying.values(), *self._at_work.values()):
            self._end(lease)
        self._lying.clear()
        self._at_work.clear()

    def _end(self, lease: _Lease) -> None:
        for owner in lease.locks:
            lock = self._locks[owner]
            lock.release()
            if not lock.holders:
                del self._locks[owner]

    # --- who has tried ----------------------------------------------------------------------------------------------

    def explain(self, worker: RunningNode, error: BaseException) -> str | None:
        """Describe what a node's code tried to write to, if it failed because this class made that read-only."""
        if not isinstance(error, Exception) or _READ_ONLY.search(in_words(error)) is None:
            return None
        for arrays in _arrays_in_frames(error):
            ours = [(name, owner) for name, array in arrays for owner in _whole(array)[:1] if self._is_ours(owner)]
            if any(not array.flags.writeable and not self._is_ours(_whole(array)[0]) for _, array in arrays):
                return None  # it may be that one
            if not ours:
                continue
            name, owner = ours[0]
            for lease in self._at_work.get(worker, ()):
                if id(owner) in lease.locks:
                    return (
                        f'it wrote into the array that it took from "{lease.edge.label}", which others may use too, '
                        f"so it is read-only (T1): change a copy, as in {name}.copy()"
                    )
            edge = self._last_locked[id(owner)][1]
            whose = "it has" if edge.source is worker else f'"{edge.source.path}" has'
            return (
                f'it wrote into the array that {whose} sent on "{edge.label}" and that was in use there, so it was '
                f"read-only (T1): send a copy, as in {name}.copy(), or a new array each time"
            )
        return None

    def _is_ours(self, owner: Array) -> bool:
        """Return whether it is locked, or was recently."""
        remembered = self._last_locked.get(id(owner))
        return remembered is not None and remembered[0]() is owner


def _oldest(edge: Edge) -> int | None:
    """Return the number of the oldest token on an edge; None: there is none."""
    if isinstance(edge, SyncEdge):
        return None if edge.token is None else edge.token.sequence
    queue: deque[Lying] = edge.queue  # type: ignore[attr-defined]
    return queue[0][NUMBER] if queue else None


def _way() -> int:
    """Return a hash of the call stack."""
    frame: FrameType | None = inspect.currentframe()
    found = []
    while frame is not None:  # to its end: a firing may have begun inside the end of another, with what that has
        found.append(id(frame.f_code))
        frame = frame.f_back
    return hash(tuple(found))


def _arrays_in_frames(error: BaseException) -> Iterator[list[tuple[str, Array]]]:
    """Yield the names and arrays that the failed code could access, by stack frame, the innermost first."""
    frames = []
    place = error.__traceback__
    while place is not None:
        frames.append(place.tb_frame)
        place = place.tb_next
    for frame in reversed(frames):
        arrays = []
        for name, value in frame.f_locals.items():
            if isinstance(value, Node):
                parts = ((f"{name}.{own}", part) for own, part in vars(value).items())
            else:
                parts = (one for one in [(name, value)])
            for found, part in parts:
                look = _Look()
                look.of(part)
                arrays += [(found, array) for array in look.arrays]
        yield arrays
