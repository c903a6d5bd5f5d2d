"""Keys and names as Zenoh's key expressions."""

from __future__ import annotations

import re

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

from hfg.errors import MessageTooLarge, TransportError
from hfg_transports.zenoh.names import LONGEST_KEY, Keys, escape, join, unescape
from hfg_transports.zenoh.presence import prefix_key, presence_key, read_presence_key

CHUNK = st.text(alphabet=st.characters(exclude_characters="/"), min_size=1)
NAME = st.lists(CHUNK, min_size=1, max_size=4).map("/".join)


@given(NAME)
def test_any_name_becomes_a_key_without_meaning_for_zenoh_and_comes_back(name: str) -> None:
    key = escape(name)
    assert not re.search(r"[*$#?@\x00]", key)
    assert str(zenoh.KeyExpr(key)) == key
    assert unescape(key) == name


@pytest.mark.parametrize("name", ["", "a//b", "/a", "a/"])
def test_names_with_nothing_between_their_slashes_are_refused(name: str) -> None:
    with pytest.raises(TransportError, match=r'is no name: between its "/" there must be something; leave out'):
        escape(name)


def test_a_key_that_would_end_the_process_is_refused() -> None:
    """Zenoh panics when a key does not fit into a batch."""
    with pytest.raises(MessageTooLarge, match=f"the longest has {LONGEST_KEY}; take a shorter name or less metadata"):
        join("hfg", "x" * LONGEST_KEY)


@pytest.mark.slow
@given(NAME, st.binary(max_size=200))
def test_a_presence_says_its_name_and_metadata_and_is_found_by_each_of_its_prefixes(name: str, metadata: bytes) -> None:
    prefix = Keys("realm").presences
    key = presence_key(prefix, "abc", 3, name, metadata)
    assert read_presence_key(prefix, key) == ("abc.3", name, metadata)
    chunks = name.split("/")
    for length in range(len(chunks) + 1):
        assert zenoh.KeyExpr(prefix_key(prefix, "/".join(chunks[:length]))).includes(key)
    assert not zenoh.KeyExpr(prefix_key(prefix, f"{name}/more")).includes(key)


@pytest.mark.parametrize("rest", ["", "token", "token/meta", "token/?!/name", "token/A/name"])
def test_what_is_no_presence_of_ours_is_passed_over(rest: str) -> None:
    prefix = Keys("realm").presences
    assert read_presence_key(prefix, f"{prefix}/{rest}") is None
    assert read_presence_key(prefix, f"elsewhere/{rest}") is None


def test_no_wildcard_over_values_sees_who_is_there() -> None:
    keys = Keys("realm")
    assert not zenoh.KeyExpr("**").includes(presence_key(keys.presences, "abc", 1, "name", b""))


def test_realms_are_apart() -> None:
    assert not zenoh.KeyExpr(f"{Keys('a').data}/**").intersects(f"{Keys('b').data}/**")
