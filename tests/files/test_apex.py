"""Files of CS::APEX become graphs, and the report says exactly what became of each part."""

from __future__ import annotations

import asyncio
import textwrap
from pathlib import Path
from typing import Any

import pytest

import hfg
from hfg import registry
from hfg.files import Document, apex, build, describe, text_of
from hfg.files.apex.converting import convert
from hfg.files.apex.reading import read_file
from hfg.files.apex.table import rule_of, rules
from hfg.files.findings import Findings
from hfg.nodetypes.description import NodeType

PLACES = [folder / "shared/data/apex" for folder in Path(__file__).parents]
REAL = next((one for one in PLACES if one.is_dir()), PLACES[0])  # files of CS::APEX itself, which are not ours to keep
IMAGE, DISPLAY, BLUR = "csapex::ExampleImageGenerator", "csapex::OutputDisplay", "csapex::BoxBlur"


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def imported(text: str) -> tuple[Document, apex.ConversionReport]:
    """What becomes of a file, without that it is built."""
    path = Path("made.apex")
    path.write_text("#!/usr/bin/csapex\n" + textwrap.dedent(text))
    findings = Findings()
    file = read_file(path, "made.apex", findings)
    assert file is not None
    document, report = convert(file, "made.apex", findings)
    assert findings.problems == []
    text_of(document)
    return document, report


def node(kind: str, number: int = 0, more: str = "", parameters: str = "{}") -> str:
    return f"{{type: '{kind}', uuid: '{kind}_{number}', state: {{params: {parameters}}}, {more}}}"


def edges(document: Document) -> list[str]:
    return [f"{one.source} -> {one.target}{' active' if one.active else ''}" for one in document.edges]


# --- the table ---


def _has(kind: NodeType, field: str, name: str) -> bool:
    ports = getattr(kind, field)
    if name.endswith("[]"):
        return f"{name[:-2]}[0]" in ports or name[:-2] in kind.vectors
    return not name or name in ports or (field == "slots" and name == "reset")


@pytest.mark.parametrize("name", rules())
def test_the_table_names_types_ports_and_parameters_that_there_are(name: str) -> None:
    rule = rules()[name]
    pytest.importorskip(rule.type.partition(":")[0])
    kind = registry.find(rule.type)._type
    for field in ("inputs", "outputs", "slots", "events"):
        for port in getattr(rule, field):
            assert _has(kind, field, port) or (field == "outputs" and _has(kind, "events", port)), port
    assert all(_has(kind, "slots", port) for port in rule.triggers.values())
    goes = [rule.parameter(one) for one in rule.parameters]
    assert {one.to for one in goes if one is not None} | set(rule.set) <= set(kind.parameters)


def test_a_type_of_the_same_name_from_elsewhere_is_another() -> None:
    assert rule_of("csapex::Delay") is rule_of("vision_plugins::Delay") is not None
    assert rule_of("my_robot::Delay") is None


# --- the real files ---

REPORTS = sorted(Path(__file__).parent.glob("reports/*.txt"))
NEEDS_ROS = ("csapex_schoenbuch_", "ros_export.apex")


def test_every_real_file_has_a_report_that_is_expected() -> None:
    if not REAL.is_dir():
        pytest.skip("the files of CS::APEX are not here")
    assert [one.stem for one in REPORTS] == sorted(one.name for one in REAL.iterdir())


@pytest.mark.parametrize("expected", REPORTS, ids=lambda one: one.stem)
def test_the_report_on_a_real_file_is_word_by_word_what_is_expected(expected: Path) -> None:
    """`hfg convert` prints it; what changes it belongs into tests/files/reports, read by somebody."""
    if not (REAL / expected.stem).is_file():
        pytest.skip("the files of CS::APEX are not here")
    pytest.importorskip("cv2")
    _, report = apex.read(REAL / expected.stem)
    assert str(report).replace(f"{REAL}/", "") + "\n" == expected.read_text(encoding="utf-8")
    assert all(bool(one.why) == (one.state != "mapped") for one in (*report.nodes, *report.connections))


