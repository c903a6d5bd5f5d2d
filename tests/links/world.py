"""A world without a network in which links live and die: programs, a channel that does what it likes, ledgers.

One action is one small step of one program or of the channel, so that a death can fall between any two of them. The
world checks at each ledger that tokens are there exactly once and in order, and keeps books on what must come.
"""

from __future__ import annotations

import random
from collections import deque
from dataclasses import dataclass, field
from typing import Literal

from hfg.links import ExactConsumer, ExactProducer, Outbox, Outgoing
from hfg.transport import Buffer, Delivery, EncodedToken, Position


@dataclass
class Settings:
    """What kind of link, and between whom."""

    consumers: int = 1
    window: int = 4
    capacity: int = 4
    depth: int = 0
    release: Literal["done", "accepted"] = "done"
    outbox: bool = False
    ledgers: bool = True
    relay: bool = False  # the producer feeds a program without a ledger, and that one the consumers
    batch: int = 60_000


class Ledger:
    """What a consumer records: an effect and its position at once, by its newest life only."""

    def __init__(self) -> None:
        self.incarnation = 0
        self.entries: list[Position] = []
        self.starts: dict[int, int] = {}  # where this consumer joined, by stream: it gets nothing up to there
        self.repeats = False  # without memory between lives
        self.is_late = False  # it has joined a relay

    def write(self, incarnation: int, token: Delivery) -> bool:
        """Record a token; an old life is refused, as by a lock."""
        if incarnation != self.incarnation:
            return False
        position = token.position
        assert bytes(token.value) == text(position), f"{position} carries the value of another"
        if self.entries:
            last = self.entries[-1]
            follows = position == (last.stream, last.sequence + 1)
            is_first = self.repeats or position.sequence == 1 + self.starts.get(position.stream, 0)
            begins = position.stream > last.stream and is_first
            furthest = max(self.entries)
            again = self.repeats and position <= (furthest.stream, furthest.sequence + 1)
            assert follows or begins or again, f"after {last} came {position} (L2)"
        else:
            start = self.starts.get(position.stream, 0)
            assert position.sequence == start + 1 or self.repeats, f"after {start} came {position} (L2)"
        self.entries.append(position)
        return True


def text(position: Position) -> bytes:
    return b"%d.%d" % (position.stream, position.sequence)


class Sink:
    """A life of a consumer with effects."""

    def __init__(self, world: World, name: str, incarnation: int) -> None:
        self.world = world
        self.name = name
        self.incarnation = incarnation
        self.ledger = world.ledgers[name]
        self.ledger.incarnation = incarnation
        known = self.ledger.entries[-1] if self.ledger.entries and world.settings.ledgers else None
        self.end = ExactConsumer(name, incarnation, capacity=world.settings.capacity, ledger=known)
        self.taken: deque[Delivery] = deque()
        self.recorded = 0

    def receive(self, header: Buffer, payload: Buffer) -> None:
        self.end.receive(header, payload)

    def step(self, what: int) -> bool:
        """Take, record, say that it is done, or speak; whether there was anything to do."""
        if what == 0:
            token = self.end.take()
            if token is not None:
                self.taken.append(token)
            return token is not None
        if what == 1:
            if not self.taken:
                return False
            if self.ledger.write(self.incarnation, self.taken[0]):
                self.taken.popleft()
                self.recorded += 1
            else:
                self.world.kill(self)
            return True
        if what == 2:
            if not self.recorded:
                return False
            self.recorded -= 1
            self.end.done()
            return True
        return self.world.put_up(self, self.end.flush())

    def check(self) -> None:
        self.end.check_invariants()


