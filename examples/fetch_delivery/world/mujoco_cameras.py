"""The same arena before MuJoCo's cameras: light, perspective and textures by OpenGL, for who has it.

Another renderer than the light one, written by others: what is recognised in the pictures of both is not made for one
of them. Panels, prints, motion blur and noise are those of the light one. Needs the package `mujoco`, and OpenGL that
works without a screen.
"""

from __future__ import annotations

import importlib
import math
import os
import sys
from typing import Any, Final

import cv2
import numpy as np

from examples.fetch_delivery import signs
from examples.fetch_delivery.messages import Picture, Vector
from examples.fetch_delivery.world.arena import Arena
from examples.fetch_delivery.world.rendering import (
    BASKET,
    FOCAL_PX,
    FRONT,
    HEIGHT,
    WIDTH,
    Camera,
    Cube,
    Renderer,
    Round,
)

_THIN: Final = 0.002  # half of a panel
_MOST_AROUND: Final = 12
_BASKET_AT: Final = 100.0  # metres from the arena, so that neither camera sees what the other one does
_AWAY: Final = (0.0, 0.0, -50.0)
_CUBE_SHADE: Final = 225
_GREY: Final = 1 / 255
_REMEDY: Final = (
    "on Debian and Ubuntu: apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri, and MUJOCO_GL=egl in the environment; "
    "or apt-get install libosmesa6, and MUJOCO_GL=osmesa"
)


class CamerasMissing(Exception):
    """MuJoCo's cameras cannot be used here; the text says what is missing, and what to do."""


class MujocoRenderer(Renderer):
    """Takes pictures of one arena by MuJoCo.

    Raises:
      CamerasMissing: without the package, or without OpenGL.
    """

    def __init__(self, arena: Arena) -> None:
        """Describe the scene to MuJoCo; the context to draw in belongs to the thread that makes it."""
        super().__init__(arena)
        self._mujoco = mujoco = _imported()
        self._named: set[str] = set()
        self._m = mujoco.MjModel.from_xml_string(self._scene(), self._files())
        self._d = mujoco.MjData(self._m)
        try:
            self._gl = mujoco.Renderer(self._m, HEIGHT, WIDTH)
        except Exception as error:  # what is missing decides whether it is PyOpenGL's, of ctypes or MuJoCo's
            raise _without_opengl(error) from error
        for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
            self._gl.scene.flags[flag] = 0

    def close(self) -> None:
        """Release the context."""
        self._gl.close()

    def _draw_front(
        self, pose: tuple[float, float, float], around: tuple[Round, ...], hidden: frozenset[str]
    ) -> Picture:
        if len(around) > _MOST_AROUND:
            raise ValueError(f"at most {_MOST_AROUND} things can stand about before this camera, not {len(around)}")
        self._place("robot", (pose[0], pose[1], 0.0), pose[2])
        for number in range(_MOST_AROUND):
            if number < len(around):
                self._stand(f"around {number}", around[number])
            else:
                self._place(f"around {number}", _AWAY, 0.0)
        for name in self._named:
            self._m.geom(name).rgba[3] = 0.0 if name in hidden else 1.0
        return self._look("front")

    def _draw_basket(self, cube: Cube | None) -> Picture:
        if cube is None:
            self._place("cube", _AWAY, 0.0)
            return self._look("basket")
        ahead = BASKET.ahead + cube.distance + signs.CUBE_M / 2
        self._place("cube", (_BASKET_AT + ahead, cube.left, BASKET.height - 0.05), cube.yaw)
        material = self._m.material(f"{'smeared' if cube.smeared else 'cube'} {cube.number}").id
        for side in range(4):
            self._m.geom(f"side {side}").matid = material
        return self._look("basket")

    def _look(self, camera: str) -> Picture:
        self._mujoco.mj_kinematics(self._m, self._d)
        self._mujoco.mj_camlight(self._m, self._d)
        self._gl.update_scene(self._d, camera=camera)
        return np.asarray(cv2.cvtColor(self._gl.render(), cv2.COLOR_RGB2GRAY), np.uint8)

    def _stand(self, name: str, thing: Round) -> None:
        geom = self._m.geom(name)
        geom.size[:2] = thing.radius, thing.height / 2
        geom.rgba[:3] = thing.shade * _GREY
        self._place(name, (thing.x, thing.y, thing.height / 2 + 0.01), 0.0)

    def _place(self, body: str, at: tuple[float, float, float], theta: float) -> None:
        mocap = int(self._m.body(body).mocapid[0])
        self._d.mocap_pos[mocap] = at
        self._d.mocap_quat[mocap] = (math.cos(theta / 2), 0.0, 0.0, math.sin(theta / 2))

    # --- the description ---

    def _files(self) -> dict[str, bytes]:
        return {
            f"{name}.png": cv2.imencode(".png", cv2.cvtColor(copies[0], cv2.COLOR_GRAY2BGR))[1].tobytes()
            for name, copies in self._prints.items()
        }

    def _scene(self) -> str:
        prints = "".join(
            f'<texture name="{name}" type="2d" file="{name}.png"/><material name="{name}" texture="{name}"/>'
            for name in self._prints
        )
        around = "".join(
            f'<body name="around {number}" mocap="true">'
            f'<geom name="around {number}" type="cylinder" size=".25 .2" rgba="0 0 0 1"/></body>'
            for number in range(_MOST_AROUND)
        )
        return f"""<mujoco>
<statistic extent="10" center="0 0 0"/>
<visual>
  <global offwidth="{WIDTH}" offheight="{HEIGHT}"/><map znear=".004" zfar="4"/><quality shadowsize="0" offsamples="0"/>
  <headlight ambient=".55 .55 .55" diffuse=".4 .4 .4" specular="0 0 0"/>
</visual>
<default><geom contype="0" conaffinity="0"/></default>
<asset>
  <texture name="sky" type="skybox" builtin="gradient" rgb1=".78 .78 .78" rgb2=".6 .6 .6" width="64" height="64"/>
  {prints}
</asset>
<worldbody>
  <geom type="plane" size="8 8 .1" rgba=".45 .45 .45 1"/>{self._standing()}{around}
  <body name="robot" mocap="true">{_camera("front", FRONT)}</body>
  <body pos="{_BASKET_AT} 0 0">{_camera("basket", BASKET)}{_basket()}</body>
  <body name="cube" mocap="true">{_cube()}</body>
</worldbody>
</mujoco>"""

    def _standing(self) -> str:
        """Return the panels of the light renderer as thin boxes."""
        named = {id(copies): name for name, copies in self._prints.items()}
        boxes = []
        for panels in (self._outer, self._inner):
            for corners, back, surface, name in zip(
                panels.corners, panels.normals, panels.surfaces, panels.names, strict=True
            ):
                right, up = corners[1] - corners[0], corners[0] - corners[3]
                size = float(np.linalg.norm(right)) / 2, float(np.linalg.norm(up)) / 2
                look = f'rgba="{_rgb(surface)} 1"' if isinstance(surface, int) else f'material="{named[id(surface)]}"'
                boxes.append(_box(corners.mean(0) + _THIN * back, right, up, size, look, name))
                if name:
                    self._named.add(name)
        return "".join(boxes)


