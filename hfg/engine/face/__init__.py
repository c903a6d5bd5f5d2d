"""What users hold in their hands: a run, its feeds and readers.

running      run, run_async, running       composition  the engine and all that depends on it
run          what one can do with a run    outside      feeds, readers, signals
"""

__all__: list[str] = []
