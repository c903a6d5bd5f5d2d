"""Recording what passes ports of a run to MCAP files, and playing it back.

playing     nodes that send what was recorded             `hfg play`
players     step by step, at its time
tracks      what one node did: firings, calls, signals
reading     files, also damaged ones                      `hfg info`
recovering  makes a complete file of one that is not      `hfg recover`
recording   which ports, what is said about the run       `run.record`, `hfg record`
writing     the thread that encodes and writes
mcap        the file: chunks, indexes, summary
layout      where everything lies in a file, damaged or not
chunks      what is in a chunk, within bounds
messages    what a token looks like in it
schemas     JSON schemas, those of Foxglove for images
values      values as JSON and back, to the bit
"""

from hfg.recording.playing import Playing, play_into
from hfg.recording.reading import File, Loss, PortInfo, RecordingInfo
from hfg.recording.recording import Recording, record
from hfg.recording.recovering import recover

__all__ = ["File", "Loss", "Playing", "PortInfo", "Recording", "RecordingInfo", "play_into", "record", "recover"]
