"""The command line: one module per verb.

    app         the command itself: options of all, what an error looks like    verbs  which there are
    run         hfg run TARGET      run a graph to its end
    tap         hfg tap TARGET PATH run it and print what passes a port
    top         hfg top             watch a graph that runs in another process
    agent       hfg agent           lets this host run parts of graphs
    runs        hfg ps, deploy, logs, restart, stop    agents and runs of a realm; deployed: the process of one
    check       hfg check TARGET    look for mistakes without running
    tune        hfg tune TARGET     search for parameters   sweep  hfg sweep TARGET  tables of what if   search  both
    draw        hfg draw TARGET     show what a graph looks like
    convert     hfg convert TARGET  write it as a graph file
    nodes       hfg nodes [MODULE]  which node types there are
    new         hfg new node NAME   begin a file; templates: what it says
    keys        hfg keys new DIR    certificates to try links between hosts with; certificates: makes them
    execute     a run with everything around it
    live        the table while a graph runs    table     what it says    terminal  where it is drawn
    sockets     how one process looks at a run in another
    target      finds what TARGET names
    options     those of several verbs          completing  what the Tab key offers
    settings    --param path=value
    interrupt   Ctrl-C
    show        sentences, tracebacks, tables
    encoding    JSON

Exit codes: 0 success; 1 a run or check that failed, including by `abort`, a stall or Ctrl-C; 2 wrong use. A verb writes
its result to standard output and everything else to standard error. `import hfg` does not import any of this.
"""

from hfg.cli.app import main

__all__ = ["main"]