@pytest.mark.parametrize("name", [one.stem for one in REPORTS])
def test_every_real_file_is_imported_whole_and_runs_unless_it_needs_ros(name: str) -> None:
    if not (REAL / name).is_file():
        pytest.skip("the files of CS::APEX are not here")
    pytest.importorskip("cv2")
    document, report = apex.read(REAL / name)
    kept = sum(len(one.graph.edges) if one.graph else 0 for one in document.nodes.values()) + len(document.edges)
    assert kept + len(document.notes.get("csapex connections", [])) == len(report.connections)
    graph = build(document)
    text = text_of(describe(graph))  # without values that are as usual
    assert text_of(describe(build(describe(graph)))) == text
    if name.startswith(NEEDS_ROS):
        assert {one.check for one in graph.check() if one.severity == "error"} == {"missing-type"}
    else:
        assert report.count("missing") == (0, 0)
        assert not [one for one in graph.check() if one.severity == "error"]
        assert hfg.run(graph, clock="virtual", until_s=0.1).outcome == ("until" if report.nodes else "done")


@pytest.mark.slow
def test_the_real_classifier_learns_and_classifies(tmp_path: Path) -> None:
    if not REAL.is_dir():
        pytest.skip("the files of CS::APEX are not here")
    pytest.importorskip("cv2")
    graph = apex.load(REAL / "classifier_test.apexs")
    model = str(tmp_path / "forest.yaml")
    for path in ("RandomTreesTrainer_0.path", "Graph_0/RandomTrees_0.path"):
        graph.edit(hfg.commands.SetParameter(path, model))
    samples: list[Any] = []
    classified: list[Any] = []

    async def main() -> hfg.Report:
        async with hfg.running(graph, until_s=20) as run:
            graph["FunctionSampleGenerator_0.sample"].sent.subscribe(lambda token: samples.append(token.value))
            graph["Graph_0/SelectVectorComponent_0.out"].sent.subscribe(lambda token: classified.append(token.value))
            await asyncio.sleep(10)
            await run.trigger(graph["RandomTreesTrainer_0.train"])
            return await run.wait_finished()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        assert runner.run(main()).outcome == "until"
    assert Path(model).is_file()
    assert 590 <= len(classified) <= 610  # none before it had learned, then each of 60 a second
    truth = {sample.values: sample.label for sample in samples}
    right = sum(truth[sample.values] == sample.label for sample in classified)
    assert right > 0.8 * len(classified)  # to say "outlier" each time would be right for two of three
    assert 0.3 < sum(sample.label for sample in classified) / len(classified) < 0.6  # seven of ten are outliers
    for number in range(4):
        assert Path(f"ScatterPlot_{number}.png").is_file()


def test_the_real_switch_is_wired_as_in_the_file() -> None:
    if not REAL.is_dir():
        pytest.skip("the files of CS::APEX are not here")
    document, _ = apex.read(REAL / "tutorialmessage.apex")
    assert edges(document) == [
        "UserSwitch_0.is_first -> TextDisplay_0.value",
        "UserSwitch_0.image -> OutputDisplay_0.image",
        "GenericImageCombiner_0.out -> UserSwitch_0.second",
        "ExampleImageGenerator_0.image -> UserSwitch_0.first",
        "ExampleImageGenerator_0.image -> GenericImageCombiner_0.images[0]",
    ]
    assert document.nodes["UserSwitch_0"].parameters == {"selector": "first"}
    assert document.nodes["GenericImageCombiner_0"].parameters == {"images": 1, "script": "255-$1"}


def test_eight_sources_share_a_slot_that_is_numbered_as_of_old() -> None:
    if not REAL.is_dir():
        pytest.skip("the files of CS::APEX are not here")
    report = hfg.run(apex.load(REAL / "parallel_slot_tester.apex"), clock="virtual", until_s=0.99)
    assert [report.nodes[f"ExampleImageGenerator_{one}"].firings for one in (0, 1, 2, 3, 8, 9, 10, 11)] == [60] * 8


# --- nodes ---


def test_a_node_keeps_where_it_stands_and_how_it_runs() -> None:
    document, _ = imported(
        f"""
        nodes:
          - {node(BLUR, 0, "label: Blur, pos: [1, -2], color: [255, 0, 128], max_frequency: 5, exec_mode: 1")}
          - {node(BLUR, 1, "enabled: false, max_frequency: 0, exec_mode: 0, z: 7")}
          - {node(BLUR, 2, "label: 'csapex::BoxBlur_2', color: [-1, -1, -1]")}
        """
    )
    first, second, third = document.nodes.values()
    assert (first.position, first.max_rate_hz, first.release) == ([1, -2], 5.0, "sequential")
    assert first.notes == {"label": "Blur", "colour": "#ff0080"}
    assert (second.enabled, second.max_rate_hz, second.release, second.notes) == (
        False,
        None,
        "pipelined",
        {"drawn": {"z": 7}},
    )
    assert (third.max_rate_hz, third.release, third.notes) == (60.0, "auto", {})


