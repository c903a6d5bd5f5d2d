"""A refusal as fields: what was expected and sent, why, what helps; the sentence is hfg's. Depends on errors."""

from __future__ import annotations

from hfg import errors
from hfg.errors import CheckFailed, FileError, GraphError, HfgError, NodeError, TargetError, UsageError, in_words
from hfg.studio.messages import Reject

__all__ = ["Refused", "parts_of", "reject"]


class Refused(UsageError):
    """A request that the studio refuses, with the code that pages know."""

    def __init__(self, code: str, message: str, path: str = "") -> None:
        self.code = code
        self.path = path
        super().__init__(message)


def reject(number: int, error: BaseException) -> Reject:
    """Return the answer to a request that failed with this error."""
    parts = parts_of(error)
    choices = error.choices if isinstance(error, TargetError) else ()
    sentence = str(error) if isinstance(error, HfgError) else in_words(error)
    return Reject(number, _code(error), sentence, **parts, choices=choices)


def parts_of(error: BaseException) -> dict[str, str]:
    """Return the parts of a refusal; the sentence of a graph error ends in its remedy."""
    if isinstance(error, CheckFailed | FileError) and error.problems:
        first = error.problems[0]
        return {"path": first.path, "reason": f"{first.what}: {first.why}", "remedy": first.remedy}
    sentence = str(error)
    head, _, remedy = sentence.rpartition("; ")
    parts = {
        "path": str(getattr(error, "path", "") or ""),
        "remedy": remedy if head else "",
        "reason": head or sentence,
    }
    if isinstance(error, errors.ConnectionError):
        parts |= {name: getattr(error, name) for name in ("expected", "sent", "reason") if getattr(error, name)}
    return parts


def _code(error: BaseException) -> str:
    match error:
        case Refused():
            return error.code
        case errors.ConnectionError(expected=expected) if expected:
            return "types"
        case FileError():
            return "file"
        case NodeError():
            return "failed"
        case GraphError():
            return "refused"
        case UsageError():
            return "usage"
    return "failed"
