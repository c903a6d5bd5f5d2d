"""What `hfg new` writes: the text of a node type, a graph or a package, and of its test. Depends on nothing."""

from __future__ import annotations

from typing import Final

__all__ = ["GRAPH", "GRAPH_TEST", "NODE", "NODE_TEST", "PLUGIN"]

NODE: Final = '''\
"""A node type; `hfg nodes {module}.py` tells what goes in and out."""

from __future__ import annotations

import hfg
from annotated_types import Ge

__all__ = ["{Name}"]


class {Name}(hfg.Node):
    """Let values through from a limit on, and tell of the first."""

    value = hfg.Input(float)
    passed = hfg.Output(float)
    first = hfg.Event(float)
    limit = hfg.Parameter(0.5, Ge(0))
    count = hfg.State(0)

    def process(self, value: float) -> None:
        if value < self.limit:
            return  # nothing this time
        self.count += 1
        if self.count == 1:
            self.first.trigger(value)
        self.passed.send(value)

    @hfg.slot
    def forget(self) -> None:
        """Take the next value for the first again."""
        self.count = 0
'''

NODE_TEST: Final = '''\
"""What {Name} does, firing by firing, without a graph: `pytest`."""

from __future__ import annotations

from hfg.testing import fire

from {module} import {Name}


def test_lets_values_through_from_the_limit_on() -> None:
    node = {Name}(limit=0.7)
    assert fire(node, value=0.6).outputs == {{}}
    assert fire(node, value=0.7).outputs == {{"passed": 0.7}}


def test_tells_of_the_first_until_it_forgets() -> None:
    node = {Name}()
    assert fire(node, value=0.8).events == [("first", 0.8)]
    assert fire(node, value=0.9).events == []
    fire(node, slot="forget")
    assert fire(node, value=0.9).events == [("first", 0.9)]
'''

GRAPH: Final = '''\
"""A graph: `hfg run {module}.py` runs it, `hfg check {module}.py` checks it."""

from __future__ import annotations

from collections.abc import Iterator

import hfg

__all__ = ["build"]


@hfg.node
def samples(*, count: int = 10) -> Iterator[float]:
    """Give a slow wave."""
    for number in range(count):
        yield abs(number % 8 - 4) / 4


@hfg.node
def high(sample: float, *, limit: float = 0.5) -> float | None:
    """Let through what is above the limit; None is silence."""
    return sample if sample > limit else None


class Watch(hfg.Node):
    """Once it is active, say what comes."""

    sample = hfg.Input(float)
    seen = hfg.Output(float)

    def process(self, sample: float) -> float | None:
        if not self.active:
            return None
        self.log.info("saw %s", sample)
        return sample

    @hfg.slot
    def begin(self) -> None:
        """Become active, by the edge that leads here."""


def build() -> hfg.Graph:
    """Build the graph; nothing happens before it runs."""
    graph = hfg.Graph("{module}")
    source = graph.add(samples(), max_rate_hz=5)
    chosen = graph.add(high())
    watch = graph.add(Watch())
    graph.connect(source.out, chosen.ports.inputs["sample"])
    graph.connect(chosen.out, watch.sample)
    graph.start.activates(watch.begin)
    graph.connect(watch.seen, graph.output("seen", float))
    return graph
'''

GRAPH_TEST: Final = '''\
"""The graph in virtual time, the same each time and at once: `pytest`."""

from __future__ import annotations

import hfg

from {module} import build


def test_high_samples_are_seen() -> None:
    report = hfg.run(build(), clock="virtual")
    assert report.outcome == "done"
    assert report.outputs["seen"] == [1.0, 0.75, 0.75, 1.0, 0.75]


def test_there_is_nothing_to_complain_about() -> None:
    assert build().check() == []
'''

