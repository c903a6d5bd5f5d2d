"""Data alone: a source, a fork, a join and a sink, in step, with silence where a branch has nothing to say.

    sentences ──┬── count words ──┬── tell
                └── find longest ─┘

Shown: functions as node types, an optional input, back-pressure, a thread group.
Run it with `hfg run examples/word_count.py --param tell.prefix=-`.
"""

from __future__ import annotations

from collections.abc import Iterator

import hfg

TEXT = """Data flows along edges from outputs to inputs.

Events happen.
Activity moves."""


@hfg.node
def sentences(*, text: str = TEXT) -> Iterator[str]:
    """Yield one line after the other."""
    yield from text.splitlines()


@hfg.node
def count_words(sentence: str) -> int:
    """Count the words of a line."""
    return len(sentence.split())


@hfg.node
def find_longest(sentence: str) -> str | None:
    """Find the longest word; an empty line has none, and stays silent."""
    return max(sentence.split(), key=len, default=None)


@hfg.node
def tell(count: int, longest: str = "(none)", *, prefix: str = "*") -> None:
    """Print both; a line without words takes the default."""
    print(f"{prefix} {count} words, the longest: {longest}")


graph = hfg.Graph("word-count")
graph.group("work", threads=1)
source = graph.add(sentences())
counter = graph.add(count_words())
longest = graph.add(find_longest(), group="work")
teller = graph.add(tell())
graph.connect(source.out, counter.sentence)
graph.connect(source.out, longest.sentence)
graph.connect(counter.out, teller.count)
graph.connect(longest.out, teller.longest)
