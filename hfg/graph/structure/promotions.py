"""Promotion: a parameter of a subgraph that stands for parameters inside (rule G3). Depends on ports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hfg.ports import ParameterPort


class Promotions:
    """The inner parameters that the parameters of one subgraph stand for.

    Attributes:
      by_name: of the subgraph's parameter, the parameters inside, in order of promoting.
    """

    __slots__ = ("by_name",)

    def __init__(self) -> None:
        self.by_name: dict[str, list[ParameterPort[Any]]] = {}

    def of(self, name: str) -> Sequence[ParameterPort[Any]]:
        """Return the parameters inside that one of the subgraph stands for."""
        return self.by_name.get(name, ())

    def has(self, inner: ParameterPort[Any]) -> bool:
        """Return whether a parameter inside has one that stands for it."""
        return any(port is inner for ports in self.by_name.values() for port in ports)

    def add(self, name: str, inner: ParameterPort[Any]) -> None:
        """Let a parameter of the subgraph stand for one more inside."""
        self.by_name.setdefault(name, []).append(inner)

    def become(self, promoted: Mapping[str, Sequence[ParameterPort[Any]]]) -> None:
        """Let them be others."""
        self.by_name = {name: list(ports) for name, ports in promoted.items()}

    def copied(self) -> dict[str, list[ParameterPort[Any]]]:
        """Return what `become` takes."""
        return {name: list(ports) for name, ports in self.by_name.items()}
