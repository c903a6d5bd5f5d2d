"""Topics of a run: with the next run they start over. Depends on `following`."""

from __future__ import annotations

from typing import Any

from hfg.engine import Run
from hfg.studio.following import Following

__all__ = ["RunTopic"]


class RunTopic:
    """A topic of the current run, and of the next one after it.

    Attributes:
      run: the run that it looks at now.
    """

    credit = 2
    kind = 0
    most_hz = 30.0

    def __init__(self, host: Following) -> None:
        self.host = host
        self.run: Run | None = None

    def time(self) -> float:
        """See `Topic`."""
        return self.host.steering.elapsed()

    def take(self) -> Any:
        """See `Topic`."""
        run = self.host.steering.run
        if run is not self.run:
            self.let_go()
            self.run = run
            if run is not None:
                self.attach(run)
        return self.news()

    def attach(self, run: Run) -> None:
        """A run has begun, or there is one."""

    def let_go(self) -> None:
        """The run is over."""

    def news(self) -> Any:
        """Return what is new."""
        raise NotImplementedError

    def close(self) -> None:
        """See `Topic`."""
        self.let_go()