class Head:
    """A life of the first producer."""

    def __init__(self, world: World, epoch: int) -> None:
        self.world = world
        settings = world.settings
        kept = None
        if settings.outbox and world.outbox is not None:
            kept = Outbox(world.outbox.stream, world.outbox.first, tuple(world.outbox.tokens))
        self.end = ExactProducer(
            epoch,
            window=settings.window,
            depth=settings.depth,
            release=settings.release,
            outbox=kept,
            largest_batch=settings.batch,
        )
        self.epoch = epoch
        for name in world.downstream(self):
            self.end.admit(name, after=0 if kept is None or world.outbox is None else world.outbox.joined.get(name, 0))
        if settings.outbox:
            if world.outbox is None:
                world.outbox = Store(epoch, 1, deque())
            world.outbox.owner = self

    def receive(self, header: Buffer, payload: Buffer) -> None:
        self.end.receive(header, payload)
        self._forget()

    def _forget(self) -> None:
        """What is done by all need not be kept."""
        store = self.world.outbox
        if store is not None and store.owner is self:
            while len(store.tokens) > self.end.unfinished:
                store.tokens.popleft()
                store.first += 1

    def step(self, what: int) -> bool:
        if what < 2:
            return self.send()
        return self.world.put_down(self, self.end.flush(self.world.now))

    def send(self) -> bool:
        if not self.end.free:
            return False
        position = Position(self.end.position.stream, self.end.position.sequence + 1)
        token = (b"", text(position))
        store = self.world.outbox
        if store is not None:
            if store.owner is not self:
                self.world.kill(self)  # another life has the lock
                return True
            store.tokens.append(token)
        assert self.end.send(token) == position.sequence
        self._forget()
        if self is self.world.head:
            self.world.sent[position.stream] = position.sequence
        return True

    def check(self) -> None:
        self.end.check_invariants()


@dataclass
class Store:
    """An outbox on a disk."""

    stream: int
    first: int
    tokens: deque[EncodedToken]
    owner: Head | None = None
    joined: dict[str, int] = field(default_factory=dict)  # who takes part from when on


class Relay:
    """A life of a program that answers each token with one, has no ledger, and hands on the numbers."""

    def __init__(self, world: World, incarnation: int) -> None:
        self.world = world
        settings = world.settings
        self.incarnation = incarnation
        self.end = ExactConsumer("relay", incarnation, capacity=settings.capacity)
        self.out = ExactProducer(incarnation, window=settings.window, inherits=True, largest_batch=settings.batch)
        for name in world.downstream(self):
            self.out.admit(name)
        self.inside: deque[Position] = deque()
        self.next: Delivery | None = None

    def step(self, what: int) -> bool:
        if what == 0:
            return self.pass_on()
        if what == 1:
            done = 0
            while self.inside and self._is_done(self.inside[0]):
                self.inside.popleft()
                done += 1
            self.end.done(done)
            return done > 0
        if what == 2:
            return self.world.put_down(self, self.out.flush(self.world.now))
        return self.world.put_up(self, self.end.flush())

    def _is_done(self, position: Position) -> bool:
        here = self.out.position
        return position.stream < here.stream or position.sequence <= self.out.released

    def pass_on(self) -> bool:
        self.next = self.next or self.end.take()
        if self.next is None or not self.out.takes(self.next.position):
            return False
        self.inside.append(self.next.position)
        self.out.send(self.next.token, self.next.position)
        self.next = None
        return True

    def check(self) -> None:
        self.end.check_invariants()
        self.out.check_invariants()


@dataclass
class Counted:
    """How often something happened, so that a test can see that it did."""

    lost: int = 0
    repeated: int = 0
    reordered: int = 0
    deaths: int = 0
    zombies: int = 0
    frames: int = 0


