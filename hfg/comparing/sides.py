"""One side of a comparison: a recording, the report of a run as JSON, or runs in virtual time.

Runs are made in processes of their own, so two versions of a module do not meet. The first is recorded, so that all
sides are compared by what a recording holds. Depends on recordings and on one run of a search.
"""

from __future__ import annotations

import glob
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import msgspec

from hfg.base.bounds import JOURNAL_BYTES
from hfg.base.token import Token
from hfg.base.whole import read_plain
from hfg.engine import Report, Run
from hfg.engine.observing.encoding import encode
from hfg.errors import HfgError, UsageError
from hfg.graph import Graph
from hfg.recording import File, record
from hfg.recording.course import Course
from hfg.recording.recording import is_recordable, ports_of
from hfg.recording.seeking import Seeking
from hfg.tuning.evaluating import Constraints, Problem, Told, evaluate, seed_parameters
from hfg.tuning.scores import STATISTICS, Passed, Score, ScoreLike
from hfg.tuning.space import Space
from hfg.tuning.tuning import read_scores, read_seeds
from hfg.tuning.workers import Died, Workers, usual_processes

Spans = dict[str, list[tuple[float, float]]]
"""When each node was active, in seconds of the run."""

_OF_NODES: Final = ("firings", "silent", "calls", "failed")
_OF_EDGES: Final = ("sent", "dropped", "lost", "untaken")


class Side(msgspec.Struct):
    """What is known of one side.

    Attributes:
      name: as the user named it.
      outcome: of the run.
      why: a sentence, if something went wrong.
      duration_s: on the clock of the run; None if unknown.
      scores: by name, one for each seed.
      counts: by what is counted; None if nothing was.
      activity: None if unknown.
      graph: the commands that build it, as data; None if unknown.
      recording: the file; None if there is none.
      notes: what the comparison leaves out of this side.
    """

    name: str
    outcome: str = "unknown"
    why: str = ""
    duration_s: float | None = None
    scores: dict[str, list[float]] = {}
    counts: dict[str, int] | None = None
    activity: Spans | None = None
    graph: list[Any] | None = None
    recording: str | None = None
    notes: list[str] = []

    def count(self, report: Report) -> Side:
        """Take over what a report counts. Return this side."""
        self.outcome, self.duration_s, self.counts = report.outcome, report.duration_s, {}
        for path, node in report.nodes.items():
            self.counts |= {f"{path}: {name}": getattr(node, name) for name in _OF_NODES}
        for label, edge in report.edges.items():
            self.counts |= {f"{label}: {name}": getattr(edge, name) for name in _OF_EDGES}
        return self

    def add(self, told: Told, judged: Sequence[Score], seed: int | None) -> None:
        """Add the scores of a run; nan where it has none, so that those of a seed stay side by side."""
        values = told.scores if told.outcome == "ok" else [float("nan")] * len(judged)
        for score, value in zip(judged, values, strict=True):
            self.scores[score.name].append(value)
        if told.outcome != "ok" and not self.why:
            self.why = f"{told.outcome}{'' if seed is None else f' with seed {seed}'}: {told.why}"

    def take_first(self, ran: _Ran, file: Path) -> None:
        """Take over what the first run tells, and what its recording does, if there is one."""
        if file.exists():
            recorded = read_recording(file, self.name)
            self.activity, self.graph, self.recording = recorded.activity, recorded.graph, recorded.recording
            self.notes += recorded.notes
        self.notes += [f'tokens of "{port}" are not data, and not compared' for port in ran.left_out]
        if ran.report is not None:
            self.count(ran.report)
        else:
            self.outcome, self.duration_s = ran.told.outcome, ran.told.simulated_s


# --- files ------------------------------------------------------------------------------------------------------------


def read_recording(file: Path, name: str = "", scores: Sequence[ScoreLike] = ()) -> Side:
    """Read a recording.

    Args:
      file: its path.
      name: of the side; the file's by default.
      scores: what it is judged by; of a recording, only statistics of ports.

    Raises:
      UsageError: it is not a recording, cannot be read, or has no such score.
    """
    with File(file) as recording:
        info = recording.info()
        side = Side(name or str(file), info.outcome or "unknown", duration_s=info.duration_s, recording=str(file))
        side.notes += [str(loss) for loss in info.losses]
        left = info.left_out | info.refused
        side.notes += [f'{count} tokens of "{port}" were not recorded' for port, count in left.items()]
        course = Course(Seeking(recording))
        for _ in course.read():
            pass
        ends = info.began + info.duration_s
        side.activity = {}
        for node, begin, end in course.spans():
            span = (begin / 1e9 - info.began, (ends if end is None else end / 1e9) - info.began)
            side.activity.setdefault(node, []).append(span)
        if course.unknown_after is not None:
            side.notes.append(f"activity after {course.unknown_after / 1e9 - info.began:.3f} s is not compared")
        if info.commands:
            try:
                side.graph = msgspec.json.decode(info.commands, type=list[Any])
            except (msgspec.DecodeError, RecursionError) as error:
                side.notes.append(f"the graph, because its description is damaged ({error})")
        side.scores = {score.name: [_score(recording, score)] for score in read_scores(scores, ())} if scores else {}
    return side


