"""What the producer of an exact link knows of one of its consumers.

Changed by its own methods alone, each of which says what has happened. Stands on `frames`.
"""

from __future__ import annotations

from hfg.links.frames import Status

__all__ = ["Peer"]


class Peer:
    """One consumer, as its statuses have told.

    Attributes:
      name: its name on the link.
      incarnation: which life of it is believed; 0: it was never heard of.
      expected: the only incarnation to believe, or None for the newest that is heard of.
      in_step: this life of it follows this epoch and stream: it is sent tokens. Others are only probed.
      accepted: what it has got.
      done: what it has processed; never goes back.
      limit: what it has room for.
      sent: what was sent to it and is not known to be lost.
      last_serial: of what carried the last of those; a status that has seen it and lacks some proves them lost.
      owed: it is to be probed at once.
      since: when something was last sent to it or learnt of it.
      patience_s: how long after that it is probed.
      answers: something was heard of it since it was last probed.
      silent: it was probed again, for it had not answered.
      unanswered: how often in a row it was probed and did not answer.
    """

    __slots__ = (
        "_shortest_s",
        "accepted",
        "answers",
        "done",
        "expected",
        "in_step",
        "incarnation",
        "last_serial",
        "limit",
        "name",
        "owed",
        "patience_s",
        "sent",
        "silent",
        "since",
        "unanswered",
    )

    def __init__(self, name: str, done: int, patience_s: float) -> None:
        self.name = name
        self.incarnation = 0
        self.expected: int | None = None
        self.in_step = False
        self.accepted = self.done = self.limit = self.sent = done
        self.last_serial = 0
        self.owed = True
        self.answers = True
        self.silent = False
        self.unanswered = 0
        self.since = float("-inf")
        self.patience_s = self._shortest_s = patience_s

    def believes(self, incarnation: int) -> bool:
        """Whether a word of that life of it counts."""
        if self.expected is not None:
            return incarnation == self.expected
        return incarnation >= self.incarnation and incarnation > 0

    def believe(self, incarnation: int) -> None:
        """No other life of it counts from now on."""
        self.expected = incarnation
        if self.incarnation != incarnation:
            self.begin(incarnation)
            self.owe()

    def begin(self, incarnation: int) -> None:
        """It has come back: what it had accepted and not done is gone with its former life."""
        self.incarnation = incarnation
        self.fall_out()

    def fall_out(self) -> None:
        """It has to be told where the producer stands before it can be sent anything."""
        self.in_step = False
        self.accepted = self.limit = self.sent = self.done
        self.last_serial = 0

    def step_in(self, accepted: int) -> None:
        """It knows where the producer stands, and has so much."""
        self.in_step = True
        self.accepted = self.sent = accepted

    def move_to(self, done: int) -> None:
        """The numbers go on from elsewhere."""
        self.give_up(done)
        self.owe()

    def give_up(self, done: int) -> None:
        """Nothing up to there is wanted by it any more, nor need it be told."""
        self.done = done
        self.fall_out()
        self.owed = False

    def learn(self, status: Status) -> bool:
        """It says what it has, what is done and what it lacks; give whether that is news."""
        news = status.accepted > self.accepted or status.done > self.done or status.limit > self.limit
        self.accepted = max(self.accepted, status.accepted)
        self.limit = max(self.limit, status.limit)
        if status.seen >= self.last_serial and self.accepted < self.sent:
            self.sent = self.accepted  # it has seen what was sent last, and lacks these
        self.sent = max(self.sent, self.accepted)
        self.done = max(self.done, status.done)
        if news:
            self.ask_soon()
        return news

    def owe(self) -> None:
        """It is to be probed at once."""
        self.owed = True

    def heard(self) -> None:
        """There was a word of it, whatever it says; after a silence the next one is not taken for a long one."""
        self.answers = True
        self.unanswered = 0
        if self.silent:
            self.silent = False
            self.ask_soon()

    def ask_soon(self) -> None:
        """Something new was heard of it: the next silence is not taken for a long one."""
        self.patience_s = self._shortest_s

    def carry(self, last: int, serial: int, now: float) -> None:
        """It was sent all up to that number, the last of it by that datagram."""
        self.sent = max(self.sent, last)
        self.last_serial = serial
        self.since = now

    def probed(self, now: float, slowest_s: float) -> None:
        """It is asked; if it was silent, the next time later."""
        if not self.owed:
            self.silent = not self.answers
            self.unanswered += not self.answers
            self.patience_s = min(2 * self.patience_s, slowest_s)
        self.owed = self.answers = False
        self.since = now
