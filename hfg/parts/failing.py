"""Errors that are told from one part to another: what is left of them is a class of hfg's and sentences (rule L4)."""

from __future__ import annotations

import traceback

from hfg import errors
from hfg.errors import HfgError, NodeError, RunError
from hfg.frames import users_part
from hfg.parts.messages import Failed

__all__ = ["as_error", "as_failed"]


def as_failed(error: BaseException | None) -> Failed | None:
    """Put what went wrong into words."""
    if error is None:
        return None
    cause = error.__cause__
    trace = ""
    if cause is not None:
        trace = "".join(traceback.format_exception(type(cause), cause, users_part(cause.__traceback__), chain=False))
    if isinstance(error, NodeError):
        begin = f'node "{error.path}" failed in {error.what}: '
        return Failed(type(error).__name__, str(error).removeprefix(begin), error.path, error.what, trace)
    kind = type(error).__name__ if isinstance(error, HfgError) else "RunError"
    text = str(error) if isinstance(error, HfgError) else errors.in_words(error)
    return Failed(kind, text, trace=trace)


def as_error(failed: Failed, where: str) -> HfgError:
    """Make an error of what was told.

    Args:
      failed: as it came.
      where: in which process, for a note at the error.
    """
    kind = getattr(errors, failed.kind, RunError)
    error: HfgError
    if failed.path:
        error = NodeError(failed.path, failed.what, failed.text)
    elif isinstance(kind, type) and issubclass(kind, HfgError) and kind.__init__ is HfgError.__init__:
        error = kind(failed.text)
    else:
        error = RunError(failed.text)
    error.add_note(f"in {where}" + (f":\n{failed.trace}" if failed.trace else ""))
    return error
