"""The command line: one module per verb.

    app         the command itself: verbs, options of all, what an error looks like
    run         hfg run TARGET      run a graph to its end
    check       hfg check TARGET    look for mistakes without running
    draw        hfg draw TARGET     show what a graph looks like
    nodes       hfg nodes [MODULE]  which node types there are
    target      finds what TARGET names
    settings    --param path=value
    interrupt   Ctrl-C
    show        sentences, tracebacks, tables
    encoding    JSON

Exit codes: 0 success; 1 a run or check that failed, also by `abort`, a stall or Ctrl-C; 2 wrong use. A verb reports to
standard output, everything else goes to standard error. `import hfg` does not import any of this.
"""

from hfg.cli.app import main

__all__ = ["main"]
