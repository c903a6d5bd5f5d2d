"""When a graph in parts is quiet, and the consequences (rules F8, P9, F13, R5).

The consequences of quiet take effect when nothing moves *anywhere*, and all at one moment. So the parts report when
they rest and what they have sent, received and taken until then, and the main part compares the reports. When all rest
and nothing is in transit, it asks each part whether this still holds (Mattern's second wave), and then leads them
through the steps of rule R5 together. A part that has moved meanwhile interrupts this; it reports again when it rests.

An edge that may lose signals may have lost some; then the reports of its two ends never match. If all rest and only
such edges differ, they are checked again after a while; if nothing has arrived until then, the missing signals count as
lost.

A state machine: its inputs are method calls, its outputs are calls of `ask` and `wait`, and the answers may come at any
time and in any order. Does not depend on a network, a clock or an engine.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Annotated, Any, Final, Literal, TypeAlias

import msgspec

Step: TypeAlias = Literal[
    "missing", "lose", "rests", "fullest", "grow", "held", "give_up", "complete", "end", "stuck", "finish"
]

_STEPS: Final[tuple[Step, ...]] = ("rests", "fullest", "held", "give_up", "complete", "end", "stuck")
"""The questions to all parts, in this order (SEMANTICS "quiet"); the answers determine the other questions."""


Counted: TypeAlias = Annotated[int, msgspec.Meta(ge=0, le=2**62)]

Account: TypeAlias = tuple[Counted, Counted, str, bool]
"""One side's state of an edge: how many tokens have left or arrived, how many of them were taken, whether the consumer
takes, drains or gets none, and whether the producer is enabled.
"""


_ANSWERS: Final[dict[Step, Any]] = {
    "missing": Any,
    "lose": Any,
    "rests": Any,
    "finish": Any,
    "fullest": tuple[float, float, str] | None,
    "stuck": list[str],
}
"""Types of answers to some questions; the others are answered with yes or no."""


_QUESTIONS: Final[dict[Step, Any]] = {"lose": dict[str, Counted], "grow": str, "finish": list[str]}
"""Types of the contents of these questions."""


class Rest(msgspec.Struct, frozen=True):
    """A part rests.

    Attributes:
      part: its name.
      number: how often it has rested; from 1.
      leaving: its state of leaving edges, by label.
      coming: its state of incoming edges. If nothing is in transit, the two sides agree.
    """

    part: str
    number: int
    leaving: dict[str, Account]
    coming: dict[str, Account]


class Question(msgspec.Struct, frozen=True):
    """A question or instruction to a part, valid if it still rests.

    Attributes:
      step: see `Step`.
      rest: the number of the rest that it refers to.
      value: for `lose` how many have left, by label of the edge; for `grow` the label of the edge; for `finish` the
        reasons why the run has stalled.
    """

    step: Step
    rest: int
    value: Any = None

    def check(self) -> None:
        """Check that its value is one.

        Raises:
          ValueError: it is not.
        """
        msgspec.convert(self.value, _QUESTIONS.get(self.step, Any))


class Answer(msgspec.Struct, frozen=True):
    """The answer of a part.

    Attributes:
      part: its name.
      step: step of the question.
      rest: rest of the question.
      moved: the part does not rest any more, or has moved in between; nothing was done.
      value: `fullest`: (capacity, number, label) of a queue, or None. `held`: whether tokens may still be brought in or
        taken from outside. `give_up`, `complete`, `end`: whether this made something move. `stuck`: reasons.
    """

    part: str
    step: Step
    rest: int
    moved: bool = False
    value: Any = None


class Agreement:
    """Sees to it that what follows from quiet happens when the whole is quiet."""

    def __init__(
        self,
        parts: Iterable[str],
        ask: Callable[[str, Question], None],
        *,
        lossy: Iterable[str] = (),
        wait: Callable[[], None] = lambda: None,
    ) -> None:
        """Start with parts that have not rested yet.

        Args:
          parts: their names.
          ask: sends a question to a part; pass its answer to `hear`.
          lossy: labels of the edges that may lose tokens.
          wait: schedules a call of `look_again`.
        """
        self._lossy = frozenset(lossy)
        self._wait = wait
        self._missed: dict[str, tuple[int, int]] = {}  # what all have agreed on to be missing, before the pause
        self._rests: dict[str, Rest | None] = dict.fromkeys(parts)
        self._ask = ask
        self._step: Step | None = None
        self._round: dict[str, int] = {}  # the rest of each part that is meant
        self._answers: dict[str, Any] = {}

    def rest(self, rest: Rest) -> None:
        """A part rests; its previous report is obsolete."""
        self._rests[rest.part] = rest
        self._step = None
        self._look()

    def _look(self) -> None:
        missing = self._missing()
        if missing is None or (missing and missing == self._missed):
            return  # it is waited for already
        self._missed = {}
        self._begin("missing" if missing else "rests")

    def look_again(self) -> None:
        """A while has passed in which something that is missing might have come."""
        if self._step is None and self._missed and self._missing() == self._missed:
            self._begin("missing")

    def leave(self, part: str) -> None:
        """A part is gone, or is restarted: its report does not count."""
        self._rests[part] = None
        self._step = None

    def hear(self, answer: Answer) -> None:
        """A part has answered.

        Raises:
          ValueError: not with what such a question asks for.
        """
        if self._step is None or answer.step != self._step or self._round.get(answer.part) != answer.rest:
            return  # to a question of which nothing comes any more
        if not answer.moved:
            msgspec.convert(answer.value, _ANSWERS.get(answer.step, bool | None))
        if answer.moved:
            self._step = None  # it will rest again
            return
        self._answers[answer.part] = answer.value
        if len(self._answers) == len(self._round):
            self._decide(self._step, self._answers)

    def _begin(self, step: Step, value: Any = None) -> None:
        self._step = step
        self._answers = {}
        self._round = {part: rest.number for part, rest in self._rests.items() if rest is not None}
        for part, number in list(self._round.items()):
            if self._step != step:
                return  # an answer that came at once has ended it
            self._ask(part, Question(step, number, value))

    def _decide(self, step: Step, answers: dict[str, Any]) -> None:
        if step == "missing":
            missing = self._missing() or {}
            if missing == self._missed:
                self._missed = {}
                self._begin("lose", {label: count for label, (count, _) in missing.items()})
            else:
                self._step = None
                self._missed = missing
                self._wait()
            return
        if step == "fullest":
            full = [(tuple(found), part) for part, found in answers.items() if found is not None]
            if full:
                (_, _, label), part = min(full)
                self._step = None
                self._ask(part, Question("grow", self._round[part], label))
                return
        elif step == "stuck":
            self._begin("finish", [reason for reasons in answers.values() for reason in reasons])
            return
        elif step in ("finish", "lose"):
            self._step = None
            return
        elif step != "rests" and any(answers.values()):
            self._step = None  # it continues, or is held open from outside
            return
        self._begin(_STEPS[_STEPS.index(step) + 1])

    def _missing(self) -> dict[str, tuple[int, int]] | None:
        """Return how many tokens have left and arrived, for edges with missing tokens, by label.

        None: some parts do not rest, or something else is in transit, even if it is only an acknowledgement.
        """
        leaving: dict[str, Account] = {}
        coming: dict[str, Account] = {}
        for rest in self._rests.values():
            if rest is None:
                return None
            leaving |= rest.leaving
            coming |= rest.coming
        if leaving.keys() != coming.keys():
            return None
        missing: dict[str, tuple[int, int]] = {}
        for label, (count, done, hearing, speaking) in leaving.items():
            came, _, heard, _ = coming[label]
            if (count, done, hearing, speaking) == coming[label]:
                continue
            if label not in self._lossy or hearing != heard or came >= count:
                return None
            missing[label] = (count, came)
        return missing
