"""Recordings as sources: what passed a port of another run, when it did.

`hfg record` writes them, and `hfg play` plays one into a whole graph.
"""

from hfg.recording.playing import Playback

__all__ = ["Playback"]
