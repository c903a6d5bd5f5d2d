"""What waits: the loop, the code of nodes, threads, clocks, beginning and ending.

engine      the loop: pump, time, quiet, end    callbacks   what it tells those who stand on it
lifetime    setup and teardown                  settings    how a run is to be done
code        runs node code: on the loop, by a carrier (async), in the thread of one of the groups
plan        workers and edges of a flat graph   iteration   a run within the run (G4)
ports       node ports lead into the run        rx          reactivex on the run's clock
relays      ports of dissolved subgraphs        places      where somebody looks, found again after edits
virtual     a loop whose clock jumps            upstairs    fills the table by which rules call those above
watchdog    a node that blocks the loop         interrupt   Ctrl-C
"""

__all__: list[str] = []
