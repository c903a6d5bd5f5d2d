"""Looks at runs in other processes, through the sockets that they listen at.

Depends on `show` and `engine.face.watching`.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from typing import Final

import msgspec

from hfg.cli import show
from hfg.engine.face.watching import Answer, Question, run_names, run_sockets
from hfg.engine.observing.encoding import encode
from hfg.errors import TargetError

_LONGEST_ANSWER: Final = 64_000_000
_PATIENCE_S: Final = 2.0


class Line:
    """A connection to the run of another process; use it in a `with` block.

    Raises:
      TargetError: no graph runs there.
    """

    def __init__(self, name: str) -> None:
        self._pid = name
        with contextlib.closing(run_sockets()) as there:
            try:
                connected = there.connect(name) if is_process(name) else None
            except BlockingIOError:
                raise TargetError(f"process {name} does not answer: a node blocks its loop") from None
        if connected is None:
            raise TargetError(_nothing_runs(name))
        self._socket = connected
        self._socket.settimeout(_PATIENCE_S)
        self._heard = b""
        self._asked = False

    def ask(self, question: Question) -> Answer | None:
        """Ask and wait for the answer; None if there is none within two seconds: a node blocks the loop over there.

        The next call then waits for that answer on.

        Raises:
          TargetError: the run is over, or what comes back makes no sense.
        """
        try:
            if not self._asked:
                self._socket.sendall(encode(question) + b"\n")
                self._asked = True
            while b"\n" not in self._heard:
                more = self._socket.recv(1 << 20)
                if not more or len(self._heard) > _LONGEST_ANSWER:
                    raise TargetError(f"the run in process {self._pid} is over")
                self._heard += more
        except TimeoutError:
            return None
        except OSError:
            raise TargetError(f"the run in process {self._pid} is over") from None
        heard, _, self._heard = self._heard.partition(b"\n")
        self._asked = False
        try:
            answer = msgspec.json.decode(heard, type=Answer)
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
            raise TargetError(f"process {self._pid} answers what this version of hfg cannot read: {error}") from None
        if answer.error:
            raise TargetError(f"process {self._pid}: {answer.error}")
        return answer

    def send(self, data: bytes) -> None:
        """Send bytes as they are.

        Raises:
          TargetError: the run is over.
        """
        try:
            self._socket.sendall(data)
        except OSError:
            raise TargetError(f"the run in process {self._pid} is over") from None

    def receive(self) -> bytes | None:
        """Return the next bytes as they come; None if none come for two seconds.

        Raises:
          TargetError: the run is over.
        """
        heard, self._heard = self._heard, b""
        try:
            heard = heard or self._socket.recv(1 << 20)
        except TimeoutError:
            return None
        except OSError:
            heard = b""
        if not heard:
            raise TargetError(f"the run in process {self._pid} is over")
        return heard

    def lines(self) -> Iterator[str]:
        """Yield the lines of a tap, until the run is over or the run closes the tap."""
        self._socket.settimeout(None)
        while True:
            *whole, self._heard = self._heard.split(b"\n")
            yield from (line.decode() + "\n" for line in whole)
            with contextlib.suppress(OSError):
                if more := self._socket.recv(1 << 20):
                    self._heard += more
                    continue
            return

    def __enter__(self) -> Line:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self._socket.close()


def runs() -> list[Answer]:
    """The runs that can be looked at, in order of process ids; one too busy to answer has no name.

    Sockets that dead processes have left are removed.
    """
    found = []
    with contextlib.closing(run_sockets()) as there:
        names = run_names(there)
    for name in names:
        with contextlib.suppress(TargetError), Line(name) as line:
            answer = line.ask(Question("name")) or Answer(graph="(does not answer)")
            found.append(msgspec.structs.replace(answer, pid=int(name.partition("-")[0]), name=name))
    return found


def find(named: str | None) -> list[Answer]:
    """Find the runs that a user means by a process id, as `hfg top` shows it, or by the name of a graph.

    Raises:
      TargetError: there is none.
    """
    if named is not None and is_process(named):
        with contextlib.closing(run_sockets()) as there:
            if named in run_names(there):
                return [Answer(name=named)]
    found = runs()
    if not found:
        what = "no graph runs that could be looked at"
        if named is not None and is_process(named):
            what = f"no graph that could be looked at runs in process {named}, nor in any other"
        raise TargetError(
            f"{what}: hfg run starts one, or a program with hfg.run(graph, watch=True) or HFG_WATCH=1, on the real "
            "clock, as the same user"
        )
    if named is None:
        return found
    fitting = [one for one in found if one.graph == named]
    if not fitting:
        running = ", ".join(f'"{one.graph}" in process {one.name}' for one in found)
        where = f"in process {named}" if is_process(named) else f'by the name "{named}"'
        raise TargetError(f"no graph that could be looked at runs {where}; there is {running}")
    return fitting


def is_process(named: str) -> bool:
    """Whether it is the number of a process, and of which of its runs."""
    return named.replace("-", "", 1).isdecimal()


def which(verb: str, there: Sequence[Answer]) -> int:
    """List the runs that a user may have meant; gives the exit code."""
    show.table("", ("process", "graph", "target"), [(one.name, one.graph, one.target) for one in there])
    show.sentence(f"more than one graph runs: name its process, as in hfg {verb} {there[0].name}")
    return 2


def _nothing_runs(name: str) -> str:
    return f"no graph that could be looked at runs in process {name}; hfg top, without a number, finds those there are"
