"""The values that a search may try: parameters of a graph, as numbers from 0 to 1 and back.

A parameter's kind, limits and choices come from its declaration; users narrow them. An optimiser knows only the cells,
one number each. Depends on the graph floor.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any, Final

from hfg.base.limits import step_within
from hfg.base.values import Colour, Span, same
from hfg.encoding import encode
from hfg.errors import EncodingError, UsageError
from hfg.graph import Graph
from hfg.graph.structure.naming import suggest
from hfg.nodetypes.node import Node
from hfg.ports import ParameterPort
from hfg.ports.specs import ParameterSpec

_MOST_CELLS: Final = 1000
_MOST_STEPS: Final = 100_000


@dataclass(frozen=True, slots=True)
class Cell:
    """One number of a search.

    Attributes:
      low: the smallest value.
      high: the largest.
      grid: values are multiples of this; 0: any.
      log: equal steps are equal factors.
      options: it is one of this many choices, by index; 0: it is a number.
    """

    low: float = 0.0
    high: float = 1.0
    grid: float = 0.0
    log: bool = False
    options: int = 0

    @property
    def levels(self) -> int:
        """How many values there are; 0 if it is any number between the limits."""
        if self.options:
            return self.options
        return round((self.high - self.low) / self.grid) + 1 if self.grid else 0

    def value(self, unit: float) -> float:
        """Return the value for a number from 0 to 1."""
        unit = min(max(unit, 0.0), 1.0)
        levels = self.levels
        if levels and not self.log:
            index = min(int(unit * levels), levels - 1)
            return index if self.options else self.low + index * self.grid
        if self.log:
            found = math.exp(math.log(self.low) + unit * (math.log(self.high) - math.log(self.low)))
        else:
            found = self.low + unit * (self.high - self.low)
        if self.grid:
            found = self.low + round((found - self.low) / self.grid) * self.grid
        return min(max(found, self.low), self.high)

    def unit(self, value: float) -> float:
        """Return the number from 0 to 1 that gives a value. A value outside the limits gives one beyond 0 or 1."""
        levels = self.levels
        if levels and not self.log:
            return ((value if self.options else (value - self.low) / self.grid) + 0.5) / levels
        if self.log:
            if value <= 0:
                return -1.0
            return (math.log(value) - math.log(self.low)) / (math.log(self.high) - math.log(self.low))
        return (value - self.low) / (self.high - self.low) if self.high > self.low else 0.5


@dataclass(frozen=True)
class Tuned:
    """A parameter whose value is searched for, or the same parameter of several nodes.

    Attributes:
      path: as users write it, "pid.kp" or "*/follow.speed".
      paths: the parameters that it names.
      spec: the declaration of the first.
      cells: the numbers that make up a value.
      make: returns the value for them.
      take: returns the numbers for a value; None if the value is not among those searched.
    """

    path: str
    paths: tuple[str, ...]
    spec: ParameterSpec
    cells: tuple[Cell, ...]
    make: Callable[[Sequence[float]], Any]
    take: Callable[[Any], Sequence[float] | None]

    def as_data(self, value: Any) -> Any:
        """Return a value as plain data."""
        return self.spec.encode(value)

    def as_text(self, value: Any) -> str:
        """Return a value as people read it."""
        if isinstance(value, float):
            return f"{value:.5g}"
        return str(value) if isinstance(value, bool | int | str) else str(encode(value, self.spec.type))


class Space:
    """All parameters of a search.

    Attributes:
      tuned: the parameters.
      cells: all their numbers, in order.
    """

    def __init__(self, tuned: Iterable[Tuned]) -> None:
        self.tuned = list(tuned)
        self.cells = [cell for one in self.tuned for cell in one.cells]
        if len(self.cells) > _MOST_CELLS:
            raise UsageError(f"a search has {_MOST_CELLS} numbers at most, these parameters have {len(self.cells)}")
        taken = [path for one in self.tuned for path in one.paths]
        twice = next((path for path in taken if taken.count(path) > 1), None)
        if twice is not None:
            raise UsageError(f'parameter "{twice}" is named twice; leave out one')

    def values(self, units: Sequence[float]) -> dict[str, Any]:
        """Return the values of all parameters, by path, for numbers from 0 to 1."""
        found, first = {}, 0
        for one in self.tuned:
            part = units[first : first + len(one.cells)]
            first += len(one.cells)
            found[one.path] = one.make([cell.value(unit) for cell, unit in zip(one.cells, part, strict=True)])
        return found

    def units(self, values: Mapping[str, Any]) -> list[float] | None:
        """Return the numbers from 0 to 1 that give these values; None if one is outside what is searched."""
        found: list[float] = []
        for one in self.tuned:
            numbers = one.take(values[one.path])
            if numbers is None:
                return None
            found += [cell.unit(number) for cell, number in zip(one.cells, numbers, strict=True)]
        return found if all(-1e-9 <= unit <= 1 + 1e-9 for unit in found) else None

    def present(self, graph: Graph) -> dict[str, Any]:
        """Return the values that a graph has now."""
        found = find_parameters(graph)
        return {one.path: found[one.paths[0]].value for one in self.tuned}

    def apply(self, graph: Graph, values: Mapping[str, Any]) -> None:
        """Set values in a graph that is not running."""
        set_values(graph, {path: values[one.path] for one in self.tuned for path in one.paths})

    def as_data(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return values as plain data."""
        return {one.path: one.as_data(values[one.path]) for one in self.tuned}

    def as_text(self, values: Mapping[str, Any]) -> str:
        """Return values as people read them."""
        return ", ".join(f"{one.path} = {one.as_text(values[one.path])}" for one in self.tuned)


