"""Order maintenance: places in a sequence are found without counting."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hfg.graph.structure.sequence import Sequence


@pytest.mark.slow
@given(st.lists(st.tuples(st.sampled_from(["insert", "remove", "replace"]), st.integers(0, 50)), max_size=60))
def test_it_does_what_a_list_does(steps: list[tuple[str, int]]) -> None:
    sequence, plain, fresh = Sequence(range(-5, 0)), list(range(-5, 0)), iter(range(1000))
    for what, number in steps:
        place = number % (len(plain) + (what == "insert")) if plain or what == "insert" else None
        if place is None:
            continue
        if what == "insert":
            item = next(fresh)
            sequence.insert(place, item)
            plain.insert(place, item)
        elif what == "remove":
            assert sequence.remove(plain.pop(place)) == place
        else:
            item = next(fresh)
            assert sequence.replace(plain[place], item) == place
            plain[place] = item
        assert sequence.items == plain
        assert [sequence.position(one) for one in plain] == list(range(len(plain)))


def test_all_are_numbered_anew_only_when_there_is_no_room_between_two() -> None:
    sequence = Sequence(["first", "last"])
    before = sequence.numbering
    for number in range(50):
        sequence.insert(number + 1, str(number))
    assert sequence.numbering == before
    for number in range(50, 200):
        sequence.insert(number + 1, str(number))
    assert before < sequence.numbering <= before + 4
    assert sequence.items == ["first", *map(str, range(200)), "last"]
    assert [sequence.position(one) for one in sequence.items] == list(range(202))
