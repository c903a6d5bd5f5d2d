"""The rules of activity as functions over values (rules A3-A6): the effect of received tokens, and of sending.

Nothing here depends on nodes, edges or time.
"""

from __future__ import annotations

from collections.abc import Iterable

__all__ = ["after_receipt", "asked_for", "leaving"]


def after_receipt(active: bool, modifiers: Iterable[int]) -> bool:
    """Return A(v) after the tokens of one firing, or one slot's token, were taken (A6).

    All -1 act first, then all +1, so that the result does not depend on the order of the inputs.
    """
    for modifier in modifiers:
        if modifier > 0:
            return True
        if modifier < 0:
            active = False
    return active


def asked_for(given: int | None, passed_on: int) -> int | None:
    """Return the modifier that a node's code asks for when it sends a token object, or None (A4).

    A received 0 says nothing: whoever passes the token on sends its value, and A3 decides.

    Args:
      given: `activity=` of the sending; an explicit 0 holds the activity back.
      passed_on: the token's own modifier.
    """
    return (passed_on or None) if given is None else given


def leaving(may_carry: bool, edge_active: bool, explicit: int | None, is_no_message: bool) -> int:
    """Return the modifier a token has on one edge (A3, A4, T1, T3).

    Args:
      may_carry: A(v) = 1, or the right of A3.
      edge_active: A(e).
      explicit: the modifier the node's code asked for, or None.
      is_no_message: NO_MESSAGE never carries anything.
    """
    if is_no_message or not edge_active:
        return 0
    if explicit is not None:
        return explicit
    return 1 if may_carry else 0