PARAMETERS = """{
    r: {int: 3, min: 1, max: 9, step: 2}, d: {type: range, double: 0}, b: {type: value, bool: true},
    s: {type: value, string: "", name: s}, l: {type: value, long: 9000000000}, n: {type: value},
    i: {type: interval, int: [1, 5], min: 0, max: 9}, di: {type: interval, double: [0.5, 2]},
    e: {type: set, txt: ONE, int: 1, values: [[ONE, 1]]}, u: {type: bitset, int: 6},
    m: {type: bitset, int: 5, values: {a: 1, b: 2, c: 4}}, c: {type: color, values: [1, 2, 255]},
    p: {type: path, version: 2, value: /tmp/x, is_file: true}, a: {type: angle, double: 1.5}, t: {type: trigger},
    q: {type: progress}, x: {type: text}, z: {type: "null"}, list: {type: string_list, list: [a, b]}}"""


def test_parameters_of_every_kind_are_read() -> None:
    document, report = imported(f"nodes: [{node('my::Own', 0, parameters=PARAMETERS)}]")
    assert document.nodes["Own_0"].parameters == {
        "r": 3,
        "d": 0.0,
        "b": True,
        "s": "",
        "l": 9000000000,
        "n": None,
        "i": [1, 5],
        "di": [0.5, 2],
        "e": 1,
        "u": 6,
        "m": ["a", "c"],
        "c": "#0102ff",
        "p": "/tmp/x",
        "a": 1.5,
        "list": ["a", "b"],
    }
    assert report.nodes[0].state == "missing"


def test_a_type_that_is_not_there_keeps_its_place_and_its_data() -> None:
    document, report = imported(
        f"""
        nodes:
          - {node("my::Own", 3, "secret: [1, 2]", "{x: {type: value, int: 3}}")}
          - {node(IMAGE)}
        connections: [{{uuid: '{IMAGE}_0:|:out_0', targets: ['my::Own_3:|:in_some/thing']}}]
        """
    )
    own = document.nodes["Own_3"]
    assert own.type == "my::Own"
    assert own.notes["csapex"]["secret"] == [1, 2]
    assert own.notes["csapex"]["state"]["params"]["x"]["int"] == 3
    assert edges(document) == ["ExampleImageGenerator_0.image -> Own_3.in_some_thing"]
    assert [one.state for one in (*report.nodes, *report.connections)] == ["missing", "approximated", "missing"]
    assert text_of(describe(build(document))) == text_of(document)


def test_a_value_without_counterpart_is_kept_and_told() -> None:
    document, report = imported(
        f"nodes: [{node('csapex::Delay', 0, parameters='{delay: {double: 2}, blocking: {type: value, bool: true}}')}]"
    )
    assert document.nodes["Delay_0"].parameters == {"seconds": 2.0}
    assert document.nodes["Delay_0"].notes == {"csapex": {"blocking": True}}
    assert str(report.nodes[0]) == (
        "csapex::Delay_0 (csapex::Delay) is about hfg.nodes.flow:Delay: "
        'its parameter "blocking" (True) has no counterpart'
    )


def test_a_value_beyond_our_limits_stays_as_usual_and_is_told() -> None:
    pytest.importorskip("hfg.nodes.cv")
    Path("a.apex").write_text(f"nodes: [{node('csapex::MedianFilter', 0, parameters='{kernel: {int: 4}}')}]")
    document, report = apex.read("a.apex")
    assert document.nodes["MedianFilter_0"].parameters == {}
    assert document.nodes["MedianFilter_0"].notes == {"csapex": {"kernel": 4}}
    assert 'its parameter "kernel" stays as usual' in report.nodes[0].why[0]


def test_notes_become_notes_of_the_graph() -> None:
    document, report = imported(
        "nodes: [{type: 'csapex::Note', uuid: 'csapex::Note_0', pos: [5, 6], "
        "state: {params: {text: {type: value, string: Hello}, w: {type: value, int: 30}, h: {type: value, int: 20}}}}]"
    )
    assert document.nodes == {}
    assert document.notes == {"Note_0": {"text": "Hello", "position": [5, 6], "size": [30, 20]}}
    assert (report.notes, report.nodes) == (1, [])