# --- parameters of a graph --------------------------------------------------------------------------------------------


def find_parameters(graph: Graph) -> dict[str, ParameterPort[Any]]:
    """Return the parameters of a graph that users set, by path, also those inside subgraphs."""
    return dict(_found(graph, ""))


def _found(graph: Graph, around: str) -> Iterator[tuple[str, ParameterPort[Any]]]:
    for name, node in graph.nodes.items():
        path = f"{around}{name}"
        for port in _settable(node):
            yield f"{path}.{port.name}", port
        inside = getattr(node, "graph", None)
        if isinstance(inside, Graph):
            yield from _found(inside, f"{path}/")


def _settable(node: Node) -> list[ParameterPort[Any]]:
    return [port for port in node.ports.parameters.values() if port.spec.is_port and port.spec.is_given]


def set_values(graph: Graph, values: Mapping[str, Any]) -> None:
    """Set parameters of a graph, by path.

    Raises:
      UsageError: a value does not fit.
    """
    found = find_parameters(graph)
    for path, value in values.items():
        if path not in found:
            raise UsageError(f'graph "{graph.name}" has no parameter "{path}"; {suggest(path, found)}')
        try:
            found[path].value = value
        except ValueError as error:
            raise UsageError(str(error)) from error


def read_parameter(graph: Graph, text: str) -> Tuned:
    """Read what is to be searched, as in "pid.kp=0.1..10".

    Args:
      graph: has the parameter.
      text: a path, where `*` stands for any characters and all that match get the same value, and after "=" the range
        "low..high", "low..high:log" for equal factors, "low..high/5" for five values, or "a,b,c" for these values.
        Without a range, the limits of the declaration hold.

    Raises:
      UsageError: there is no such parameter, it has no limits, or a value does not fit it.
    """
    path, _, said = text.partition("=")
    path, said = path.strip(), said.strip()
    known = find_parameters(graph)
    matching = [one for one in known if fnmatchcase(one, path)] if "*" in path else [path]
    if not matching or matching[0] not in known:
        raise UsageError(f'graph "{graph.name}" has no parameter "{path}"; {suggest(path, known)}')
    spec = known[matching[0]].spec
    other = next((one for one in matching if known[one].spec.kind != spec.kind), None)
    if other is not None:
        raise UsageError(
            f'"{path}" is of kind {spec.kind} at "{matching[0]}", but {known[other].spec.kind} at "{other}"'
        )
    cells, make, take = _Reading(path, spec, said).read()
    tuned = Tuned(path, tuple(matching), spec, cells, make, take)
    _check_ends(tuned, [known[one].spec for one in matching])
    return tuned


