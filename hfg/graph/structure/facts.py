"""Facts that users state about activity: at most one, or exactly one, of some nodes is active. Depends on nodes.

The code that keeps a fact may be beyond any analysis. So the analysis of activity takes facts for granted, and debug
runs check them.
"""

from __future__ import annotations

from collections import Counter
from typing import Final, Literal, TypeAlias, get_args

import msgspec

from hfg.errors import GraphError
from hfg.graph.structure.level import Level
from hfg.graph.structure.naming import path_of
from hfg.graph.structure.paths import meant, node_at
from hfg.graph.structure.refusals import Refusable
from hfg.nodetypes.node import Node

Claim: TypeAlias = Literal["at most one", "exactly one"]
MOST_FACTS: Final = 1_000
"""Each new fact is compared with all others, and a file may hold many (rule L4)."""

CLAIMS: Final[tuple[Claim, ...]] = get_args(Claim)


class Fact(msgspec.Struct, frozen=True, eq=False):
    """How many of some nodes are active at any moment.

    Attributes:
      claim: "at most one" or "exactly one".
      nodes: the nodes or subgraphs; a subgraph stands for all nodes inside.
    """

    claim: Claim
    nodes: tuple[Node, ...]

    def __str__(self) -> str:
        paths = ", ".join(f'"{path_of(node)}"' for node in self.nodes)
        return f"{self.claim} of {paths} is active"

    def says(self, other: Fact) -> bool:
        """Return whether another fact says the same."""
        return self.claim == other.claim and set(self.nodes) == set(other.nodes)


def facts_of(level: Level) -> list[Fact]:
    """Return the facts stated about nodes of a level and all inside it; those of removed nodes are not among them."""
    facts: list[Fact] = level.whole.facts
    if level.owner is not None:
        prefix = f"{level.path}/"
        return [
            fact for fact in facts if all(level.holds(one) and path_of(one).startswith(prefix) for one in fact.nodes)
        ]
    return [fact for fact in facts if all(level.holds(node) for node in fact.nodes)]


def state_fact(level: Level, claim: Claim, nodes: tuple[Node | str, ...]) -> Fact:
    """State a fact about nodes, or their paths. To state one twice is to state it once.

    Raises:
      GraphError: it names fewer than two nodes, or one that is not in the graph; nothing was changed.
    """
    level.need_rest("stating a fact")
    fact = Fact(claim, nodes)  # type: ignore[arg-type]  # what else it names, is refused
    with Refusable(level.title):
        fact = Fact(claim, tuple(meant(level, node, node_at) for node in nodes))
        refuse_fact(level, fact)
        known = next((one for one in facts_of(level) if one.says(fact)), None)
        if known is not None:
            return known
        level.whole.facts.append(fact)
    return fact


def refuse_fact(level: Level, fact: Fact) -> None:
    """Raise if the fact cannot be; changes nothing.

    Raises:
      GraphError: it names fewer than two nodes, one of them twice, or one that is not in the graph.
    """
    method = f"graph.{fact.claim.replace(' ', '_')}"
    if fact.claim not in CLAIMS:
        raise GraphError(f'a fact says "at most one" or "exactly one", got {fact.claim!r:.80}')
    for node in fact.nodes:
        if not isinstance(node, Node):
            raise GraphError(f"{method} takes nodes or their paths, got {node!r:.80}")
        if not level.holds(node):
            raise GraphError(f'{method} names "{path_of(node)}", which is not in {level.title}; add it first')
    if len(fact.nodes) < 2 and not any(node._type.is_subgraph for node in fact.nodes):
        raise GraphError(
            f"{method} needs two nodes or more, or a subgraph, got {len(fact.nodes)}: name all that take turns"
        )
    twice = next((node for node, count in Counter(fact.nodes).items() if count > 1), None)
    if twice is not None:
        raise GraphError(f'{method} names "{path_of(twice)}" twice; name it once')
    if len(level.whole.facts) >= MOST_FACTS:
        raise GraphError(
            f"{level.whole.root.title} states {MOST_FACTS:,} facts already, as many as are allowed: name a subgraph in "
            "place of the nodes inside"
        )


def swap_in_facts(facts: list[Fact], old: Node, new: Node) -> None:
    """Let the facts about a node be about the one that takes its place."""
    for number, fact in enumerate(facts):
        if old in fact.nodes:
            facts[number] = Fact(fact.claim, tuple(new if one is old else one for one in fact.nodes))
