"""`hfg top [RUN]`: the live table of a graph that runs in another process, or on another host of the realm.

Depends on `sockets`, `runs`, `table`, `terminal` and `show`.
"""

from __future__ import annotations

import sys
import time
from typing import Annotated

import msgspec
import typer

from hfg.cli import show
from hfg.cli.live import EVERY_S
from hfg.cli.options import SettingsOption
from hfg.cli.runs import RealmLine
from hfg.cli.sockets import Line, find, which
from hfg.cli.table import View
from hfg.cli.terminal import Foot, is_terminal
from hfg.engine import Glance
from hfg.engine.face.watching import Question
from hfg.errors import TargetError

_PIPE_COLUMNS = 200
_BETWEEN_S = 1.0  # where there is one table only, rates are those of so long
_MOST_LOOKS = 4  # while processes of parts have not answered


def top(
    run: Annotated[
        str | None, typer.Argument(help="process id or name of the graph; default: the only running graph")
    ] = None,
    settings: SettingsOption = None,
    json: Annotated[bool, typer.Option("--json", help="Write the current state of the run as JSON.")] = False,
) -> int:
    """Watch a graph that is running in another process. Without a terminal, print one table."""
    if settings is not None:
        with RealmLine(settings, run) as far:
            return _look(far, json)
    there = find(run)
    if len(there) > 1:
        return which("top", there)
    with Line(there[0].name) as line:
        return _look(line, json)


def _look(line: Line | RealmLine, json: bool) -> int:
    try:
        if json or not is_terminal(sys.stdout):
            return _once(line, json)
        _watch(line)
    except KeyboardInterrupt:  # how one leaves it
        return 0
    return 0


def _once(line: Line | RealmLine, json: bool) -> int:
    """Look twice, so that there are rates, and write what was seen; more often while processes of parts are asked."""
    view = View()
    glances: list[Glance] = []
    while len(glances) < 2 or (len(glances) < _MOST_LOOKS and not view.has_rates):
        if glances:
            time.sleep(_BETWEEN_S)
        glance = _glance(line)
        if glance is None:
            show.sentence("the run does not answer: a node blocks its loop")
            return 1
        glances.append(glance)
        view.look(glance)
    last = glances[-1]
    if json:
        head = {"graph": last.graph, "outcome": last.outcome, "duration_s": last.duration_s, "lost": last.lost}
        head |= {"growing": last.growing, "monitors": last.monitors}
        show.json({**head, "nodes": [row._asdict() for row in view.rows()]})
    else:
        show.write("\n".join(view.lines(_PIPE_COLUMNS, len(last.nodes) + 10)) + "\n")
    return 0


def _watch(line: Line | RealmLine) -> None:
    """Draw until the run is over."""
    foot = Foot(sys.stdout)
    view = View()
    glance = None
    try:
        while True:
            newest = _glance(line)
            if newest is not None:
                glance = newest
            elif glance is not None:
                glance = msgspec.structs.replace(glance, outcome="does not answer: a node blocks its loop")
            if glance is None:
                foot.draw(["no answer yet: a node blocks its loop"])
            elif foot.is_ready():
                view.look(glance)
                columns, height = foot.size()
                foot.draw(view.lines(columns, height, coloured=foot.coloured))
            time.sleep(EVERY_S)
    except TargetError as over:
        show.sentence(str(over))


def _glance(line: Line | RealmLine) -> Glance | None:
    answer = line.ask(Question("glance"))
    return None if answer is None else answer.glance
