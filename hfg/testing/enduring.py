"""Calls node types with hostile values: `python -m hfg.testing.enduring [MODULE or REFERENCE ...]`.

Each type has a process of its own. A call is known by its number: a call that ends the process, or does not return, is
reported with its arguments, and the calls after it continue in a new process. A node may raise any error here; `usable`
checks errors against the declaration. Depends on `hostile`, `firing` and `separate`.
"""

from __future__ import annotations

import contextlib
import mmap
import struct
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Final

import msgspec
import numpy as np

from hfg.ports.specs import REQUIRED
from hfg.registry import find
from hfg.testing.firing import fire
from hfg.testing.hostile import Hostile
from hfg.testing.samples import sample_folder
from hfg.testing.separate import common_arguments, forked, in_processes, references_of, serve
from hfg.types import describe_value

__all__ = ["Death", "Endured", "endure", "main"]

_STARTING_S: Final = 120.0
_IN_A_ROW: Final = 4
"""Firings of one node before the next is made: state of one call may harm a later one."""


class Death(msgspec.Struct, frozen=True):
    """A call that ended its process, or did not return.

    Attributes:
      call: its number; with the seed and the reference it is made again.
      how: "ended its process by SIGSEGV".
      what: the call, as a user would write it.
    """

    call: int
    how: str
    what: str


class Endured(msgspec.Struct, frozen=True):
    """The result for a type.

    Attributes:
      calls: number of calls.
      refused: number of calls that raised an error.
      deaths: the first deaths.
      seconds: how long it took.
    """

    reference: str
    calls: int = 0
    refused: int = 0
    deaths: tuple[Death, ...] = ()
    seconds: float = 0.0


def endure(
    references: Iterable[str],
    *,
    calls: int = 100,
    seed: int = 0,
    limit_s: float = 20.0,
    most_deaths: int = 5,
    processes: int = 1,
    within_s: float = 3600.0,
    tell: Callable[[Endured], None] | None = None,
) -> list[Endured]:
    """Call node types with hostile values, each in a process of its own. Return the results in their order.

    Args:
      references: "module:name" each.
      calls: calls of each type.
      seed: each seed gives other values.
      limit_s: seconds of CPU time for one call.
      most_deaths: deaths of a type after which it is given up.
      processes: number of types at a time.
      within_s: seconds of CPU time for one type; a slow type is called less often, and the result has the number.
      tell: called with each result as soon as it is there; from several threads if there are several processes.

    Raises:
      RuntimeError: a worker has failed; the message has what it wrote.
    """
    how = _How(calls, seed, limit_s, most_deaths, within_s)
    return in_processes("hfg.testing.enduring", references, how, Endured, processes=processes, tell=tell)


class _How(msgspec.Struct):
    """See `endure`."""

    calls: int
    seed: int
    limit_s: float
    most_deaths: int
    within_s: float


class _Watch:
    """Runs the calls of one type in forked processes, one after another's death."""

    def __init__(self, reference: str, how: _How) -> None:
        self._reference = reference
        self._how = how
        self._shared = mmap.mmap(-1, 16)
        self._deaths: list[Death] = []
        self._spent_s = 0.0

    def watch(self) -> Endured:
        start, how = 0, self._how
        while start < how.calls and self._spent_s < how.within_s and len(self._deaths) < how.most_deaths:
            died = self._forked(start)
            call = max(start, self._shown()[0])
            if not died:
                start = call
                break
            self._deaths.append(Death(call, died, _Calls(self._reference, how.seed).shown(call)))
            start = call + 1
        return Endured(self._reference, start, self._shown()[1], tuple(self._deaths), self._spent_s)

    def _shown(self) -> tuple[int, int]:
        call, refused = struct.unpack("qq", self._shared[:16])
        return call, refused

    def _forked(self, start: int) -> str:
        """Run calls from `start` in a forked process. Return how it died, or ""."""
        began = time.monotonic()
        self._shared[:8] = struct.pack("q", start - 1)  # until the first call is made
        died = forked(
            lambda: self._call(start),
            lambda call: 4 * self._how.limit_s if call >= start else _STARTING_S,
            lambda: self._shown()[0],
        )
        self._spent_s += time.monotonic() - began
        return died

    def _call(self, start: int) -> None:
        """Make the calls; the number of each is in shared memory before it starts."""
        refused, how = self._shown()[1], self._how
        until = time.process_time() + how.within_s - self._spent_s
        with sample_folder(), np.errstate(all="ignore"):
            calls = _Calls(self._reference, how.seed)
            number = start
            while number < how.calls and time.process_time() < until:
                self._shared[:16] = struct.pack("qq", number, refused)
                refused += not calls.call(number)
                number += 1
            calls.close()
            self._shared[:16] = struct.pack("qq", number, refused)


