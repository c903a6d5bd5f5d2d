"""Outputs: synchronous sending, exactly one token on every edge per firing (rule F3).

Each output has an event, `sent`, from which asynchronous and lossy edges start (rule A9). Depends on `base`, `events`
and `automatic`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, Generic, Self, TypeAlias, TypeVar, overload

import numpy as np
import numpy.typing as npt
from typing_extensions import TypeForm

from hfg.base.token import Token
from hfg.ports.automatic import sent_name
from hfg.ports.base import Kind, Owner, Port, Source, need_sendable
from hfg.ports.events import EventPort
from hfg.ports.relays import InnerTarget, inner_target

__all__ = ["Output", "OutputPort"]

T = TypeVar("T")


Loaner: TypeAlias = "Callable[[tuple[int, ...], np.dtype[Any]], np.ndarray[Any, Any] | None]"
"""Returns an array in memory that can be sent without a copy, or None if there is none."""


class OutputPort(Port, Source[T]):
    """The output of one node."""

    __slots__ = ("_emit", "_inner", "_loaner")

    kind: ClassVar[Kind] = "output"
    _inner: InnerTarget[T]

    def __init__(self, node: Owner, name: str, type: Any) -> None:  # noqa: A002
        super().__init__(node, name, type)
        self._emit: Callable[[Any, int | None, float | None], None] = self._refuse
        self._loaner: Loaner | None = None

    def send(self, value: T | Token[T] | None, *, activity: int | None = None, stamp: float | None = None) -> None:
        """Write the value to send. It leaves together with all other outputs when the firing is over (rule F3).

        Args:
          value: None is silence (rule T2); a received token that is passed on keeps its modifier and its stamp.
          activity: an explicit modifier (-1, 0, +1) for active edges (rule A4): 0 holds the activity back, +1 takes
            that of an active sender; by default, rule A3 decides.
          stamp: in seconds; by default, rule T5 decides.

        Raises:
          NotRunning: the node is not part of a run.
          UsageError: the output was already written in this firing, no firing is in progress, or the modifier or the
            stamp is invalid.
        """
        if activity is not None or stamp is not None or type(value) is Token:
            need_sendable(value, activity, stamp)
        self._emit(value, activity, stamp)

    def loan(self, shape: int | tuple[int, ...], dtype: npt.DTypeLike = np.float64) -> np.ndarray[Any, Any]:
        """Return an array to fill and to send here; its initial contents are undefined.

        If the output leads to another process of this host and the array is large, the array is in memory that both
        processes share, and is not copied. Otherwise it is an ordinary array, as from `numpy.empty`. Once sent, it is
        read-only.
        """
        size, kind = (shape,) if isinstance(shape, int) else tuple(shape), np.dtype(dtype)
        loaned = None if self._loaner is None else self._loaner(size, kind)
        return np.empty(size, kind) if loaned is None else loaned

    def _loan_from(self, loaner: Loaner) -> None:
        """Set the source of `loan`'s arrays. If an output leads to several processes, the first edge's is used."""
        if self._loaner is None:
            self._loaner = loaner

    @property
    def sent(self) -> EventPort[T]:
        """The event that repeats each value that firings send here, but neither silence nor END (rule A9).

        Use it for consumers that work at their own pace: the node does not wait for them, and the edge sets what
        happens to tokens they miss.
        """
        event: EventPort[T] = self.node._port("event", sent_name(self.name))
        return event

    @property
    def inner(self) -> InnerTarget[T]:
        """Its side inside a subgraph."""
        try:
            return self._inner
        except AttributeError:
            self._inner = inner_target(self)
            return self._inner

    def _connect(self, emit: Callable[[Any, int | None, float | None], None]) -> None:
        """Send values with this function from now on; for the runner."""
        self._emit = emit

    def _disconnect(self) -> None:
        """Refuse values again; for the runner."""
        self._emit = self._refuse

    def _refuse(self, value: Any, activity: int | None, stamp: float | None) -> None:
        raise self._not_running("send")


class Output(Generic[T]):
    """Declare an output in a class body; `type` is the type of its values, any type hint."""

    kind: ClassVar[Kind] = "output"

    def __init__(self, type: TypeForm[T]) -> None:  # noqa: A002
        self.type: Any = type
        self.inferred = False  # read from a function instead of a class body
        self.name = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = self.name or name

    @overload
    def __get__(self, node: None, owner: Any) -> Self: ...
    @overload
    def __get__(self, node: Owner, owner: Any) -> OutputPort[T]: ...
    def __get__(self, node: Any, owner: Any) -> Any:
        return self if node is None else node._port("output", self.name)

    def __repr__(self) -> str:
        return f"<Output {self.name}>"
