"""Nodes at both ends of what the tests send by ROS 2."""

from __future__ import annotations

from typing import Any

import hfg


class Say(hfg.Node):
    out = hfg.Event(Any)

    @hfg.slot
    def say(self, value: Any) -> None:
        self.out.trigger(value)


class Keep(hfg.Node):
    value = hfg.Input(Any)
    kept = hfg.State(factory=list[Any])

    def process(self, value: Any) -> None:
        self.kept.append(value)