class _Calls:
    """The calls of one type; each belongs to its number."""

    def __init__(self, reference: str, seed: int) -> None:
        self._reference = reference
        self._origin: Any = find(reference)
        self._type = self._origin._type
        self._seed = seed
        self._node: Any = None

    def _drawn(self, number: int) -> tuple[dict[str, Any], Hostile]:
        """Draw the parameters, which are shared by several calls, and return the generator of values."""
        row = Hostile(f"{self._reference} {self._seed} row {number // _IN_A_ROW}", guards=False)
        given = {name: spec for name, spec in self._type.parameters.items() if spec.is_given}
        parameters = {
            name: row.parameter(spec) for name, spec in given.items() if spec.default is REQUIRED or row.chance(60)
        }
        draw = Hostile(f"{self._reference} {self._seed} {number}")
        return parameters, draw

    def _values(self, own: Any, draw: Hostile) -> tuple[str | None, dict[str, Any]]:
        slots = [name for name, spec in own.slots.items() if spec.handler_name]
        if slots and (own.process_kind == "none" or draw.chance(30)):
            slot = slots[draw.number(len(slots))]
            spec = own.slots[slot]
            return slot, {"value": draw.value(spec.type)} if spec.takes_value else {}
        return None, {
            name: draw.value(spec.type) for name, spec in own.inputs.items() if not spec.optional or draw.chance(70)
        }

    def call(self, number: int) -> bool:
        """Make a call; say whether the node took it."""
        parameters, draw = self._drawn(number)
        try:
            if self._node is None or number % _IN_A_ROW == 0:
                self.close()
                self._node = self._origin(**parameters)
            slot, values = self._values(self._node._type, draw)
            fire(self._node, debug=False, slot=slot, **values)
        except Exception:
            self.close()
            return False
        return True

    def close(self) -> None:
        if self._node is not None:
            with contextlib.suppress(Exception):
                fire(self._node, hook="teardown")
            self._node = None

    def shown(self, number: int) -> str:
        """Write a call as a user would."""
        parameters, draw = self._drawn(number)
        title = self._reference.partition(":")[2]
        given = ", ".join(f"{name}={value!r:.80}" for name, value in parameters.items())
        try:
            own = self._origin(**parameters)._type
            slot, values = self._values(own, draw)
        except Exception as error:
            return f"{title}({given}), which raises {error}"
        said = [f"{title}({given})", *([f"slot={slot!r}"] if slot else [])]
        return f"fire({', '.join([*said, *(f'{name}={_short(value)}' for name, value in values.items())])})"


def _short(value: Any) -> str:
    if not isinstance(value, np.ndarray):
        return f"{value!r:.200}"
    said = describe_value(value)
    if value.dtype.kind == "f" and value.size:
        counts = {
            "NaN": int(np.isnan(value).sum()),
            "infinite": int(np.isinf(value).sum()),
            "denormal": int(((value != 0) & (np.abs(value) < np.finfo(value.dtype).tiny)).sum()),
        }
        said += "".join(f", {count} {name}" for name, count in counts.items() if count)
        finite = value[np.isfinite(value)]
        said += f", {finite.min():g} to {finite.max():g}" if finite.size else ""
    elif value.dtype.kind in "ui" and value.size:
        said += f", {value.min()} to {value.max()}"
    if not value.flags.c_contiguous:
        said += f", strides {value.strides}"
    return f"<{said}>"


def main(arguments: Sequence[str] | None = None) -> int:
    """Call node types with hostile values, and report deaths. The exit code is 1 if there are any."""
    parser = common_arguments("hfg.testing.enduring", main.__doc__)
    parser.add_argument("--calls", type=int, default=100, help="calls of each type (100)")
    parser.add_argument("--limit", type=float, default=20.0, help="seconds of CPU time for one call (20)")
    parser.add_argument("--within", type=float, default=3600.0, help="seconds of CPU time for one type (3600)")
    parser.add_argument("--deaths", type=int, default=5, help="deaths of a type after which it is given up (5)")
    parser.add_argument("--verbose", "-v", action="store_true", help="write a line for each type as soon as it is done")
    given = parser.parse_args(arguments)
    if given.worker:
        serve(_How, lambda references, how: (_Watch(one, how).watch() for one in references))
        return 0
    references, problems = references_of(given.what)
    found = endure(
        references,
        calls=given.calls,
        seed=given.seed,
        limit_s=given.limit,
        most_deaths=given.deaths,
        processes=given.processes,
        within_s=given.within,
        tell=None if given.json else _all_told if given.verbose else _told,
    )
    died = [one for one in found if one.deaths]
    if given.json:
        sys.stdout.write(msgspec.json.format(msgspec.json.encode(found), indent=2).decode() + "\n")
        return int(bool(problems or died))
    for line in problems:
        sys.stdout.write(f"{line}\n")
    least = min((one.calls for one in found), default=0)
    sys.stdout.write(
        f"{len(found) - len(died)} of {len(found)} node types endured {sum(one.calls for one in found)} calls, "
        f"at least {least} each; {sum(one.refused for one in found)} were refused\n"
    )
    return int(bool(problems or died))


def _told(endured: Endured) -> None:
    for each in endured.deaths:
        sys.stdout.write(f"{endured.reference}: call {each.call} {each.how}: {each.what}\n")
    sys.stdout.flush()


def _all_told(endured: Endured) -> None:
    _told(endured)
    sys.stdout.write(
        f"{endured.reference}: {endured.calls} calls in {endured.seconds:.1f} s, {endured.refused} refused\n"
    )
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
