"""The smallest graph: a source, a function between, and a sink.

Run it with `python examples/hello.py` or `hfg run examples/hello.py --param count.to=5`.
"""

from __future__ import annotations

from collections.abc import Iterator

import hfg


@hfg.node
def count(*, to: int = 3) -> Iterator[int]:
    yield from range(1, to + 1)


@hfg.node
def square(value: int) -> int:
    return value * value


@hfg.node
def show(value: int) -> None:
    print(value)


graph = hfg.Graph("hello")
graph.add(count()) >> graph.add(square()) >> graph.add(show())

if __name__ == "__main__":
    hfg.run(graph)
