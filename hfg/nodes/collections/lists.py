"""Lists: built, joined, taken apart, put in order, searched. Depends on functions, nodetype and ports."""

from __future__ import annotations

import itertools
import random
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Annotated, Any, Literal, TypeVar

from annotated_types import Interval

from hfg.nodes._equality import same
from hfg.nodes.collections.fields import read_field
from hfg.nodetypes.functions import node
from hfg.nodetypes.node import Node
from hfg.ports import Event, Input, Inputs, Output, Parameter, State, slot

T = TypeVar("T")


# --- building ---


@node(inputs={"items": Inputs(Any, 2)}, outputs=list[Any])
def build_list(*items: Any) -> list[Any]:
    """Make a list of the values at all inputs, in their order.

    Fires once all inputs hold a token; silence at one of them is silence, and the end of one is the end.

    Args:
      items: any number of values.

    CS::APEX: csapex::VectorGenerate.
    """
    return list(items)


@node(inputs={"lists": Inputs(Sequence[Any], 2)}, outputs=list[Any])
def merge_lists(*lists: Sequence[Any]) -> list[Any]:
    """Concatenate the lists at all inputs.

    Fires once all inputs hold a token; silence at one of them is silence, and the end of one is the end.

    Args:
      lists: any number of lists.

    CS::APEX: csapex::VectorMerge.
    """
    return list(itertools.chain(*lists))


@node
def append_item(items: Sequence[T], item: T) -> list[T]:
    """Append a value to a list.

    Args:
      items: the list, which stays as it is; the answer is a new one.
      item: the value.
    """
    return [*items, item]


@node
def repeat_item(item: T, *, times: Annotated[int, Interval(ge=0, le=1_000_000)] = 2) -> list[T]:
    """Make a list that has one value several times.

    Args:
      item: the value.
      times: how often.
    """
    return [item] * times


@node(inputs={"lists": Inputs(Sequence[Any], 2)}, outputs=list[tuple[Any, ...]], parameters={"same_length": True})
def zip_lists(*lists: Sequence[Any], same_length: bool) -> list[tuple[Any, ...]]:
    """Make tuples of the first items of all lists, of the second ones, and so on.

    Args:
      lists: any number of lists.
      same_length: whether lists of different lengths are an error; else the shortest one decides.

    Raises:
      ValueError: the lengths differ, and must not.
    """
    lengths = {len(one) for one in lists}
    if same_length and len(lengths) > 1:
        raise ValueError(f"the lists must be of one length, got {', '.join(str(len(one)) for one in lists)}")
    return list(zip(*lists, strict=False))


@node
def enumerate_items(items: Sequence[T], *, start: int = 0) -> list[tuple[int, T]]:
    """Return each item with its number.

    Args:
      items: a list.
      start: the number of the first one.
    """
    return list(enumerate(items, start))


@node
def combine_lists(
    a: Sequence[Any],
    b: Sequence[Any],
    *,
    operation: Literal["union", "intersection", "difference", "symmetric difference"] = "union",
) -> list[Any]:
    """Combine two lists as sets: nothing is there twice, and the order is that of a, then of b.

    Args:
      a: the first list.
      b: the second one.
      operation: items in either, in both, only in a, or in exactly one of them.
    """
    first, second = _unique(a), _unique(b)
    match operation:
        case "union":
            return _unique([*first, *second])
        case "intersection":
            return [item for item in first if _is_in(item, second)]
        case "difference":
            return [item for item in first if not _is_in(item, second)]
        case _:
            alone = [item for item in first if not _is_in(item, second)]
            return alone + [item for item in second if not _is_in(item, first)]


# --- taking apart ---


@node
def size(items: Collection[object]) -> int:
    """Count the items of a list, dict, set or text.

    Args:
      items: any collection.

    CS::APEX: csapex::VectorSize.
    """
    return len(items)


@node
def select_item(items: Sequence[T], *, index: int = 0) -> T:
    """Return one item of a list; drive the parameter `index` by an edge to choose it by a stream.

    Args:
      items: a list.
      index: which one, from 0; negative ones count from the end.

    Raises:
      IndexError: the list is too short.

    CS::APEX: csapex::SelectVectorComponent.
    """
    if not -len(items) <= index < len(items):
        raise IndexError(f"there is no item {index} in a list of {len(items)}")
    return items[index]


@node
def slice_items(items: Sequence[T], *, start: int | None = None, stop: int | None = None, step: int = 1) -> list[T]:
    """Return a part of a list, as `items[start:stop:step]` does.

    Args:
      items: a list.
      start: the place of the first item, from 0; negative ones count from the end; None is the beginning.
      stop: the index after the last item; None is the end.
      step: every which item; negative ones go backwards.

    Raises:
      ValueError: the step is 0.
    """
    return list(items[start:stop:step])


