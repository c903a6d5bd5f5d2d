"""`--foxglove`: lets viewers look at a run. Depends on `options`; the server is an extra, imported when it is used."""

from __future__ import annotations

from typing import Any

from hfg.base.hooks import hooks
from hfg.cli import show
from hfg.cli.options import ViewFlags
from hfg.engine import Run
from hfg.errors import TargetError, UsageError

_HIGHEST_PORT = 65535


class Viewing:
    """Viewers of a run, if they were asked for."""

    def __init__(self, flags: ViewFlags) -> None:
        """Read where they connect.

        Raises:
          TargetError: it is not an address.
        """
        self._wanted = flags.foxglove or flags.foxglove_at is not None
        self._where: dict[str, Any] = {} if flags.foxglove_at is None else _where(flags.foxglove_at)
        self._origins = flags.foxglove_origin or []
        self._page: Any = None
        if self._origins and not self._wanted:
            raise TargetError("--foxglove-origin says who may look, so --foxglove is missing")

    def begin(self, run: Run) -> None:
        """Serve viewers from now on, and tell the user the address."""
        if self._wanted:
            try:
                self._page = hooks.foxglove(run, **self._where, origins=self._origins)
            except UsageError as error:
                raise TargetError(str(error)) from None
            show.sentence(f"Foxglove: open connection, Foxglove WebSocket, {self._page.address}")

    def end(self) -> None:
        """The run is over: wait until viewers have the last messages."""
        if self._page is not None:
            self._page.join()


def _where(text: str) -> dict[str, Any]:
    host, _, port = text.rpartition(":")
    if not port.isascii() or not port.isdigit() or int(port) > _HIGHEST_PORT:
        raise TargetError(f"--foxglove-at takes ADDRESS:PORT, as in 127.0.0.1:8765, or a port, got {text!r:.80}")
    return {"host": host.strip("[]") or "127.0.0.1", "port": int(port)}
