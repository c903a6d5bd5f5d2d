"""State: attributes that belong to one run."""

from __future__ import annotations

from typing import Any

import pytest

import hfg
from hfg.errors import DeclarationError


class Counter(hfg.Node):
    total = hfg.State(0)
    seen = hfg.State[list[int]]([])
    cache = hfg.State[dict[str, int]](factory=dict)

    def setup(self) -> None:
        self.opened = "file"


def test_state_is_a_plain_attribute() -> None:
    node = Counter()
    node.total += 1
    node.seen.append(3)
    assert (node.total, node.seen, node.cache) == (1, [3], {})
    assert isinstance(Counter.total, hfg.State)
    assert list(Counter._type.states) == ["total", "seen", "cache"]


def test_every_run_and_every_node_begins_with_its_own() -> None:
    node = Counter()
    node._reset_states()
    node.total, node.cache["a"] = 7, 1
    node.seen.append(3)
    node._reset_states()
    assert (node.total, node.seen, node.cache) == (0, [], {})
    assert Counter().seen == []


def test_what_an_earlier_run_left_is_removed_and_what_was_there_before_stays() -> None:
    node: Any = Counter()
    node.note = "mine"
    port = node.activated
    node._reset_states()
    node.setup()
    node.extra, node.note = 1, "changed"
    late = node.deactivated
    node._reset_states()
    assert not hasattr(node, "opened")
    assert not hasattr(node, "extra")
    assert node.note == "changed"
    assert (node.activated, node.deactivated) == (port, late)


@pytest.mark.parametrize("wrong", [{}, {"default": 1, "factory": list}, {"initial": 3}])
def test_state_takes_a_default_or_a_factory(wrong: dict[str, Any]) -> None:
    with pytest.raises(DeclarationError, match=r"either one default or factory="):
        hfg.State(**wrong)
