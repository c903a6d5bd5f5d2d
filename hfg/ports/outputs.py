"""Outputs: synchronous sending, exactly one token on every edge for each firing (rule F3).

Beside each stands an event, `sent`, where asynchronous and lossy edges begin (rule A9). Stands on `base`, `events`
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
from hfg.ports.base import Kind, Owner, Port, Source
from hfg.ports.events import EventPort
from hfg.ports.relays import InnerTarget, inner_target

__all__ = ["Output", "OutputPort"]

T = TypeVar("T")


Loaner: TypeAlias = "Callable[[tuple[int, ...], np.dtype[Any]], np.ndarray[Any, Any] | None]"
"""Gives an array that lies where it can be sent without being copied, or None if it has none."""


class OutputPort(Port, Source[T]):
    """The output of one node."""

    __slots__ = ("_emit", "_inner", "_loaner")

    kind: ClassVar[Kind] = "output"
    _inner: InnerTarget[T]

    def __init__(self, node: Owner, name: str, type: Any) -> None:  # noqa: A002
        super().__init__(node, name, type)
        # Whoever runs the node puts its own function here: (value, activity, stamp) -> None.
        self._emit: Callable[[Any, int | None, float | None], None] = self._refuse
        self._loaner: Loaner | None = None

    def send(self, value: T | Token[T] | None, *, activity: int | None = None, stamp: float | None = None) -> None:
        """Write what leaves when the firing is over, with all outputs together (rule F3).

        Args:
          value: None is silence (rule T2); a received token passed on keeps its modifier and its stamp.
          activity: an explicit modifier (-1, 0, +1) for active edges (rule A4): 0 holds the activity back, +1 takes
            that of an active sender; without one, rule A3 decides.
          stamp: in seconds; without one, rule T5 decides.

        Raises:
          NotRunning: nobody runs the node.
          UsageError: the output was already written in this firing, or this is no firing.
        """
        self._emit(value, activity, stamp)

    def loan(self, shape: int | tuple[int, ...], dtype: npt.DTypeLike = np.float64) -> np.ndarray[Any, Any]:
        """Give an array to fill and to send here; what is in it at first is nobody's.

        Where the output leads to another process of this host and the array is large, it lies in the memory that both
        share, and so is not copied; else it is an ordinary one, as from `numpy.empty`. Once it was sent it cannot be
        written to any more.
        """
        size, kind = (shape,) if isinstance(shape, int) else tuple(shape), np.dtype(dtype)
        loaned = None if self._loaner is None else self._loaner(size, kind)
        return np.empty(size, kind) if loaned is None else loaned

    def _loan_from(self, loaner: Loaner) -> None:
        """Be given what `loan` asks; where an output leads to several processes, the first edge's."""
        if self._loaner is None:
            self._loaner = loaner

    @property
    def sent(self) -> EventPort[T]:
        """The event that tells what a firing has sent here: not when it was silent, and never END (rule A9).

        For consumers at a pace of their own: nobody waits for them, and the edge says what becomes of what they miss.
        """
        event: EventPort[T] = self.node._port("event", sent_name(self.name))
        return event

    @property
    def inner(self) -> InnerTarget[T]:
        """Its side that looks into a subgraph."""
        try:
            return self._inner
        except AttributeError:
            self._inner = inner_target(self)
            return self._inner

    def _refuse(self, value: Any, activity: int | None, stamp: float | None) -> None:
        raise self._not_running("send")


class Output(Generic[T]):
    """Declare an output in a class body; `type` is what it sends, any type hint."""

    kind: ClassVar[Kind] = "output"

    def __init__(self, type: TypeForm[T]) -> None:  # noqa: A002
        self.type: Any = type
        self.inferred = False  # read from a function, not written in a class body
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
