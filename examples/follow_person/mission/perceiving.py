"""Perception: from a scan to obstacles, from these to tracks, from pictures to clothes (figure 22, on its left)."""

from __future__ import annotations

import hfg
from examples.follow_person.messages import Imu, Photo, RingScan, Twist
from examples.follow_person.perception.bodies import level_cloud, make_scene, upright_bodies
from examples.follow_person.perception.clothes import Clothes, picture_of
from examples.follow_person.perception.records import Look, Person, Scene
from examples.follow_person.perception.standing import SplitStanding
from hfg.geometry import Grid, PointCloud
from hfg.nodes import clouds, estimation, flow, vision

REACH_M = 13.0
"""What is farther away is not looked at."""


class Perception(hfg.Subgraph):
    """What the robot knows: where it is, what is in its way, who is around and wears what.

    Attributes:
      scan: of the laser.
      odometry: velocity by the wheels.
      imu: of the inertial unit.
      photo: pictures of the camera.
      person: who is followed.
      obstacles: points of all obstacles, in the frame of the robot.
      grid: the same as a grid.
      scene: who is around.
      looks: what they wear.
      seen: a picture and the scene of its moment.
    """

    scan, odometry, imu = hfg.Input(RingScan), hfg.Input(Twist), hfg.Input(Imu)
    photo, person = hfg.Input(Photo), hfg.slot(type=Person)
    obstacles, grid, scene = hfg.Output(PointCloud), hfg.Output(Grid), hfg.Output(Scene)
    looks, seen = hfg.Event(dict[int, Look]), hfg.Event(list[object])

    def build(self, graph: hfg.Graph) -> None:
        """Connect what measures with what learns."""
        self._see_obstacles(graph)
        self._see_people(graph)
        self._look_at_them(graph)

    def _see_obstacles(self, graph: hfg.Graph) -> None:
        """Import the cloud, and take the ground out."""
        cloud, level = graph.add(clouds.rings_to_cloud(), name="cloud"), graph.add(level_cloud(), name="level")
        near = graph.add(clouds.crop_distance(low=0.5, high=REACH_M), name="near")
        ground = graph.add(clouds.split_ground(height=0.0, slope=0.25, reach=REACH_M), name="ground")
        grid = graph.add(clouds.obstacle_grid(cell=0.1, size=2 * REACH_M - 2), name="obstacle_grid")
        graph.connect(self.scan.inner, cloud.scan)
        graph.connect(cloud.out, level.cloud)
        graph.connect(self.imu.inner, level.imu)
        graph.connect(level.out, near.cloud)
        graph.connect(near.out, ground.cloud)
        graph.connect(ground.obstacles, grid.cloud)
        graph.connect(ground.obstacles, self.obstacles.inner)
        graph.connect(grid.out, self.grid.inner)

    def _see_people(self, graph: hfg.Graph) -> None:
        """Cluster what does not stand, and track what could be people."""
        localise = graph.add(estimation.FuseGyro(), name="localise")
        standing = graph.add(SplitStanding(), name="standing")
        clusters = graph.add(clouds.cluster_points(gap=0.35, least=4), name="clusters")
        bodies = graph.add(upright_bodies(), name="bodies")
        tracks = graph.add(estimation.TrackPoints(noise=0.12, acceleration=2.5, gate=3.5, forget_s=1.5), name="tracks")
        scene = graph.add(make_scene(), name="scene")
        graph.connect(self.odometry.inner, localise.twist)
        graph.connect(self.imu.inner, graph.add(yaw_rate(), name="yaw_rate").imu)
        graph.connect(graph["yaw_rate"].ports.outputs["out"], localise.yaw_rate)
        graph.connect(graph["ground"].ports.outputs["obstacles"], standing.obstacles)
        graph.connect(tracks.tracks, standing.tracks, initial=([],))
        graph.connect(self.person.inner, standing.person)
        graph.connect(standing.others, clusters.cloud)
        graph.connect(clusters.labelled, bodies.labelled)
        graph.connect(bodies.out, tracks.detections)
        graph.connect(tracks.tracks, scene.tracks)
        graph.connect(bodies.out, scene.bodies)
        graph.connect(self.imu.inner, scene.imu)
        graph.connect(self.odometry.inner, scene.odometry)
        for node in (standing, bodies, scene):
            graph.connect(localise.pose, node.pose)
        graph.connect(scene.out, self.scene.inner)

    def _look_at_them(self, graph: hfg.Graph) -> None:
        """Join each picture with the scene of its moment."""
        same_moment = graph.add(flow.JoinByStamp(values=2), name="same_moment")
        clothes = graph.add(Clothes(), name="clothes")
        graph.connect(self.photo.inner, same_moment.values[0])
        graph.connect(graph["scene"].ports.outputs["out"], same_moment.values[1])
        graph.connect(same_moment.joined, clothes.seen, overflow="latest")
        graph.connect(same_moment.joined, self.seen.inner, overflow="latest")
        graph.connect(clothes.looks, self.looks.inner)


class SeePeople(hfg.Subgraph):
    """Find people in pictures.

    Attributes:
      seen: a picture and the scene of its moment.
      people: boxes of people in a picture, and what they were found in.
    """

    seen, people = hfg.slot(type=list[object]), hfg.Event(list[object])

    def build(self, graph: hfg.Graph) -> None:
        """Detect people, and join them with what was seen."""
        picture = graph.add(picture_of(), name="picture")
        detector = graph.add(vision.PeopleDetector(threshold=0.0, pyramid=1.1), name="detector")
        both = graph.add(flow.JoinByStamp(values=2), name="both")
        graph.connect(self.seen.inner, picture.seen, overflow="latest")
        graph.connect(picture.out, detector.image)
        graph.connect(detector.boxes, both.values[0])
        graph.connect(self.seen.inner, both.values[1])
        graph.connect(both.joined, self.people.inner)


@hfg.node
def yaw_rate(imu: Imu) -> float:
    """Return how fast the robot turns.

    Args:
      imu: of the inertial unit.
    """
    return imu.yaw_rate
