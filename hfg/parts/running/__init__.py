"""One part of a run in operation, and its connections to others.

part      an engine, and the tokens that leave and enter it
channels  messages to and from others
ends      links, at the near ends of its edges to and from others
carrier   all of these together
rings     large arrays in shared memory
keeping   the state of a part with a ledger, as data
"""

__all__: list[str] = []