def read_range(name: str, text: str) -> Tuned:
    """Read the range of a number that does not belong to a parameter, as in "0.1..10".

    Args:
      name: for messages.
      text: as after "=" in `read_parameter`.

    Raises:
      UsageError: it is not a range of numbers.
    """
    spec = ParameterSpec(name, float, 0.0)
    cells, make, take = _Reading(name, spec, text.strip()).read()
    return Tuned(name, (name,), spec, cells, make, take)


def _check_ends(tuned: Tuned, specs: Sequence[ParameterSpec]) -> None:
    """Refuse a range that reaches beyond the limits of the declaration."""
    for unit in (0.0, 1.0):
        value = tuned.make([cell.value(unit) for cell in tuned.cells])
        for spec, path in zip(specs, tuned.paths, strict=True):
            wrong = spec.check(value)
            if wrong is not None:
                raise UsageError(f'parameter "{path}" {wrong}')


_Read = tuple[tuple[Cell, ...], Callable[[Sequence[float]], Any], Callable[[Any], Sequence[float] | None]]


class _Reading:
    """Reads the range of one parameter by its kind."""

    def __init__(self, path: str, spec: ParameterSpec, said: str) -> None:
        self._path, self._spec, self._said = path, spec, said

    def read(self) -> _Read:
        """Return the cells of the parameter, and the ways to a value and back."""
        if self._said and ".." not in self._said:
            return self._listed([self._value(one) for one in self._said.split(",")])
        if ".." in self._said and "/" in self._said:
            return self._spaced()
        match self._spec.kind:
            case "bool":
                return self._listed([False, True])
            case "choice" if not self._said:
                return self._listed(list(self._spec.choices or ()))
            case "choices" if not self._said:
                return self._members()
            case "int":
                return (self._cell(whole=True),), lambda numbers: round(numbers[0]), lambda value: [value]
            case "float":
                return (self._cell(),), lambda numbers: float(numbers[0]), _of_number
            case "colour":
                cell = self._cell(0, 255, whole=True)
                return (cell,) * 3, lambda numbers: Colour(*map(round, numbers)), list
            case "interval":
                return (self._cell(whole=self._is_whole()),) * 2, self._span, list
            case "vector":
                return self._vector()
        raise UsageError(
            f'parameter "{self._path}" is of kind {self._spec.kind}, of which there is no range: list values, as in '
            f"{self._path}=a,b"
        )

    # --- kinds

    def _listed(self, values: list[Any]) -> _Read:
        for value in values:
            wrong = self._spec.check(value)
            if wrong is not None:
                raise UsageError(f'parameter "{self._path}" {wrong}')

        def take(value: Any) -> list[float] | None:
            return next(([float(index)] for index, one in enumerate(values) if same(one, value)), None)

        return (Cell(options=len(values)),), lambda numbers: values[int(numbers[0])], take

    def _members(self) -> _Read:
        members = list(self._spec.choices or ())
        kind = type(self._spec.default) if isinstance(self._spec.default, list | set | frozenset | tuple) else frozenset

        def make(numbers: Sequence[float]) -> Any:
            return kind(member for member, number in zip(members, numbers, strict=True) if number)

        return (Cell(options=2),) * len(members), make, lambda value: [float(member in value) for member in members]

    def _span(self, numbers: Sequence[float]) -> Any:
        kind = round if self._is_whole() else float
        return Span(*map(kind, sorted(numbers)))

    def _vector(self) -> _Read:
        shape = self._spec.shape
        count = shape[0] if shape is not None and len(shape) == 1 else None
        if count is None:
            raise UsageError(f'parameter "{self._path}" has no fixed length, so it has no range: list values')
        kind: Callable[[Any], Any] = tuple
        if not isinstance(self._spec.default, tuple):
            import numpy as np

            dtype = getattr(self._spec.default, "dtype", np.float64)
            kind = lambda numbers: np.array(numbers, dtype)  # noqa: E731 - a class of arrays cannot be called so
        return (self._cell(),) * count, lambda numbers: kind([float(one) for one in numbers]), list

    def _is_whole(self) -> bool:
        default = self._spec.default
        return isinstance(default, tuple) and bool(default) and all(type(one) is int for one in default)

    # --- ranges

    def _cell(self, low: float | None = None, high: float | None = None, *, whole: bool = False) -> Cell:
        """Return the cell of a number between the limits that are given, or else declared."""
        step = step_within(self._spec.limits)
        grid = float(step) if step is not None else 1.0 if whole else 0.0
        log = False
        if self._said:
            low, high, log = self._range()
        else:
            low = self._inside(self._spec.minimum, grid) if low is None else low
            high = self._inside(self._spec.maximum, -grid) if high is None else high
        if low is None or high is None:
            raise UsageError(f'parameter "{self._path}" has no limits: write {self._path}=LOW..HIGH')
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise UsageError(
                f'parameter "{self._path}" has the range {low:g}..{high:g}: write the smaller number first'
            )
        if log and low <= 0:
            raise UsageError(f'parameter "{self._path}" has the range {low:g}..{high:g}:log: it begins above 0')
        if step is not None:
            low, high = math.ceil(low / grid - 1e-9) * grid, math.floor(high / grid + 1e-9) * grid
        return Cell(low, high, grid, log)

    def _inside(self, bound: float | None, grid: float) -> float | None:
        """Return a declared limit, or the number next to it if it is not allowed itself."""
        if bound is None or self._spec.check(type(self._spec.default)(bound) if grid else float(bound)) is None:
            return bound
        away = math.inf if bound == self._spec.minimum else -math.inf
        return bound + grid if grid else math.nextafter(bound, away)

    def _range(self) -> tuple[float, float, bool]:
        said, _, how = self._said.partition(":")
        low, _, high = said.partition("..")
        if how not in ("", "log"):
            raise UsageError(f'"{self._path}={self._said}": after the range stands ":log" or nothing, got ":{how}"')
        try:
            return float(low), float(high), how == "log"
        except ValueError:
            raise UsageError(
                f'"{self._path}={self._said}" is not a range: write {self._path}=LOW..HIGH, as in 0.1..10'
            ) from None

    def _spaced(self) -> _Read:
        """Read "low..high/5" as five values at equal distances."""
        said, _, count = self._said.partition("/")
        count, colon, how = count.partition(":")
        if not count.isdecimal() or not 2 <= int(count) <= _MOST_STEPS or self._spec.kind not in ("int", "float"):
            raise UsageError(
                f'"{self._path}={self._said}": after "/" stands the number of values, 2 at least, and the parameter '
                "is a number"
            )
        self._said = said + colon + how
        cell = self._cell()
        units = [index / (int(count) - 1) for index in range(int(count))]
        kind: Callable[[float], Any] = round if self._spec.kind == "int" else float
        return self._listed(list(dict.fromkeys(kind(cell.value(unit)) for unit in units)))

    def _value(self, text: str) -> Any:
        try:
            return self._spec.read_text(text.strip())
        except EncodingError as error:
            raise UsageError(str(error).replace(f'"{self._spec.name}"', f'"{self._path}"')) from None


def _of_number(value: Any) -> Sequence[float] | None:
    return [float(value)] if isinstance(value, int | float) else None
