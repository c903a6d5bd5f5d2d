"""The table's text: what it says, and what it leaves out where there is no room."""

from __future__ import annotations

import msgspec
import pytest
from rich.cells import cell_len

from hfg.cli.table import View
from hfg.engine import Glance, MonitorGlance, NodeGlance


def node(
    path: str, *, done: int = 0, busy_s: float = 0.0, queued: int = 0, failed: int = 0, **more: object
) -> NodeGlance:
    known: dict[str, object] = {"group": "loop", "active": False, "doing": "rate", **more}
    made = NodeGlance(
        path, str(known["group"]), done, busy_s, queued, failed, bool(known["active"]), str(known["doing"])
    )
    return msgspec.structs.replace(made, age_s=float(str(known.get("age_s", 0.0))))


def look(at: float, *nodes: NodeGlance, outcome: str = "running") -> Glance:
    return Glance("fetch", outcome, at, 100 + at, list(nodes))


def view(*glances: Glance) -> View:
    made = View()
    for glance in glances:
        made.look(glance)
    return made


TWO = view(
    look(1.0, node("camera", done=10), node("arm/move", busy_s=1.0)),
    look(1.5, node("camera", done=25, group="eyes"), node("arm/move", done=1, busy_s=1.4, queued=3, active=True)),
)


def test_says_what_the_nodes_do_now() -> None:
    assert TWO.lines(80, 24) == [
        "fetch  running  1.5 s  2 nodes",
        "active  arm/move",
        "busy  eyes 0 %  loop 80 %",
        "node        rate   busy  queue  active  now",
        "camera      30.0    0 %                 rate",
        "arm/move     2.0   80 %      3  yes     rate",
    ]


def test_rates_are_those_of_the_last_second() -> None:
    looks = [look(at, node("a", done=done)) for at, done in ((0.0, 0), (1.0, 1000), (1.5, 1005), (2.0, 1010))]
    (row,) = view(*looks).rows()
    assert row.rate_hz == pytest.approx(10.0)


def test_a_node_of_another_process_has_the_rate_of_its_own_counts() -> None:
    """The first glance lacks its counts, and those of later ones are as old as the last report of its process."""
    looks = [look(0.0), look(1.0, node("a", done=50, age_s=1.0)), look(2.0, node("a", done=140, age_s=0.2))]
    made = view(*looks[:2])
    assert not made.has_rates
    made.look(looks[2])
    assert made.has_rates
    (row,) = made.rows()
    assert row.rate_hz == pytest.approx(50.0)  # 90 firings in 1.8 s


def test_one_glance_has_no_rates_and_a_node_that_is_new_neither() -> None:
    (row,) = view(look(1.0, node("a", done=5, busy_s=1.0))).rows()
    assert (row.rate_hz, row.busy_share) == (0.0, 0.0)
    _, new = view(look(1.0, node("a")), look(2.0, node("a"), node("b", done=9))).rows()
    assert new.rate_hz == 0.0


def test_errors_have_a_column_when_there_are_some() -> None:
    lines = view(look(1.0, node("a", failed=2), node("b"))).lines(80, 24)
    assert lines[0].endswith("2 nodes  2 errors")
    assert lines[2].split() == ["node", "rate", "busy", "queue", "active", "errors", "now"]


def test_fused_nodes_have_a_mark_when_there_are_some() -> None:
    made = view(look(1.0, msgspec.structs.replace(node("a"), fused=True), node("b")))
    assert [line.split() for line in made.lines(80, 24)[2:]] == [
        ["node", "rate", "busy", "queue", "active", "fused", "now"],
        ["a", "0", "0", "%", "yes", "rate"],
        ["b", "0", "0", "%", "rate"],
    ]
    assert [row.fused for row in made.rows()] == [True, False]


def test_monitors_have_a_line_with_what_is_known_of_each() -> None:
    known = {"dark": ("violated", 3), "stops": ("not yet", 0), "once": ("violated", 1)}
    found = [MonitorGlance(name, *rest) for name, rest in known.items()]
    lines = view(msgspec.structs.replace(look(1.0, node("a")), monitors=found)).lines(80, 24)
    assert lines[1] == "monitors  dark violated 3 times  stops not yet  once violated"


def test_deadlines_have_a_bar_of_what_the_oldest_data_has_used_up() -> None:
    oldest = {"a": 0.05, "b": 2.0}
    late = [msgspec.structs.replace(node(name), deadline_s=0.1, oldest_s=seconds) for name, seconds in oldest.items()]
    lines = view(look(1.0, *late, node("free"))).lines(80, 24)
    assert [line.rstrip() for line in lines[2:]] == [
        "node    rate   busy  queue      budget  active  now",
        "a          0    0 %          ██░░ 50 %          rate",
        "b          0    0 %         ████ 999 %          rate",
        "free       0    0 %                             rate",
    ]


@pytest.mark.parametrize("columns", [1, 5, 20, 33, 47, 80, 200])
@pytest.mark.parametrize("height", [1, 2, 4, 10, 50])
def test_fits_into_any_terminal(columns: int, height: int) -> None:
    names = ["a", "fetch/arm/左手/" + "x" * 50, "new\nline\x1b[2J", "größe", ""]
    nodes = [node(name, done=10**9, failed=1, busy_s=3, active=True, doing="input " + name) for name in names * 3]
    lines = view(look(0.0, *nodes), look(1.0, *nodes)).lines(columns, height)
    assert 0 < len(lines) <= max(1, height - 1)
    assert all(cell_len(line) <= max(columns - 1, 4) for line in lines)
    assert all(line.isprintable() for line in lines)


def test_twenty_columns_show_nodes_and_rates() -> None:
    assert TWO.lines(20, 24)[3:] == ["node        rate", "camera      30.0", "arm/move     2.0"]


def test_of_too_many_nodes_the_busiest_are_shown_and_the_rest_is_counted() -> None:
    before = [node(f"n{number}") for number in range(60)]
    after = [node(f"n{number}", busy_s=number / 60) for number in range(60)]
    lines = view(look(0.0, *before), look(1.0, *after)).lines(80, 10)
    assert len(lines) == 9
    assert [line.split()[0] for line in lines[3:-1]] == ["n59", "n58", "n57", "n56", "n55"]
    assert lines[-1] == "… 55 more, less busy"


def test_colours_only_where_they_are_welcome() -> None:
    assert not any("\x1b" in line for line in TWO.lines(80, 24))
    assert TWO.lines(80, 24, coloured=True)[1] == "\x1b[32mactive  arm/move\x1b[0m"


def test_large_numbers_are_short() -> None:
    nodes = [node(str(done), done=done) for done in (9, 99, 999, 12_345, 987_654)]
    rows = view(look(0.0, *[node(one.path) for one in nodes]), look(1.0, *nodes)).lines(80, 24)[3:]
    assert [row.split()[1] for row in rows] == ["9.0", "99.0", "999", "12.3k", "988k"]
