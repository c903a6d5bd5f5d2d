"""Parts on one loop that can be killed, over a network that loses, repeats and delays datagrams."""

from __future__ import annotations

from typing import Any

import pytest

from hfg.parts.processes import launching
from hfg.parts.processes.launching import LoopLauncher
from hfg_transports.memory import Faults, Network

__all__ = ["mortal_parts"]


def mortal_parts(monkeypatch: pytest.MonkeyPatch, seed: int = 3) -> dict[str, Any]:
    """The parts of the next run, by name: `parts["far"].kill()`."""
    parts: dict[str, Any] = {}

    class Made(LoopLauncher):
        def __init__(self) -> None:
            super().__init__(network=Network(Faults(loss=0.2, repetition=0.1, delay_s=(0.001, 0.003)), seed=seed))

        async def launch(self, run: str, part: str, host: str, incarnations: tuple[int, int]) -> Any:
            parts[part] = await super().launch(run, part, host, incarnations)
            return parts[part]

    monkeypatch.setattr(launching, "LoopLauncher", Made)
    return parts
