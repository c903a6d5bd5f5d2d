"""Values of robots in space: transforms, frames over time, scans of lasers, point clouds, grids.

    transforms   Transform, and the arrays it consists of
    records      values with a frame and a stamp: FrameTransform, PoseInFrame, LaserScan, RingScan, PointCloud, Grid;
                 Twist
    scenes       what a 3-D view shows: Scene, of Solid, Line and Label
    tree         TransformTree: frames over time, and how to get from one to another

Lengths are in metres, angles in radians, stamps in seconds on the run's clock. Frames are right-handed: x ahead, y to
the left, z up. Quaternions are Hamilton's, in the order x, y, z, w, as in ROS and SciPy. Recordings write these values
in Foxglove's schemas. Depends on `types` and numpy.
"""

from hfg.geometry.records import FrameTransform, Grid, LaserScan, PointCloud, PoseInFrame, RingScan, Twist
from hfg.geometry.scenes import Label, Line, Scene, Solid
from hfg.geometry.transforms import Coordinates, Quaternion, Transform, Vector3
from hfg.geometry.tree import FrameError, TransformTree

__all__ = [
    "Coordinates",
    "FrameError",
    "FrameTransform",
    "Grid",
    "Label",
    "LaserScan",
    "Line",
    "PointCloud",
    "PoseInFrame",
    "Quaternion",
    "RingScan",
    "Scene",
    "Solid",
    "Transform",
    "TransformTree",
    "Twist",
    "Vector3",
]