def test_thread_groups_are_groups_and_the_default_one_is_the_loop() -> None:
    document, report = imported(
        f"""
        nodes: [{node(BLUR, 0)}, {node(BLUR, 1)}, {node(BLUR, 2)}]
        threads:
          groups: [{{id: 2, name: vision, affinity: [true, false]}}]
          assignments:
            - {{uuid: ~, id: 1}}
            - {{uuid: '{BLUR}_0', id: 1}}
            - {{uuid: '{BLUR}_1', id: 2}}
            - {{uuid: '{BLUR}_2', id: 0}}
        """
    )
    assert [one.group for one in document.nodes.values()] == [None, "vision", "BoxBlur_2"]
    assert {name: one.threads for name, one in document.groups.items()} == {"vision": 1, "BoxBlur_2": 1}
    assert report.remarks[0] == 'thread group "vision": on which processors it runs is left out'


# --- connections ---


def wired(*connections: str, kinds: tuple[str, ...] = (IMAGE, DISPLAY), more: str = "") -> tuple[list[str], list[str]]:
    """The edges that there are, and the states of all connections."""
    nodes = ", ".join(node(kind) for kind in kinds)
    listed = []
    for one in connections:
        source, target, *active = one.split(" ")
        kind = "active" if active else "default"
        listed.append(f"{{uuid: '{source}', targets: ['{target}'], types: [{kind}]}}")
    document, report = imported(f"{more}\nnodes: [{nodes}]\nconnections: [{', '.join(listed)}]")
    return edges(document), [one.state for one in report.connections]


def test_active_connections_are_active_edges() -> None:
    assert wired(f"{IMAGE}_0:|:out_0 {DISPLAY}_0:|:in_0 active")[0] == [
        "ExampleImageGenerator_0.image -> OutputDisplay_0.image active"
    ]


def test_the_graph_itself_starts_and_ends() -> None:
    delay = "csapex::Delay"  # as it stands in the file, before values are made of signals
    found = wired(f"event_activation {delay}_0:|:in_0", f"{delay}_0:|:out_0 slot_exit", kinds=(delay,))
    assert found == (["start -> Delay_0.value", "Delay_0.out -> stop"], ["mapped", "mapped"])


COUNT, DETECT = "csapex::CountMessages", "csapex::BooleanTrigger"


@pytest.mark.parametrize(
    ("more", "number", "expected"),
    [
        ("", 0, "forward"),  # of old, and nothing in the file says otherwise
        ("version: {major: 1, minor: 0, patch: 0}", 0, "enable"),
        ("version: {major: 1, minor: 0, patch: 0}", 2, "forward"),
        ("", 2, "forward"),  # only counts automatic ports
    ],
)
def test_slots_are_counted_with_or_without_automatic_ones(more: str, number: int, expected: str) -> None:
    found, states = wired(
        f"{IMAGE}_0:|:out_0 csapex::Delay_0:|:slot_{number}", kinds=(IMAGE, "csapex::Delay"), more=more
    )
    assert found == [f"ExampleImageGenerator_0.image -> Delay_0.{expected}"]
    assert states == ["approximated" if (more, number) == ("", 0) else "mapped"]


def test_one_number_that_only_counts_automatic_ports_decides_for_the_file() -> None:
    found, states = wired(
        f"{DETECT}_0:|:event_4 {COUNT}_0:|:slot_2",
        f"{DETECT}_0:|:event_3 {COUNT}_0:|:slot_1",
        "event_activation csapex::Delay_0:|:slot_0",
        kinds=(DETECT, COUNT, "csapex::Delay"),
    )
    assert found == [
        "BooleanTrigger_0.false -> CountMessages_0.reset",
        "BooleanTrigger_0.true -> CountMessages_0.disable",
        "start -> Delay_0.enable",
    ]
    assert states == ["mapped"] * 3


def test_very_old_triggers_are_events() -> None:
    found, _ = wired(f"{DETECT}_0:|:trigger_1 {COUNT}_0:|:slot_1", kinds=(DETECT, COUNT))
    assert found == ["BooleanTrigger_0.false -> CountMessages_0.reset"]


def test_parameters_are_ports() -> None:
    found, states = wired(
        "csapex::boolean::Toggle_0:|:out_true csapex::HoldableBuffer_0:|:in_hold",
        "csapex::boolean::Toggle_0:|:out_0 csapex::HoldableBuffer_0:|:in_nothing",
        kinds=("csapex::boolean::Toggle", "csapex::HoldableBuffer"),
    )
    assert found == ["Toggle_0.value -> HoldableBuffer_0.hold"]
    assert states == ["mapped", "missing"]


