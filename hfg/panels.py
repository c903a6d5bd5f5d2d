"""What a node type offers to people who look at a run: views of it, and actions in a menu.

The studio shows both; a graph runs the same with and without them. A view is a method that draws a `Scene`, in the
coordinates of its world, whenever a page can take another picture. Without a page it is not called. An action has a
label and typed arguments: it sets parameters of the node, or calls one of its slots. Depends on nothing.

Examples:
  >>> class Lamp:
  ...     dim = Change("Dim the lamp", {"brightness": 0.2})
  ...     blink = Call("Blink", "blink")
  ...
  ...     @view("The lamp")
  ...     def seen(self, look: Look) -> Scene:
  ...         scene = Scene(-1, -1, 1, 1)
  ...         scene.disc((0, 0), 0.5, fill="one")
  ...         return scene
  >>> [action.label for action in actions_of(Lamp).values()]
  ['Dim the lamp', 'Blink']
  >>> views_of(Lamp)["seen"].title
  'The lamp'
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal, Protocol, TypeAlias, TypeVar, overload

import numpy as np
import numpy.typing as npt

__all__ = ["Call", "Change", "Colour", "Look", "Scene", "View", "actions_of", "view", "views_of"]

Colour: TypeAlias = Literal[
    "ink", "soft", "faint", "line", "ground", "raised", "good", "bad", "warn", "one", "two", "three", "four"
]
"""Colours of a scene. The page has a light and a dark form of each. Orange and blue are not among them: there they mean
activity and the person."""

Place: TypeAlias = Sequence[float] | npt.NDArray[Any]
"""A point, x and y."""

Places: TypeAlias = Sequence[Place] | npt.NDArray[Any]

C = TypeVar("C")


class Scene:
    """A drawing in the coordinates of its world. Shapes lie upon those before them.

    Attributes:
      bounds: left, bottom, right and top of what is shown. If the bottom is the larger number, y leads down, as in
        images.
      caption: a line above the drawing.
      shapes: what was drawn, in order; each is its kind and what the kind needs.
    """

    def __init__(self, left: float, bottom: float, right: float, top: float, *, caption: str = "") -> None:
        self.bounds = (float(left), float(bottom), float(right), float(top))
        self.caption = caption
        self.shapes: list[tuple[Any, ...]] = []

    def line(self, points: Places, colour: Colour = "ink", *, width: float = 1.0) -> None:
        """Draw a line through points; `width` is in pixels."""
        self.shapes.append(("line", points, "", colour, width))

    def area(
        self, points: Places, *, fill: Colour | None = None, line: Colour | None = None, width: float = 1.0
    ) -> None:
        """Draw a closed outline, filled or not."""
        self.shapes.append(("area", points, fill or "", line or "", width))

    def disc(
        self, at: Place, radius: float, *, fill: Colour | None = None, line: Colour | None = None, width: float = 1.0
    ) -> None:
        """Draw a circle, filled or not."""
        self.shapes.append(("disc", at, radius, fill or "", line or "", width))

    def rays(self, begin: Place, ends: Places, colour: Colour = "soft") -> None:
        """Draw the measurements of a sensor: faint lines from one point to many, with a dot at each end."""
        self.shapes.append(("rays", begin, ends, colour))

    def text(
        self,
        text: str,
        at: Place,
        size: float,
        colour: Colour = "ink",
        *,
        anchor: Literal["start", "middle", "end"] = "middle",
    ) -> None:
        """Write a line of text; `size` is the height of its letters in the world."""
        self.shapes.append(("text", str(text), at, size, colour, anchor))

    def image(self, image: npt.NDArray[np.uint8], left: float, bottom: float, right: float, top: float) -> None:
        """Draw an 8-bit image, grey or with colours in the order blue, green, red. It must not change afterwards."""
        self.shapes.append(("image", image, (left, bottom, right, top)))


class Look(Protocol):
    """A run, as a view sees it."""

    @property
    def path(self) -> str:
        """The path of the node."""

    @property
    def now(self) -> float:
        """Seconds since the run began."""

    def latest(self, port: str) -> Any:
        """Return the last value that has passed a port, None if nothing has since the page began to look.

        Args:
          port: of the node, "scan"; or inside of it, "perception/localise.pose".
        """

    def active(self) -> Sequence[str]:
        """Return the paths of the active nodes, as seen from the node, which is itself ""."""


@dataclass(frozen=True)
class View:
    """A view that a node type offers; made by `view`.

    Attributes:
      title: above the drawing, for people.
      draw: the method.
    """

    title: str
    draw: Callable[[Any, Look], Scene | None]

    @property
    def doc(self) -> str:
        """The first line of the method's docstring."""
        return (self.draw.__doc__ or "").strip().partition("\n")[0]

    @overload
    def __get__(self, node: None, owner: Any) -> View: ...
    @overload
    def __get__(self, node: object, owner: Any) -> Callable[[Look], Scene | None]: ...
    def __get__(self, node: Any, owner: Any) -> Any:
        """Return the method of a node, so that tests can call it."""
        return self if node is None else self.draw.__get__(node)


def view(title: str) -> Callable[[Callable[[Any, Look], Scene | None]], View]:
    """Offer a method as a view of the node: `def arena(self, look: hfg.panels.Look) -> hfg.panels.Scene`.

    It is called on the loop of the graph, so its node must run there. It returns quickly and changes nothing. None
    means that there is nothing to see yet.

    Args:
      title: above the drawing, for people.
    """
    return lambda draw: View(title, draw)


@dataclass(frozen=True)
class Change:
    """An action that sets parameters of the node, in one step of the history that can be undone.

    Attributes:
      label: in the menu, for people.
      values: the parameters that it sets, by name, and the values that it suggests.
      help: what it is good for.
    """

    label: str
    values: Mapping[str, Any] = field(default_factory=dict)
    help: str = ""


@dataclass(frozen=True)
class Call:
    """An action that calls a slot of the node. Its effect on the world cannot be undone.

    If the slot takes a record (a NamedTuple or a dataclass), people give its fields. Limits and units stand in their
    annotations, as those of parameters do.

    Attributes:
      label: in the menu, for people.
      slot: the name of the slot.
      help: what it is good for.
    """

    label: str
    slot: str
    help: str = ""


def _of(kind: Any, wanted: type[C] | tuple[type[C], ...]) -> dict[str, C]:
    found: dict[str, C] = {}
    for owner in reversed(getattr(kind, "__mro__", ())):
        for name, value in vars(owner).items():
            if isinstance(value, wanted):
                found[name] = value
            else:
                found.pop(name, None)
    return found


_ACTIONS: Final[tuple[type[Any], ...]] = (Change, Call)


def views_of(kind: Any) -> dict[str, View]:
    """Return the views that a node type offers, by the names of their methods."""
    return _of(kind, View)


def actions_of(kind: Any) -> dict[str, Change | Call]:
    """Return the actions that a node type offers, by their names in the class."""
    return _of(kind, _ACTIONS)
