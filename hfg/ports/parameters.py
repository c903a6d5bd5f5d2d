"""Parameters: values with limits, set when a node is made and by tokens (rule P8).

Depends on `base`, `specs`, `kinds` and `conditions`, and on limits and types.
"""

from __future__ import annotations

import typing
from collections.abc import Callable, Collection, Mapping
from typing import Annotated, Any, ClassVar, Generic, Self, TypeVar, cast, overload

import annotated_types
from typing_extensions import TypeForm

from hfg.base.limits import kept_metadata, limits_of, limits_within, step_within
from hfg.base.values import own_copy
from hfg.errors import DeclarationError, UsageError
from hfg.ports.base import Kind, Owner, Port, Relaying, Source, Target
from hfg.ports.conditions import ShownIf, conditions_of
from hfg.ports.kinds import choices_of, type_of_default, without_none
from hfg.ports.specs import REQUIRED, ParameterSpec, Required
from hfg.types import accepts

__all__ = ["Parameter", "ParameterPort", "spec_of"]

T = TypeVar("T")


class ParameterPort(Port, Source[T], Target[T]):
    """The parameter of one node: a value, an optional input and an output (rule P8)."""

    __slots__ = ("_tell", "spec")

    kind: ClassVar[Kind] = "parameter"

    def __init__(self, node: Owner, name: str, spec: ParameterSpec) -> None:
        super().__init__(node, name, spec.type)
        self.spec = spec
        self._tell: Callable[[Any], None] | None = None  # reports to a run that the node has set a read-only parameter

    def _report_to(self, report: Callable[[Any], None] | None) -> None:
        """Call this whenever the node sets its read-only parameter; for the runner."""
        self._tell = report

    @property
    def value(self) -> T:
        """The current value, a list as a copy. Setting it checks the limits.

        Raises:
          ValueError: on setting: the value violates a limit, or only the node may set it. The old value stays.
        """
        value: T = own_copy(self.node._parameters[self.name])
        return value

    @value.setter
    def value(self, value: T) -> None:
        self.node._set_parameter(self.name, value)


