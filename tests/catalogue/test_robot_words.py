"""Words that people who build robots search for find the node that they mean, among the first three."""

from __future__ import annotations

from typing import Final

from hfg.catalogue import index_of, installed, ranked
from hfg.catalogue.offers import Offer

WORDS: Final = """
pure pursuit                | pure_pursuit
slew rate                   | LimitTwist
collision check             | slow_for_obstacles
stanley controller          | stanley_steering
tf                          | LookupTransform TransformPose
lookup transform            | LookupTransform
transform point cloud       | TransformCloud
transform pose              | TransformPose
static transform publisher  | fixed_frame
tf broadcaster              | broadcast_pose
quaternion to euler         | euler_angles
roll pitch yaw              | euler_angles transform_of_angles
slerp                       | interpolate_transforms
invert transform            | invert_transform
compose transforms          | compose_transforms
rigid transform             | transform_points TransformPose
point cloud                 | scan_to_cloud rings_to_cloud TransformCloud
laserscan to pointcloud     | scan_to_cloud
pointcloud to laserscan     | cloud_to_scan
velodyne                    | rings_to_cloud
vlp16                       | rings_to_cloud
3d lidar                    | rings_to_cloud
voxel grid                  | voxel_grid
downsample point cloud      | voxel_grid
crop box                    | crop_box
passthrough filter          | crop_box crop_distance
remove nan points           | finite_points
ransac                      | fit_plane
plane segmentation          | fit_plane split_plane
ground removal              | split_ground
ground segmentation         | split_ground
euclidean clustering        | cluster_points
dbscan                      | cluster_points
cluster point cloud         | cluster_points
occupancy grid              | obstacle_grid
costmap                     | grid_costs
inflate obstacles           | grid_costs
shadow filter               | filter_scan_shadows
laser range filter          | filter_scan_ranges
scan angle filter           | filter_scan_angles
median filter scan          | filter_scan_median
kalman filter               | KalmanFilter
extended kalman filter      | KalmanFilter FuseGyro
alpha beta filter           | AlphaBeta
multi target tracking       | TrackPoints
data association            | TrackPoints
hungarian                   | TrackPoints
track people                | TrackPoints
mahalanobis                 | TrackPoints
wheel odometry              | IntegrateTwist differential_twist
dead reckoning              | IntegrateTwist
differential drive          | differential_twist
skid steering               | differential_twist
ackermann                   | ackermann_twist
bicycle model               | ackermann_twist
omni wheels                 | OmniTwist
holonomic drive             | OmniTwist
imu fusion                  | FuseGyro
gyroscope bias              | FuseGyro
sensor fusion               | FuseGyro
path planning               | plan_path
scan matching               | match_scan
tf2                         | LookupTransform
obstacle map                | obstacle_grid
butterworth                 | Butterworth
low pass filter             | Butterworth low_pass LowPass
band pass filter            | Butterworth
notch filter                | Notch
mains hum                   | Notch
transfer function           | TransferFunction
slew limit                  | LimitSlew LimitTwist
fft                         | fourier_transform spectrum
frequency spectrum          | spectrum
zero order hold             | SampleAndHold
hybrid a star               | plan_maneuver
reverse parking             | plan_maneuver
dubins                      | plan_maneuver
smooth path                 | smooth_path
footprint collision         | check_path
velocity limit              | LimitTwist
obstacle stop               | slow_for_obstacles
slam                        | SlamScans
gmapping                    | SlamScans MapScans
occupancy grid mapping      | MapScans SlamScans
log odds                    | MapScans
likelihood field            | match_scan_to_grid
localization in map         | match_scan_to_grid SlamScans
map_server                  | load_map save_map
save map                    | save_map
load map                    | load_map
ekf                         | ExtendedKalmanFilter
jacobian                    | ExtendedKalmanFilter
cluster to detection        | cluster_detections
crop image                  | crop_image crop_boxes
region of interest          | crop_image crop_boxes
aruco pose                  | marker_poses
camera matrix marker        | marker_poses
onnx                        | RunNetwork DetectObjects
yolo                        | yolo_boxes DetectObjects
ssd detector                | ssd_boxes DetectObjects
object detection            | DetectObjects
neural network              | RunNetwork DetectObjects
letterbox                   | image_tensor
non maximum suppression     | yolo_boxes ssd_boxes
3d markers                  | scene_of_tracks scene_of_clusters scene_of_path
"""


def test_words_of_robotics_find_their_nodes() -> None:
    library = installed([Offer("hfg.nodes")])
    index, missing = index_of(library.types), []
    for line in WORDS.strip().splitlines():
        words, _, meant = line.partition("|")
        found = [library.types[one].reference.rpartition(":")[2] for one in ranked(index, words)[:3]]
        if not set(meant.split()) & set(found):
            missing.append(f"{words.strip()}: {found}")
    assert not missing, "\n".join(missing)
