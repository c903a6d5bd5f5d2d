# type: ignore  # noqa: PGH003 - for whoever checks the whole folder; test_typing.py takes this line off
"""What mypy and pyright must refuse: each line that ends in "# error", and no other; run by test_typing.py."""

from __future__ import annotations

from collections.abc import Iterator

import hfg
from tests.typing.accepted import Box, MapLookup, ask, blur, connect, follow, graph, maybe, numbers, show

lookup = MapLookup()

# Types.
connect(ask().out, lookup.key)  # error
connect(lookup.unknown, lookup.look)  # error
connect(lookup.pose, lookup.map)  # error
connect(lookup.done, lookup.forget)  # error
lookup.unknown.activates(lookup.look)  # error

# Directions.
connect(lookup.key, numbers().out)  # error
connect(lookup.key, lookup.map)  # error
connect(lookup.pose, numbers().out)  # error
connect(lookup.forget, lookup.key)  # error
connect(lookup.pose, lookup.unknown)  # error
connect(Box().person, lookup.anything)  # error
connect(MapLookup.pose, lookup.anything)  # error

# Values.
lookup.pose.send(3)  # error
lookup.unknown.trigger("three")  # error
lookup.key.send(3)  # error
lookup.total = "three"  # error
lookup.tolerance = "three"  # error
lookup.band = (0.1, 0.2)  # error
lookup.frame = "#ff8000"  # error
lookup.portion = "half"  # error
lookup.key = 3  # error

# Parameters of functions.
blur(sigma="wide")  # error
blur(width=3)  # error
numbers(3)  # error
blur("image.png")  # error
maybe(1)  # error
show(value=1)  # error
numbers(count=3).out.send("three")  # error


# Declarations.
@hfg.node
def letters() -> Iterator[str]:
    yield "a"


connect(letters().out, lookup.key)  # error
hfg.Event(3)  # error
hfg.Input()  # error

# The graph.
graph.connect(lookup.pose, lookup.key)  # error
graph.connect(lookup.key, lookup.pose)  # error
graph.connect(numbers(), lookup.key)  # error
graph.connect(graph.start, lookup.key)  # error
graph.connect(letters().out, follow.person)  # error
graph.connect(letters().out, follow.person.inner)  # error
graph.connect(graph.input("keys", str), lookup.key)  # error
graph.connect(lookup.pose, graph.output("poses", int))  # error
graph.connect(lookup.unknown, lookup.forget, overflow="forget")  # error
graph.add(MapLookup)  # error
graph.add(lookup, on_error="ignore")  # error
graph.promote(follow.speed, 3)  # error
graph.gate(3, by=lookup)  # error
graph.gate(lookup, lookup)  # error

# A run.
hfg.run(graph, until_s="3")  # error
hfg.run(graph, until=3)  # error
hfg.running(graph, begin=print)  # error


async def with_a_run(run: hfg.Run) -> None:
    async with run.feed(graph.input("numbers", int)) as feed:
        await feed.send("three")  # error
    await run.wait_for(lookup.key)  # error
    run.read(lookup.pose)  # error
    run.tap(lookup)  # error
