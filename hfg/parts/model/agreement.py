"""When a graph in parts is quiet, and what follows from that (rules F8, P9, F13, R5).

What a run does when nothing moves any more, it does when nothing moves *anywhere*, and all of it at one moment. So the
parts say when they rest and what they have sent, received and taken until then; whoever runs the whole compares. Where
all rest and nothing is on its way, he asks each part whether that still holds (Mattern's second wave), and then lets
them go through the steps of rule R5 together. A part that has moved meanwhile breaks this off; it will rest again, and
say so.

An edge that may lose signals can have lost some, and then its two ends never say the same. Where all rest and only that
is between them, the whole looks again after a while; if nothing has come until then, what is missing counts as lost.

A state machine: what it is told are method calls, what it wants done is what `ask` and `wait` are called with, and the
answers may come at any time and in any order. Knows no network, no clock and no engine.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Annotated, Any, Final, Literal, TypeAlias

import msgspec

__all__ = ["Account", "Agreement", "Answer", "Counted", "Question", "Rest", "Step"]

Step: TypeAlias = Literal[
    "missing", "lose", "rests", "fullest", "grow", "held", "give_up", "complete", "end", "stuck", "finish"
]

_STEPS: Final[tuple[Step, ...]] = ("rests", "fullest", "held", "give_up", "complete", "end", "stuck")
"""What is asked of all parts, in this order (SEMANTICS "quiet"); the others are asked for by the answers."""


Counted: TypeAlias = Annotated[int, msgspec.Meta(ge=0, le=2**62)]

Account: TypeAlias = tuple[Counted, Counted, str, bool]
"""What one side knows of an edge: how many tokens have left or come, how many of them were taken, whether the consumer
takes, drains or is sent none, and whether the producer is enabled."""


_ANSWERS: Final[dict[Step, Any]] = {
    "missing": Any,
    "lose": Any,
    "rests": Any,
    "finish": Any,
    "fullest": tuple[float, float, str] | None,
    "stuck": list[str],
}
"""What is answered to a question; to the others, whether it is so."""


_QUESTIONS: Final[dict[Step, Any]] = {"lose": dict[str, Counted], "grow": str, "finish": list[str]}
"""What a question of these steps says."""


class Rest(msgspec.Struct, frozen=True):
    """A part rests.

    Attributes:
      part: its name.
      number: how often it has rested; from 1.
      leaving: what it knows of edges that leave it, by label.
      coming: what it knows of edges that come in. Where nothing is on its way the two sides know the same.
    """

    part: str
    number: int
    leaving: dict[str, Account]
    coming: dict[str, Account]


class Question(msgspec.Struct, frozen=True):
    """What a part is to do or say, if it still rests.

    Attributes:
      step: see `Step`.
      rest: the number of the rest that is meant.
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
    """What a part has answered.

    Attributes:
      part: its name.
      step: of the question.
      rest: of the question.
      moved: the part does not rest any more, or not since then; nothing was done.
      value: `fullest`: (capacity, number, label) of a queue, or None. `held`: whether somebody outside may still bring
        or take something. `give_up`, `complete`, `end`: whether that made something move. `stuck`: reasons.
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
        """Begin with parts that have not rested yet.

        Args:
          parts: their names.
          ask: brings a question to a part; its answer is to be given to `hear`.
          lossy: the edges that may lose tokens, by label.
          wait: has `look_again` called in a while.
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
        """A part rests; what it said before holds no more."""
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
        """A part is gone, or begins anew: what it said does not count."""
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
            self._step = None  # it goes on, or is held open by somebody outside
            return
        self._begin(_STEPS[_STEPS.index(step) + 1])

    def _missing(self) -> dict[str, tuple[int, int]] | None:
        """How many have left and come on edges where some are missing, by label.

        None: some parts do not rest, or something else is between them, be it only the word that something was taken.
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
