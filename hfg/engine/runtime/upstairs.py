"""Ties the deciding modules together: what those below ask of those above. Stands on all, decides nothing."""

from __future__ import annotations

from hfg.engine.fusion.specialise import specialise
from hfg.engine.rules import activity, agenda, concurrency, errors, iterating, quiet, sending, wiring
from hfg.engine.runtime import ports

__all__ = ["Deciders"]


class Deciders:
    """See `core.Upstairs`."""

    idle_again = staticmethod(agenda.idle_again)
    fail = staticmethod(errors.fail)
    fail_call = staticmethod(errors.fail_call)
    operator_failed = staticmethod(errors.operator_failed)
    begin_beside = staticmethod(concurrency.begin)
    land = staticmethod(concurrency.land)
    send_end = staticmethod(sending.send_end)
    node_ended = staticmethod(quiet.node_ended)
    activity_changed = staticmethod(activity.changed)
    scopes_changed = staticmethod(activity.scopes_changed)
    deactivate_inside = staticmethod(activity.deactivate_inside)
    rewire = staticmethod(wiring.rewire)
    choose_step = staticmethod(specialise)
    bind_ports = staticmethod(ports.bind)
    iterate = staticmethod(iterating.begin)