def test_what_has_no_counterpart_is_kept_in_the_notes_and_told() -> None:
    document, report = imported(
        f"""
        nodes: [{node(IMAGE, 0)}, {node(IMAGE, 1)}, {node(DISPLAY)}]
        connections:
          - {{uuid: '{IMAGE}_0:|:out_7', targets: ['{DISPLAY}_0:|:in_0']}}
          - {{uuid: '{IMAGE}_0:|:out_0', targets: ['{DISPLAY}_0:|:in_0', slot_save, '{DISPLAY}_0:|:out_0']}}
          - {{uuid: '{IMAGE}_1:|:out_0', targets: ['{DISPLAY}_0:|:in_0'], types: [active]}}
        """
    )
    assert edges(document) == ["ExampleImageGenerator_0.image -> OutputDisplay_0.image"]
    assert [one.why for one in report.connections] == [
        ["hfg.nodes.csapex:ExampleImage has no output for number 7"],
        [],
        ['the graph itself has nothing like "slot_save" here'],
        ['"out_0" is no port where a connection ends'],
        ["OutputDisplay_0.image is connected to ExampleImageGenerator_0.image already, and an input takes one"],
    ]
    assert len(document.notes["csapex connections"]) == 4
    assert document.notes["csapex connections"][-1].endswith(":|:in_0 (active)")


def test_an_edge_between_types_that_do_not_fit_is_told() -> None:
    Path("a.apex").write_text(
        f"nodes: [{node('csapex::TextInput')}, {node(DISPLAY)}]\n"
        f"connections: [{{uuid: 'csapex::TextInput_0:|:out_0', targets: ['{DISPLAY}_0:|:in_0']}}]"
    )
    document, report = apex.read("a.apex")
    assert edges(document) == []
    assert report.connections[0].state == "missing"
    assert len(document.notes["csapex connections"]) == 1


def test_variadic_ports_have_the_number_that_the_file_says() -> None:
    join = node("csapex::Join", 0, parameters="{input count: {type: value, int: 3}}")
    document, _ = imported(
        f"""
        nodes: [{join}, {node(IMAGE)}]
        connections: [{{uuid: '{IMAGE}_0:|:out_0', targets: ['csapex::Join_0:|:in_2']}}]
        """
    )
    assert document.nodes["Join_0"].parameters == {"values": 3}
    assert edges(document) == ["ExampleImageGenerator_0.image -> Join_0.values[2]"]


SUBGRAPH = """
    name: Snippet
    description: "Relays\\n"
    tags: ["", test]
    yaml:
      nodes:
        - {type: 'csapex::IntRangeGenerator', uuid: source}
        - type: csapex::Graph
          uuid: csapex::Graph_0
          max_frequency: 60
          state: {params: {input count: {type: value, int: 1}, output count: {type: value, int: 1},
            slot count: {type: value, int: 1}, event count: {type: value, int: 1},
            iterate_containers: {type: value, bool: false}, input names: {type: string_list, list: [Sample, Sample]}}}
          subgraph:
            nodes:
              - {type: 'csapex::Relay', uuid: relay}
              - {type: 'csapex::MessageEvent', uuid: event}
              - {type: 'csapex::CountMessages', uuid: count}
              - {type: 'csapex::Note', uuid: 'csapex::Note_0', state: {params: {text: {type: value, string: in here}}}}
            connections:
              - {uuid: relayout_0, targets: ['relay:|:in_0', 'event:|:in_0', 'count:|:in_0']}
              - {uuid: 'relay:|:out_0', targets: [relayin_0]}
              - {uuid: 'event:|:event_3', targets: [relayslot_0]}
              - {uuid: relayevent_0, targets: ['count:|:slot_3']}
              - {uuid: event_activation, targets: ['count:|:slot_3'], types: [active]}
        - {type: 'csapex::CountMessages', uuid: after}
      connections:
        - {uuid: 'source:|:out_0', targets: ['csapex::Graph_0:|:in_0']}
        - {uuid: 'csapex::Graph_0:|:out_0', targets: ['after:|:in_0']}
        - {uuid: 'csapex::Graph_0:|:event_3', targets: ['csapex::Graph_0:|:slot_2']}
      fulcrums: [{from: a, to: b, pts: [[1, 2]]}]
"""


