"""A set of definitions, and how records of them are encoded. Depends on definitions, services and files."""

from __future__ import annotations

import os
from typing import Any

from hfg.errors import UsageError
from hfg.ros import definitions as of
from hfg.ros import files, services
from hfg.ros.definitions import RECORDS, Fields, Record
from hfg.ros.fitting import Fit, fit_of


class Types:
    """A set of definitions.

    Attributes:
      known: the fields of all types, by name.
      store: what encodes and decodes records.
      made: types that were asked for, by name.
    """

    def __init__(self, known: dict[str, Fields] | None = None, around: Types | None = None) -> None:
        """Start with the definitions of ROS 2, or with others.

        Args:
          known: definitions; None: those of ROS 2.
          around: the types that are the same there are taken from there.
        """
        self.store: Any = of.store()
        self._around = around
        self._records: dict[str, type[Record]] = {}
        self._fits: dict[str, Fit] = {}
        self.made: dict[str, Any] = {}
        self.known = dict(of.standard() if known is None else known)
        if known is None:
            for name, text in services.STANDARD.items():
                self.known |= services.of_text(name, text)
        self._standard = {} if around is not None else dict(self.known)

    def is_standard(self, name: str) -> bool:
        """Return whether a type and what is in it are defined as in ROS 2."""
        standard = self._standard if self._around is None else self._around._standard
        return all(self.known[one] == standard.get(one) for one in of.inside(name, self.known))

    def complete(self, name: str) -> None:
        """Find a type and what is in it, in the folders of HFG_ROS_PATH if needed.

        Raises:
          UsageError: it is not there, or cannot be read.
        """
        known = dict(self.known)
        self._complete(name, known)
        self.known = known

    def record(self, name: str) -> type[Record]:
        """Return the class of a type's records.

        Raises:
          UsageError: the type is unknown, or cannot be decoded here.
        """
        if name not in self._records:
            for one in of.inside(name, self.known):
                if one not in self._records:
                    self._make(one)
        return self._records[name]

    def _make(self, name: str) -> None:
        fields = self.known[name]
        of.need_supported(name, fields)
        shared = self._around is not None and self._around.known.get(name) == fields
        inner = all(
            self._records[one] is (self._around or self)._records.get(one)
            for _, about in fields
            for one in of.named(about)
        )
        if shared and inner and self._around is not None:
            record = self._around.record(name)
        else:
            record = of.record_of(name, fields, self._records, RECORDS)
        self._records[name] = record
        self._fits[name] = fit_of(name, fields, record, self._fits)
        of.put(self.store, name, fields, record)

    def fit(self, name: str) -> Fit:
        """Return the check of a type's records before they are encoded."""
        self.record(name)
        return self._fits[name]

    def register(self, what: str | os.PathLike[str], name: str = "") -> list[str]:
        """Read definitions; see `hfg.ros.messages.register`."""
        found = files.texts(what, name)
        made: dict[str, Fields] = {}
        for one, text in found.items():
            made |= services.of_text(one, text)
        for one, fields in made.items():
            if self.known.get(one, fields) != fields:
                raise UsageError(f"{one} is known already, and is defined differently")
        known = self.known | made
        for one in made:
            self._complete(one, known)
        self.known = known
        return sorted(found)

    def _complete(self, name: str, known: dict[str, Fields]) -> None:
        """Add to definitions the types in a type that are in the folders of HFG_ROS_PATH."""
        todo = [name]
        while todo:
            one = todo.pop()
            if one not in known:
                known |= services.of_text(one, files.on_path(one))
            todo += [inner for _, about in known[one] for inner in of.named(about) if inner not in known]
        of.inside(name, known)
