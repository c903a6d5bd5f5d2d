"""One run from its beginning to its end: the loop that drives it, and what leads into it.

engine      the loop: pump, time, quiet, end    callbacks   what it tells those who stand on it
run_lifecycle    setup and teardown                  settings    how a run is to be done
plan        workers and edges of a flat graph
ports       node ports lead into the run        rx          reactivex on the run's clock
relays      ports of dissolved subgraphs        places      where somebody looks, found again after edits
interrupt   Ctrl-C                              rules    fills the table by which rules call those above
"""

__all__: list[str] = []