def test_subgraphs_have_their_ports_and_relays() -> None:
    document, report = imported(SUBGRAPH)
    assert (document.notes["description"], document.notes["tags"]) == ("Relays", ["test"])
    box = document.nodes["Graph_0"].graph
    assert box is not None
    assert [list(one) for one in (box.inputs, box.outputs, box.slots, box.events)] == [
        ["in_0"],
        ["out_0"],
        ["slot_0", "activation"],
        ["event_0"],
    ]
    assert [f"{one.source} -> {one.target}" for one in box.edges] == [
        "in_0 -> relay.value",
        "in_0 -> event.value",
        "in_0 -> count.value",
        "relay.out -> out_0",
        "event.received -> event_0",
        "slot_0 -> count.reset",
        "activation -> count.reset",
    ]
    assert edges(document) == [
        "Graph_0.activated -> Graph_0.activation active",
        "source.out -> Graph_0.in_0",
        "Graph_0.out_0 -> after.value",
        "Graph_0.event_0 -> Graph_0.slot_0",
    ]
    assert document.notes["Graph_0/Note_0"] == {"text": "in here"}
    assert document.nodes["Graph_0"].notes == {"input names": ["Sample"]}
    assert "bend points of 1 drawn connections are left out" in report.remarks
    assert {one.state for one in report.connections} == {"mapped"}


def test_an_imported_subgraph_runs() -> None:
    Path("a.apexs").write_text(textwrap.dedent(SUBGRAPH))
    report = hfg.run(apex.load("a.apexs"), clock="virtual")
    assert report.outcome == "done"
    assert report.nodes["after"].processed == report.nodes["Graph_0/relay"].processed == 10


def test_a_subgraph_iterates_over_the_inputs_that_its_bits_name() -> None:
    bits = "iterate_containers: {type: value, bool: true}, iterated_containers: {type: bitset, int: 1}"
    text = SUBGRAPH.replace("iterate_containers: {type: value, bool: false}", bits)
    document, _ = imported(text)
    assert document.nodes["Graph_0"].iterate_over == ("in_0",)


# --- sets, by their texts ---

OPERATIONS = "[[A > B, 0], [A >= B, 1], [A == B, 2], [A != B, 3], [A <= B, 4], [A < B, 5]]"


def read(text: str) -> tuple[Document, apex.ConversionReport]:
    """Read a file as a user does."""
    Path("read.apex").write_text(textwrap.dedent(text), encoding="utf-8")
    return apex.read("read.apex")


@pytest.mark.parametrize("kind", ["csapex::CompareInteger", "csapex::BinaryBoolean"])
@pytest.mark.parametrize("how", ["text and number", "text alone", "number and names"])
def test_a_set_means_what_its_text_says(kind: str, how: str) -> None:
    compares = kind.endswith("Integer")
    texts = ["A > B", "A >= B", "A == B", "A != B", "A <= B", "A < B"]
    expected = [">", ">=", "==", "!=", "<=", "<"]
    if not compares:
        texts, expected = (
            [f"A {one} B" for one in ("AND", "OR", "NAND", "NOR", "XOR")],
            ["and", "or", "nand", "nor", "xor"],
        )
    names = ", ".join(f"[{text}, {number}]" for number, text in enumerate(texts))
    parts = {
        "text and number": "txt: '{text}', int: {number}",
        "text alone": "txt: '{text}'",
        "number and names": "int: {number}, values: [" + names + "]",
    }[how]
    for number, text in enumerate(texts):
        said = parts.format(text=text, number=number)
        document, report = read(f"nodes: [{node(kind, 0, '', f'{{operation: {{type: set, {said}}}}}')}]")
        name = kind.rpartition(":")[2] + "_0"
        assert document.nodes[name].parameters == {"operation": expected[number]}
        assert report.nodes[0].state == "mapped"
        assert build(document)[name].ports.parameters["operation"].value == expected[number]


@pytest.mark.parametrize("said", ["txt: A ? B, int: 0", "int: 0", "txt: A > B but only sometimes"])
def test_a_set_that_says_something_unknown_is_approximated_and_named(said: str) -> None:
    document, report = read(
        f"nodes: [{node('csapex::CompareInteger', 0, '', f'{{operation: {{type: set, {said}}}}}')}]"
    )
    assert document.nodes["CompareInteger_0"].parameters == {}
    assert report.nodes[0].state == "approximated"
    assert 'its parameter "operation" (' in report.nodes[0].why[0]
    assert document.nodes["CompareInteger_0"].notes["csapex"] == {"operation": 0 if "int" in said else None} or (
        "int" not in said
    )


