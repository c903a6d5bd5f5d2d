"""A graph that is cut for processes, and run as one (rules L1 to L3, F7, R5).

agreement     when the whole is quiet, and what follows from that: decides, never waits
part          one part: an engine, and the tokens that leave it and come in
messages      what parts tell each other beside tokens; failing: errors among it
channels      messages and tokens on a session of a transport; rings: large arrays among these, in shared memory
worker        a part that somebody else has begun; process: the process around it
serving       what somebody outside asks of a part, from its side; asking, run: from that of the main part
crossing      what is brought in and seen, as data; sieve: which side of an edge tells of it
realm         agents and runs on other hosts: how they are found, and what one asks them
agent         begins parts on its host; hosting: the processes it does that with, and what these write
abroad        launching by agents; standing: a run that others hear of and steer
distribution  the whole, as the main part sees it; other: what it knows of another; launching: where they are begun
local         all parts on one event loop, without links
"""

__all__: list[str] = []
