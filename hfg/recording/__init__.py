"""Recording the tokens of a run's ports to MCAP files, and playing them back.

playing     changes a graph so that it plays a recording  `hfg play`
choosing    the nodes that play it
stand_ins   the types that take their places
players     play step by step, each at its time
tracks      the steps of one node: firings, calls, signals
course      activity, parameters, edits and errors by time
seeking     messages by time, chunk by chunk              `hfg studio run.mcap`
reading     files, including damaged ones                 `hfg info`
recovering  makes a complete file of an incomplete one    `hfg recover`
exporting   writes a bag of ROS 2                        `hfg recover --format rosbag2`
bags        opens a bag of ROS 2 as a file
rosmessages tokens from messages of ROS 2
recording   which ports, description of the run           `run.record`, `hfg record`
writing     the thread that encodes and writes
mcap        the file: chunks, indexes, summary
layout      where everything is in a file, damaged or not
chunks      the contents of a chunk, within bounds
messages    the form of a token in it
schemas     JSON schemas, Foxglove's for images
foxglove    Foxglove's schemas for scans, clouds, grids, poses and transforms
values      values as JSON and back, bit for bit
"""

from hfg.recording.exporting import Exported, export_bag
from hfg.recording.playing import Playing, play_into
from hfg.recording.reading import File, Loss, PortInfo, RecordingInfo
from hfg.recording.recording import Recording, record
from hfg.recording.recovering import recover

__all__ = [
    "Exported",
    "File",
    "Loss",
    "Playing",
    "PortInfo",
    "Recording",
    "RecordingInfo",
    "export_bag",
    "play_into",
    "record",
    "recover",
]
