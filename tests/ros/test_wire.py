"""What rmw_zenoh writes: golden strings from its design document, https://github.com/ros2/rmw_zenoh."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hfg.errors import UsageError
from hfg.ros.graph import RosGraph, sentence_of
from hfg.ros.names import full_name, need_namespace, need_node_name, node_name_of, remapping
from hfg.ros.wire import Attachment, Entity, Gaps, Qos, read_attachment, read_qos, read_token, tokens_of

HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
ADD = "RIHS01_e118de6bf5eeb66a2491b5bda11202e7b68f198d6f67922cf30364858239c81a"
SESSION = "aac3178e146ba6f1fc6e6a4085e77f21"
STRING = "std_msgs::msg::dds_::String_"

NODE = Entity(0, SESSION, 0, 0, "NN", "/", "listener")
LISTENER = Entity(0, SESSION, 0, 10, "MS", "/", "listener", "/chatter", "std_msgs/msg/String", HASH)
TALKER = Entity(
    0, "8b20917502ee955ac4476e0266340d5c", 0, 10, "MP", "/", "talker", "/chatter", "std_msgs/msg/String", HASH,
    Qos(depth=7),
)  # fmt: skip
SERVER = Entity(
    0, "f9980ee0495eaafb3e38f0d19e2eae12", 0, 10, "SS", "/", "add_two_ints_server", "/add_two_ints",
    "example_interfaces/srv/AddTwoInts", ADD,
)  # fmt: skip

GOLDEN = {
    f"@ros2_lv/0/{SESSION}/0/0/NN/%/%/listener": NODE,
    f"@ros2_lv/0/{SESSION}/0/10/MS/%/%/listener/%chatter/{STRING}/{HASH}/::,10:,:,:,,": LISTENER,
    f"@ros2_lv/0/8b20917502ee955ac4476e0266340d5c/0/10/MP/%/%/talker/%chatter/{STRING}/{HASH}/::,7:,:,:,,": TALKER,
    "@ros2_lv/0/f9980ee0495eaafb3e38f0d19e2eae12/0/10/SS/%/%/add_two_ints_server/%add_two_ints/"
    f"example_interfaces::srv::dds_::AddTwoInts_/{ADD}/::,10:,:,:,,": SERVER,
}


@pytest.mark.parametrize("token", GOLDEN)
def test_tokens_are_those_of_the_design_document_and_read_back(token: str) -> None:
    assert GOLDEN[token].token == token
    assert read_token(token) == GOLDEN[token]


def test_keys_are_those_of_the_design_document() -> None:
    assert TALKER.key == f"0/chatter/{STRING}/{HASH}"
    named = Entity(2, SESSION, 0, 1, "SC", "/", "a", "/add_two_ints", "example_interfaces/srv/AddTwoInts", ADD)
    assert named.key == f"2/add_two_ints/example_interfaces::srv::dds_::AddTwoInts_/{ADD}"
    inner = Entity(0, SESSION, 0, 1, "MP", "/robot1", "a", "/robot1/chatter", "std_msgs/msg/String", HASH)
    assert inner.key == f"0/robot1/chatter/{STRING}/{HASH}"
    assert "/%/%robot1/a/%robot1%chatter/" in inner.token
    assert tokens_of(3) == "@ros2_lv/3/**"


def test_an_identity_is_the_hash_of_the_token_low_half_first() -> None:
    xxhash = pytest.importorskip("xxhash", reason="xxhash is part of hfg[ros2]")
    assert LISTENER.gid == xxhash.xxh3_128_digest(LISTENER.token.encode())[::-1]


def test_attachments_have_33_bytes_in_the_order_of_the_design_document() -> None:
    attachment = Attachment(1, 2, bytes(range(16)))
    assert attachment.encode() == bytes([1, *[0] * 7, 2, *[0] * 7, 16, *range(16)])
    assert read_attachment(attachment.encode()) == attachment
    assert read_attachment(b"") is None
    assert read_attachment(attachment.encode()[:-1]) is None
    assert read_attachment(attachment.encode().replace(b"\x10", b"\x11", 1)) is None


@pytest.mark.parametrize(
    ("qos", "text"),
    [
        (Qos(), "::,10:,:,:,,"),
        (Qos(depth=42), "::,:,:,:,,"),
        (Qos("best_effort"), "2::,10:,:,:,,"),
        (Qos("reliable", "transient_local", 1), ":1:,1:,:,:,,"),
        (Qos(depth=0), "::2,:,:,:,,"),
    ],
)
def test_quality_of_service_leaves_out_the_defaults_of_rmw_zenoh(qos: Qos, text: str) -> None:
    assert qos.text == text
    assert read_qos(text) == qos


def test_chunks_of_newer_versions_are_passed_over() -> None:
    assert read_token(f"{LISTENER.token}/backends:cuda:1") == LISTENER


@given(st.text(max_size=200))
def test_no_token_and_no_attachment_of_others_does_harm(text: str) -> None:
    for whole in (text, f"@ros2_lv/0/{text}", f"{LISTENER.token[:40]}{text}", LISTENER.token.replace("10", text)):
        read_token(whole)
    read_attachment(text.encode())
    read_qos(text)


def test_gaps_are_counted_for_each_publisher_by_itself() -> None:
    gaps = Gaps()
    one, other = bytes(16), bytes([1] * 16)
    assert [gaps.note(Attachment(number, 0, one)) for number in (5, 6, 9)] == [0, 0, 2]
    assert [gaps.note(Attachment(number, 0, other)) for number in (1, 2, 1, 3)] == [0, 0, 0, 0]
    assert gaps.lost == 2


def test_the_graph_finds_ends_that_do_not_match_and_says_why() -> None:
    graph = RosGraph()
    wrong = Entity(0, SESSION, 1, 11, "MP", "/", "liar", "/chatter", "std_msgs/msg/Int32", HASH)
    older = Entity(0, SESSION, 1, 12, "MP", "/", "older", "/chatter", "std_msgs/msg/String", "TypeHashNotSupported")
    graph.told([(True, one.token) for one in (TALKER, wrong, older)] + [(True, "nonsense")])
    assert graph.fit(LISTENER, "MP") == [TALKER]
    assert graph.unfit(LISTENER, "MP") == [wrong, older]
    assert "std_msgs/msg/Int32" in sentence_of(LISTENER, wrong)
    assert "another definition" in sentence_of(LISTENER, older)
    assert graph.types("MP") == {"/chatter": {"std_msgs/msg/String", "std_msgs/msg/Int32"}}
    assert graph.refused == 1
    graph.told([(False, TALKER.token)])
    assert graph.fit(LISTENER, "MP") == []


@pytest.mark.parametrize(
    ("name", "full"),
    [
        ("/a/b", "/a/b"),
        ("b", "/robot1/b"),
        ("~/b", "/robot1/driver/b"),
        ("~", "/robot1/driver"),
        ("x/y", "/robot1/x/y"),
    ],
)
def test_names_become_full(name: str, full: str) -> None:
    assert full_name(name, "/robot1", "driver") == full


@pytest.mark.parametrize("name", ["", "/", "a//b", "/a/", "1a", "a__b", "a b", "a*", "/a/\x1b[31m", "~a/../b"])
def test_other_names_are_refused(name: str) -> None:
    with pytest.raises(UsageError, match="not a name in ROS 2"):
        full_name(name, "/", "node")


def test_names_are_remapped_as_ros_does() -> None:
    rules = remapping("scan:=/front/scan ~/out:=image", "/robot1", "driver")
    assert full_name("/robot1/scan", "/robot1", "driver", rules) == "/front/scan"
    assert full_name("~/out", "/robot1", "driver", rules) == "/robot1/image"
    with pytest.raises(UsageError, match="not a rule"):
        remapping("scan=/front", "/", "driver")


def test_namespaces_and_names_of_nodes_are_checked() -> None:
    assert [need_namespace(text) for text in ("", "/", "robot1", "/a/b/")] == ["/", "/", "/robot1", "/a/b"]
    with pytest.raises(UsageError, match="not a namespace"):
        need_namespace("/a-b")
    with pytest.raises(UsageError, match="not a node name"):
        need_node_name("a/b")
    assert [node_name_of(text) for text in ("my graph", "7up", "")] == ["my_graph", "hfg_7up", "hfg"]