def _imported() -> Any:
    """Import MuJoCo; it decides then, and once for all, by what it draws."""
    if sys.platform == "linux" and "mujoco" not in sys.modules:
        os.environ.setdefault("MUJOCO_GL", "egl")  # what it takes by itself needs a screen
    try:
        mujoco = importlib.import_module("mujoco")
        importlib.import_module("mujoco.renderer")
    except ModuleNotFoundError as error:
        if error.name != "mujoco":
            raise
        raise CamerasMissing("MuJoCo's cameras need the package mujoco; pip install 'hfg[mujoco]'") from None
    except Exception as error:
        raise _without_opengl(error) from error
    return mujoco


def _without_opengl(error: Exception) -> CamerasMissing:
    told = (str(error).strip() or type(error).__name__).splitlines()[0].rstrip(".")
    tried = os.environ.get("MUJOCO_GL", "")
    return CamerasMissing(f"MuJoCo cannot draw with MUJOCO_GL={tried}, OpenGL is missing ({told}); {_REMEDY}")


def _numbers(values: Any) -> str:
    return " ".join(f"{float(value):.6f}" for value in values)


def _rgb(shade: float) -> str:
    return _numbers([shade * _GREY] * 3)


def _box(middle: Any, right: Any, up: Any, size: tuple[float, float], look: str, name: str = "") -> str:
    """Return a thin box whose picture looks to where `right` and `up` are right and up."""
    called = f'name="{name}" ' if name else ""
    axes = _numbers([*right, *up])
    return (
        f'<geom {called}type="box" pos="{_numbers(middle)}" xyaxes="{axes}" size="{_numbers([*size, _THIN])}" {look}/>'
    )


def _camera(name: str, camera: Camera) -> str:
    up = _numbers([0, -1, 0, math.tan(camera.pitch), 0, 1])
    fovy = 2 * math.degrees(math.atan(HEIGHT / 2 / FOCAL_PX))
    return f'<camera name="{name}" pos="{camera.ahead} 0 {camera.height}" xyaxes="{up}" fovy="{fovy}"/>'


def _basket() -> str:
    """Return its bottom, where the cube stands, and its sides: all darker than paper."""
    bottom = BASKET.height - 0.05 - signs.CUBE_M / 2
    far, wide, high = 0.3, 0.2, 0.12
    ahead, left, above = np.eye(3)
    dark, darker = f'rgba="{_rgb(120)} 1"', f'rgba="{_rgb(90)} 1"'
    return "".join(
        [
            _box((far / 2, 0, bottom - _THIN), -left, ahead, (wide, far), dark),
            _box((far, 0, bottom + high), -left, above, (wide, high), darker),
            _box((far / 2, wide, bottom + high), ahead, above, (far, high), darker),
            _box((far / 2, -wide, bottom + high), -ahead, above, (far, high), darker),
        ]
    )


def _cube() -> str:
    """Return a cube whose four sides bear a print."""
    half = signs.CUBE_M / 2
    inside = half - 2 * _THIN
    core = f'<geom type="box" size="{_numbers([inside, inside, half])}" rgba="{_rgb(_CUBE_SHADE)} 1"/>'
    sides = []
    for side in range(4):
        facing = side * math.pi / 2
        normal: Vector = np.array([math.cos(facing), math.sin(facing), 0.0])
        right = np.array([-normal[1], normal[0], 0.0])
        sides.append(_box(normal * (half - _THIN), right, (0, 0, 1), (half, half), 'material="cube 1"', f"side {side}"))
    return core + "".join(sides)
