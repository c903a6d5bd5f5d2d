"""The topic of a view: the scene that a node draws whenever a page can take one.

The view is called on the graph's loop, but only as often as the share of all streams allows. The JSON is made off it.
Depends on `run_topics` and `offering`.
"""

from __future__ import annotations

import base64
from typing import Any, Final

import numpy as np
from typing_extensions import override

from hfg.engine import Run
from hfg.engine.observing.taps import Tap
from hfg.errors import HfgError, in_words
from hfg.panels import Scene
from hfg.reporting.pictures import is_picture
from hfg.studio.following import Following
from hfg.studio.offering import offered_view
from hfg.studio.places import place_at
from hfg.studio.refusing import Refused
from hfg.studio.run_topics import RunTopic
from hfg.studio.showing import image_frame

__all__ = ["SceneTopic", "scene_as_data"]

_MOST_TAPS: Final = 256
_LONGEST: Final = 640
_QUALITY: Final = 75
_SIZE: Final = 4
"""Bytes before the pixels of `image_frame`."""


class _Look:
    """See `hfg.panels.Look`; of one run."""

    def __init__(self, host: Following, run: Run, path: str) -> None:
        self.path = path
        self._host = host
        self._run = run
        self._taps: dict[str, Tap] = {}
        self._values: dict[str, Any] = {}

    @property
    def now(self) -> float:
        """See `Look`."""
        return self._run.elapsed()

    def latest(self, port: str) -> Any:
        """See `Look`."""
        tap = self._taps.get(port)
        if tap is None:
            if len(self._taps) >= _MOST_TAPS:
                raise Refused("usage", f"a view looks at {_MOST_TAPS} ports at most", self.path)
            path = f"{self.path}/{port}" if "." in port else f"{self.path}.{port}"
            tap = self._taps[port] = self._run.tap(place_at(self._host.graph, path), size=1)
        if tap.latest is not None and not tap.latest.is_marker:
            self._values[port] = tap.latest.value
        return self._values.get(port)

    def active(self) -> list[str]:
        """See `Look`."""
        inside = f"{self.path}/"
        active = self._host.spans.active
        return [one.removeprefix(inside) for one in active if one.startswith(inside)] + [""] * (self.path in active)

    def close(self) -> None:
        """Look no more."""
        for tap in self._taps.values():
            tap.close()


class SceneTopic(RunTopic):
    """The newest scene of a view."""

    credit = 1
    most_hz = 15.0

    def __init__(self, host: Following, path: str, name: str) -> None:
        super().__init__(host)
        self._path, self._name = path, name
        self._node, self._view = offered_view(host.graph, path, name)
        self._look: _Look | None = None

    @override
    def attach(self, run: Run) -> None:
        self._node, self._view = offered_view(self.host.graph, self._path, self._name)
        group = self.host.tables.of["nodes"][self._path].group
        if self.host.tables.of["groups"][group].number:
            raise Refused(
                "state",
                f'a view is drawn on the loop of the graph, but "{self._path}" runs in group "{group}"; let it run on '
                "the loop",
                self._path,
            )
        self._look = _Look(self.host, run, self._path)

    @override
    def let_go(self) -> None:
        if self._look is not None:
            self._look.close()
            self._look = None

    @override
    def news(self) -> Any:
        if self._look is None:
            return None
        try:
            scene = self._view.draw(self._node, self._look)
        except HfgError:
            raise
        except Exception as error:
            raise Refused("failed", f'view "{self._name}" of "{self._path}" failed: {in_words(error)}') from error
        if scene is None:
            return None
        if not isinstance(scene, Scene):
            raise Refused("failed", f'view "{self._name}" of "{self._path}" gives a Scene or None, not {scene!r:.60}')
        return lambda: scene_as_data(scene)


def scene_as_data(scene: Scene) -> dict[str, Any]:
    """Return a scene as a page takes it, without the shapes that cannot be drawn."""
    shapes = []
    for kind, *rest in scene.shapes:
        try:
            shapes.append([kind, *(_data(one) for one in rest)])
        except (TypeError, ValueError):
            continue
    return {"bounds": list(scene.bounds), "caption": scene.caption, "shapes": shapes}


def _data(value: Any) -> Any:
    if isinstance(value, str):
        return value
    if is_picture(value):
        return base64.b64encode(image_frame(value, _LONGEST, _QUALITY)[_SIZE:]).decode()
    numbers = np.asarray(value, np.float64)
    if not np.isfinite(numbers).all():
        raise ValueError("a place is a finite number")
    return np.round(numbers, 3).tolist()
