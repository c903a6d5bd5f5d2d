"""The producer's state of one consumer of an exact link.

Changed only by its own methods, each of which is one event. Depends on `frames`.
"""

from __future__ import annotations

from hfg.links.frames import Status


class Peer:
    """One consumer, according to its statuses.

    Attributes:
      name: its name on the link.
      incarnation: its trusted incarnation; 0: it has not sent anything yet.
      expected: the only trusted incarnation, or None for the newest one that sends a message.
      in_step: this incarnation follows the current epoch and stream, so tokens are sent to it. Others are only probed.
      accepted: number of the last token that has arrived there.
      done: number of the last token that it has processed; never decreases.
      limit: it has room for tokens up to this number.
      sent: number of the last token that was sent to it and is not known to be lost.
      last_serial: serial number of the datagram with that token; a status that has seen it and lacks tokens proves them
        lost.
      owed: probe it at once.
      since: when a token was last sent to it, or it last sent news.
      patience_s: how long after `since` it is probed.
      answers: it has sent a message since it was last probed.
      silent: it was probed again because it had not answered.
      unanswered: number of consecutive probes without an answer.
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
        """Start over with a new incarnation: tokens that the previous one had accepted and not processed are gone."""
        self.incarnation = incarnation
        self.fall_out()

    def fall_out(self) -> None:
        """Stop sending tokens to it until it knows the producer's position."""
        self.in_step = False
        # Back to `done`: what was accepted and not processed died with it, so these tokens must be sent again.
        self.accepted = self.limit = self.sent = self.done
        self.last_serial = 0

    def step_in(self, accepted: int) -> None:
        """Start sending tokens: it knows the producer's position and has accepted tokens up to `accepted`."""
        self.in_step = True
        self.accepted = self.sent = accepted

    def move_to(self, done: int) -> None:
        """Continue with other numbers."""
        self.give_up(done)
        self.owe()

    def give_up(self, done: int) -> None:
        """Mark everything up to `done` as no longer wanted; no need to report it."""
        self.done = done
        self.fall_out()
        self.owed = False

    def learn(self, status: Status) -> bool:
        """Process a status: what it has, what it has processed and what it lacks. Return whether this is news."""
        news = status.accepted > self.accepted or status.done > self.done or status.limit > self.limit
        # Statuses may overtake each other, so every number only grows; an old status changes nothing.
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
        """Probe it at once."""
        self.owed = True

    def heard(self) -> None:
        """It has sent a message, whatever the contents. The first message after a silence also resets the patience."""
        self.answers = True
        self.unanswered = 0
        if self.silent:
            self.silent = False
            self.ask_soon()

    def ask_soon(self) -> None:
        """Something new was heard of it: the next silence is not taken for a long one."""
        self.patience_s = self._shortest_s

    def carry(self, last: int, serial: int, now: float) -> None:
        """It was sent all tokens up to `last`, the last one with datagram `serial`."""
        self.sent = max(self.sent, last)
        self.last_serial = serial
        self.since = now

    def probed(self, now: float, slowest_s: float) -> None:
        """It was probed. If it was silent, the next probe comes later."""
        if not self.owed:
            self.silent = not self.answers
            self.unanswered += not self.answers
            # Doubling keeps probes to a dead consumer rare; the upper bound keeps the detection of its return fast.
            self.patience_s = min(2 * self.patience_s, slowest_s)
        self.owed = self.answers = False
        self.since = now
