"""Connects a part of a run with the links of all its edges to and from others.

Depends on `ends`.
"""

from __future__ import annotations

from collections.abc import Callable

from hfg.base.logs import Log
from hfg.graph.flat import CutEdge
from hfg.parts.model.messages import GoesOn, Hears, Joins, Message, OfAnEdge, Sees, Shares, Speaks, Untrue
from hfg.parts.running.channels import called
from hfg.parts.running.ends import IncomingEnd, OutgoingEnd, World
from hfg.parts.running.part import Part
from hfg.transport import Session

_LOGGER = Log("hfg.parts")


class PartLinks:
    """Carries the tokens of a part over its edges to and from others."""

    def __init__(
        self,
        part: Part,
        session: Session,
        near: Session,
        run: str,
        incarnations: dict[str, int],
        edges: list[CutEdge],
        say: Callable[[str, Message], None],
        remembered: frozenset[str] = frozenset(),
        *,
        shares_memory: bool = False,
        admits: bool = True,
    ) -> None:
        """Connect the part.

        Args:
          part: the part, not started yet.
          session: the session that reaches all parts.
          near: the session that reaches parts on the same host.
          run: the name by which all parts know the run.
          incarnations: the incarnations of all parts.
          edges: the edges between it and others.
          say: sends a message to another part.
          remembered: labels of the edges whose producer remembers the tokens of its previous incarnations.
          shares_memory: large arrays between parts of one host may go through shared memory.
          admits: parts of younger incarnations are there, and receive messages.
        """
        self._part = part
        self._links: dict[str, OutgoingEnd | IncomingEnd] = {}
        outgoing: dict[str, OutgoingEnd] = {}
        incoming: dict[str, IncomingEnd] = {}
        world = World(part, session, near, run, incarnations, say)
        for edge in edges:
            if edge.source == part.name:
                self._links[edge.label] = outgoing[edge.label] = OutgoingEnd(world, edge)
            else:
                self._links[edge.label] = incoming[edge.label] = IncomingEnd(world, edge, edge.label in remembered)
        for edge in (edge for edge in edges if shares_memory and edge.within_host):
            must_hold_arrays = part.keeper is not None and edge.source == part.name  # for they are kept with it
            if edge.guarantee == "exact" and not must_hold_arrays:
                self._links[edge.label].share(world)
        self._outgoing, self._incoming = outgoing, incoming
        part.connect(outgoing, incoming)
        if part.keeper is not None:
            part.keeper.stand_at(part.inlets, part.outlets, outgoing)
        for other, incarnation in incarnations.items() if admits else ():
            if incarnation > incarnations[part.name]:
                self.admit(other, incarnation)

    def admit(self, other: str, incarnation: int) -> None:
        """Another part has died and is restarted as this incarnation."""
        _LOGGER.info(
            "%s: %s is back as incarnation %d: its edges resume", called(self._part.name), called(other), incarnation
        )
        for link in self._links.values():
            if link.other == other:
                link.admit(incarnation)

    def hear(self, other: str, message: OfAnEdge) -> None:
        """Process a part's message about an edge.

        Raises:
          Untrue: it has no such edge to this part, or the message cannot be true.
        """
        label = message.label
        link = self._links.get(label)
        says_producer = isinstance(message, Speaks | Shares | GoesOn)
        says_consumer = isinstance(message, Hears | Sees)
        if (
            link is None
            or link.other != other
            or (says_producer and label not in self._incoming)
            or (says_consumer and label not in self._outgoing)
        ):
            raise Untrue(f'of an edge "{label:.200}", which does not lead so from it to {called(self._part.name)}')
        match message:
            case Speaks():
                self._part.speak(label, message.speaking, message.total)
            case Hears():
                self._part.hear(label, message.hearing, message.total)
            case Joins():
                link.join(message)
            case GoesOn():
                self._incoming[label].goes_on(message.number)
            case Shares():
                self._incoming[label].borrow(message)
            case Sees():
                self._outgoing[label].seen(message)

    async def close(self) -> None:
        """End all links."""
        for link in self._links.values():
            await link.close()
