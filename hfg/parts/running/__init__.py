"""One part of a run at work, and what connects it with others.

part      an engine, and the tokens that leave it and come in
channels  messages and tokens on a session of a transport
rings     large arrays among these, in shared memory
keeping   what a part with a ledger has done, as data
"""

__all__: list[str] = []