@node
def chunk_items(items: Sequence[T], *, length: Annotated[int, Interval(ge=1)] = 2) -> list[list[T]]:
    """Part a list into lists of one length; the last one may be shorter.

    Args:
      items: a list.
      length: of each part.
    """
    return [list(items[start : start + length]) for start in range(0, len(items), length)]


@node
def windows(items: Sequence[T], *, length: Annotated[int, Interval(ge=1)] = 2) -> list[list[T]]:
    """Return all windows of consecutive items of a list; none if the list is shorter than a window.

    Args:
      items: a list.
      length: of each window.
    """
    return [list(items[start : start + length]) for start in range(len(items) - length + 1)]


@node
def flatten(items: Sequence[Any], *, depth: Annotated[int, Interval(ge=0, le=100)] = 1) -> list[Any]:
    """Put the items of lists within a list into its place.

    Args:
      items: a list; lists, tuples and sets in it are opened, texts and dicts are not.
      depth: how many levels are opened.
    """
    return list(_opened(items, depth))


def _opened(items: Iterable[Any], depth: int) -> Iterable[Any]:
    for item in items:
        if depth and isinstance(item, list | tuple | set | frozenset):
            yield from _opened(item, depth - 1)
        else:
            yield item


@node
def pluck(items: Sequence[Any], *, field: str = "") -> list[Any]:
    """Return the same field of each item.

    Args:
      items: a list of dicts, records or lists.
      field: a key, the name of a field, or a number, and ways into it: "pose.x"; "" is the item itself.

    Raises:
      LookupError: an item does not have it.
    """
    return [read_field(item, field) for item in items]


# --- order ---


@node
def reverse_items(items: Sequence[T]) -> list[T]:
    """Turn a list round.

    Args:
      items: a list.
    """
    return list(reversed(items))


@node
def sort_items(items: Sequence[Any], *, field: str = "", descending: bool = False) -> list[Any]:
    """Put a list into order; what is equal keeps its order.

    Args:
      items: a list.
      field: of each item by which it is sorted: a key, the name of a field, or a number, and ways into it: "pose.x"; ""
        is the item itself.
      descending: whether the largest comes first.

    Raises:
      TypeError: two items cannot be compared.
      ValueError: nor do two that hold arrays have an order.
      LookupError: an item does not have the field.
    """
    return sorted(items, key=lambda item: read_field(item, field), reverse=descending)


@node
def min_by(items: Sequence[Any], *, field: str = "") -> Any:
    """Return the item whose field is the smallest, the first of several; silent for an empty list.

    Args:
      items: a list.
      field: a key, the name of a field, or a number, and ways into it: "pose.x"; "" is the item itself.

    Raises:
      TypeError: two items cannot be compared.
      ValueError: nor do two that hold arrays have an order.
      LookupError: an item does not have the field.
    """
    return min(items, key=lambda item: read_field(item, field), default=None)


@node
def max_by(items: Sequence[Any], *, field: str = "") -> Any:
    """Return the item whose field is the largest, the first of several; silent for an empty list.

    Args:
      items: a list.
      field: a key, the name of a field, or a number, and ways into it: "pose.x"; "" is the item itself.

    Raises:
      TypeError: two items cannot be compared.
      ValueError: nor do two that hold arrays have an order.
      LookupError: an item does not have the field.
    """
    return max(items, key=lambda item: read_field(item, field), default=None)


class ShuffleItems(Node):
    """Put each list into a random order.

    Every run sends the same ones, and so do two nodes with the same seed.

    Attributes:
      items: a list.
      seed: another seed gives other orders; with None, every run has different ones.
      shuffled: the list in its new order.
    """

    items = Input(Sequence[Any])
    shuffled = Output(list[Any])
    seed = Parameter[int | None](0, type=int | None)
    chance = State[random.Random | None](None)

    def process(self, items: Sequence[Any]) -> list[Any]:
        """Mix it."""
        if self.chance is None:
            self.chance = random.Random(self.seed)
        mixed = list(items)
        self.chance.shuffle(mixed)
        return mixed


# --- asking ---


def _unique(items: Iterable[Any]) -> list[Any]:
    """Return each of equal items once, the first; those that have no hash are compared one by one."""
    found: list[Any] = []
    seen: set[Any] = set()
    others: list[Any] = []
    for item in items:
        try:
            if item in seen:
                continue
            seen.add(item)
        except TypeError:
            if any(same(item, one) for one in others):
                continue
            others.append(item)
        found.append(item)
    return found


