"""Messages between the parts of a run, and decisions: nothing here waits, or depends on a running engine.

messages    all messages except tokens         failing       errors in them
agreement   when the whole run is quiet        clocks        one clock for all parts
deaths      whether a dead part is restarted   inheriting    where a part without a ledger resumes
ledgers     stored states of parts             trace_filter  which side of an edge reports its events
"""

__all__: list[str] = []