class World:
    """All programs, the channel between them, and what must come of it."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.now = 0.0
        self.cut = False
        self.flying: list[tuple[Sink | Relay | Head, bool, Buffer, Buffer]] = []
        self.counted = Counted()
        self.sent: dict[int, int] = {}
        self.outbox: Store | None = None
        self.numbers = 0
        self.newest: dict[str, int] = {}
        self.names = [f"sink{index}" for index in range(settings.consumers)]
        self.joined = set(self.names)
        self.ledgers = {name: Ledger() for name in self.names}
        for ledger in self.ledgers.values():
            ledger.repeats = not settings.ledgers
        self.sinks: list[Sink] = []
        self.relays: list[Relay] = []
        self.heads: list[Head] = []
        self.start_head()
        if settings.relay:
            self.start_relay()
        for name in self.names:
            self.start_sink(name)

    # --- lives

    def _number(self, name: str) -> int:
        self.numbers += 1
        self.newest[name] = self.numbers
        return self.numbers

    @property
    def head(self) -> Head | None:
        return self.heads[-1] if self.heads else None

    def start_head(self) -> None:
        self.counted.zombies += len(self.heads)
        self.heads.append(Head(self, self._number("head")))

    def start_relay(self) -> None:
        self.counted.zombies += len(self.relays)
        self.relays.append(Relay(self, self._number("relay")))

    def start_sink(self, name: str) -> None:
        self.counted.zombies += any(one.name == name for one in self.sinks)
        self.sinks.append(Sink(self, name, self._number(name)))

    def kill(self, program: Sink | Relay | Head) -> None:
        self.counted.deaths += 1
        for programs in (self.sinks, self.relays, self.heads):
            if program in programs:
                programs.remove(program)  # type: ignore[arg-type]
        self.flying = [one for one in self.flying if one[0] is not program]

    def downstream(self, program: Head | Relay) -> list[str]:
        if isinstance(program, Head) and self.settings.relay:
            return ["relay"]
        return sorted(self.joined)

    def programs(self) -> list[Sink | Relay | Head]:
        return [*self.heads, *self.relays, *self.sinks]

    def lives(self, name: str) -> list[Sink | Relay | Head]:
        """All that are alive of the program of a name, the newest last."""
        if name == "head":
            return [*self.heads]
        return [*self.relays] if name == "relay" else [one for one in self.sinks if one.name == name]

    def leave(self, name: str) -> None:
        """A consumer takes no part any more, by a change of the graph."""
        self.joined.discard(name)
        for one in self._last_hop():
            one.dismiss(name)

    def join(self, name: str) -> None:
        """A consumer takes part from now on, as a new one."""
        if name in self.joined:
            return
        for sink in [one for one in self.sinks if one.name == name]:
            self.kill(sink)
        self.joined.add(name)
        ledger = self.ledgers[name] = Ledger()
        ledger.repeats = not self.settings.ledgers
        for one in self._last_hop():
            one.admit(name)
        if self.settings.relay:
            ledger.repeats = ledger.is_late = True  # where it begins is between the relay's lives and who feeds it
        elif self.outbox is not None:
            last = self.outbox.first + len(self.outbox.tokens) - 1
            ledger.starts[self.outbox.stream] = self.outbox.joined[name] = last
        else:
            ledger.starts = dict(head.end.position for head in self.heads)
        self.start_sink(name)

    def _last_hop(self) -> list[ExactProducer]:
        return [one.out for one in self.relays] if self.settings.relay else [one.end for one in self.heads]

    # --- the channel

    def put_down(self, program: Head | Relay, out: list[Outgoing]) -> bool:
        """From a producer: to one consumer, or all, in whatever life."""
        for one in out:
            receivers: list[Sink | Relay] = [*self.sinks]
            if isinstance(program, Head) and self.settings.relay:
                receivers = [*self.relays]
            for receiver in receivers:
                name = "relay" if isinstance(receiver, Relay) else receiver.name
                if one.to is None or one.to == name:
                    self._fly(receiver, True, one)
        return bool(out)

    def put_up(self, program: Sink | Relay, out: list[Outgoing]) -> bool:
        """From a consumer: to the producer, in whatever life."""
        for one in out:
            receivers: list[Relay | Head] = [*self.heads]
            if isinstance(program, Sink) and self.settings.relay:
                receivers = [*self.relays]
            for receiver in receivers:
                self._fly(receiver, False, one)
        return bool(out)

    def _fly(self, receiver: Sink | Relay | Head, down: bool, one: Outgoing) -> None:
        self.counted.frames += 1
        if not self.cut:
            self.flying.append((receiver, down, one.header, one.payload))

    def deliver(self, index: int) -> bool:
        """Let one datagram arrive; any but the first has overtaken others."""
        if not self.flying:
            return False
        index %= len(self.flying)
        self.counted.reordered += index > 0
        receiver, down, header, payload = self.flying.pop(index)
        if isinstance(receiver, Relay):
            (receiver.end if down else receiver.out).receive(header, payload)
        else:
            receiver.receive(header, payload)
        return True

    def lose(self, index: int) -> None:
        if self.flying:
            self.counted.lost += 1
            del self.flying[index % len(self.flying)]

    def repeat(self, index: int) -> None:
        if self.flying:
            self.counted.repeated += 1
            self.flying.append(self.flying[index % len(self.flying)])

    # --- what must hold

    def check(self) -> None:
        for program in self.programs():
            program.check()
        settings = self.settings
        if (
            self.head is not None
            and settings.release == "done"
            and not settings.relay
            and self.sent
            and settings.ledgers
        ):
            stream = self.head.end.position.stream
            for name in self.joined:
                done = [one.sequence for one in self.ledgers[name].entries if one.stream == stream]
                base = self.ledgers[name].starts.get(stream, 0)
                ahead = self.sent.get(stream, 0) - (done[-1] if done else base)
                assert ahead <= settings.window, f"{ahead} tokens are ahead of {name} (L1)"

    def be_kind(self) -> None:
        """Everybody lives and the channel does its work: now all must come, in bounded time."""
        self.cut = False
        if not any(one.epoch == self.newest["head"] for one in self.heads):
            self.start_head()
        if self.settings.relay and not any(one.incarnation == self.newest["relay"] for one in self.relays):
            self.start_relay()
        for name in sorted(self.joined):
            if not any(one.incarnation == self.newest[name] for one in self.sinks):
                self.start_sink(name)
        for _ in range(60):
            self.work()  # first: what has yet to arrive may be of a former life
            if self.is_all_done():
                break
            self.now += 0.1
        assert self.is_all_done(), "tokens are left though nobody is in their way (L2, L3)"
        self.check()
        for name in self.joined:
            self._check_complete(self.ledgers[name])

    def work(self) -> None:
        """Let everybody do what there is to do, in order, until nothing is left; that must come soon."""
        for _ in range(10_000):
            busy = False
            while self.deliver(0):
                busy = True
            for program in self.programs():
                parts = (1, 2, 3) if isinstance(program, Head) else (0, 1, 2, 3)
                for what in parts:
                    if isinstance(program, Head) and what == 1:
                        continue
                    busy = program.step(what) or busy
            if not busy:
                return
        raise AssertionError("the link spins (L3)")

    def is_all_done(self) -> bool:
        """Whether the newest producers have nothing left, and consumers have passed on what came of older ones."""
        head = self.head
        producers = [one.end for one in self.heads[-1:]] + [one.out for one in self.relays[-1:]]
        consumers = [one.end for one in self.sinks] + [one.end for one in self.relays[-1:]]
        left = sum(one.unfinished for one in producers) + sum(one.unfinished for one in consumers)
        return head is not None and left == 0

    def _check_complete(self, ledger: Ledger) -> None:
        head = self.head
        assert head is not None
        stream, last = head.end.position
        got = {one.sequence for one in ledger.entries if one.stream == stream}
        base = ledger.starts.get(stream, 0)
        if not ledger.repeats:
            assert got == set(range(base + 1, last + 1)), f"of {last} tokens of stream {stream} came {sorted(got)}"
        elif last > base and ledger.entries and not ledger.is_late:
            assert last in got

    def check_rest(self) -> None:
        """When all is done and former lives are dead, nobody has anything to say, now or later."""
        newest = {one.name: one for one in self.sinks}
        old: list[Sink | Relay | Head] = [one for one in self.sinks if newest[one.name] is not one]
        for program in [*self.heads[:-1], *self.relays[:-1], *old]:
            self.kill(program)
        self.work()
        before = self.counted.frames
        for _ in range(20):
            self.now += 10.0
            self.work()
        assert self.counted.frames == before, "frames are sent though nothing happens (L3)"
        heads = [one.end for one in self.heads[-1:]] + [one.out for one in self.relays[-1:]]
        assert [one.due for one in heads] == [None] * len(heads)


ACTIONS = 100


def act(world: World, action: int, which: int) -> None:
    """Do one thing, chosen by two numbers, so that a history is a list of them."""
    programs = world.programs()
    if action < 25:
        world.deliver(0)
    elif action < 35:
        for _ in range(len(world.flying)):
            world.deliver(0)
    elif action < 39:
        world.deliver(which)
    elif action < 42:
        world.lose(which)
    elif action < 45:
        world.repeat(which)
    elif action < 46 or (world.cut and action < 54):
        world.cut = not world.cut
    elif action < 54:
        world.now += (0.01, 0.1, 1.0)[which % 3]
    elif action < 55 and programs:
        world.kill(programs[which % len(programs)])
    elif action < 61:
        revive(world, which, only_dead=action > 55)
    elif action < 62 and world.settings.consumers > 1:
        join_or_leave(world, which)
    elif action < 80 and programs:
        programs[which % len(programs)].step(which // 7 % 4)
    elif programs:
        program = programs[which % len(programs)]
        for _ in range(1 + which // 7 % 3):
            for what in range(4):
                program.step(what)


def join_or_leave(world: World, which: int) -> None:
    """By a change of the graph; one consumer stays."""
    name = world.names[which % len(world.names)]
    if name not in world.joined:
        world.join(name)
    elif len(world.joined) > 1:
        world.leave(name)


def revive(world: World, which: int, *, only_dead: bool = False) -> None:
    """Start a new life of somebody, whether the old one is dead or not; if it is not, that one is a zombie from now on.

    Of three lives of one program the oldest dies, else most of the world were zombies.
    """
    names = [*world.names, "head", "relay"]
    name = names[which % len(names)]
    if only_dead and world.lives(name):
        return
    if name == "head":
        world.start_head()
    elif name == "relay":
        if world.settings.relay:
            world.start_relay()
    elif name in world.joined:
        world.start_sink(name)
    for program in world.lives(name)[:-2]:
        world.kill(program)


def random_settings(chance: random.Random) -> Settings:
    relay = chance.random() < 0.3
    release: Literal["done", "accepted"] = "done" if relay else chance.choice(["done", "accepted"])
    window = chance.choice([1, 2, 4, 9])
    depth = chance.choice([0, 3]) if release == "accepted" else 0
    return Settings(
        consumers=chance.choice([1, 1, 2, 3]),
        window=window,
        capacity=max(1, window + depth - chance.choice([0, 0, 0, 1])),
        depth=depth,
        release=release,
        outbox=chance.random() < 0.4,
        ledgers=chance.random() < 0.8,
        relay=relay,
        batch=chance.choice([60_000, 30]),
    )


def live(seed: int, steps: int = 800) -> World:
    """Make a world and let it live by chance; then be kind to it."""
    chance = random.Random(seed)
    world = World(random_settings(chance))
    if chance.random() < 0.7:
        world.work()
    for _ in range(chance.randrange(steps)):
        act(world, chance.randrange(ACTIONS), chance.randrange(10_000))
        world.check()
    world.be_kind()
    world.check_rest()
    return world
