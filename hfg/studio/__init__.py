"""The studio: a graph, at rest or running, that several pages in a browser see and edit at once.

    messages     what a page and the studio say to each other      records     what a page shows, as tables of records
    describing, places   a graph as records, and its paths     tables   what has changed, as numbered patches
    following    keeps the tables as the graph and its run are     history, words   edits as people read them
    spans        when nodes were active, and by which edges activity moves
    targets      where an edge may lead, and why not               palette     node types that words and a wire fit
    viewing      one page: its frames, subscriptions, credits      budget      how much of the graph's time it may take
    topics       what pages subscribe to, with run_topics, sampled_topics (measures, timeline), tapped_topics (values)
    waiting      which nodes wait, for what, and which edges are full
    showing      a value for people         logs       log records          conditions  of breakpoints, as data
    steering     the run: start, pause, steps, breakpoints         failing     what a run failed with
    layouts      where everything is drawn  clipboard  nodes as text
    project      the file: open, save, who else has written it     journal     edits that survive a sudden end
    starters     graphs for users who have none yet, with `ball`
    requests, asking   what a page asks for                        refusing    a refusal as fields
    running_elsewhere  runs of other programs
    studio       all of it together
    local, attaching   for other programs of the same user         notebook    for the program itself
    cookies      pages come back after a sudden end
    entrance     who may come in            web        the pages' server    serving  its thread and port

All but the last line lives on the loop on which the graph runs and knows nothing of the network, so it needs no extra.
The server has a thread and a loop of its own: the graph never waits for a page.
"""

from __future__ import annotations

__all__: list[str] = []
