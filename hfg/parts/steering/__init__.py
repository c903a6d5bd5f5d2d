"""What somebody outside does with a run whose nodes are in several parts, and sees of it.

run       what one can do with such a run
asking    what is asked of other parts, from the side of the main one
serving   and from the side of the part that is asked
crossing  what is brought in and seen, as data
"""

__all__: list[str] = []