class Parameter(Generic[T]):
    """Declare a parameter in a class body; `self.tolerance` is then its value (on a subgraph, its port).

    For a parameter of a function, use it in the annotation of a keyword-only argument: `Annotated[float, Ge(0),
    hfg.Parameter(unit="m")]`. The default is then written after the `=`.

    Args:
      default: its value unless the node is made with another. Without a default, a value must be given.
      limits: annotated-types constraints: `Interval(ge=0, le=1)`, `Len(1, 9)`, `Predicate(str.isidentifier)` ... Limits
        on numbers hold for every element of a list, pair, vector or matrix.
      unit: shown to users.
      choices: the only allowed values, or a mapping from labels to the values; if the type is a set or a list, its
        allowed members. A `Literal` or an enum implies its choices.
      step: how much an editor changes the value per step; not a limit (`MultipleOf` is one).
      group: editors show the parameter in this group: "filter", or "filter/details".
      help: its meaning; by default, the docstring of the node type provides it.
      shown_if: editors show it only if another parameter of the node is on, `shown_if="masked"`, or has a value, one of
        a list, or keeps a limit: `shown_if={"mode": ["a", "b"], "count": Gt(3)}`.
      read_only: only the node's own code sets it, `self.done = 0.5`, and users see it; it has an output and no input. A
        number with both limits is shown as progress. Every run starts with the default.
      pattern: the file names that it accepts: "*.png *.jpg".
      directory: the path must be a directory.
      save: the path is written to, not read from.
      type: any type hint; by default, the type of the default.
      trigger: no value, but a slot and an event of this name: a call of the slot triggers the event.
    """

    kind: ClassVar[Kind] = "parameter"

    @overload
    def __init__(
        self,
        default: T,
        /,
        *limits: Any,
        unit: str | None = None,
        choices: Collection[object] | Mapping[str, object] | None = None,
        step: float | None = None,
        group: str | None = None,
        help: str | None = None,
        shown_if: ShownIf | None = None,
        read_only: bool = False,
        pattern: str | None = None,
        directory: bool = False,
        save: bool = False,
        trigger: bool = False,
    ) -> None: ...
    @overload
    def __init__(
        self,
        default: T,
        /,
        *limits: Any,
        unit: str | None = None,
        choices: Collection[object] | Mapping[str, object] | None = None,
        step: float | None = None,
        group: str | None = None,
        help: str | None = None,
        shown_if: ShownIf | None = None,
        read_only: bool = False,
        pattern: str | None = None,
        directory: bool = False,
        save: bool = False,
        type: TypeForm[T],
        trigger: bool = False,
    ) -> None: ...
    @overload
    def __init__(
        self,
        /,
        *,
        unit: str | None = None,
        choices: Collection[object] | Mapping[str, object] | None = None,
        step: float | None = None,
        group: str | None = None,
        help: str | None = None,
        shown_if: ShownIf | None = None,
        pattern: str | None = None,
        directory: bool = False,
        save: bool = False,
        type: TypeForm[T],
    ) -> None: ...
    @overload
    def __init__(
        self: Parameter[None], /, *, trigger: bool, group: str | None = None, help: str | None = None
    ) -> None: ...
    @overload
    def __init__(
        self: Parameter[Any],
        /,
        *,
        unit: str | None = None,
        choices: Collection[object] | Mapping[str, object] | None = None,
        step: float | None = None,
        group: str | None = None,
        help: str | None = None,
        shown_if: ShownIf | None = None,
        pattern: str | None = None,
        directory: bool = False,
        save: bool = False,
    ) -> None: ...
    def __init__(
        self,
        default: Any = REQUIRED,
        /,
        *limits: Any,
        unit: str | None = None,
        choices: Collection[Any] | Mapping[str, Any] | None = None,
        step: float | None = None,
        group: str | None = None,
        help: str | None = None,  # noqa: A002
        shown_if: ShownIf | None = None,
        read_only: bool = False,
        pattern: str | None = None,
        directory: bool = False,
        save: bool = False,
        type: Any = None,  # noqa: A002
        trigger: bool = False,
    ) -> None:
        unknown = [limit for limit in (default, *limits)[1:] if not limits_of([limit])]
        if unknown:
            raise DeclarationError(
                f"{unknown[0]!r} is not a limit for a parameter: use those of annotated_types, such as "
                "Interval(ge=0, le=1)"
            )
        if not isinstance(default, Required) and limits_of([default]) and not isinstance(default, slice):
            raise DeclarationError(
                f"{default!r} is a limit, but the first argument of a parameter is its default; write "
                f"hfg.Parameter(0.5, {default!r}), or put it next to hfg.Parameter in Annotated[float, "
                f"{default!r}, hfg.Parameter(...)]"
            )
        if trigger and default is REQUIRED:
            default = None
        self.inferred: ParameterSpec | None = None  # of a parameter that was read from a function
        self.default = default
        self.limits = limits
        self.unit = unit
        self.choices = choices
        self.step = step
        self.group = group
        self.help = help
        self.shown_if = shown_if
        self.read_only = read_only
        self.pattern = pattern
        self.directory = directory
        self.save = save
        self.type: Any = type
        self.trigger = trigger
        self.name = ""

    @classmethod
    def of(cls, spec: ParameterSpec) -> Parameter[Any]:
        """Make the declaration of a parameter that was read from a function."""
        made: Parameter[Any] = cls(spec.default, type=spec.type)
        made.inferred, made.name, made.trigger = spec, spec.name, spec.trigger
        return made

    def __set_name__(self, owner: object, name: str) -> None:
        self.name = self.name or name

    def spec(
        self,
        where: str = "",
        name: str | None = None,
        *,
        default: Any = REQUIRED,
        type: Any = None,  # noqa: A002
    ) -> ParameterSpec:
        """Return the declaration as plain data.

        Args:
          where: the node type, for error messages.
          name: the parameter's name, if the declaration has none.
          default: for a declaration in an annotation, the default after the `=`.
          type: for a declaration in an annotation, the annotated type.

        Raises:
          DeclarationError: it contradicts itself.
        """
        if self.inferred is not None:
            return self.inferred
        name = name or self.name
        where = f'{where}{": " if where else ""}parameter "{name}"'
        hint = self.type if self.type is not None else type
        default = self.default if self.default is not REQUIRED else default
        if hint is None and not self.trigger:
            hint = type_of_default(None if default is REQUIRED else default)
        hint = _opened(hint)
        metadata = getattr(hint, "__metadata__", ()) if typing.get_origin(hint) is Annotated else ()
        units = [item.unit for item in metadata if isinstance(item, annotated_types.Unit)]
        bare = None if hint is None else kept_metadata(hint)
        limits = (*limits_of(metadata), *limits_of(self.limits), *limits_within(bare))
        choices, labels = _choices(self.choices, bare, where)
        spec = ParameterSpec(
            name=name,
            type=bare,
            default=default,
            limits=limits,
            unit=self.unit if self.unit is not None else units[0] if units else None,
            choices=choices,
            trigger=self.trigger,
            labels=labels,
            step=self.step if self.step is not None else step_within(limits),
            group=self.group,
            help=self.help,
            shown_if=conditions_of(self.shown_if, where),
            read_only=self.read_only,
            pattern=self.pattern,
            directory=self.directory,
            save=self.save,
        )
        _refuse_contradictions(spec, self.step, where)
        return spec

    @overload
    def __get__(self, node: None, owner: Any) -> Self: ...
    @overload
    def __get__(self, node: Relaying, owner: Any) -> ParameterPort[T]: ...
    @overload
    def __get__(self, node: object, owner: Any) -> T: ...
    def __get__(self, node: Any, owner: Any) -> Any:
        if node is None:
            return self
        if self.trigger:
            raise UsageError(
                f'"{self.name}" is a trigger: write node.ports.slots["{self.name}"] or node.ports.events["{self.name}"]'
            )
        if isinstance(node, Relaying):
            return cast(Any, node)._port("parameter", self.name)
        return node._parameters[self.name]

    def __set__(self, node: Any, value: T) -> None:
        node._set_parameter(self.name, value, own=True)

    def __repr__(self) -> str:
        return f"<Parameter {self.name}>"


