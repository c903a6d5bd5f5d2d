"""Connects decisions with the modules above them: `core.RuleCallbacks` filled in."""

from __future__ import annotations

from hfg.engine.fusion.specialise import specialise
from hfg.engine.rules import activity, agenda, concurrency, errors, iterating, quiescence, sending, wiring
from hfg.engine.runtime import ports

__all__ = ["RuleFunctions"]


class RuleFunctions:
    """See `core.RuleCallbacks`."""

    idle_again = staticmethod(agenda.idle_again)
    fail = staticmethod(errors.fail)
    fail_call = staticmethod(errors.fail_call)
    operator_failed = staticmethod(errors.operator_failed)
    begin_concurrent = staticmethod(concurrency.begin)
    complete_firings = staticmethod(concurrency.complete_firings)
    send_end = staticmethod(sending.send_end)
    node_ended = staticmethod(quiescence.node_ended)
    activity_changed = staticmethod(activity.changed)
    scopes_changed = staticmethod(activity.scopes_changed)
    deactivate_inside = staticmethod(activity.deactivate_inside)
    rewire = staticmethod(wiring.rewire)
    specialise = staticmethod(specialise)
    bind_ports = staticmethod(ports.bind)
    iterate = staticmethod(iterating.begin)
