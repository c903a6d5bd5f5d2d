"""Dicts, records and tuples: composed, decomposed, looked up. Depends on functions, nodetype and ports."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any, TypeAlias

from annotated_types import MinLen

from hfg.nodes.collections.fields import read_field, record_fields
from hfg.nodetypes.functions import node
from hfg.nodetypes.node import Node
from hfg.ports import Event, Input, Inputs, Output, Outputs, Parameter, State, slot

MapOrFunction: TypeAlias = Mapping[Any, Any] | Callable[[Any], Any]


class MapLookup(Node):
    """Look a key up in a map, as in Fig. 18 of the paper; signal if it is not there.

    The map comes in step with the key, by the input, or whenever it has changed, by the slot; the one that came last is
    used. A value of None, as a map of known poses has it for those that are not known, counts as not there. Active
    edges from `found` and `unknown` carry activity to the next node in either case.

    Attributes:
      key: what is looked up.
      map: a dict, or a function of the key that gives None, or raises LookupError, if it does not know; optional.
      use_map: a map that is used from now on.
      found: the value of the key; silent if there is none.
      unknown: the key, if it is not in the map, or no map has come yet.

    Raises:
      Exception: whatever a function that is used as map raises but LookupError.

    CS::APEX: csapex::LookupMapEntry.
    """

    key = Input(Any)
    map = Input(MapOrFunction, optional=True)
    found = Output(Any)
    unknown = Event(Any)
    known = State[MapOrFunction | None](None)

    def process(self, key: Any, map: MapOrFunction | None) -> Any:  # noqa: A002 - the paper's word
        """Look it up."""
        if map is not None:
            self.known = map
        value = self._value(key)
        if value is None:
            self.unknown.trigger(key)
        return value

    @slot
    def use_map(self, map: MapOrFunction) -> None:  # noqa: A002 - the paper's word
        """Use this map from now on."""
        self.known = map

    def _value(self, key: Any) -> Any:
        if isinstance(self.known, Mapping):
            return self.known.get(key) if isinstance(key, Hashable) and _has_hash(key) else None
        if self.known is None:
            return None
        try:
            return self.known(key)
        except LookupError:
            return None


def _has_hash(key: Any) -> bool:
    try:
        hash(key)
    except TypeError:  # a tuple with a list in it
        return False
    return True


# --- several values in one, and back ---


class Compose(Node):
    """Make one tuple of the values at all inputs.

    Fires once all inputs hold a token; silence at one of them is silence, and the end of one is the end.

    Attributes:
      parts: any number of values.
      composed: the tuple.

    CS::APEX: csapex::Composer.
    """

    parts = Inputs(Any, 2)
    composed = Output(tuple[Any, ...])

    def process(self, parts: list[Any]) -> tuple[Any, ...]:
        """Put them together."""
        return tuple(parts)


class Decompose(Node):
    """Send each part of a tuple, list or record at an output of its own.

    A part that is None is silence.

    Attributes:
      composed: a tuple, list, dataclass, NamedTuple or struct with as many parts as there are outputs.
      parts: the parts in order.

    Raises:
      ValueError: there are more or fewer parts than outputs.
      TypeError: the value has no parts.

    CS::APEX: csapex::Decomposer.
    """

    composed = Input(Any)
    parts = Outputs(Any, 2)

    def process(self, composed: Any) -> None:
        """Take it apart."""
        found = parts_of(composed)
        if len(found) != len(self.parts):
            raise ValueError(
                f"a {type(composed).__name__} with {len(found)} parts came, but there are {len(self.parts)} outputs: "
                f"make the node with parts={len(found)}"
            )
        for output, part in zip(self.parts, found, strict=True):
            if part is not None:
                output.send(part)


def parts_of(value: Any) -> list[Any]:
    """Return the parts of a value.

    Raises:
      TypeError: it has none.
    """
    if isinstance(value, list | tuple):
        return list(value)
    names = record_fields(value)
    if not names:
        raise TypeError(f"a {type(value).__name__} has no parts; a tuple, list or record has")
    return [getattr(value, name) for name in names]


class ComposeDict(Node):
    """Make one dict of the values at all inputs.

    Fires once all inputs hold a token; silence at one of them is silence, and the end of one is the end.

    Attributes:
      values: any number of values.
      keys: their keys in order.
      composed: the dict.

    Raises:
      ValueError: there are more or fewer keys than inputs.

    CS::APEX: csapex::CreateMapMessage.
    """

    values = Inputs(Any, 2)
    composed = Output(dict[str, Any])
    keys = Parameter[Sequence[str]](("a", "b"), MinLen(1), type=Sequence[str])

    def process(self, values: list[Any]) -> dict[str, Any]:
        """Put them together."""
        need_keys(self.keys, len(values), "inputs")
        return dict(zip(self.keys, values, strict=True))


class DecomposeDict(Node):
    """Send the values of several keys of a dict, or fields of a record, at an output each.

    What is not there, or None, is silence; `missing` tells of it.

    Attributes:
      composed: a dict or record.
      keys: what each output gives: a key, the name of a field, or ways into it: "pose.x".
      values: the values in the order of the keys.
      missing: each key that is not there.

    Raises:
      ValueError: there are more or fewer keys than outputs.

    CS::APEX: csapex::DecomposeMapMessage.
    """

    composed = Input(Any)
    values = Outputs(Any, 2)
    missing = Event(str)
    keys = Parameter[Sequence[str]](("a", "b"), MinLen(1), type=Sequence[str])

    def process(self, composed: Any) -> None:
        """Take it apart."""
        need_keys(self.keys, len(self.values), "outputs")
        for output, key in zip(self.values, self.keys, strict=True):
            try:
                value = read_field(composed, key)
            except LookupError:
                self.missing.trigger(key)
                continue
            if value is not None:
                output.send(value)


def need_keys(keys: Sequence[str], count: int, ports: str) -> None:
    """See that there are as many keys as ports.

    Raises:
      ValueError: there are not.
    """
    if len(keys) != count:
        raise ValueError(
            f"there are {len(keys)} keys ({', '.join(keys)}) for {count} {ports}: make the node with values={len(keys)}"
        )


@node
def key_value(value: Any, *, key: str = "key") -> tuple[str, Any]:
    """Return a value with a name, as a pair; see dict_of_pairs.

    Args:
      value: anything.
      key: its name.

    CS::APEX: csapex::CreateKeyValueMessage.
    """
    return key, value


@node(inputs={"pairs": Inputs(tuple[Any, Any], 2)}, outputs=dict[Any, Any])
def dict_of_pairs(*pairs: tuple[Any, Any]) -> dict[Any, Any]:
    """Make a dict of the pairs (key, value) at all inputs; of equal keys the last counts.

    Args:
      pairs: any number of pairs.

    Raises:
      TypeError: what should be a key cannot be one, such as a list.

    CS::APEX: csapex::CreateMapMessage.
    """
    return dict(pairs)


# --- dicts ---


@node(inputs={"dicts": Inputs(Mapping[Any, Any], 2)}, outputs=dict[Any, Any])
def merge_dicts(*dicts: Mapping[Any, Any]) -> dict[Any, Any]:
    """Make one dict of those at all inputs; of equal keys the last counts.

    Args:
      dicts: any number of dicts.
    """
    return {key: value for one in dicts for key, value in one.items()}


@node
def keys_of(mapping: Mapping[Any, Any]) -> list[Any]:
    """List the keys of a dict.

    Args:
      mapping: a dict.
    """
    return list(mapping)


@node
def values_of(mapping: Mapping[Any, Any]) -> list[Any]:
    """List the values of a dict.

    Args:
      mapping: a dict.
    """
    return list(mapping.values())


@node
def pairs_of(mapping: Mapping[Any, Any]) -> list[tuple[Any, Any]]:
    """List the keys of a dict with their values.

    Args:
      mapping: a dict.
    """
    return list(mapping.items())


@node
def get_field(value: Any, *, field: str = "") -> Any:
    """Return what a key, field or number of a value holds; None in it is silence.

    Args:
      value: a dict, list, tuple, dataclass, NamedTuple, struct or attrs class.
      field: a key, the name of a field, or a number, and ways into it: "pose.x", "points.0.x"; "" is the value itself.

    Raises:
      LookupError: there is nothing of that name.
    """
    return read_field(value, field)


@node
def set_key(mapping: Mapping[Any, Any], value: Any, *, key: str = "key") -> dict[Any, Any]:
    """Return a dict in which one key has another value, or is new.

    Args:
      mapping: the dict, which stays as it is; the answer is a new one.
      value: what the key has.
      key: which one.
    """
    return {**mapping, key: value}


@node
def pick_keys(mapping: Mapping[str, Any], *, keys: Sequence[str] = ()) -> dict[str, Any]:
    """Keep some keys of a dict, in the order of the list.

    Args:
      mapping: a dict.
      keys: which are kept; those that are not there are passed over.
    """
    return {key: mapping[key] for key in keys if key in mapping}


@node
def without_keys(mapping: Mapping[str, Any], *, keys: Sequence[str] = ()) -> dict[str, Any]:
    """Leave out some keys of a dict.

    Args:
      mapping: a dict.
      keys: which are left out; those that are not there are passed over.
    """
    return {key: value for key, value in mapping.items() if key not in keys}


@node
def rename_keys(mapping: Mapping[str, Any], *, names: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Return keys of a dict other names; a name that is there already is lost to the later of both.

    Args:
      mapping: a dict.
      names: the new name of each key that gets one; None changes nothing.
    """
    new = names or {}
    return {new.get(key, key): value for key, value in mapping.items()}
