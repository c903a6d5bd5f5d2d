"""One hundred searches as people write them, each with the node types that a person may mean by it.

They were written before the search, from tasks and not from the names of the types, together with the types that they
mean. `HELD_OUT` were chosen at random then. Nobody tunes the search by them, so their score tells how it fares with
words that it has not met; a query that is used for tuning moves to `QUERIES`, and another one takes its place.
"""

from __future__ import annotations

from typing import Final

__all__ = ["HELD_OUT", "QUERIES"]

_EVERY: Final = """
webcam                              | video:Camera
print                               | display:TextDisplay files:StandardOutput display:log_value files:WriteLines
timer                               | time:Ticker time:Clock activity:Wait time:Schedule
regex                               | values:matches_text values:search_text values:replace_pattern values:find_all
path planning                       | robotics:plan_path
background subtraction              | video:BackgroundSubtractor
integrator                          | values:Integral
saturation                          | values:clamp
time synchronizer                   | flow:Synchronizer flow:JoinByStamp
fft                                 | cv:dft
csv reader                          | files:CsvRows files:read_csv
rate limiter                        | flow:Throttle
face detection                      | vision:CascadeDetector
crop                                | cv:get_rect_sub_pix
kalman                              | robotics:LandmarkMap robotics:TrackDisks
coins                               | cv:hough_circles robotics:find_disks
blur image                          | cv:blur cv:gaussian_blur cv:median_blur cv:stack_blur cv:box_filter
edge detection                      | cv:canny cv:sobel cv:laplacian cv:scharr
resize picture                      | cv:resize
rotate an image                     | cv:rotate cv:warp_affine cv:get_rotation_matrix_2d
grayscale                           | cv:cvt_color cv:decolor
save video                          | video:WriteVideo
read video file                     | video:VideoFile
write json file                     | files:WriteJson files:WriteJsonLines
load image from disk                | files:read_image files:ImageFiles
show picture on screen              | display:ImageDisplay
plot values over time               | display:TimePlot
scatter plot                        | display:ScatterPlot
qr code reader                      | vision:BarcodeReader
make qr code                        | vision:qr_code
barcode scanner                     | vision:BarcodeReader
aruco                               | vision:MarkerDetector
chessboard calibration              | vision:CameraCalibration vision:ChessboardFinder cv:find_chessboard_corners
optical flow                        | video:OpticalFlow cv:calc_optical_flow_farneback cv:calc_optical_flow_pyr_lk
track object                        | video:ObjectTracker video:PointTracker
pid controller                      | values:PID
low pass filter                     | values:LowPass
moving average                      | values:MovingAverage
running median                      | values:MovingMedian
standard deviation                  | values:Statistics values:WindowStatistics cv:mean_std_dev
random numbers                      | values:RandomUniform values:RandomNormal values:RandomInt
gaussian noise                      | values:AddNoise values:RandomNormal values:AddNoiseToVector
sine wave                           | values:waveform
derivative                          | values:Derivative
convert degrees to radians          | values:radians_of
parse json                          | values:ParseJson
string to number                    | values:ParseFloat values:ParseInt
split string                        | values:split_text values:split_lines
concatenate strings                 | values:join_text values:join_list
uppercase                           | values:change_case
string formatting                   | values:format_text values:format_fields
sort a list                         | collections:sort_items
remove duplicates                   | collections:unique_items flow:Distinct flow:Different
dictionary lookup                   | collections:MapLookup collections:get_field
if else                             | logic:choose flow:switch activity:Branch
switch between inputs               | flow:Mux
route value to one of several outputs | flow:Demux flow:switch
merge two streams                   | flow:Merge
buffer last values                  | flow:Recent flow:Window flow:HoldableBuffer flow:Cache
sliding window                      | flow:Window flow:TimeWindow flow:Recent collections:windows
debounce button                     | flow:Debounce logic:Stable
delay                               | flow:Delay
every tenth value                   | flow:EveryNth
skip the first values               | flow:Skip
count messages                      | flow:Count
stopwatch                           | time:Stopwatch
timeout                             | activity:TimeLimit time:Deadline
retry on failure                    | activity:Retry
run steps one after another         | activity:Sequence
state machine fallback              | activity:Fallback
watchdog                            | time:Deadline
frames per second                   | time:RateMeter
latency                             | time:age time:Stopwatch
hysteresis                          | logic:Hysteresis
rising edge                         | logic:Edges
both conditions true                | logic:logical_and
majority vote                       | logic:at_least
toggle switch                       | logic:Toggle logic:FlipFlop
obstacle distance from laser        | robotics:nearest_obstacle
scan matching localization          | robotics:match_scan
slam                                | robotics:LandmarkMap robotics:match_scan
point cloud from lidar              | robotics:scan_points
stereo depth                        | vision:StereoDepth
pose estimation                     | cv:solve_pnp cv:solve_pnp_generic cv:solve_pnp_ransac cv:recover_pose
homography                          | cv:find_homography
feature matching                    | vision:match_descriptors
sift keypoints                      | vision:KeypointDetector
pedestrian detection                | vision:PeopleDetector
svm                                 | learning:SvmTrainer learning:Classifier
random forest                       | learning:RandomTreesTrainer
nearest neighbour classifier        | learning:NearestTrainer learning:Classifier
draw bounding boxes                 | vision:draw_boxes
write text on image                 | cv:put_text
largest blob                        | cv:connected_components_with_stats cv:find_contours cv:connected_components
fill holes                          | cv:morphology_ex cv:flood_fill cv:inpaint
denoise                             | cv:fast_nl_means_denoising cv:fast_nl_means_denoising_colored
contrast enhancement                | vision:EqualizeLocally cv:equalize_hist cv:convert_scale_abs
binarize                            | cv:threshold cv:adaptive_threshold
template matching                   | cv:match_template
heatmap                             | cv:apply_color_map
"""

_HELD_OUT: Final = frozenset(
    {
        16,
        17,
        20,
        21,
        22,
        24,
        26,
        28,
        31,
        38,
        43,
        45,
        48,
        51,
        55,
        63,
        64,
        65,
        67,
        68,
        72,
        73,
        77,
        81,
        83,
        86,
        87,
        88,
        91,
        92,
    }
)


def _read() -> tuple[tuple[str, frozenset[str]], ...]:
    pairs = (line.split("|") for line in _EVERY.strip().splitlines())
    return tuple((words.strip(), frozenset(f"hfg.nodes.{one}" for one in meant.split())) for words, meant in pairs)


QUERIES: Final = tuple(one for number, one in enumerate(_read()) if number not in _HELD_OUT)
HELD_OUT: Final = tuple(one for number, one in enumerate(_read()) if number in _HELD_OUT)