def test_the_text_of_a_set_is_taken_also_where_the_table_has_no_values() -> None:
    """A number of a set is what its author counted by; "same" must not hand it on."""
    document, _ = imported(
        f"nodes: [{node('csapex::UnixSignalEmitter', 0, '', '{signal: {type: set, txt: SIGUSR2, int: 12}}')}]"
    )
    assert document.nodes["UnixSignalEmitter_0"].parameters == {"signal": "SIGUSR2"}


# --- types whose counterpart depends on their parameters ---


@pytest.mark.parametrize(
    ("said", "code"),
    [
        ("{}", "BGR2GRAY"),  # as CS::APEX has it by default
        ("{output: {type: set, txt: HSV, int: 4}}", "BGR2HSV"),
        ("{input: {type: set, txt: RGB, int: 1}, output: {type: set, txt: HSL, int: 3}}", "RGB2HLS"),
        ("{input: {type: set, txt: YUV, int: 0}, output: {type: set, txt: RGB, int: 1}}", "YUV2RGB"),
        ("{input: {type: set, txt: MONO, int: 5}, output: {type: set, txt: BGR, int: 2}}", "GRAY2BGR"),
        ("{input: {type: set, txt: BGR, int: 2}, output: {type: set, txt: LAB, int: 6}}", "BGR2Lab"),
    ],
)
def test_a_colour_conversion_is_that_of_both_its_parameters(said: str, code: str) -> None:
    pytest.importorskip("cv2")
    document, report = read(f"nodes: [{node('csapex::ColorConvert', 0, '', said)}]")
    assert report.nodes[0].state == "mapped"
    assert build(document)["ColorConvert_0"].ports.parameters["code"].value == code


def test_a_colour_conversion_that_there_is_not_is_named() -> None:
    pytest.importorskip("cv2")
    said = "{input: {type: set, txt: HSV, int: 4}, output: {type: set, txt: LUV, int: 7}}"
    document, report = read(f"nodes: [{node('csapex::ColorConvert', 0, '', said)}]")
    assert report.nodes[0].state == "approximated"
    assert "HSV2Luv" in str(document.nodes["ColorConvert_0"].notes)


def test_a_time_stamp_is_that_of_the_value() -> None:
    kind = "csapex::ExtractTimeStamp"
    found, states = wired(f"{IMAGE}_0:|:out_0 {kind}_0:|:in_0", kinds=(IMAGE, kind))
    assert (found, states) == (["ExampleImageGenerator_0.image -> ExtractTimeStamp_0.value"], ["mapped"])
    assert rule_of(kind).type == "hfg.nodes.time:stamp_of"  # type: ignore[union-attr]


def test_a_screenshot_has_its_folder_its_ending_and_its_ports() -> None:
    pytest.importorskip("cv2")
    kind = "csapex::MakeScreenshot"
    said = (
        "{path: {type: path, value: /tmp}, quality: {type: range, int: 75}, "
        "format: {type: value, string: '%s_$wx$h.jpg'}}"
    )
    document, report = read(
        f"""
        version: {{major: 1, minor: 0, patch: 0}}
        nodes: [{node(kind, 0, "", said)}]
        connections:
          - {{uuid: event_activation, targets: ['{kind}_0:|:slot_2'], types: [default]}}
          - {{uuid: '{kind}_0:|:event_3', targets: [slot_exit], types: [default]}}
        """
    )
    assert document.nodes["MakeScreenshot_0"].parameters == {
        "path": "/tmp",
        "quality": 75,
        "format": "jpg",
        "name": "MakeScreenshot_0_",
    }
    assert edges(document) == ["start -> MakeScreenshot_0.take", "MakeScreenshot_0.done -> stop"]
    assert report.nodes[0].state == "approximated"


FILE = (
    "{import directory: {type: value, bool: false}, path: {type: path, value: PATH}, "
    "directory/loop: {type: value, bool: true}}"
)
FOLDER = """{import directory: {type: value, bool: true}, directory: {type: path, value: PATH},
    directory/current_file: {type: value, string: PATH/2.png}, directory/loop: {type: value, bool: false},
    directory/sort_numerically: {type: value, bool: true}, directory/filter: {type: value, string: '.*'},
    directory/play: {type: value, bool: true}, directory/current: {type: range, int: 1, min: 0, max: 2, step: 1}}"""