def spec_of(name: str, default: Any, hint: Any, where: str) -> ParameterSpec:
    """Return the description of the parameter that a keyword-only argument declares.

    Raises:
      DeclarationError: its annotation contradicts itself.
    """
    hint = _opened(hint)
    metadata = getattr(hint, "__metadata__", ()) if typing.get_origin(hint) is Annotated else ()
    said = [item for item in metadata if isinstance(item, Parameter)]
    wrong = None
    if len(said) > 1:
        wrong = "has two hfg.Parameter in its annotation; combine them in one"
    elif said and (said[0].default is not REQUIRED or said[0].type is not None):
        wrong = "has its default or type in hfg.Parameter; write Annotated[float, hfg.Parameter(...)] = 0.5"
    elif said and said[0].read_only:
        wrong = "is read-only, but a function cannot set it; make the node type a class"
    if wrong is not None:
        raise DeclarationError(f'{where}: parameter "{name}" {wrong}')
    if default is None and hint is not Any:
        hint = _or_none(hint)
    return (said[0] if said else Parameter()).spec(where, name, default=default, type=hint)


def _opened(hint: Any) -> Any:
    """Make the limits of `Annotated[float, Ge(0)] | None` hold for the whole union; None satisfies every limit."""
    bare = without_none(hint)
    if bare is hint or typing.get_origin(bare) is not Annotated or not accepts(None, hint):
        return hint
    opened: Any = typing.Union[typing.get_args(bare)[0], None]  # noqa: UP007 - some hints know no |
    for item in (*bare.__metadata__, *getattr(hint, "__metadata__", ())):  # inside and outside the union
        opened = Annotated[opened, item]
    return opened


def _or_none(hint: Any) -> Any:
    """Allow None as a value; the annotations of the type stay."""
    if accepts(None, hint):
        return hint
    bare = typing.get_args(hint)[0] if typing.get_origin(hint) is Annotated else hint
    widened: Any = typing.Union[bare, None]  # noqa: UP007 - some hints know no |
    for item in getattr(hint, "__metadata__", ()) if bare is not hint else ():
        widened = Annotated[widened, item]
    return widened


def _choices(said: Any, hint: Any, where: str) -> tuple[tuple[Any, ...] | None, tuple[str, ...]]:
    """Return the allowed choices and their labels."""
    if said is None:
        known = None if hint is None else choices_of(hint)
        return (None, ()) if known is None else (tuple(known.values()), tuple(known))
    if isinstance(said, str) or not isinstance(said, Collection) or not said:
        raise DeclarationError(
            f'{where}: choices are several values, got {said!r:.80}; write choices=("fast", "good"), or '
            'choices={"Fast": 1, "Good": 2} to call them something'
        )
    if isinstance(said, Mapping):
        return tuple(said.values()), tuple(map(str, said))
    return tuple(said), ()


def _refuse_contradictions(spec: ParameterSpec, step: Any, where: str) -> None:
    """Refuse options that a parameter of its kind cannot have.

    Raises:
      DeclarationError: an option contradicts the kind; the message has the remedy.
    """
    wrong = None
    if spec.trigger and (spec.read_only or spec.choices or spec.limits or step is not None):
        wrong = "is a trigger and has no value, so nothing else can be said about it; omit the other options"
    elif spec.read_only and spec.default is REQUIRED:
        wrong = "is read-only and has no default to start with; write hfg.Parameter(0.0, read_only=True)"
    elif step is not None and (not isinstance(step, int | float) or isinstance(step, bool) or not step > 0):
        wrong = f"has a step of {step!r}; a step must be a number above 0"
    elif step is not None and spec.kind not in ("int", "float", "interval", "vector", "matrix", "list", "progress"):
        wrong = f"has a step, but its kind is {spec.kind}; omit step="
    elif spec.says_path and spec.kind != "path":
        wrong = f"has the kind {spec.kind}, but pattern=, directory= and save= are for paths; give it type=Path"
    elif spec.pattern is not None and (
        spec.directory or not isinstance(cast(object, spec.pattern), str) or not spec.pattern.split()
    ):
        wrong = f'has the pattern {spec.pattern!r}; a pattern matches file names, as in pattern="*.png *.jpg"'
    elif any(condition.parameter == spec.name for condition in spec.shown_if):
        wrong = "depends on its own value to be shown, so it could be hidden forever; name another parameter"
    else:
        said: dict[str, Any] = {"unit": spec.unit, "group": spec.group, "help": spec.help}
        odd = next((word for word, one in said.items() if one is not None and not isinstance(one, str)), None)
        if odd is not None:
            wrong = f'has {odd}={said[odd]!r}; write a string, as in {odd}="..."'
    if wrong is not None:
        raise DeclarationError(f"{where} {wrong}")
