"""Recording what passes ports of a run to MCAP files, and playing it back.

    recording   which ports, what is said about the run      `hfg.record`, `run.record`
    writing     the thread that encodes and writes
    mcap        the file: chunks, indexes, summary
    messages    what a token looks like in it
    schemas     JSON schemas, those of Foxglove for images
    values      values as JSON and back, to the bit
"""

from hfg.recording.recording import Recording, record

__all__ = ["Recording", "record"]
