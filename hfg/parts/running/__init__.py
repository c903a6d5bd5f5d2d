"""One part of a run at work, and what connects it with others.

part      an engine, and the tokens that leave it and come in
channels  messages to and from others
ends      links, at the near ends of its edges to and from others
carrier   all of these, as one
rings     large arrays among these, in shared memory
keeping   what a part with a ledger has done, as data
"""

__all__: list[str] = []
