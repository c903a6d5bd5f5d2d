"""What the parts of a run tell each other, and what they decide: nothing here waits, or knows an engine at work.

messages    all that is said beside tokens     failing     errors among it
agreement   when the whole is quiet            clocks      one clock for all
lives       whether a dead part begins anew    inheriting  where it goes on that keeps nothing
ledgers     where is kept what a part has done sieve       which side of an edge tells of it
"""

__all__: list[str] = []
