"""Files that are none of CS::APEX, or contradict themselves: one clear sentence each, all of them together."""

from __future__ import annotations

from pathlib import Path

import pytest

import hfg
from hfg.files import apex

GOOD = "{type: 'csapex::Relay', uuid: a}"


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def refusal(text: str | bytes) -> list[str]:
    """What is said about a file."""
    Path("a.apex").write_bytes(text.encode() if isinstance(text, str) else text)
    with pytest.raises(hfg.errors.FileError) as refused:
        apex.read("a.apex")
    found = [str(problem) for problem in refused.value.problems]
    assert all("\n" not in one for one in found)
    return found


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            b"\x7fELF\x02\x01\xff\xfe",
            "a.apex:1: this is no text in UTF-8; a graph of CS::APEX is text, messages are not imported",
        ),
        ("", "a.apex:1: there is nothing in it; name a file that CS::APEX has saved"),
        (
            "#!/usr/bin/csapex\n",
            "a.apex:1: there is nothing in it; name a file that CS::APEX has saved",
        ),
        ("- a\n- b\n", "a.apex:1: a file of CS::APEX is keys and values, got a list; see how CS::APEX saves it"),
        ("settings: []\n", "a.apex:1: there are no nodes in it; name a file that CS::APEX has saved"),
        ("nodes: 3\n", "a.apex:1: nodes is a list, got 3; see how CS::APEX saves it"),
        ("nodes:\n  - {type: 'csapex::Relay'}\n", "a.apex:2: a node has no uuid; write it, or take the node out"),
        ("nodes:\n  - type: csapex::Re", "a.apex:2: a node has no uuid; write it, or take the node out"),
        ("nodes:\n  - {uuid: a}\n", "a.apex:2: a node has no type; write it, or take the node out"),
        (
            f"nodes:\n  - {GOOD}\n  - {GOOD}\n",
            'a.apex:3: "a": its uuid is also that of the node in line 2; give one of them another, and its connections',
        ),
        (
            f"version: {{major: 7, minor: 1, patch: 0}}\nnodes: [{GOOD}]\n",
            "a.apex:1: it is of version 7, and versions 0 and 1 are known; save it with CS::APEX 1.0, "
            "or correct the number",
        ),
        (
            "nodes: [{type: x, uuid: a, pos: [1]}]",
            'a.apex:1: "a": pos is two numbers, got a list; correct it, or take it out',
        ),
        (
            "nodes: [{type: x, uuid: a, enabled: often}]",
            "a.apex:1: \"a\": enabled is true or false, got 'often'; correct it, or take it out",
        ),
        (
            "nodes: [{type: x, uuid: a, state: {params: {p: {int: three}}}}]",
            "a.apex:1: \"a.p\": this should be of type int, got 'three'; correct it",
        ),
        (
            f"nodes: [{GOOD}]\nconnections:\n  - {{uuid: 'b:|:out_0', targets: ['a:|:in_0']}}\n",
            'a.apex:3: "b:|:out_0 -> a:|:in_0": this is connected to "b", which is not there; '
            "take it out, or mend its uuid",
        ),
        (
            f"nodes: [{GOOD}]\nconnections:\n  - {{targets: ['a:|:in_0']}}\n",
            "a.apex:3: a connection has no uuid, so it begins nowhere; write the port that it comes from",
        ),
        (
            f"nodes: [{GOOD}]\nconnections: [{{uuid: 'a:|:out_0', targets: ['a:|:in_0'], types: [active, active]}}]\n",
            'a.apex:2: "a:|:out_0": there are 2 types of 1 targets; each target has one, default or active',
        ),
        (
            f"nodes: [{GOOD}]\nconnections: [{{uuid: 'a:|:out_0', targets: ['a:|:in_0'], types: [fast]}}]\n",
            "a.apex:2: \"a:|:out_0\": a connection is default or active, got 'fast'; correct it",
        ),
        (
            f"nodes: [{GOOD}]\nthreads: {{assignments: [{{uuid: a, id: 9}}]}}\n",
            'a.apex:1: "a": it is assigned to thread group 9, which is not there; assign it to one of threads.groups',
        ),
        (
            "nodes: [{type: x, uuid: 'a:|:b'}]",
            'a.apex:1: a node cannot be called "a:|:b"; ":|:" parts a node from its port',
        ),
    ],
)
def test_what_is_wrong_is_one_sentence_with_its_line(text: str | bytes, sentence: str) -> None:
    assert refusal(text) == [sentence]


def test_everything_that_is_wrong_is_told_at_once() -> None:
    found = refusal(
        "version: {major: 3}\nnodes:\n  - {uuid: a, type: x, pos: here}\n  - {uuid: a, type: y}\n"
        "connections:\n  - {uuid: 'z:|:out_0', targets: ['a:|:in_0', 'y:|:in_0']}\n"
    )
    assert [one.split(": ")[0] for one in found] == ["a.apex:1", "a.apex:3", "a.apex:4", *["a.apex:6"] * 3]


@pytest.mark.parametrize("end", [1 / 3, 1 / 2, 0.9])
def test_a_file_that_was_cut_off_is_refused_or_its_report_is_about_what_is_left(end: float) -> None:
    whole = "nodes:\n" + "".join(
        f"  - {{type: 'csapex::Relay', uuid: n{one}, pos: [{one}, 2], color: [1, 2, 3]}}\n" for one in range(9)
    )
    text = whole[: int(len(whole) * end)]
    assert any("this is no YAML" in one for one in refusal(text))


def test_a_file_that_is_not_there_is_one_sentence() -> None:
    with pytest.raises(hfg.errors.FileError, match=r"lost\.apex: there is no such file; see where it is"):
        apex.read("lost.apex")
    with pytest.raises(hfg.errors.FileError, match=r"this is a folder; name a file in it that ends in \.apex"):
        apex.read(".")