def _is_in(item: Any, items: Iterable[Any]) -> bool:
    return any(item is one or same(item, one) for one in items)


@node
def unique_items(items: Sequence[T]) -> list[T]:
    """Return each of equal items once, in the order in which they first come.

    Args:
      items: a list.
    """
    return _unique(items)


@node
def contains_item(items: Collection[object], item: object) -> bool:
    """Say whether a value is in a list; of a dict, whether it is a key.

    Args:
      items: any collection.
      item: the value.
    """
    return _is_in(item, items)


@node
def index_of(items: Sequence[object], item: object) -> int | None:
    """Return the place of a value in a list, from 0, the first of several; silent if it is not there.

    Args:
      items: a list.
      item: the value.
    """
    return next((place for place, one in enumerate(items) if one is item or same(one, item)), None)


@node
def count_item(items: Sequence[object], item: object) -> int:
    """Count how often a value is in a list.

    Args:
      items: a list.
      item: the value.
    """
    return sum(one is item or same(one, item) for one in items)


@node
def filter_items(
    items: Sequence[Any],
    *,
    field: str = "",
    operation: Literal["==", "!=", "<", "<=", ">", ">=", "in", "not in", "is true", "is false"] = "is true",
    value: Any = None,
) -> list[Any]:
    """Keep the items of which something is true.

    Args:
      items: a list.
      field: what is looked at: a key, the name of a field, or a number, and ways into it: "pose.x"; "" is the item
        itself.
      operation: what must hold between it and the value; "in" asks whether it is one of the values in a list.
      value: what it is compared with.

    Raises:
      TypeError: an item cannot be compared with the value, or "in" has no list of values.
      ValueError: the answer is an array and neither true nor false.
      LookupError: an item does not have the field.
    """
    return [item for item in items if _holds(read_field(item, field), operation, value)]


def _holds(one: Any, operation: str, value: Any) -> bool:
    match operation:
        case "==":
            return same(one, value)
        case "!=":
            return not same(one, value)
        case "<":
            return bool(one < value)
        case "<=":
            return bool(one <= value)
        case ">":
            return bool(one > value)
        case ">=":
            return bool(one >= value)
        case "is true":
            return bool(one)
        case "is false":
            return not one
    if not isinstance(value, Collection):
        raise TypeError(f'"{operation}" needs a list of values, got {value!r:.80}: set the parameter "value"')
    return _is_in(one, value) == (operation == "in")


@node
def group_by(items: Sequence[Any], *, field: str = "") -> Mapping[Any, list[Any]]:
    """Part a list into lists of items that have the same field, by what they have in common.

    Args:
      items: a list.
      field: a key, the name of a field, or a number, and ways into it: "pose.x"; "" is the item itself.

    Raises:
      TypeError: what they have in common cannot be the key of a dict, such as a list.
      LookupError: an item does not have the field.
    """
    found: dict[Any, list[Any]] = {}
    for item in items:
        found.setdefault(read_field(item, field), []).append(item)
    return found


# --- one by one ---


class EachItem(Node):
    """Signal each item of a list, then that this was all.

    All signals of a list leave in one firing, in order; the queue of an edge into an input makes room for them. To send
    each item *through* nodes and have a list of what came out, use a subgraph that iterates instead (rule G4): that
    keeps step with the stream.

    Attributes:
      items: a list.
      item: each of its items.
      done: how many they were, after the last one.
    """

    items = Input(Collection[Any])
    item = Event(Any)
    done = Event(int)

    def process(self, items: Collection[Any]) -> None:
        """Signal them."""
        for item in items:
            self.item.trigger(item)
        self.done.trigger(len(items))


class CollectItems(Node):
    """Collect signals into a list, until `finish`.

    With `EachItem.done` at `finish` it undoes what EachItem does. A list that is incomplete when the run ends is not
    sent: finish first.

    Attributes:
      item: each value is appended to the list.
      finish: gives the list and begins a new one.
      at: also send the list as soon as it has this number of items; 0 waits for `finish`.
      collected: the list.
    """

    collected = Event(list[Any])
    at = Parameter(0, Interval(ge=0))
    so_far = State(factory=list[Any])

    @slot
    def item(self, value: Any) -> None:
        """Append it to the list."""
        self.so_far.append(value)
        if len(self.so_far) == self.at:
            self.finish_now()

    @slot
    def finish(self) -> None:
        """Send the list."""
        self.finish_now()

    def finish_now(self) -> None:
        """Send the list and begin a new one."""
        done, self.so_far = self.so_far, []
        self.collected.trigger(done)