def _score(file: File, score: Score) -> float:
    """Return the statistic of a recorded port."""
    port, _, statistic = score.name.rpartition(".")
    if score.function is not None or statistic not in STATISTICS or not file.numbers_of(port):
        raise UsageError(
            f'"{file.path}" does not tell the score "{score.name}": of a recording, name a port that it has and one of '
            f"{', '.join(STATISTICS)}, as in node.port.rms"
        )
    passed = Passed()
    for _, _, data in file.messages(file.numbers_of(port)):
        passed.put(Token(file.object_in(data).get("value")))
    if passed.wrong or not passed.count:
        raise UsageError(f'score "{score.name}": {passed.wrong or "no value passed the port"}')
    return STATISTICS[statistic](passed)


def read_report(file: Path) -> Side:
    """Read a report that `hfg run --json` has written.

    Raises:
      UsageError: it is not a report, or cannot be read.
    """
    try:
        data = read_plain(file, JOURNAL_BYTES.most + 1)
        if len(data) > JOURNAL_BYTES.most:
            raise UsageError(f'the report "{file}" is too large; {JOURNAL_BYTES.remedy}')
        report = msgspec.json.decode(data, type=Report)
    except OSError as error:
        raise UsageError(f'the report "{file}" cannot be read: {error.strerror}') from None
    except (msgspec.DecodeError, RecursionError) as error:
        raise UsageError(f'"{file}" is not the report of a run: {error}; hfg run --json writes one') from None
    return Side(str(file)).count(report)


# --- runs -------------------------------------------------------------------------------------------------------------


class _Ran(msgspec.Struct):
    """One run, as its process tells it."""

    told: Told
    report: Report | None = None
    left_out: list[str] = []
    refused: str = ""


def run_both(
    names: Sequence[str],
    builds: Sequence[Callable[[], Graph]],
    folder: Path,
    *,
    scores: ScoreLike | Sequence[ScoreLike] = (),
    seeds: Sequence[int] = (),
    seed_parameter: str | None = None,
    constraints: Constraints | None = None,
    until_s: float | None = None,
    processes: int | None = None,
    patience_s: float | None = None,
    told: Callable[[Told], object] = lambda told: None,
) -> list[Side]:
    """Run graphs in virtual time, each once with each seed; the first run of each is recorded.

    Args:
      names: of the sides.
      builds: functions that return a new graph each.
      folder: for the recordings.
      scores: what runs are judged by; see `hfg.tuning.tune`.
      seeds: of the runs.
      seed_parameter: gets the seed; by default every parameter with the name "seed".
      constraints: monitors; a run that violates one has no score.
      until_s: ends each run.
      processes: how many runs at a time.
      patience_s: a run that takes longer on the clock of the wall is ended.
      told: called after each run.

    Raises:
      HfgError: a graph cannot be built, or a score or seed does not fit.
    """
    if not builds:
        return []
    judged = read_scores(scores, ()) if scores else []
    problem = Problem(lambda: Graph("none"), Space([]), judged, (), until_s, constraints or {})
    every = read_seeds(seeds)
    work = partial(_work, problem, builds, folder, every, seed_parameter)
    tasks = [msgspec.json.encode((side, turn)) for side in range(len(builds)) for turn in range(len(every))]
    sides = [Side(name, scores={score.name: [] for score in judged}) for name in names]
    with Workers(work, processes or usual_processes(), patience_s) as workers:
        for number, answer in enumerate(workers.in_order(tasks)):
            side, first = sides[number // len(every)], number % len(every) == 0
            ran = _read(answer)
            told(ran.told)
            side.add(ran.told, judged, every[number % len(every)])
            if first:
                side.take_first(ran, _file(folder, number // len(every)))
    return sides


def _read(answer: bytes | Died) -> _Ran:
    if isinstance(answer, Died):
        return _Ran(Told("late" if answer.late else "crashed", why=str(answer)))
    ran = msgspec.json.decode(answer, type=_Ran)
    if ran.refused:
        raise UsageError(ran.refused)
    return ran


def _file(folder: Path, side: int) -> Path:
    return folder / f"{side}.mcap"


def _work(
    problem: Problem,
    builds: Sequence[Callable[[], Graph]],
    folder: Path,
    seeds: Sequence[int | None],
    seed_parameter: str | None,
    task: bytes,
) -> bytes:
    """Do this in a process of its own."""
    side, turn = msgspec.json.decode(task)
    runs: list[Run] = []
    left_out: list[str] = []

    def begin(run: Run) -> None:
        runs.append(run)
        if turn == 0:
            left_out.extend(_record(run, _file(folder, side)))

    try:
        graph = builds[side]()
        paths = seed_parameters(graph, seed_parameter) if seeds != [None] else []
    except HfgError as error:
        return msgspec.json.encode(_Ran(Told("refused"), refused=str(error)))
    told = evaluate(replace(problem, build=lambda: graph, seed_paths=paths), {}, seeds[turn], begin)
    refused = told.why if told.outcome == "refused" else ""
    report = msgspec.Raw(encode(runs[0].report())) if runs else None  # its outputs can have any values
    return msgspec.json.encode({"told": told, "report": report, "left_out": left_out, "refused": refused})


def _record(run: Run, file: Path) -> list[str]:
    """Record all ports whose values are data. Return the others."""
    ports = ports_of(run)
    data = [path for path, port in ports.items() if is_recordable(path, port.type)]
    if data:
        record(run, file, select=[glob.escape(path) for path in data])
    return [path for path in ports if path not in data]
