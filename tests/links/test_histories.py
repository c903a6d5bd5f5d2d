"""Whatever a channel and the deaths of programs do to an exact link, each token is recorded once and in order.

Nothing here waits: worlds are made of the state machines alone.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict

import pytest
from hypothesis import HealthCheck, settings, strategies
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule, run_state_machine_as_test

from tests.links.world import Settings, World, join_or_leave, live, revive

pytestmark = pytest.mark.slow

WHICH = strategies.integers(0, 10_000)


class Links(RuleBasedStateMachine):
    """Small steps of programs and of the channel between them; at the end everybody is kind, and all must have come."""

    world: World

    @initialize(
        consumers=strategies.integers(1, 3),
        window=strategies.sampled_from([1, 2, 5]),
        eager=strategies.booleans(),
        outbox=strategies.booleans(),
        ledgers=strategies.booleans(),
        relay=strategies.booleans(),
    )
    def begin(self, consumers: int, window: int, eager: bool, outbox: bool, ledgers: bool, relay: bool) -> None:
        release = "accepted" if eager and not relay else "done"
        self.world = World(
            Settings(consumers, window, window, release=release, outbox=outbox, ledgers=ledgers, relay=relay)  # type: ignore[arg-type]
        )

    @rule(which=WHICH)
    def a_program_goes_on(self, which: int) -> None:
        programs = self.world.programs()
        if programs:
            programs[which % len(programs)].step(which // 7 % 4)

    @rule()
    def the_oldest_datagram_arrives(self) -> None:
        self.world.deliver(0)

    @rule(which=WHICH)
    def a_datagram_overtakes_others(self, which: int) -> None:
        self.world.deliver(which)

    @rule(which=WHICH)
    def a_datagram_is_lost(self, which: int) -> None:
        self.world.lose(which)

    @rule(which=WHICH)
    def a_datagram_is_repeated(self, which: int) -> None:
        self.world.repeat(which)

    @rule()
    def the_connection_is_cut_or_comes_back(self) -> None:
        self.world.cut = not self.world.cut

    @rule(seconds=strategies.sampled_from([0.01, 0.1, 1.0]))
    def time_passes(self, seconds: float) -> None:
        self.world.now += seconds

    @rule(which=WHICH)
    def a_program_dies(self, which: int) -> None:
        programs = self.world.programs()
        if programs:
            self.world.kill(programs[which % len(programs)])

    @rule(which=WHICH)
    def a_program_begins_a_new_life(self, which: int) -> None:
        revive(self.world, which)

    @rule(which=WHICH)
    def a_consumer_joins_or_leaves(self, which: int) -> None:
        join_or_leave(self.world, which)

    @rule()
    def all_goes_well_for_a_while(self) -> None:
        self.world.work()

    @invariant()
    def each_end_is_sound_and_the_window_holds(self) -> None:
        if hasattr(self, "world"):
            self.world.check()

    def teardown(self) -> None:
        if hasattr(self, "world"):
            self.world.be_kind()
            self.world.check_rest()


@pytest.mark.rule("L1", "L2", "L3")
def test_exactly_once_in_order_and_never_stuck() -> None:
    run_state_machine_as_test(
        Links,
        settings=settings(
            max_examples=30, stateful_step_count=50, deadline=None, suppress_health_check=list(HealthCheck)
        ),
    )


@pytest.mark.rule("L1", "L2", "L3")
@pytest.mark.parametrize("block", range(10))
def test_a_thousand_random_histories(block: int) -> None:
    total: Counter[str] = Counter()
    for seed in range(100 * block, 100 * block + 100):
        world = live(seed)
        total.update(asdict(world.counted))
        total["recorded"] += sum(len(ledger.entries) for ledger in world.ledgers.values())
    few = {name: count for name, count in total.items() if count < 10}
    assert not few, f"these histories are too tame: {few}"


@pytest.mark.soak
@pytest.mark.timeout(900)
@pytest.mark.parametrize("block", range(50))
def test_fifty_thousand_histories(block: int) -> None:
    print(f"seeds from {1_000_000 + 1000 * block}")
    for seed in range(1_000_000 + 1000 * block, 1_000_000 + 1000 * block + 1000):
        live(seed, 400)
