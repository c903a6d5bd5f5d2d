"""The token game says of random small graphs what the reference machine does in every state that it can reach."""

from __future__ import annotations

from collections import Counter

import pytest

from hfg.analysis.game import Game
from hfg.analysis.playing import Play
from hfg.analysis.searching import pairs_together, search
from hfg.graph.flat import flatten
from tests.analysis.exhaustive import Drawn, Explored, draw

MOST_STATES = 600


def compare(drawn: Drawn) -> str:
    """Compare one graph; return how far."""
    explored = Explored(drawn.graph)
    game = Game(flatten(drawn.graph))
    play = Play(game, game.nodes)
    found = search(play, MOST_STATES)
    states = explored.states()
    places = dict(zip([edge.label for edge in game.edges], game.places.one, strict=True))
    places |= {game.flat.path(index): 1 << bit for index, bit in game.places.node.items()}
    pairs = pairs_together(play)
    for active, lying in states:
        marked = [places[path] for path in active if path in places] + [places[label] for label, _ in lying]
        for one in marked:
            assert one in pairs, (drawn.graph.name, active, lying)
            assert all(pairs[one] & other for other in marked if other != one), (drawn.graph.name, active, lying)
    if not found.is_complete:
        return "large"
    reached = {(frozenset(game.places.active_in(state)), frozenset(_lying(game, state))) for state in found.reached}
    assert states <= reached, (drawn.graph.name, sorted(map(str, states - reached))[:3])
    several = any(state & two for state in found.reached for two in game.places.two)
    if not explored.is_complete or several or not drawn.is_plain:
        return "contained"
    assert {active for active, _ in states} == {active for active, _ in reached}, drawn.graph.name
    counts = {len(active) + sum(count for _, count in lying) for active, lying in states}
    assert counts == {(state & play.mask).bit_count() for state in found.reached}, drawn.graph.name
    return "equal"


def _lying(game: Game, state: int) -> list[tuple[str, int]]:
    bits = game.places
    return [
        (edge.label, 2 if state & bits.two[number] else 1)
        for number, edge in enumerate(game.edges)
        if state & bits.one[number]
    ]


def test_every_state_of_random_graphs_is_in_the_game_and_plain_graphs_have_no_other() -> None:
    seen = Counter(compare(draw(seed)) for seed in range(150))
    assert seen["equal"] > 30, seen
    assert seen["contained"] > 30, seen


@pytest.mark.soak
@pytest.mark.timeout(1800)
def test_every_state_of_5000_random_graphs_is_in_the_game() -> None:
    seen = Counter(compare(draw(seed)) for seed in range(1_000, 6_000))
    assert seen["equal"] > 1_000, seen