def test_a_file_importer_reads_pictures_of_a_folder_in_order(tmp_path: Path) -> None:
    cv2 = pytest.importorskip("cv2")
    for number in (10, 9, 2):
        (tmp_path / "pictures").mkdir(exist_ok=True)
        cv2.imwrite(str(tmp_path / "pictures" / f"{number}.png"), cv2.UMat(number, number, cv2.CV_8UC3).get())
    said = FOLDER.replace("PATH", str(tmp_path / "pictures")).replace("\n", " ")
    document, report = read(f"nodes: [{node('csapex::FileImporter', 0, 'max_frequency: 0', said)}]")
    assert document.nodes["FileImporter_0"].type == "hfg.nodes.files:ImageFiles"
    assert report.nodes[0].why == ["the stream ends behind the last file"]
    graph = build(document)
    graph.connect(graph["FileImporter_0"].ports.outputs["image"], graph.output("pictures", Any))
    assert [one.shape[0] for one in hfg.run(graph, clock="virtual").outputs["pictures"]] == [2, 9, 10]


def test_a_file_importer_reads_one_file_once_whatever_is_said_of_folders(tmp_path: Path) -> None:
    """As in CS::APEX's own test that has to end well: the file, then `slot_exit`."""
    (tmp_path / "msg_0.apexm").write_text("type: std::string")
    said = FILE.replace("PATH", str(tmp_path / "msg_0.apexm"))
    document, report = read(
        f"""
        nodes: [{node("csapex::FileImporter", 0, "exec_type: 0", said)}]
        connections: [{{uuid: 'csapex::FileImporter_0:|:out_0', targets: [slot_exit], types: [default]}}]
        """
    )
    assert "it gives the paths of files" in str(report)
    assert "directory/loop" not in str(report.nodes[0])
    assert hfg.run(build(document), clock="virtual").outcome == "stopped"


def test_a_file_importer_has_the_slots_and_events_of_its_numbers() -> None:
    kind = "csapex::FileImporter"
    slots = [
        wired(f"event_activation {kind}_0:|:slot_{number}", kinds=(kind,), more="version: {major: 1}")[0]
        for number in range(2, 6)
    ]
    assert [one[0].rpartition(".")[2] for one in slots] == ["restart", "play", "stop", "abort"]
    events = [
        wired(f"{kind}_0:|:event_{number} slot_exit", kinds=(kind,), more="version: {major: 1}")[0] for number in (3, 4)
    ]
    assert [one[0].partition(" ")[0] for one in events] == ["FileImporter_0.began", "FileImporter_0.ended"]


# --- signals into inputs ---


@pytest.mark.parametrize(("slot", "outcome"), [("slot_exit", "stopped"), ("slot_abort", "aborted")])
def test_what_must_fail_in_csapex_fails_and_what_must_end_well_does(slot: str, outcome: str) -> None:
    """Its own two smallest tests: the activation of the graph goes through a delay into `slot_abort` or `slot_exit`."""
    document, report = read(
        f"""
        nodes: [{node("csapex::Delay", 0, "exec_type: 0", "{delay: {type: range, double: 1}}")}]
        connections:
          - {{uuid: 'csapex::Delay_0:|:out_0', targets: [{slot}], types: [default]}}
          - {{uuid: event_activation, targets: ['csapex::Delay_0:|:in_0'], types: [default]}}
        """
    )
    assert [one.state for one in report.connections] == ["mapped", "approximated"]
    graph = build(document)
    if outcome == "stopped":
        assert hfg.run(graph, clock="virtual").outcome == outcome
        return
    with pytest.raises(hfg.errors.Aborted) as raised:
        hfg.run(graph, clock="virtual")
    assert raised.value.report.outcome == outcome  # type: ignore[attr-defined]


def test_a_signal_of_any_node_is_passed_on_as_a_value_and_carries_activity() -> None:
    relay = "csapex::Relay"
    document, _ = read(
        f"""
        nodes: [{node("csapex::Delay", 0, "exec_type: 0", "{delay: {type: range, double: 1}}")}, {node(relay)}]
        connections:
          - {{uuid: event_activation, targets: ['csapex::Delay_0:|:slot_2'], types: [active]}}
          - {{uuid: 'csapex::Delay_0:|:event_0', targets: ['{relay}_0:|:in_0'], types: [active]}}
          - {{uuid: '{relay}_0:|:out_0', targets: [slot_abort], types: [default]}}
        """
    )
    assert edges(document)[1:3] == [
        "Delay_0.activated -> Delay_0_activated_as_value.trigger active",
        "Delay_0_activated_as_value.given -> Relay_0.value active",
    ]
    with pytest.raises(hfg.errors.Aborted):
        hfg.run(build(document), clock="virtual")