_PLUGIN_PROJECT: Final = """\
[build-system]
requires = ["hatchling>=1.27"]
build-backend = "hatchling.build"

[project]
name = "{distribution}"
version = "0.1.0"
description = "Node types for hfg"
readme = "README.md"
requires-python = ">=3.11"
dependencies = ["hfg"]

[project.optional-dependencies]
test = ["hypothesis", "pytest"]

# By this hfg finds the node types: of a module, or of a package and all modules in it.
[project.entry-points."hfg.nodes"]
{module} = "{module}.nodes"

[tool.hatch.build.targets.wheel]
packages = ["src/{module}"]

[tool.pytest.ini_options]
testpaths = ["tests"]
"""

_PLUGIN_README: Final = """\
# {distribution}

Node types for hfg.

```console
pip install -e ".[test]"
hfg nodes {module}.nodes     # what is in it
hfg nodes {Name}             # and what that does
pytest
```

Graphs use them as any others, `from {module}.nodes import {Name}`, and graph files by reference,
`{module}.nodes:{Name}`.
"""

_PLUGIN_INIT: Final = '''\
"""Node types for hfg."""
'''

_PLUGIN_NODES: Final = '''\
"""The node types; `hfg nodes {module}.nodes` lists them."""

from __future__ import annotations

import hfg
from annotated_types import Gt

__all__ = ["{Name}", "scaled"]


@hfg.node
def scaled(value: float, *, factor: float = 2.0) -> float:
    """Multiply each value by a factor.

    Silence stays silence.

    Args:
      value: any number.
      factor: by what it is multiplied.
      out: the product.
    """
    return factor * value


class {Name}(hfg.Node):
    """Tell how far the values went, and when they went too far.

    Attributes:
      value: where it is now, in metres.
      way: how far it went since it began or was reset, in metres.
      far: the way, when it is longer than the limit for the first time.
      limit: how far it may go.
      again: begins at 0 again.
    """

    value = hfg.Input(float)
    way = hfg.Output(float)
    far = hfg.Event(float)
    limit = hfg.Parameter(10.0, Gt(0), unit="m")
    last = hfg.State[float | None](None)
    gone = hfg.State(0.0)

    def process(self, value: float) -> float:
        before, step = self.gone, 0.0 if self.last is None else abs(value - self.last)
        self.last, self.gone = value, before + step
        if before <= self.limit < self.gone:
            self.far.trigger(self.gone)
        return self.gone

    @hfg.slot
    def again(self) -> None:
        self.last, self.gone = None, 0.0
'''

_PLUGIN_TEST: Final = '''\
"""What the node types do, firing by firing, and that hfg finds them: `pytest`."""

from __future__ import annotations

import pytest
from hfg.catalogue import offers, types_of, undocumented
from hfg.testing import fire, try_type

from {module} import nodes

TYPES = types_of(nodes).types


def test_scaled_multiplies() -> None:
    assert fire(nodes.scaled(factor=3.0), value=2.0).outputs == {{"out": 6.0}}


def test_the_way_is_counted_and_told_of_once() -> None:
    node = nodes.{Name}(limit=3.0)
    ways = [fire(node, value=value).outputs["way"] for value in (1.0, 3.0, 1.0)]
    assert ways == [0.0, 2.0, 4.0]
    fire(node, slot="again")
    assert fire(node, value=0.0).events == []
    assert fire(node, value=5.0).events == [("far", 5.0)]
    assert fire(node, value=6.0).events == []


@pytest.mark.parametrize("reference", [one.reference for one in TYPES])
def test_types_keep_their_word(reference: str) -> None:
    """With any values of the types and limits that they declare."""
    assert try_type(reference).usable


def test_everything_is_documented() -> None:
    assert [line for one in TYPES for line in undocumented(one)] == []


def test_hfg_finds_the_package() -> None:
    found = [offer.module for offer in offers()]
    assert nodes.__name__ in found, "install it first: pip install -e ."
'''

PLUGIN: Final = {
    "pyproject.toml": _PLUGIN_PROJECT,
    "README.md": _PLUGIN_README,
    "src/{module}/__init__.py": _PLUGIN_INIT,
    "src/{module}/nodes.py": _PLUGIN_NODES,
    "src/{module}/py.typed": "",
    "tests/test_{module}.py": _PLUGIN_TEST,
}
