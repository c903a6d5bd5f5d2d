"""Firings that fail are tried again with the same values before the node's policy decides (rule X1).

A signal that an attempt has sent cannot be taken back, so such a firing is not repeated; what an attempt has written to
outputs has not left, and is thrown away. Each attempt has the time limit of a firing. Depends on `firing`.
"""

from __future__ import annotations

import logging
import random
from collections.abc import Callable
from typing import Any

from hfg.engine.model.concurrent import Attempts
from hfg.engine.model.running_node import RunningNode
from hfg.engine.rules import firing
from hfg.errors import in_words
from hfg.trace import FiringRetried

__all__ = ["retry", "try_again"]

_LOGGER = logging.getLogger("hfg.engine")


def retry(worker: RunningNode, error: BaseException) -> bool:
    """The firing of a worker, which has one at a time, has failed: whether it is tried again."""
    attempts = worker.attempts
    if attempts is None:
        return False

    def again() -> None:
        attempts.again()
        process: Any = worker.process
        worker.core.code.execute(worker, process, attempts.arguments, firing.when_done(worker))

    if not try_again(worker, attempts, worker.counts.firings, error, again):
        return False
    worker.take_written()
    worker.execution.end_limit()
    return True


def try_again(
    worker: RunningNode, attempts: Attempts, number: int, error: BaseException, again: Callable[[], None]
) -> bool:
    """If a firing that has failed may be tried once more, let that be after a pause.

    Args:
      worker: whose firing.
      attempts: made at it so far.
      number: of the firing.
      error: by which the last attempt has failed; one that is no `Exception` ends a task or the program on purpose.
      again: makes the next attempt.
    """
    options, core = worker.options, worker.core
    if not _is_meant(error, options.retry_on) or not attempts.may_retry(options.retries) or core.over:
        return False
    pause_s = _pause(worker, number, attempts.made)
    worker.counts.add_retry()
    words = in_words(error)
    _LOGGER.warning(
        'node "%s": firing %d, attempt %d of %d, failed: %s; again in %g s',
        worker.path,
        number,
        attempts.made,
        options.retries + 1,
        words,
        pause_s,
        extra={"path": worker.path},
    )
    if core.trace is not None:
        core.trace(FiringRetried(core.now(), worker.path, number, attempts.made, words, pause_s))
    attempts.wait(core.after(pause_s, again))
    return True


def _is_meant(error: BaseException, names: tuple[str, ...]) -> bool:
    """Whether such an error is tried again: it or a base of it is named, if any is."""
    if not isinstance(error, Exception):
        return False
    return not names or any(_name(kind) in names for kind in type(error).__mro__)


def _name(kind: type) -> str:
    return kind.__qualname__ if kind.__module__ == "builtins" else f"{kind.__module__}:{kind.__qualname__}"


def _pause(worker: RunningNode, number: int, made: int) -> float:
    """Seconds until the next attempt: the more there were the longer, and drawn by the run's seed if by chance at all.

    Each draw is by itself, so that it does not depend on the order in which firings fail.
    """
    options = worker.options
    longest = min(options.retry_backoff_max_s, options.retry_backoff_s * 2.0 ** min(made - 1, 60))
    if not options.retry_jitter:
        return float(longest)
    drawn = random.Random(f"{worker.core.seed} {worker.path} {number} {made}").random()
    return float(longest * (1.0 - options.retry_jitter * drawn))
