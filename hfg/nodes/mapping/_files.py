"""Maps in files, as ROS's map_server has them: a picture, and a YAML file that says what its pixels mean.

The format is that of wiki.ros.org/map_server: the first row of the picture has the greatest y, dark is occupied.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import yaml
from annotated_types import Interval, MinLen

from hfg.base.clock import now
from hfg.encoding.pictures import need_fair_size
from hfg.errors import shown
from hfg.geometry import Grid, Transform
from hfg.nodes._extras import require
from hfg.nodes.files.access import FilePath, named, read_whole, write_whole
from hfg.nodetypes.functions import node

_FREE, _UNKNOWN, _OCCUPIED = 254, 205, 0  # pixels, as map_saver writes them
_NUMBERS: Final = {"resolution": None, "negate": 0.0, "occupied_thresh": 0.65, "free_thresh": 0.196}


@node
def save_map(
    grid: Grid,
    path: FilePath,
    *,
    occupied: Annotated[int, Interval(ge=1, le=100)] = 65,
    free: Annotated[int, Interval(ge=0, le=99)] = 25,
) -> Path:
    """Save an occupancy grid as a map file of ROS: a PNG picture and a YAML file, as map_saver writes them.

    Fires once per grid with its path. Both files are replaced only as a whole, the picture first. Writing blocks the
    loop; put the node into a thread group if maps are large.

    Args:
      grid: 0 to 100 percent, -1 where nothing is known, such as that of `MapScans`; its origin must not be tilted.
      path: path of the YAML file, "maps/house.yaml"; the picture is "maps/house.png".
      occupied: least value of an obstacle.
      free: greatest value of a free cell; what lies between is written as unknown.

    Returns:
      out: path of the YAML file.

    Raises:
      ValueError: the grid has no cells, or its origin is tilted; or the path is not valid.
      OSError: a file cannot be written; the message says why.
    """
    place = named(path)
    if not grid.values.size:
        raise ValueError(f'the map in frame "{grid.frame_id}" is empty; there is nothing to save')
    roll, pitch, yaw = grid.origin.angles
    if abs(roll) > 1e-6 or abs(pitch) > 1e-6:
        raise ValueError(f"a map file has no room for an origin that is tilted, got roll {roll:g} and pitch {pitch:g}")
    values = np.nan_to_num(grid.values.astype(np.float64), nan=-1.0)
    picture = np.full(values.shape, _UNKNOWN, np.uint8)
    picture[(values >= 0) & (values <= free)] = _FREE
    picture[values >= occupied] = _OCCUPIED
    cv2 = require("cv2", "vision")
    _, encoded = cv2.imencode(".png", np.ascontiguousarray(picture.T[::-1]))
    x, y, _ = grid.origin.translation.tolist()
    target = place.with_suffix(".png")
    about = {
        "image": target.name, "mode": "trinary", "resolution": float(grid.cell), "origin": [x, y, yaw], "negate": 0,
        "occupied_thresh": 0.65, "free_thresh": 0.196,
    }  # fmt: skip
    write_whole(target, lambda file: file.write(encoded.tobytes()))
    text = yaml.safe_dump(about, sort_keys=False).encode()
    write_whole(place, lambda file: file.write(text))
    return place


@node
def load_map(path: FilePath, *, frame_id: Annotated[str, MinLen(1)] = "map") -> Grid:
    """Load an occupancy grid from a map file of ROS's map_server: a YAML file that names a PNG or PGM picture.

    Fires once per path. Reading blocks the loop; put the node into a thread group if maps are large.

    Args:
      path: path of the YAML file.
      frame_id: the frame of the map, which the file does not say.

    Returns:
      out: 100 for occupied, 0 for free, -1 for unknown; in the modes "scale" and "raw" of a file also what lies
        between. Its stamp is now.

    Raises:
      ValueError: the YAML file or the picture is not a map; the message says what is missing.
      OSError: a file cannot be read; the message says why.
    """
    place = named(path)
    about = _read_about(place)
    data = read_whole(_image_of(place, about))
    need_fair_size(data, f'the picture of the map "{place}"')
    cv2 = require("cv2", "vision")
    try:
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE) if data else None
    except cv2.error:
        picture = None
    if picture is None:
        raise ValueError(f'"{_image_of(place, about)}" is not a picture: a map needs a PNG or PGM file')
    x, y, yaw = about["origin"]
    values = _values(picture, about)
    return Grid(frame_id, now(), Transform.of(x, y, yaw=yaw), about["resolution"], np.ascontiguousarray(values[::-1].T))


def _image_of(place: Path, about: dict[str, Any]) -> Path:
    return place.parent / str(about["image"])  # an absolute path stays one


def _read_about(place: Path) -> dict[str, Any]:
    """Return what a YAML file says of a map.

    Raises:
      ValueError: it is not one.
    """
    try:
        read = yaml.safe_load(read_whole(place))
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        raise ValueError(f'"{place}" is not a map: it is not YAML: {" ".join(str(error).split())}') from None
    about: dict[str, Any] = read if isinstance(read, dict) else {}
    wrong = [f'no "{name}"' for name in ("image", "resolution", "origin") if name not in about]
    for name, usual in _NUMBERS.items():
        about.setdefault(name, usual)
        if not _is_number(about[name]) and not wrong:
            wrong.append(f"{name} is {shown(about[name])}, not a number")
    origin = about.get("origin")
    if not wrong and not (isinstance(origin, list) and len(origin) == 3 and all(map(_is_number, origin))):
        wrong.append(f"origin is {shown(origin)}, not x, y and yaw")
    if not wrong and not about["resolution"] > 0:
        wrong.append(f"resolution is {about['resolution']} m, not a length")
    if not wrong and about.get("mode", "trinary") not in ("trinary", "scale", "raw"):
        wrong.append(f'mode is {shown(about["mode"])}, not "trinary", "scale" or "raw"')
    if wrong:
        raise ValueError(f'"{place}" is not a map of ROS: {", ".join(wrong)}; write one with mapping.save_map')
    about["resolution"], about["origin"] = float(about["resolution"]), [float(one) for one in about["origin"]]
    return about


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and math.isfinite(value) and abs(value) < 1e15


def _values(picture: Any, about: dict[str, Any]) -> Any:
    mode = about.get("mode", "trinary")
    if mode == "raw":
        return np.where(picture <= 100, picture, 255).astype(np.uint8).view(np.int8)  # 255 is -1
    share = picture / 255 if about["negate"] else (255 - picture.astype(np.float64)) / 255
    low, high = about["free_thresh"], about["occupied_thresh"]
    between = np.rint(1 + 98 * (share - low) / max(high - low, 1e-9)) if mode == "scale" else np.full(share.shape, -1.0)
    values = np.where(share > high, 100, np.where(share < low, 0, np.clip(between, -1, 100)))
    return values.astype(np.int8)
